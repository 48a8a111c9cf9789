"""Where things stand, and which keys describe it: joints, cameras, lights, axes of round shapes.

Poses are ``T_a_b`` (4, 4), frame b in frame a, in metres; angles in radians. A view looks along −Z
with +Y up, as OpenGL and Blender have it; the format's own camera looks along −X with +Z up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ligature.adf.frames import (
    ANTIPARALLEL,
    PARALLEL,
    Array,
    JointFrames,
    axis_rotation,
    frame,
    inverse,
    joint_frames,
    matrix_rpy,
    minimal_rotation,
    pose_matrix,
    rpy_matrix,
)

Vector = tuple[float, float, float]
Pose = tuple[Vector, Vector]

IDENTITY = np.eye(4)
AXIS_TURNS = {"X": rpy_matrix(0, np.pi / 2, 0), "Y": rpy_matrix(-np.pi / 2, 0, 0), "Z": np.eye(3)}
"""Rotation (3, 3) that takes local Z to the axis of a round shape (as in AMBF)."""

SAME_PLACE = 2e-6
"""Metres and radians below which two poses are the same: what single precision leaves of one metre."""


@dataclass(frozen=True)
class JointKeys:
    """What a file states about where a joint is; pivots and axes in body frames, angles in radians."""

    parent_pivot: Vector
    child_pivot: Vector
    parent_axis: Vector
    child_axis: Vector
    offset: float = 0.0
    joint_offset: float = 0.0


def pose_of(T: Array) -> Pose:
    """Position x y z and orientation r p y of a pose."""
    return vector(T[:3, 3]), matrix_rpy(T[:3, :3])


def matrix_of(pose: Pose | None) -> Array:
    """The pose (4, 4) of position and orientation; identity for None."""
    return np.eye(4) if pose is None else pose_matrix(*pose)


def vector(values: Array) -> Vector:
    """Three floats, without negative zeros."""
    x, y, z = (float(v) + 0.0 for v in values)
    return x, y, z


def same_place(A: Array, B: Array, tolerance: float = SAME_PLACE) -> bool:
    """Whether two rigid poses are the same; lengths count relative to their size beyond one metre."""
    far = max(1.0, float(np.abs(A[:3, 3]).max()))
    if float(np.abs(A[:3, 3] - B[:3, 3]).max()) > tolerance * far:
        return False
    return float(np.abs(A[:3, :3] - B[:3, :3]).max()) <= tolerance


def rigid(T: Array) -> Array:
    """The nearest rigid pose of a matrix with scale or shear (polar decomposition by SVD)."""
    u, _, vt = np.linalg.svd(T[:3, :3])
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return frame(turn, T[:3, 3])


def view_pose(location: Vector, look_at: Vector, up: Vector) -> Array:
    """Pose of a view; with identity orientation in the format's sense when it looks nowhere."""
    p = np.asarray(location, dtype=float)
    back = p - np.asarray(look_at, dtype=float)
    right = np.cross(up, back)
    if np.linalg.norm(right) <= 1e-12 * max(1.0, float(np.linalg.norm(back))):
        return frame(np.column_stack([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]), p)
    back /= np.linalg.norm(back)
    right /= np.linalg.norm(right)
    return frame(np.column_stack([right, np.cross(back, right), back]), p)


def view_keys(T: Array, distance: float = 1.0) -> tuple[Vector, Vector, Vector]:
    """Location, look-at point ``distance`` metres ahead, and up direction of a view."""
    return vector(T[:3, 3]), vector(T[:3, 3] - distance * T[:3, 2]), vector(T[:3, 1])


