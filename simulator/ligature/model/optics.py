"""Cameras as measuring instruments: frames, pinhole matrices, stereo pairs and what calibration files hold.

Frames: camera C looks along -X, +Y is image right, +Z image up (as in AMBF); optical O is
ROS's and OpenCV's, x right, y down, z forward. Pixels are counted from the centre of the top left one, as in
OpenCV: the middle of a picture w wide is (w - 1) / 2. Metres and radians.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import frame, inverse, pose7_matrix
from ligature.model.scene import Camera, Scene

Array = NDArray[np.float64]

R_CAMERA_OPTICAL = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation of the optical frame in the camera frame."""

T_CAMERA_OPTICAL = frame(R_CAMERA_OPTICAL, (0.0, 0.0, 0.0))

NO_DISTORTION = (0.0, 0.0, 0.0, 0.0, 0.0)
EYES = ("left", "right")
"""The eyes of a camera with a ``stereo`` block, in this order."""

_PARALLEL = 1e-9
_SIDE = re.compile(r"left|Left|LEFT|L(?![a-z])|(?<![A-Za-z])l(?![A-Za-z])")
_OTHER = {"left": "right", "Left": "Right", "LEFT": "RIGHT", "L": "R", "l": "r"}
_MOST_TURNED = math.cos(math.radians(30.0))
"""Cosine of the largest angle between two cameras of a pair, and between their baseline and image right."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """What ``sensor_msgs/CameraInfo`` states of a camera, in pixels and metres.

    ``K`` (3, 3) projects from the optical frame, ``D`` (5,) is plumb-bob distortion k1 k2 p1 p2 k3, ``R`` (3, 3)
    turns the optical frame to the rectified one, ``P`` (3, 4) projects from the rectified frame of the left
    camera; its fourth column holds the baseline.
    """

    width: int
    height: int
    K: Array
    D: Array
    R: Array
    P: Array


def pinhole(projection: Array, width: int, height: int) -> Array:
    """Pinhole matrix K (3, 3), in pixels, of an OpenGL perspective ``projection`` (4, 4).

    The middle of the first pixel, at the top left, is at (0, 0).
    """
    p = projection
    return np.array(
        [
            [p[0, 0] * width / 2, -p[0, 1] * width / 2, (1 - p[0, 2]) * width / 2 - 0.5],
            [0.0, p[1, 1] * height / 2, (1 + p[1, 2]) * height / 2 - 0.5],
            [0.0, 0.0, 1.0],
        ]
    )


def eye_offset(camera: Camera, eye: str) -> float:
    """Metres from the camera to one of its `EYES` along image right; 0 for the camera itself."""
    if camera.stereo is None or not eye:
        return 0.0
    return camera.stereo[0] * (-0.5 if eye == "left" else 0.5)


def eye_pose(camera: Camera, pose: Array, eye: str = "") -> Array:
    """Pose (4, 4) of an eye, or of the camera, that stands at ``pose`` (7,)."""
    T = pose7_matrix(pose)
    T[:3, 3] += eye_offset(camera, eye) * T[:3, 1]
    return T


def single(K: Array, width: int, height: int, distortion: tuple[float, ...] = NO_DISTORTION) -> Calibration:
    """Calibration of a camera on its own."""
    P = np.hstack([K, np.zeros((3, 1))])
    return Calibration(width, height, K, np.array(distortion), np.eye(3), P)


def pair(
    left: Calibration, right: Calibration, T_world_left: Array, T_world_right: Array
) -> tuple[Calibration, Calibration]:
    """Calibrations of two cameras as one stereo pair; poses (4, 4) of their camera frames.

    The rectified frames share their axes: x along the baseline, z as near as may be to the mean of the two optical
    axes (Fusiello, Trucco and Verri 2000, eq. 5). Cameras that are parallel already keep R = 1 and P = K.
    """
    T_left_right = inverse(T_world_left @ T_CAMERA_OPTICAL) @ T_world_right @ T_CAMERA_OPTICAL
    baseline = float(np.linalg.norm(T_left_right[:3, 3]))
    x = T_left_right[:3, 3] / baseline
    forward = np.array([0.0, 0.0, 1.0]) + T_left_right[:3, 2]
    y = np.cross(forward, x)
    y /= np.linalg.norm(y)
    R_left = np.array([x, y, np.cross(x, y)])
    R_right = R_left @ T_left_right[:3, :3]
    f = left.K[0, 0]
    P_left, P_right = np.zeros((3, 4)), np.zeros((3, 4))
    P_left[:, :3], P_right[:, :3] = left.K, left.K
    P_right[0, 2] = right.K[0, 2]
    P_right[0, 3] = -f * baseline
    return (
        Calibration(left.width, left.height, left.K, left.D, _settled(R_left), P_left),
        Calibration(right.width, right.height, right.K, right.D, _settled(R_right), P_right),
    )


def _settled(R: Array) -> Array:
    """``R``, or exactly the identity where rounding alone keeps it from that."""
    return np.eye(3) if np.abs(R - np.eye(3)).max() < _PARALLEL else R


def stereo_partners(scene: Scene) -> dict[int, int]:
    """Right camera by left camera: two cameras of one parent, named alike but for left and right, side by side."""
    by_topic = {camera.identity.topic: camera for camera in scene.cameras}
    partners = {}
    for left in scene.cameras:
        folder, _, name = left.identity.topic.rpartition("/")
        for side in _SIDE.finditer(name):
            other = f"{folder}/{name[: side.start()]}{_OTHER[side.group()]}{name[side.end() :]}"
            right = by_topic.get(other)
            if right is not None and _side_by_side(left, right):
                partners[left.index] = right.index
    return partners


def _side_by_side(left: Camera, right: Camera) -> bool:
    """Whether two cameras see one scene as a left and a right eye do."""
    if left.attachment.parent != right.attachment.parent or left.resolution != right.resolution:
        return False
    a, b = left.attachment.T_parent_object, right.attachment.T_parent_object
    step = b[:3, 3] - a[:3, 3]
    length = float(np.linalg.norm(step))
    return length > 0.0 and bool(step @ a[:3, 1] > _MOST_TURNED * length and a[:3, 0] @ b[:3, 0] > _MOST_TURNED)
