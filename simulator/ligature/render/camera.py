"""Camera mathematics: projection, view and intrinsics of an ADF camera.

Camera frame C (as in AMBF): the camera looks along -X, +Y is image right, +Z image up.
OpenGL eye frame: x right, y up, -z forward. Pinhole matrices count pixels as `ligature.model.optics` does.
Metres and radians.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.model.optics import eye_offset, eye_pose, pinhole
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
    def orthographic(self) -> bool:
        """Whether rays are parallel."""
        return bool(self.projection[3, 3] != 0.0)

    @property
    def intrinsics(self) -> Array:
        """Pinhole matrix K (3, 3) in pixels; pixel centres are whole numbers.

        Of an orthographic view it takes metres, not directions, to pixels.
        """
        return pinhole(self.projection, self.width, self.height)


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
    """OpenGL projection (4, 4) of pixel intrinsics fx, fy, cx, cy, s (as in AMBF)."""
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


def projection_matrix(camera: Camera, width: int, height: int, eye: str = "") -> Array:
    """OpenGL projection (4, 4) of an ADF camera, or one of its eyes, for a picture of ``width`` x ``height`` pixels.

    The frustum of an eye leans towards the middle by a quarter of the separation at the focal length.
    """
    near, far = camera.near, camera.far
    if camera.intrinsics is not None:
        return from_intrinsics(camera.intrinsics, width, height, near, far)
    if camera.projection is not None:
        return np.asarray(camera.projection, dtype=float)
    if camera.orthographic_width is not None:
        return orthographic(camera.orthographic_width, width / height, near, far)
    projection = perspective(camera.field_of_view, width / height, near, far)
    if camera.stereo is not None:
        projection[0, 2] = -0.5 * eye_offset(camera, eye) / camera.stereo[1] * projection[0, 0]
    return projection


def view_of(camera: Camera, pose: Array, resolution: tuple[int, int] | None = None, eye: str = "") -> CameraView:
    """The view of ``camera``, or of its eye ``"left"`` or ``"right"``, standing at ``pose`` (7,) in world axes.

    Raises ValueError for a ``resolution`` without pixels, TypeError for what is none.
    """
    try:
        width, height = map(operator.index, resolution or camera.resolution)
    except (TypeError, ValueError):
        raise TypeError(f"a size of pictures must be a width and a height in pixels, not {resolution!r}") from None
    if width < 1 or height < 1:
        raise ValueError(f"a picture cannot be {width} x {height}: each is at least 1 pixel")
    return CameraView(
        view_matrix(eye_pose(camera, np.asarray(pose), eye)),
        projection_matrix(camera, width, height, eye),
        camera.near,
        camera.far,
        width,
        height,
    )


def unproject(depth: NDArray[np.float32], view: CameraView) -> NDArray[np.float32]:
    """Points (h, w, 3) in the optical frame of linear ``depth`` (h, w) seen by ``view``; NaN where nothing is."""
    height, width = depth.shape
    K = view.intrinsics
    v = (np.arange(height) - K[1, 2]) / K[1, 1]
    u = (np.arange(width)[None, :] - K[0, 2] - K[0, 1] * v[:, None]) / K[0, 0]
    z = np.where(np.isfinite(depth), depth, np.float32(np.nan))
    reach = np.float32(1.0) if view.orthographic else z
    points = np.empty((height, width, 3), dtype=np.float32)
    points[..., 0] = u.astype(np.float32) * reach
    points[..., 1] = v.astype(np.float32)[:, None] * reach
    points[..., 2] = z
    if view.orthographic:
        points[~np.isfinite(depth)] = np.nan
    return points
