"""State out, commands in: shared memory between the processes of a running simulator.

One file in shared memory holds the newest state (any number of readers), the loop's figures, and
one ring of commands for each front end. The physics process creates it; a front end attaches with
its name (`Block.attach`), publishes what it reads (`Block.read`), pushes commands into its own ring through
an `Outbox`, and gives a sign of life (``ring.beat``) several times a second: what a silent front end commanded
is released. It ends when the physics process shows no life (`Block.age`) or its parent is gone (`end_with_parent`).
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ligature.bus.block import Block, BusError
    from ligature.bus.mailbox import Mailbox
    from ligature.bus.outbox import Outbox
    from ligature.bus.pacing import Pace, Pacer, Throttle
    from ligature.bus.recording import Recording
    from ligature.bus.watchdog import Watchdog

__all__ = ["Block", "BusError", "Mailbox", "Outbox", "Pace", "Pacer", "Recording", "Throttle", "Watchdog"]

_HOMES = {
    "Block": "block",
    "BusError": "block",
    "Mailbox": "mailbox",
    "Outbox": "outbox",
    "Pace": "pacing",
    "Pacer": "pacing",
    "Recording": "recording",
    "Throttle": "pacing",
    "Watchdog": "watchdog",
}


def __getattr__(name: str) -> Any:
    """Import a module at its first use: the supervisor needs none of what codes commands."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
