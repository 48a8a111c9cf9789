"""The moving frame that a body of tissue deforms in; world axes are W, those of the frame B; SI units."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.model.frames import inverse
from ligature.model.scene import Body
from ligature.rotations import cross, matrix_of, rotate_back
from ligature.tables import opener, table_of

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

MAX_ACCELERATION = 50.0
"""Acceleration of the frame in m/s² above which it was put elsewhere, and its tissue does not feel it."""


class FrameArrays(NamedTuple):
    """Where a frame is and how it moves."""

    R: Array  # (3, 3) from B to W
    p: Array  # (3,) origin in W
    v: Array  # (3,) velocity of the origin in B
    w: Array  # (3,) angular velocity in B
    local: Array  # (4, 4) body frame in the inertial frame of the body
    turn: Array  # (3, 3) scratch


def _arrays(T_inertial_body: Array) -> FrameArrays:
    z = np.zeros
    return FrameArrays(np.eye(3), z(3), z(3), z(3), np.ascontiguousarray(T_inertial_body), z((3, 3)))


open_frame = opener(_arrays(np.eye(4)))


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
    table
        The frame for compiled code.
    """

    def __init__(self, body: Body) -> None:
        self._arrays = _arrays(inverse(body.T_body_inertial))
        self.table = table_of(self._arrays)
        self.R, self.p, self.v, self.w = self._arrays[:4]
        self.acceleration = np.zeros(3)
        self._before = np.zeros(3)
        self.moves = False

    def read(self, pose: Array, twist: Array) -> None:
        """Take pose (7,) and twist (6,) of the body's inertial frame."""
        self.moves = bool(read_frame(self.table, pose, twist))

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

    def snapshot(self) -> dict[str, Array]:
        """Everything that lasts from tick to tick."""
        return {"before": self._before.copy(), "acceleration": self.acceleration.copy()}

    def restore(self, snapshot: dict[str, Array]) -> None:
        """Continue from `snapshot`."""
        self._before[:], self.acceleration[:] = snapshot["before"], snapshot["acceleration"]


@kernel
def read_frame(table: Integers, pose: Array, twist: Array) -> bool:
    """Put a frame where its body's inertial frame with ``pose`` (7,) and ``twist`` (6,) is; whether it moves."""
    f = open_frame(table)
    Q, T = f.turn, f.local
    matrix_of(pose[3], pose[4], pose[5], pose[6], Q)
    for a in range(3):
        for b in range(3):
            f.R[a, b] = Q[a, 0] * T[0, b] + Q[a, 1] * T[1, b] + Q[a, 2] * T[2, b]
        f.p[a] = Q[a, 0] * T[0, 3] + Q[a, 1] * T[1, 3] + Q[a, 2] * T[2, 3] + pose[a]
    moves = False
    for a in range(6):
        moves = moves or twist[a] != 0.0
    x, y, z = cross(twist[3], twist[4], twist[5], f.p[0] - pose[0], f.p[1] - pose[1], f.p[2] - pose[2])
    f.v[0], f.v[1], f.v[2] = rotate_back(f.R, twist[0] + x, twist[1] + y, twist[2] + z)
    f.w[0], f.w[1], f.w[2] = rotate_back(f.R, twist[3], twist[4], twist[5])
    return moves


@inlined
def into(f: FrameArrays, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A point of W in B."""
    return rotate_back(f.R, x - f.p[0], y - f.p[1], z - f.p[2])


@inlined
def velocity_at(f: FrameArrays, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Velocity in B of what moves with the frame at (x, y, z)."""
    wx, wy, wz = cross(f.w[0], f.w[1], f.w[2], x, y, z)
    return f.v[0] + wx, f.v[1] + wy, f.v[2] + wz


@inlined
def turn_six(R: Array, K: Array, out: Array) -> None:
    """out = R₆ K R₆ᵀ for K (6, 6) and R₆ with R (3, 3) twice on its diagonal."""
    for i in range(2):
        for j in range(2):
            for a in range(3):
                for b in range(3):
                    total = 0.0
                    for c in range(3):
                        k = K[3 * i + c]
                        x, y, z = k[3 * j], k[3 * j + 1], k[3 * j + 2]
                        total += R[a, c] * (x * R[b, 0] + y * R[b, 1] + z * R[b, 2])
                    out[3 * i + a, 3 * j + b] = total