def light_pose(location: Vector, direction: Vector) -> Array:
    """Pose of a lamp that shines along its −Z; a zero direction shines along +X (as in AMBF)."""
    d = np.asarray(direction, dtype=float)
    length = float(np.linalg.norm(d))
    d = np.array([1.0, 0.0, 0.0]) if length < 0.01 else d / length
    across = np.cross([0.0, 0.0, 1.0], -d)
    if np.linalg.norm(across) < 1e-6:
        across = np.array([1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    return frame(np.column_stack([across, np.cross(-d, across), -d]), location)


def light_keys(T: Array) -> tuple[Vector, Vector]:
    """Location and direction of a lamp."""
    return vector(T[:3, 3]), vector(-T[:3, 2])


def joint_pose(
    keys: JointKeys, T_parent_inertial: Array = IDENTITY, T_child_inertial: Array = IDENTITY, prismatic: bool = False
) -> Array:
    """Pose of frame A in the parent's body frame (as in AMBF); its Z, of a prismatic joint its X, is the axis."""
    return T_parent_inertial @ _frames(keys, T_parent_inertial, T_child_inertial, prismatic).T_parent_a


def child_pose(
    keys: JointKeys, T_parent_inertial: Array = IDENTITY, T_child_inertial: Array = IDENTITY, prismatic: bool = False
) -> Array:
    """Pose of the child's body frame in the parent's at joint position zero (as in AMBF)."""
    frames = _frames(keys, T_parent_inertial, T_child_inertial, prismatic)
    return T_parent_inertial @ frames.T_parent_child @ inverse(T_child_inertial)


def moved_child_pose(
    keys: JointKeys,
    position: float,
    T_parent_inertial: Array = IDENTITY,
    T_child_inertial: Array = IDENTITY,
    prismatic: bool = False,
) -> Array:
    """Pose of the child in the parent at a joint position: an angle, or metres of a prismatic joint (as in AMBF)."""
    T_parent_a = joint_pose(keys, T_parent_inertial, T_child_inertial, prismatic)
    motion = (
        frame(np.eye(3), (position, 0.0, 0.0)) if prismatic else frame(axis_rotation((0, 0, 1), position), (0, 0, 0))
    )
    at_zero = child_pose(keys, T_parent_inertial, T_child_inertial, prismatic)
    return T_parent_a @ motion @ inverse(T_parent_a) @ at_zero


def joint_keys(
    T_parent_joint: Array,
    T_parent_child: Array,
    T_parent_inertial: Array = IDENTITY,
    T_child_inertial: Array = IDENTITY,
    prismatic: bool = False,
    scales: tuple[float, float] = (1.0, 1.0),
) -> JointKeys:
    """Keys of a joint at ``T_parent_joint`` whose child stands at ``T_parent_child`` in joint position zero.

    Both axes are the joint frame's own, so that they map onto each other without the format's choice
    for antiparallel axes; ``offset`` takes the turn that is left (as in AMBF). Where the child tilts the
    axis by less than 0.001 rad, or turns it over within 0.0016 rad, the format cannot express it: the axes
    are then taken as exactly parallel or antiparallel. ``scales`` are the factors that the simulator
    puts on the pivots of parent and child.
    """
    e = np.array([1.0, 0.0, 0.0]) if prismatic else np.array([0.0, 0.0, 1.0])
    T_child_joint = inverse(T_parent_child) @ T_parent_joint
    a_parent, a_child = T_parent_joint[:3, :3] @ e, T_child_joint[:3, :3] @ e
    R_ip, R_ic = T_parent_inertial[:3, :3].T, T_child_inertial[:3, :3].T
    a_a, a_b = R_ip @ a_parent, R_ic @ a_child
    between = float(np.arccos(np.clip(a_a @ a_b, -1.0, 1.0)))
    if not PARALLEL <= between <= ANTIPARALLEL:
        a_b = a_a if between < PARALLEL else -a_a
        a_child = R_ic.T @ a_b
    turn = R_ip @ T_parent_child[:3, :3] @ R_ic.T
    offset = _angle_about(a_a, turn @ minimal_rotation(a_b, a_a).T)
    roll = _angle_about(a_a, R_ip @ T_parent_joint[:3, :3] @ minimal_rotation(e, a_a).T)
    return JointKeys(
        vector(T_parent_joint[:3, 3] / scales[0]),
        vector(T_child_joint[:3, 3] / scales[1]),
        vector(a_parent),
        vector(a_child),
        offset,
        roll,
    )


def _angle_about(axis: Array, R: Array) -> float:
    """Angle of a rotation about a known axis, in −π … π."""
    side = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    turned = R @ side
    return float(np.arctan2(np.cross(side, turned) @ axis, side @ turned))


def _frames(keys: JointKeys, T_parent_inertial: Array, T_child_inertial: Array, prismatic: bool) -> JointFrames:
    return joint_frames(
        T_parent_inertial,
        T_child_inertial,
        keys.parent_pivot,
        keys.child_pivot,
        keys.parent_axis,
        keys.child_axis,
        keys.offset,
        keys.joint_offset,
        prismatic,
    )
