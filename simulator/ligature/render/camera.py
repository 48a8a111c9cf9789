"""Camera mathematics: projection, view and intrinsics of an ADF camera.

Camera frame C (ADF specification §18.1): the camera looks along -X, +Y is image right, +Z image up.
OpenGL eye frame: x right, y up, -z forward. OpenCV frame: x right, y down, z forward. Pixels have
their centres at half-integers in OpenGL and at integers in `intrinsics`. Metres and radians.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.model.scene import Camera

Array = NDArray[np.float64]

R_EYE_CAMERA = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Rotation from the camera frame to the OpenGL eye frame."""


@dataclass(frozen=True, eq=False)
class CameraView:
    """One picture to take: eye pose and projection.

    ``view`` (4, 4) maps world to eye coordinates, ``projection`` (4, 4) eye to clip coordinates;
    ``near`` and ``far`` in metres; ``width`` and ``height`` in pixels.
    """

    view: Array
    projection: Array
    near: float
    far: float
    width: int
    height: int

    @property
    def intrinsics(self) -> Array:
        """Pinhole matrix K (3, 3) in pixels, x right, y down, of a perspective projection."""
        p = self.projection
        fx, fy = p[0, 0] * self.width / 2, p[1, 1] * self.height / 2
        cx = (1 - p[0, 2]) * self.width / 2
        cy = (1 + p[1, 2]) * self.height / 2
        return np.array([[fx, -p[0, 1] * self.width / 2, cx], [0, fy, cy], [0, 0, 1]])


def view_matrix(T_world_camera: Array) -> Array:
    """World to eye (4, 4) of a camera at ``T_world_camera`` (4, 4)."""
    R = R_EYE_CAMERA @ T_world_camera[:3, :3].T
    view = np.eye(4)
    view[:3, :3] = R
    view[:3, 3] = -R @ T_world_camera[:3, 3]
    return view


def perspective(field_of_view: float, aspect: float, near: float, far: float) -> Array:
    """OpenGL projection (4, 4) with the vertical ``field_of_view`` in radians."""
    f = 1.0 / np.tan(field_of_view / 2)
    depth = near - far
    return np.array(
        [
            [f / aspect, 0, 0, 0],
            [0, f, 0, 0],
            [0, 0, (far + near) / depth, 2 * far * near / depth],
            [0, 0, -1, 0],
        ]
    )


def orthographic(width: float, aspect: float, near: float, far: float) -> Array:
    """OpenGL projection (4, 4) of a box ``width`` metres wide."""
    height = width / aspect
    return np.array(
        [
            [2 / width, 0, 0, 0],
            [0, 2 / height, 0, 0],
            [0, 0, -2 / (far - near), -(far + near) / (far - near)],
            [0, 0, 0, 1],
        ]
    )


def from_intrinsics(values: dict[str, float], width: int, height: int, near: float, far: float) -> Array:
    """OpenGL projection (4, 4) of pixel intrinsics fx, fy, cx, cy, s (ADF specification §18.2)."""
    fx, fy = values.get("fx", 100.0), values.get("fy", 100.0)
    cx, cy, skew = values.get("cx", 0.0), values.get("cy", 0.0), values.get("s", 0.0)
    return np.array(
        [
            [2 * fx / width, 2 * skew / width, (width - 2 * cx) / width, 0],
            [0, 2 * fy / height, (2 * cy - height) / height, 0],
            [0, 0, -(far + near) / (far - near), -2 * far * near / (far - near)],
            [0, 0, -1, 0],
        ]
    )


def projection_matrix(camera: Camera, width: int, height: int) -> Array:
    """OpenGL projection (4, 4) of an ADF camera for a picture of ``width`` x ``height`` pixels."""
    near, far = camera.near, camera.far
    if camera.intrinsics is not None:
        return from_intrinsics(camera.intrinsics, width, height, near, far)
    if camera.projection is not None:
        return np.asarray(camera.projection, dtype=float)
    if camera.orthographic_width is not None:
        return orthographic(camera.orthographic_width, width / height, near, far)
    return perspective(camera.field_of_view, width / height, near, far)


def view_of(camera: Camera, pose: Array, resolution: tuple[int, int] | None = None) -> CameraView:
    """The view of ``camera`` standing at ``pose`` (7,) in world axes."""
    width, height = resolution or camera.resolution
    return CameraView(
        view_matrix(pose7_matrix(np.asarray(pose))),
        projection_matrix(camera, width, height),
        camera.near,
        camera.far,
        width,
        height,
    )
