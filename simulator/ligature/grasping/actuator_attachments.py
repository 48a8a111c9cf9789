"""Attaches bodies for actuators: rigid bodies by a weld, elements of a rod by point constraints, or by a grasp.

Frames are given in body frames B; world axes, metres.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.grasping.actuator_grasps import ActuatorGrasps
from ligature.model.scene import Scene, Slip
from ligature.physics import World
from ligature.suture import Rods

Array = NDArray[np.float64]


class ActuatorAttachments:
    """Attaches, grasps and releases bodies of a scene for its actuators."""

    def __init__(self, scene: Scene, world: World, rods: Rods, grasps: ActuatorGrasps) -> None:
        self._rod_bodies, self._world, self._rods, self._grasps = scene.rod_bodies, world, rods, grasps

    def attach(self, parent: int, child: int, T_parent_frame: Array, T_child_frame: Array) -> Any:
        """Attach two frames rigidly; returns a handle. Raises ValueError when the bodies cannot be attached."""
        if child in self._rod_bodies:
            self._rods.attach(parent, child, T_parent_frame, T_child_frame)
            return ("element", parent, child)
        handle = self._world.welds.add(parent, child, T_parent_frame, T_child_frame)
        self._set_held(child, True)
        return ("weld", handle, child)

    def grasp(self, slip: Slip, parent: int, child: int, T_parent_frame: Array, T_child_frame: Array) -> Any:
        """Hold a body by friction where it is, an element of a rod rigidly; returns a handle."""
        if child in self._rod_bodies:
            return self.attach(parent, child, T_parent_frame, T_child_frame)
        number = self._grasps.add(slip, parent, child, T_parent_frame)
        self._rods.update_masses(self._world.masses)
        return ("grasp", number, child)

    def holds(self, handle: Any) -> bool:
        """Whether the body of a handle has neither slipped out nor been released by a reset."""
        if handle[0] == "grasp":
            return self._grasps.holds(handle[1])
        return handle[0] != "element" or self._rods.is_attached(handle[1], handle[2])

    def release(self, handle: Any) -> None:
        """Release the body of a handle from `attach` or `grasp`."""
        if handle[0] == "grasp":
            self._grasps.remove(handle[1])
            self._rods.update_masses(self._world.masses)
        elif handle[0] == "element":
            self._rods.detach(handle[1], handle[2])
        else:
            self._world.welds.remove(handle[1])
            self._set_held(handle[2], False)

    def _set_held(self, body: int, held: bool) -> None:
        self._world.masses.set_held(body, held)
        self._rods.update_masses(self._world.masses)
