"""The moving frame that a body of tissue deforms in; world axes are W, those of the frame B; SI units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import inverse, pose7_matrix
from ligature.model.scene import Body

Array = NDArray[np.float64]

MAX_ACCELERATION = 50.0
"""Acceleration of the frame in m/s² above which it was put elsewhere, and its tissue does not feel it."""


class Frame:
    """Frame B of a rigid body, and its motion in a tick.

    Attributes
    ----------
    R, p
        Rotation (3, 3) from B to W and origin (3,) in W.
    v, w
        Velocity of the origin and angular velocity, in the axes of B.
    acceleration
        Of the origin in the last tissue step, in the axes of W.
    """

    def __init__(self, body: Body) -> None:
        self._T_inertial_body = inverse(body.T_body_inertial)
        self.R, self.p = np.eye(3), np.zeros(3)
        self.v, self.w = np.zeros(3), np.zeros(3)
        self.acceleration = np.zeros(3)
        self._before = np.zeros(3)
        self.moves = False

    def read(self, pose: Array, twist: Array) -> None:
        """Take pose (7,) and twist (6,) of the body's inertial frame."""
        T = pose7_matrix(pose) @ self._T_inertial_body
        self.R[:], self.p[:] = T[:3, :3], T[:3, 3]
        self.moves = bool(twist.any())
        if self.moves:
            v = twist[:3] + np.cross(twist[3:], self.p - pose[:3])
            self.v[:], self.w[:] = self.R.T @ v, self.R.T @ twist[3:]
        else:
            self.v[:], self.w[:] = 0.0, 0.0

    def restart(self) -> None:
        """Its motion begins anew, without an acceleration before."""
        self._before[:] = self.R @ self.v
        self.acceleration[:] = 0.0

    def end_step(self, h: float) -> None:
        """End a tissue step of ``h`` seconds."""
        v = self.R @ self.v
        a = (v - self._before) / h
        self._before[:] = v
        self.acceleration[:] = a if (a**2).sum() < MAX_ACCELERATION**2 else 0.0

    def drift(self, at: Array, dt: float) -> Array:
        """Motion (6,) in ``dt`` of what moves with the frame at ``at`` (3,), all in B."""
        (vx, vy, vz), (wx, wy, wz), (x, y, z) = self.v, self.w, at
        return np.array([vx + wy * z - wz * y, vy + wz * x - wx * z, vz + wx * y - wy * x, wx, wy, wz]) * dt

    def into(self, point: Array) -> Array:
        """A point (3,) of W in B."""
        return np.asarray((point - self.p) @ self.R)

    def turned(self, wrench: Array) -> Array:
        """Two vectors (6,) of B in the axes of W."""
        return np.concatenate([self.R @ wrench[:3], self.R @ wrench[3:]])

    def snapshot(self) -> dict[str, Array]:
        """Everything that lasts from tick to tick."""
        return {"before": self._before.copy(), "acceleration": self.acceleration.copy()}

    def restore(self, snapshot: dict[str, Array]) -> None:
        """Continue from `snapshot`."""
        self._before[:], self.acceleration[:] = snapshot["before"], snapshot["acceleration"]
