"""The drive of an arm: joints of one tree that follow set-points or efforts. Radians, metres, N·m, N."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ligature.physics.control import TreeControl
from ligature.physics.joints import Joints

Array = NDArray[np.float64]


class Drive:
    """Joints of one tree as a plant of `ligature.robots`; arrays are (n,).

    Parameters
    ----------
    controls, joints
        The controllers of all joints, and the indices of those of the arm.
    max_velocity
        Largest speeds (n,) at which set-points are followed.
    max_deceleration
        Decelerations (n,) with which the joints brake before a set-point.
    yield_stiffness
        Stiffness in N·m/rad with which the motors yield to a load; 0 is as strong as they are.
    """

    def __init__(
        self, controls: Joints, joints: Sequence[int], max_velocity: Array, max_deceleration: Array,
        yield_stiffness: float,
    ) -> None:  # fmt: skip
        self._controls, self._joints = controls, tuple(joints)
        self._max_velocity, self._max_deceleration = max_velocity, max_deceleration
        self._yield_stiffness = np.full(len(joints), yield_stiffness)
        control = self._control
        self._rows = np.array([control.row[joint] for joint in self._joints], dtype=np.int64)

    @property
    def _control(self) -> TreeControl:
        return self._controls.control_of(self._joints[0])

    def read(self) -> Array:
        """Positions, velocities and motor efforts now, (3, n)."""
        return self._control.read(self._rows)

    def source(self) -> tuple[None, NDArray[np.int64]]:
        """The axes (n, 2) of the joints among all of the world, alone each: the second is -1."""
        axes = self._rows + self._control.first_axis
        return None, np.column_stack([axes, np.full(len(axes), -1)])

    def servo(self, position: Array, velocity: Array) -> None:
        """Follow set-points that move with ``velocity``."""
        self._control.servo(
            self._rows, position, velocity, self._max_velocity, self._max_deceleration, self._yield_stiffness
        )

    def push(self, effort: Array) -> None:
        """Drive the joints with efforts."""
        self._control.push(self._rows, effort)

    def free(self) -> None:
        """Let the joints go limp."""
        self._control.release_rows(self._rows)

    def place(self, position: Array) -> None:
        """Put the joints somewhere at once, at rest."""
        self._control.set_state(self._rows.tolist(), position.tolist())

    def reset(self) -> None:
        """Nothing: the joints belong to the physics, which put them back."""

    def snapshot(self) -> None:
        """Nothing: it is part of the physics."""

    def restore(self, snapshot: None) -> None:
        """Nothing."""
