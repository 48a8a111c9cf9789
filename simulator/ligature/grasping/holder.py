"""Holds bodies together for actuators, whether the held body is rigid or an element of a rod.

Frames are given in body frames B; world axes, metres.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.scene import Scene
from ligature.physics import World
from ligature.suture import Rods

Array = NDArray[np.float64]


class Holder:
    """Makes and removes rigid holds between bodies of a scene."""

    def __init__(self, scene: Scene, world: World, rods: Rods) -> None:
        self._rod_bodies, self._world, self._rods = scene.rod_bodies, world, rods

    def add_fixed(self, parent: int, child: int, T_parent_frame: Array, T_child_frame: Array) -> Any:
        """Hold two frames together; returns a handle. Raises ValueError when the two cannot be held."""
        if child in self._rod_bodies:
            self._rods.grip(parent, child, T_parent_frame, T_child_frame)
            return ("rod", parent, child)
        handle = self._world.add_fixed(parent, child, T_parent_frame, T_child_frame)
        self._weigh(child, True)
        return ("body", handle, child)

    def remove_fixed(self, handle: Any) -> None:
        """Let go what `add_fixed` holds."""
        if handle[0] == "rod":
            self._rods.release(handle[1], handle[2])
        else:
            self._world.remove_fixed(handle[1])
            self._weigh(handle[2], False)

    def _weigh(self, body: int, held: bool) -> None:
        self._world.hold_up(body, held)
        self._rods.weigh(self._world)
