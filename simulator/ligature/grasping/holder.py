"""Holds bodies together for actuators, whether the held body is rigid or an element of a rod.

Frames are given in body frames B; world axes, metres.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.grasping.clamps import Clamps
from ligature.model.scene import Scene, Slip
from ligature.physics import World
from ligature.suture import Rods

Array = NDArray[np.float64]


class Holder:
    """Makes and removes the holds of actuators between bodies of a scene."""

    def __init__(self, scene: Scene, world: World, rods: Rods, clamps: Clamps) -> None:
        self._rod_bodies, self._world, self._rods, self._clamps = scene.rod_bodies, world, rods, clamps

    def add_fixed(self, parent: int, child: int, T_parent_frame: Array, T_child_frame: Array) -> Any:
        """Hold two frames together; returns a handle. Raises ValueError when the two cannot be held."""
        if child in self._rod_bodies:
            self._rods.grip(parent, child, T_parent_frame, T_child_frame)
            return ("rod", parent, child)
        handle = self._world.add_fixed(parent, child, T_parent_frame, T_child_frame)
        self._update_mass(child, True)
        return ("body", handle, child)

    def add_yielding(self, slip: Slip, parent: int, child: int, T_parent_frame: Array, T_child_frame: Array) -> Any:
        """Hold a body by friction where it is, a thread rigidly; returns a handle."""
        if child in self._rod_bodies:
            return self.add_fixed(parent, child, T_parent_frame, T_child_frame)
        number = self._clamps.add(slip, parent, child, T_parent_frame)
        self._rods.update_masses(self._world)
        return ("clamp", number, child)

    def holds(self, handle: Any) -> bool:
        """Whether what a handle stands for has neither slipped out nor been let go by a reset."""
        if handle[0] == "clamp":
            return self._clamps.holds(handle[1])
        return handle[0] != "rod" or self._rods.holds(handle[1], handle[2])

    def remove_fixed(self, handle: Any) -> None:
        """Let go what `add_fixed` or `add_yielding` holds."""
        if handle[0] == "clamp":
            self._clamps.remove(handle[1])
            self._rods.update_masses(self._world)
        elif handle[0] == "rod":
            self._rods.release(handle[1], handle[2])
        else:
            self._world.remove_fixed(handle[1])
            self._update_mass(handle[2], False)

    def _update_mass(self, body: int, held: bool) -> None:
        self._world.hold_up(body, held)
        self._rods.update_masses(self._world)
