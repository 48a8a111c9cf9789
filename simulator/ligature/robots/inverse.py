"""What inverse kinematics answers: joint values, or why there are none; and the steps that the arms share.

Joint values are radians or metres.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ligature.kernels import compiled
from ligature.robots.chain import Array

Integers = NDArray[np.int64]

LIMIT_TOLERANCE = 1e-9
"""Radians or metres by which a solution may exceed a limit: rounding, not motion."""

DEGENERATE = 1e-8
"""Length in metres below which a direction is not worth an angle: its error would exceed 1e-9 rad."""

RIGID = 1e-3
"""Deviation of RᵀR from the identity up to which a matrix passes for a rotation."""


class Reason(enum.IntEnum):
    """Why a pose has no joint values; REACHED when it has."""

    REACHED = 0
    UNREACHABLE = 1
    """No joint values give the pose, whatever the limits."""
    OUTSIDE_LIMITS = 2
    """Joint values exist, and at least one of them is beyond its limits."""
    ABOVE_REMOTE_CENTRE = 3
    """Only with the end of the shaft behind the remote centre of motion."""
    SINGULAR = 4
    """Infinitely many joint values give the pose."""
    NOT_A_POSE = 5
    """The matrix holds a number that is not finite, more than 1000 km along an axis, or no right-handed rotation."""


REASONS = np.array(
    ["", "unreachable", "outside limits", "above the remote centre", "singular", "not a rigid pose within 1000 km"],
    dtype=object,
)
"""Text of each `Reason`."""


@dataclass(frozen=True, eq=False)
class InverseResult:
    """Joint values for one pose, or for many: the leading axes (...) are those of the poses.

    ``q`` (..., n) is the solution where ``ok``; for OUTSIDE_LIMITS the solution that would need wider limits, which a
    caller may clip on purpose; NaN otherwise. ``code`` (...) is the `Reason`, ``joint`` (...) the first joint beyond
    its limits, or -1. ``residual`` (...) is the angle in radians between the orientation asked for and the one that
    ``q`` gives, on arms that have too few joints to give them all; zero elsewhere.
    """

    q: Array
    code: Integers
    joint: Integers
    residual: Array

    @property
    def ok(self) -> NDArray[np.bool_]:
        """(...) whether ``q`` reaches the pose within the limits; a plain truth value for one pose."""
        reached: NDArray[np.bool_] = np.equal(self.code, Reason.REACHED)
        return reached

    @property
    def reason(self) -> str:
        """Why not, in words; empty for a pose that is reached. An array (...) of texts for many poses."""
        return cast(str, REASONS[self.code])

    def explain(self, joint_names: Sequence[str]) -> str:
        """The outcome for one pose as a sentence's end, naming the joint beyond its limits and its value."""
        if self.code == Reason.OUTSIDE_LIMITS:
            joint = int(self.joint)
            return f"it needs {joint_names[joint]} = {self.q[joint]:.4g}, which is outside its limits"
        return self.reason or "it is reachable"


def pose_rows(T: ArrayLike) -> tuple[Array, tuple[int, ...]]:
    """Poses (..., 4, 4) as rows (m, 4, 4) of their own, and the shape of their leading axes.

    Raises ValueError for arrays of other shapes.
    """
    # a copy: compiled code would be compiled again for arrays that are read-only or not contiguous
    poses = np.array(T, dtype=np.float64, order="C")
    if poses.shape[-2:] != (4, 4):
        raise ValueError(f"expected poses (..., 4, 4), got {poses.shape}")
    return poses.reshape(-1, 4, 4), poses.shape[:-2]


def seed_rows(seed: ArrayLike | None, n: int, m: int) -> Array:
    """Joint values (..., n) to stay close to, as rows: one for all poses or one a pose; None is all zeros.

    Raises ValueError for another number of rows.
    """
    if seed is None:
        return np.zeros((1, n))
    values = np.array(seed, dtype=np.float64, order="C")
    if values.shape[-1:] != (n,) or values.size // n not in (1, m):
        got = values.size // n if values.shape[-1:] == (n,) else f"the shape {values.shape}"
        raise ValueError(f"expected one seed of {n} joint values, or one for each of {m} poses, got {got}")
    rows = values.reshape(-1, n)
    return np.where(np.isfinite(rows), rows, 0.0)


class Answers:
    """Arrays that the compiled solvers fill, for m poses of leading ``shape`` and n joints."""

    def __init__(self, m: int, n: int, shape: tuple[int, ...]) -> None:
        self.shape = shape
        self.q = np.empty((m, n))
        self.code = np.empty(m, dtype=np.int64)
        self.joint = np.empty(m, dtype=np.int64)
        self.residual = np.zeros(m)

    def result(self) -> InverseResult:
        """Their readings."""
        if not self.shape:
            return InverseResult(self.q[0], self.code[0], self.joint[0], self.residual[0])
        shape = self.shape
        return InverseResult(
            self.q.reshape(*shape, self.q.shape[1]), self.code.reshape(shape), self.joint.reshape(shape),
            self.residual.reshape(shape),
        )  # fmt: skip


@compiled
def is_rigid(T: Array) -> bool:
    """Whether the upper rows of ``T`` are finite and hold a right-handed rotation."""
    for i in range(3):
        for j in range(4):
            if not np.isfinite(T[i, j]) or abs(T[i, j]) > 1e6:
                return False
    for i in range(3):
        for j in range(i, 3):
            dot = T[0, i] * T[0, j] + T[1, i] * T[1, j] + T[2, i] * T[2, j]
            if abs(dot - (1.0 if i == j else 0.0)) > RIGID:
                return False
    volume = (
        (T[1, 0] * T[2, 1] - T[2, 0] * T[1, 1]) * T[0, 2]
        + (T[2, 0] * T[0, 1] - T[0, 0] * T[2, 1]) * T[1, 2]
        + (T[0, 0] * T[1, 1] - T[1, 0] * T[0, 1]) * T[2, 2]
    )
    return bool(volume > 0.0)


@compiled
def first_outside(q: Array, limits: Array) -> int:
    """Index of the first joint of ``q`` (n,) beyond its ``limits`` (2, n), or -1."""
    for i in range(q.shape[0]):
        if q[i] < limits[0, i] - LIMIT_TOLERANCE or q[i] > limits[1, i] + LIMIT_TOLERANCE:
            return i
    return -1


@compiled
def nearest_turn(angle: float, near: float, low: float, high: float) -> float:
    """``angle`` plus whole turns: closest to ``near`` among those within the limits, if there is one."""
    near = min(max(near, low), high)
    turned = angle + 2 * np.pi * np.round((near - angle) / (2 * np.pi))
    if turned > high + LIMIT_TOLERANCE and turned - 2 * np.pi >= low - LIMIT_TOLERANCE:
        return turned - 2 * np.pi  # type: ignore[no-any-return]
    if turned < low - LIMIT_TOLERANCE and turned + 2 * np.pi <= high + LIMIT_TOLERANCE:
        return turned + 2 * np.pi  # type: ignore[no-any-return]
    return turned  # type: ignore[no-any-return]


@compiled
def aim_shaft(x: float, y: float, z: float, q: Array) -> None:
    """Yaw and pitch, into ``q``, that turn the shaft along x y z (Munawar and others 2022, eqs. 8 and 9)."""
    q[0] = np.arctan2(x, -z)
    q[1] = -np.arctan2(y, np.sqrt(x * x + z * z))
