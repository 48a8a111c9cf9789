"""A viewpoint that turns about a point: what the mouse moves in the window.

World axes with Z up, metres and radians; poses are those of a camera frame (looks along -X, +Y right, +Z up).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import frame, matrix_pose7, pose7_matrix

Array = NDArray[np.float64]

STEEPEST = np.radians(89.0)
CLOSEST, FARTHEST = 1e-3, 1e3


@dataclass(frozen=True)
class Viewpoint:
    """``distance`` metres from ``focus``, towards ``azimuth`` about Z and ``elevation`` above the horizon."""

    focus: tuple[float, float, float] = (0.0, 0.0, 0.0)
    distance: float = 1.0
    azimuth: float = 0.0
    elevation: float = 0.5

    @classmethod
    def at(cls, pose: Array, distance: float) -> Viewpoint:
        """The viewpoint of a camera at ``pose`` (7,) that looks at a point ``distance`` metres ahead."""
        T = pose7_matrix(pose)
        back = T[:3, 0]
        x, y, z = T[:3, 3] - distance * back
        elevation = float(np.clip(np.arcsin(np.clip(back[2], -1, 1)), -STEEPEST, STEEPEST))
        # seen from straight above or below, image up gives where the camera stands
        flat = back[:2] if np.hypot(*back[:2]) > 1e-3 else -np.sign(back[2]) * T[:2, 2]
        return cls((x, y, z), distance, float(np.arctan2(flat[1], flat[0])), elevation)

    @property
    def pose(self) -> Array:
        """Pose (7,) of the camera frame."""
        return matrix_pose7(frame(self._axes, self.focus + self.distance * self._axes[:, 0]))

    @property
    def _axes(self) -> Array:
        ca, sa, ce, se = np.cos(self.azimuth), np.sin(self.azimuth), np.cos(self.elevation), np.sin(self.elevation)
        return np.array([[ca * ce, -sa, -ca * se], [sa * ce, ca, -sa * se], [se, 0.0, ce]])

    def orbit(self, right: float, up: float) -> Viewpoint:
        """Turn about the focus by radians, as if the scene were dragged right and up."""
        elevation = float(np.clip(self.elevation - up, -STEEPEST, STEEPEST))
        return replace(self, azimuth=self.azimuth - right, elevation=elevation)

    def pan(self, right: float, up: float) -> Viewpoint:
        """Move sideways by parts of the distance, as if the scene were dragged right and up."""
        axes = self._axes
        x, y, z = np.array(self.focus) - self.distance * (right * axes[:, 1] + up * axes[:, 2])
        return replace(self, focus=(x, y, z))

    def zoom(self, steps: float) -> Viewpoint:
        """Go nearer by 10 % a step."""
        return replace(self, distance=float(np.clip(self.distance * 0.9**steps, CLOSEST, FARTHEST)))

    def look(self, right: float, up: float) -> Viewpoint:
        """Turn where it stands by radians, as if the scene were dragged right and up."""
        elevation = float(np.clip(self.elevation + up, -STEEPEST, STEEPEST))
        # what is seen moves by less than the azimuth does, to nothing at the vertical: up to tenfold the turn there
        azimuth = self.azimuth + right / max(np.cos(self.elevation), 0.1)
        turned = replace(self, azimuth=azimuth, elevation=elevation)
        x, y, z = self.pose[:3] - self.distance * turned._axes[:, 0]
        return replace(turned, focus=(x, y, z))
