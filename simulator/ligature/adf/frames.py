"""Rotations, poses and joint frames of the format.

Orientation blocks are r, p, y with ``R = Rz(y) Ry(p) Rx(r)`` (as in AMBF). Poses (7,) are
x y z qx qy qz qw; ``T_a_b`` (4, 4) is frame b in frame a. Metres and radians.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

PARALLEL, ANTIPARALLEL = 0.001, 3.14
"""Angles between which two axes have a rotation axis of their own; part of the format."""

_IDENTITY = np.eye(4)


def rpy_matrix(r: float, p: float, y: float) -> Array:
    """Rotation (3, 3) of an orientation block."""
    cr, sr, cp, sp, cy, sy = math.cos(r), math.sin(r), math.cos(p), math.sin(p), math.cos(y), math.sin(y)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def matrix_rpy(R: Array) -> tuple[float, float, float]:
    """An orientation block of the rotation ``R`` (3, 3), with p in -pi/2 … pi/2."""
    p = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0]))
    if math.hypot(R[0, 0], R[1, 0]) < 1e-12:
        return math.atan2(-R[1, 2], R[1, 1]), p, 0.0
    return math.atan2(R[2, 1], R[2, 2]), p, math.atan2(R[1, 0], R[0, 0])


def pose_matrix(xyz: ArrayLike, rpy: ArrayLike) -> Array:
    """Pose (4, 4) of a position and an orientation block."""
    T = np.eye(4)
    r, p, y = np.asarray(rpy, dtype=float)
    T[:3, :3] = rpy_matrix(r, p, y)
    T[:3, 3] = xyz
    return T


def frame(R: Array, p: ArrayLike) -> Array:
    """Pose (4, 4) of a rotation (3, 3) and an origin (3,)."""
    T = _IDENTITY.copy()
    T[:3, :3] = R
    T[:3, 3] = p
    return T


def inverse(T: Array) -> Array:
    """Inverse of a pose (4, 4)."""
    out = _IDENTITY.copy()
    out[:3, :3] = T[:3, :3].T
    out[:3, 3] = -T[:3, :3].T @ T[:3, 3]
    return out


def axis_rotation(axis: ArrayLike, angle: float) -> Array:
    """Rotation (3, 3) by ``angle`` about the unit vector ``axis`` (Rodrigues)."""
    x, y, z = np.asarray(axis, dtype=float)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    R: Array = np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * (K @ K)
    return R


def matrix_quaternion(R: Array) -> Array:
    """Unit quaternion x y z w of the rotation ``R`` (3, 3), w >= 0 (Shepperd's method)."""
    m00, m11, m22 = R[0, 0], R[1, 1], R[2, 2]
    squares = np.array([m00 - m11 - m22, m11 - m00 - m22, m22 - m00 - m11, m00 + m11 + m22])
    i = int(np.argmax(squares))
    q = np.empty(4)
    if i == 3:
        q[:] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1.0 + squares[3]
    else:
        j, k = (i + 1) % 3, (i + 2) % 3
        q[i] = 1.0 + squares[i]
        q[j] = R[j, i] + R[i, j]
        q[k] = R[k, i] + R[i, k]
        q[3] = R[k, j] - R[j, k]
    q /= np.linalg.norm(q)
    return q if q[3] >= 0 else -q


def quaternion_matrix(q: ArrayLike) -> Array:
    """Rotation (3, 3) of the unit quaternion ``q`` x y z w."""
    x, y, z, w = np.asarray(q, dtype=float).tolist()  # numbers: items of arrays take three times as long
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def matrix_pose7(T: Array) -> Array:
    """Pose (7,) of ``T`` (4, 4)."""
    return np.concatenate([T[:3, 3], matrix_quaternion(T[:3, :3])])


def pose7_matrix(pose: ArrayLike) -> Array:
    """``T`` (4, 4) of a pose (7,)."""
    values = np.asarray(pose, dtype=float)
    return frame(quaternion_matrix(values[3:7]), values[:3])


def minimal_rotation(u: ArrayLike, v: ArrayLike) -> Array:
    """Rotation (3, 3) that turns ``u`` to ``v``, with the format's choice for (anti)parallel axes."""
    a = np.asarray(u, dtype=float) / np.linalg.norm(u)
    b = np.asarray(v, dtype=float) / np.linalg.norm(v)
    angle = math.acos(np.clip(a @ b, -1.0, 1.0))
    if angle < PARALLEL:
        return axis_rotation((0.0, 0.0, 1.0), angle)
    if angle <= ANTIPARALLEL:
        axis = np.cross(a, b)
    else:
        to_x = math.acos(np.clip(a[0], -1.0, 1.0))
        axis = np.cross(a, (1.0, 0.0, 0.0)) if PARALLEL < to_x < ANTIPARALLEL else np.cross(b, (0.0, 1.0, 0.0))
    return axis_rotation(axis / np.linalg.norm(axis), angle)


class JointFrames(NamedTuple):
    """Constraint frames of a joint in inertial frames, and the child at joint position zero.

    ``axis`` (3,) is the joint axis in the parent's inertial frame; ``T_parent_a`` and ``T_child_b``
    (4, 4) the constraint frames A and B; ``T_parent_child`` (4, 4) the child's inertial frame in
    the parent's at zero.
    """

    axis: Array
    T_parent_a: Array
    T_child_b: Array
    T_parent_child: Array


def joint_frames(
    T_parent_inertial: Array,
    T_child_inertial: Array,
    parent_pivot: ArrayLike,
    child_pivot: ArrayLike,
    parent_axis: ArrayLike,
    child_axis: ArrayLike,
    offset: float = 0.0,
    joint_offset: float = 0.0,
    prismatic: bool = False,
) -> JointFrames:
    """Constraint frames as AMBF builds them; pivots (already scaled) and axes are in the body frames."""
    to_parent, to_child = inverse(T_parent_inertial), inverse(T_child_inertial)
    p_a = to_parent[:3, :3] @ np.asarray(parent_pivot, dtype=float) + to_parent[:3, 3]
    p_b = to_child[:3, :3] @ np.asarray(child_pivot, dtype=float) + to_child[:3, 3]
    a_a = to_parent[:3, :3] @ (np.asarray(parent_axis, dtype=float) / np.linalg.norm(parent_axis))
    a_b = to_child[:3, :3] @ (np.asarray(child_axis, dtype=float) / np.linalg.norm(child_axis))
    e = (1.0, 0.0, 0.0) if prismatic else (0.0, 0.0, 1.0)
    R_a = axis_rotation(a_a, joint_offset) @ minimal_rotation(e, a_a)
    turn = axis_rotation(a_a, offset) @ minimal_rotation(a_b, a_a)
    T_parent_child = frame(turn, p_a - turn @ p_b)
    return JointFrames(a_a, frame(R_a, p_a), frame(turn.T @ R_a, p_b), T_parent_child)
