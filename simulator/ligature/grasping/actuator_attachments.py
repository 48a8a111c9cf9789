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
    """Attaches, grasps and releases bodies of a scene for its actuators.

    Parameters
    ----------
    scene, world, rods
        The scene, its rigid bodies and its threads.
    grasps
        Takes the bodies that actuators with ``ligature slip`` hold by friction.
    """

    def __init__(self, scene: Scene, world: World, rods: Rods, grasps: ActuatorGrasps) -> None:
        self._rod_bodies, self._world, self._rods, self._grasps = scene.rod_bodies, world, rods, grasps

    def attach(self, parent: int, child: int, T_parent_frame: Array, T_child_frame: Array) -> Any:
        """Attach two bodies rigidly.

        Parameters
        ----------
        parent, child
            Indices of the body that holds and of the body or rod element that is held.
        T_parent_frame, T_child_frame
            Frames (4, 4) in their body frames B, which coincide from now on.

        Returns
        -------
        object
            A handle for `holds` and `release`.

        Raises
        ------
        ValueError
            If ``child`` is an element of a rod and ``parent`` has no collision shape.
        """
        if child in self._rod_bodies:
            self._rods.attach(parent, child, T_parent_frame, T_child_frame)
            return ("element", parent, child)
        handle = self._world.welds.add(parent, child, T_parent_frame, T_child_frame)
        self._set_held(child, True)
        return ("weld", handle, child)

    def grasp(self, slip: Slip, parent: int, child: int, T_parent_frame: Array, T_child_frame: Array) -> Any:
        """Hold a body where it is by friction, or an element of a rod rigidly.

        Parameters
        ----------
        slip
            Normal force, friction and size of the pads.
        parent, child
            Indices of the body that holds and of the body or rod element that is held.
        T_parent_frame, T_child_frame
            Frames (4, 4) in their body frames B; the pads are in the first, the second is for rod elements.

        Returns
        -------
        object
            A handle for `holds` and `release`.
        """
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
