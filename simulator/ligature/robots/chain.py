"""Serial chains from Denavit-Hartenberg tables: forward kinematics and Jacobians of one or many joint vectors.

Poses are ``T_base_tip`` (4, 4): the tip in the arm's base frame, metres. Joint values are radians, or metres
where the joint slides.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ligature.kernels import compiled
from ligature.model.poses import write_pose

Array = NDArray[np.float64]

HALF_PI = np.pi / 2


class Convention(enum.Enum):
    """Where a link's own frame sits (as in the dVRK)."""

    MODIFIED = "modified"
    """Craig: RotX(alpha) TransX(a) RotZ(theta) TransZ(d); the joint turns about the link's own z."""

    STANDARD = "standard"
    """RotZ(theta) TransZ(d) TransX(a) RotX(alpha); the joint turns about the z of the link before."""


@dataclass(frozen=True)
class Link:
    """One row of a table: angles in radians, lengths in metres, ``theta`` and ``d`` at joint value zero."""

    alpha: float = 0.0
    a: float = 0.0
    d: float = 0.0
    theta: float = 0.0
    prismatic: bool = False


class Chain:
    """A serial chain of n joints with a fixed tip after the last one.

    Parameters
    ----------
    joint_names
        Names of the n joints, in order.
    links
        The table, one row a joint.
    convention
        How its rows are to be read.
    T_last_tip
        Pose (4, 4) of the tip in the frame of the last link.
    limits
        (low, high) of each joint, radians or metres.

    Attributes
    ----------
    joint_names
        Names of the joints.
    lower, upper
        (n,) joint limits, read-only.
    """

    def __init__(
        self,
        joint_names: tuple[str, ...],
        links: tuple[Link, ...],
        convention: Convention,
        T_last_tip: ArrayLike,
        limits: ArrayLike,
    ) -> None:
        self.joint_names = joint_names
        self._limits = np.array(limits, dtype=np.float64).T.copy()
        fixed = self._limits.copy()
        fixed.flags.writeable = False
        self.lower, self.upper = fixed
        self._tip = np.array(T_last_tip, dtype=np.float64)
        self._modified = convention is Convention.MODIFIED
        self._table = np.array(
            [[math.cos(k.alpha), math.sin(k.alpha), k.a, k.d, k.theta, float(k.prismatic)] for k in links]
        )

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    def forward(self, q: ArrayLike) -> Array:
        """Pose T_base_tip (..., 4, 4) of the joint values ``q`` (..., n)."""
        rows, shape = self._rows(q)
        T = np.empty((len(rows), 4, 4))
        _forward_rows(self._table, self._modified, self._tip, rows, T)
        return T.reshape(*shape, 4, 4)

    def frames(self, q: ArrayLike) -> Array:
        """Poses in the base frame of every link, and of the tip as the last one: (..., n + 1, 4, 4)."""
        rows, shape = self._rows(q)
        T = np.empty((len(rows), self.n + 1, 4, 4))
        _frame_rows(self._table, self._modified, self._tip, rows, T)
        return T.reshape(*shape, self.n + 1, 4, 4)

    def jacobian_spatial(self, q: ArrayLike) -> Array:
        """Spatial Jacobian (..., 6, n), linear rows first.

        Gives the twist in base axes of the point of the tip body that passes through the base origin (Murray, Li,
        Sastry, *A Mathematical Introduction to Robotic Manipulation*, eq. 3.51).
        """
        rows, shape = self._rows(q)
        J = np.empty((len(rows), 6, self.n))
        _jacobian_rows(self._table, self._modified, self._tip, rows, False, J)
        return J.reshape(*shape, 6, self.n)

    def jacobian_body(self, q: ArrayLike) -> Array:
        """Body Jacobian (..., 6, n), linear rows first: the twist of the tip in tip axes (ibid., eq. 3.55)."""
        rows, shape = self._rows(q)
        J = np.empty((len(rows), 6, self.n))
        _jacobian_rows(self._table, self._modified, self._tip, rows, True, J)
        return J.reshape(*shape, 6, self.n)

    def describe(
        self, base: Array, absolute: bool, measured: Array, setpoint: Array, wrench: Array,
        js: Array, poses: Array, vectors: Array, jacobians: Array,
    ) -> None:  # fmt: skip
        """Fill in what an arm reports of its tip, in one call; the last four change.

        ``base`` (4, 4) is its base in the reference frame; ``measured`` and ``setpoint`` (3, n) are its joints, and
        ``wrench`` (6,) acts on the tip, in base axes. ``js`` (2, 3, m) receives the joints, ``poses`` (4, 7) the tip
        measured and asked for in the reference frame, then in the base; ``vectors`` (4, 6) the tip's twist in axes of
        the reference frame and of the base, then the wrench in those of the tip, or of the base where it is
        ``absolute``, and of the reference frame; ``jacobians`` (2, 6, m) the body and the spatial one.
        """
        describe_tip(
            self._table, self._modified, self._tip, base, absolute, measured, setpoint, wrench, js, poses, vectors,
            jacobians,
        )  # fmt: skip

    def tables(self) -> tuple[Array, bool, Array]:
        """What `describe_tip` takes of a chain: its table, whether that is Craig's, and the tip (4, 4)."""
        return self._table, self._modified, self._tip

    def _rows(self, q: ArrayLike) -> tuple[Array, tuple[int, ...]]:
        """``q`` as rows (m, n) of its own, and the shape that its leading axes had."""
        # a copy: compiled code would be compiled again for arrays that are read-only or not contiguous
        values = np.array(q, dtype=np.float64, order="C")
        if values.ndim == 0 or values.shape[-1] != self.n:
            raise ValueError(f"expected {self.n} joint values ({', '.join(self.joint_names)}), got {values.shape}")
        return values.reshape(-1, self.n), values.shape[:-1]


