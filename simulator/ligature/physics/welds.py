"""Rigid constraints that actuators put between bodies. World axes, SI units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.model.frames import inverse, matrix_quaternion
from ligature.physics.engine import Engine
from ligature.physics.wrenches import fixed_wrench

Array = NDArray[np.float64]

WELD_FORCE = 500.0
"""Maximum force of a weld in newtons, so that jammed bodies slip instead of exploding."""


@dataclass
class Weld:
    """A rigid constraint of Bullet between frames of two bodies, given in their body frames B."""

    parent: int
    child: int
    T_parent_frame: Array
    T_child_frame: Array
    constraint: int


class Welds:
    """The welds of an engine's bodies, by handle."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._welds: dict[int, Weld] = {}
        self._next_handle = 0

    def __iter__(self) -> Iterator[Weld]:
        return iter(self._welds.values())

    def add(self, parent: int, child: int, T_parent_frame: Array, T_child_frame: Array) -> int:
        """Weld two frames, given in the body frames of parent and child; returns a handle."""
        self._next_handle += 1
        constraint = self._constrain(parent, child, T_parent_frame, T_child_frame)
        self._welds[self._next_handle] = Weld(parent, child, T_parent_frame, T_child_frame, constraint)
        return self._next_handle

    def remove(self, handle: int) -> None:
        """Remove a weld that `add` made."""
        weld = self._welds.pop(handle)
        pybullet.removeConstraint(weld.constraint, physicsClientId=self._engine.client)
        self._engine.motions.rouse_all()

    @property
    def children(self) -> list[int]:
        """The child of each weld."""
        return [weld.child for weld in self]

    def parents(self, child: int) -> list[int]:
        """The bodies that a body is welded to as a child."""
        return [weld.parent for weld in self if weld.child == child]

    def wrench(self, weld: Weld, point: Array) -> Array:
        """Wrench (6,) of a weld on its parent about ``point`` (3,) in the last tick."""
        pose, twist = np.empty(7), np.empty(6)
        self._engine.place_of[weld.parent].read_inertial(pose, twist)
        in_parent = inverse(self._engine.scene.bodies[weld.parent].T_body_inertial) @ weld.T_parent_frame
        return fixed_wrench(self._engine.client, weld.constraint, pose, in_parent, point)

    def loosen(self) -> None:
        """Take all welds out of Bullet, for `repeat` or `restore`."""
        for weld in self:
            pybullet.removeConstraint(weld.constraint, physicsClientId=self._engine.client)
        self._engine.motions.rouse_all()

    def repeat(self) -> None:
        """Make all welds again in an engine that was rebuilt, or after `loosen`."""
        for weld in self:
            weld.constraint = self._constrain(weld.parent, weld.child, weld.T_parent_frame, weld.T_child_frame)

    def _constrain(self, parent: int, child: int, T_parent_frame: Array, T_child_frame: Array) -> int:
        bodies, client = self._engine.scene.bodies, self._engine.client
        in_parent = inverse(bodies[parent].T_body_inertial) @ T_parent_frame
        in_child = inverse(bodies[child].T_body_inertial) @ T_child_frame
        one, two = self._engine.place_of[parent], self._engine.place_of[child]
        constraint = pybullet.createConstraint(
            one.uid, one.link, two.uid, two.link, pybullet.JOINT_FIXED, [0.0] * 3,
            in_parent[:3, 3].tolist(), in_child[:3, 3].tolist(),
            matrix_quaternion(in_parent[:3, :3]).tolist(), matrix_quaternion(in_child[:3, :3]).tolist(),
            physicsClientId=client,
        )  # fmt: skip
        pybullet.changeConstraint(constraint, maxForce=WELD_FORCE, physicsClientId=client)
        self._engine.motions.rouse_all()
        return int(constraint)

    def snapshot(self) -> tuple[int, dict[int, Weld]]:
        """What lasts from tick to tick."""
        return self._next_handle, dict(self._welds)

    def restore(self, snapshot: tuple[int, dict[int, Weld]]) -> None:
        """Continue from `snapshot` in an engine that was rebuilt, or after `loosen`."""
        self._next_handle, self._welds = snapshot
        self.repeat()
