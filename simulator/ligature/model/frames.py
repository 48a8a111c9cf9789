"""The format's rotations, poses and joint frames, under the names that other packages use."""

from ligature.adf.frames import (
    ANTIPARALLEL,
    PARALLEL,
    Array,
    JointFrames,
    axis_rotation,
    frame,
    inverse,
    joint_frames,
    matrix_pose7,
    matrix_quaternion,
    matrix_rpy,
    minimal_rotation,
    pose7_matrix,
    pose_matrix,
    quaternion_matrix,
    rpy_matrix,
)

__all__ = [
    "ANTIPARALLEL",
    "PARALLEL",
    "Array",
    "JointFrames",
    "axis_rotation",
    "frame",
    "inverse",
    "joint_frames",
    "matrix_pose7",
    "matrix_quaternion",
    "matrix_rpy",
    "minimal_rotation",
    "pose7_matrix",
    "pose_matrix",
    "quaternion_matrix",
    "rpy_matrix",
]