@compiled
def identity(T: Array) -> None:
    """Set the pose ``T`` (4, 4) to the identity."""
    T[:] = 0.0
    for i in range(4):
        T[i, i] = 1.0


@compiled
def advance(row: Array, modified: bool, q: float, T: Array) -> None:
    """Multiply the pose ``T`` (4, 4) by the transform of one link, in place."""
    ca, sa, a, d, theta = row[0], row[1], row[2], row[3], row[4]
    if row[5] != 0.0:
        d += q
    else:
        theta += q
    c, s = np.cos(theta), np.sin(theta)
    for i in range(3):
        x, y, z = T[i, 0], T[i, 1], T[i, 2]
        if modified:
            T[i, 3] += x * a - y * sa * d + z * ca * d
            turned_y, turned_z = y * ca + z * sa, z * ca - y * sa
            T[i, 0], T[i, 1], T[i, 2] = x * c + turned_y * s, turned_y * c - x * s, turned_z
        else:
            turned_x, turned_y = x * c + y * s, y * c - x * s
            T[i, 3] += turned_x * a + z * d
            T[i, 0], T[i, 1], T[i, 2] = turned_x, turned_y * ca + z * sa, z * ca - turned_y * sa


@compiled
def append(T: Array, tip: Array) -> None:
    """Multiply the pose ``T`` (4, 4) by the pose ``tip`` (4, 4), in place."""
    for i in range(3):
        x, y, z = T[i, 0], T[i, 1], T[i, 2]
        for j in range(3):
            T[i, j] = x * tip[0, j] + y * tip[1, j] + z * tip[2, j]
        T[i, 3] += x * tip[0, 3] + y * tip[1, 3] + z * tip[2, 3]


@compiled
def _forward_rows(table: Array, modified: bool, tip: Array, q: Array, out: Array) -> None:
    for k in range(q.shape[0]):
        forward_row(table, modified, tip, q[k], out[k])


@compiled
def forward_row(table: Array, modified: bool, tip: Array, q: Array, T: Array) -> None:
    """Pose ``T`` (4, 4) of the tip in the base at the joint values ``q`` (n,); see `Chain.tables`."""
    identity(T)
    for j in range(table.shape[0]):
        advance(table[j], modified, q[j], T)
    append(T, tip)


@compiled
def _frame_rows(table: Array, modified: bool, tip: Array, q: Array, out: Array) -> None:
    n = table.shape[0]
    for k in range(q.shape[0]):
        identity(out[k, 0])
        for j in range(n):
            if j > 0:
                out[k, j] = out[k, j - 1]
            advance(table[j], modified, q[k, j], out[k, j])
        out[k, n] = out[k, n - 1]
        append(out[k, n], tip)


