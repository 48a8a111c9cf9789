"""State out, commands in: shared memory between the processes of a running simulator.

One file in shared memory holds the newest state (any number of readers), the loop's figures, and
one ring of commands for each front end. The physics process creates it; a front end attaches with
its name (`Block.attach`), publishes what it reads (`Block.read`), pushes commands into its own ring through
an `Outbox`, and gives a sign of life (``ring.beat``) several times a second: what a silent front end commanded
is released. It ends when the physics process shows no life (`Block.age`) or its parent is gone (`end_with_parent`).
"""

from ligature.bus.block import Block, BusError
from ligature.bus.mailbox import Mailbox
from ligature.bus.outbox import Outbox
from ligature.bus.pacing import Pace, Pacer, Throttle
from ligature.bus.recording import Recording
from ligature.bus.watchdog import Watchdog

__all__ = ["Block", "BusError", "Mailbox", "Outbox", "Pace", "Pacer", "Recording", "Throttle", "Watchdog"]
