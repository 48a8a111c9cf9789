"""The scene of a run in memory that its processes share: physics loads it, all others take it from there.

To load it takes twenty times as long as to copy it; and a process that starts again gets the scene that runs, whatever
was written to its files since. The memory has no name: only what inherits it, the processes of a run, can write to it.
"""

from __future__ import annotations

import os
import pickle  # noqa: TID251 (what processes of one run exchange)
import time
from collections.abc import Callable

from ligature.bus.block import BusError
from ligature.model.scene import Scene

_NAP = 0.005
"""Seconds between two looks for the scene."""

_LENGTH = 8
"""Bytes of the length of what follows; 0 until it is there."""


def share_scene(shared: int, scene: Scene) -> None:
    """Hand a ``scene`` to all processes that have the file descriptor ``shared``, of an empty file."""
    content = pickle.dumps(scene, pickle.HIGHEST_PROTOCOL)
    os.pwrite(shared, content, _LENGTH)
    os.pwrite(shared, len(content).to_bytes(_LENGTH, "little"), 0)


def shared_scene(shared: int, cancelled: Callable[[], bool]) -> Scene:
    """The scene in ``shared`` as soon as it is there; raises `BusError` when the wait is ``cancelled``."""
    while not cancelled():
        if length := int.from_bytes(os.pread(shared, _LENGTH, 0), "little"):
            scene: Scene = pickle.loads(os.pread(shared, length, _LENGTH))  # noqa: S301 (physics wrote it)
            return scene
        time.sleep(_NAP)
    raise BusError("no physics process has loaded the scene; 'ligature run' starts one")