@compiled
def _jacobian_rows(table: Array, modified: bool, tip: Array, q: Array, body: bool, out: Array) -> None:
    """Spatial Jacobians of the rows of ``q``, or body Jacobians, into ``out`` (m, 6, n)."""
    T = np.empty((4, 4))
    for k in range(q.shape[0]):
        J = out[k]
        identity(T)
        for j in range(table.shape[0]):
            if modified:
                advance(table[j], modified, q[k, j], T)
            _screw(T, table[j, 5] != 0.0, J, j)
            if not modified:
                advance(table[j], modified, q[k, j], T)
        if body:
            append(T, tip)
            for j in range(table.shape[0]):
                _into_tip(T, J, j)


@compiled
def _screw(T: Array, prismatic: bool, J: Array, j: int) -> None:
    """Column ``j`` of the spatial Jacobian: the twist of a joint about or along the z axis of ``T``."""
    x, y, z = T[0, 2], T[1, 2], T[2, 2]
    px, py, pz = T[0, 3], T[1, 3], T[2, 3]
    if prismatic:
        J[0, j], J[1, j], J[2, j] = x, y, z
        J[3, j] = J[4, j] = J[5, j] = 0.0
    else:
        J[0, j], J[1, j], J[2, j] = py * z - pz * y, pz * x - px * z, px * y - py * x
        J[3, j], J[4, j], J[5, j] = x, y, z


@compiled
def _into_tip(T: Array, J: Array, j: int) -> None:
    """Turn column ``j`` from the twist at the base origin in base axes to that of the tip ``T`` in tip axes."""
    wx, wy, wz = J[3, j], J[4, j], J[5, j]
    px, py, pz = T[0, 3], T[1, 3], T[2, 3]
    vx = J[0, j] + wy * pz - wz * py
    vy = J[1, j] + wz * px - wx * pz
    vz = J[2, j] + wx * py - wy * px
    for i in range(3):
        J[i, j] = T[0, i] * vx + T[1, i] * vy + T[2, i] * vz
        J[3 + i, j] = T[0, i] * wx + T[1, i] * wy + T[2, i] * wz


@compiled
def describe_tip(
    table: Array, modified: bool, tip: Array, base: Array, absolute: bool, measured: Array, setpoint: Array,
    wrench: Array, js: Array, poses: Array, vectors: Array, jacobians: Array,
) -> None:  # fmt: skip
    """See `Chain.describe`."""
    n = table.shape[0]
    js[0, :, :n], js[1, :, :n] = measured, setpoint
    T, turned, R = np.empty((4, 4)), np.empty((4, 4)), np.empty((3, 3))
    for k in range(2):
        identity(T)
        for j in range(n):
            if modified:
                advance(table[j], modified, js[k, 0, j], T)
            if k == 0:
                _screw(T, table[j, 5] != 0.0, jacobians[1], j)
            if not modified:
                advance(table[j], modified, js[k, 0, j], T)
        append(T, tip)
        if k == 0:
            R[:] = T[:3, :3]
            jacobians[0] = jacobians[1]
            for j in range(n):
                _into_tip(T, jacobians[0], j)
        write_pose(T, poses[2 + k])
        turned[:] = base
        append(turned, T)
        write_pose(turned, poses[k])
    for half in range(0, 6, 3):
        for i in range(3):
            twist = 0.0
            for a in range(3):
                for j in range(n):
                    twist += R[i, a] * jacobians[0, half + a, j] * measured[1, j]
            vectors[1, half + i] = twist
            on_tip = R[0, i] * wrench[half] + R[1, i] * wrench[half + 1] + R[2, i] * wrench[half + 2]
            vectors[2, half + i] = wrench[half + i] if absolute else on_tip
        for i in range(3):
            vectors[0, half + i] = vectors[3, half + i] = 0.0
            for a in range(3):
                vectors[0, half + i] += base[i, a] * vectors[1, half + a]
                vectors[3, half + i] += base[i, a] * wrench[half + a]
