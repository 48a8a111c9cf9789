"""What a device's numbers mean: its axes before the operator, how its handle is held, what its grip opens.

The view frame is that of the picture: x to the operator's right, y down, z into the picture. Metres, radians.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import matrix_rpy, pose7_matrix, rpy_matrix
from ligature.teleop.pairing import Hand

Array = NDArray[np.float64]

AXES = {
    "right": (1.0, 0.0, 0.0), "left": (-1.0, 0.0, 0.0), "down": (0.0, 1.0, 0.0), "up": (0.0, -1.0, 0.0),
    "away": (0.0, 0.0, 1.0), "near": (0.0, 0.0, -1.0),
}  # fmt: skip
"""Directions in the view by the words of an operator."""

SHORTEST = 0.03
"""Metres that a motion must span to report a direction."""

SQUARE = np.deg2rad(25.0)
"""How far from a right angle two motions of a hand may be."""

BROKEN = np.full((4, 4), np.nan)


class Unclear(ValueError):
    """Motions that do not show the axes; the message describes the right motion."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """``axes`` (3, 3) turn the device's axes into the view's, ``handle`` (3, 3) is the hand's frame in the device's.

    ``closed`` and ``opened`` are the device's readings of a closed and of an open grip.
    """

    axes: Array = field(default_factory=lambda: np.eye(3))
    handle: Array = field(default_factory=lambda: np.eye(3))
    closed: float = 0.0
    opened: float = 1.0

    def hand(self, time: float, pose: Array, grip: float | None) -> Hand:
        """The hand in the view for a device's ``pose`` (7,); one that is no pose becomes NaN."""
        T = pose_of(pose)
        T_view = np.eye(4)
        T_view[:3, :3] = self.axes @ T[:3, :3] @ self.handle
        T_view[:3, 3] = self.axes @ T[:3, 3]
        return Hand(time, T_view, None if grip is None else (grip - self.closed) / (self.opened - self.closed))

    def orientation_on_device(self, R_view_hand: Array) -> Array:
        """The device's orientation (3, 3) with which the hand has ``R_view_hand``."""
        return np.asarray(self.axes.T @ R_view_hand @ self.handle.T)

    def force_on_device(self, force: Array) -> Array:
        """A force (3,) of the view in the device's axes."""
        return np.asarray(self.axes.T @ force)

    def text(self) -> str:
        """The YAML block of this calibration."""
        axes, handle = (", ".join(f"{angle:.6g}" for angle in matrix_rpy(R)) for R in (self.axes, self.handle))
        return f"axes: [{axes}]\nhandle: [{handle}]\ngrip: [{self.closed:.6g}, {self.opened:.6g}]\n"


def pose_of(values: Array) -> Array:
    """The matrix (4, 4) of a pose (7,); NaN when it is none."""
    length = float(np.linalg.norm(values[3:])) if np.isfinite(values).all() else 0.0
    if not 0.5 < length < 2.0:
        return BROKEN
    return pose7_matrix(np.concatenate([values[:3], values[3:] / length]))


def axes_of_words(x: str, y: str, z: str) -> Array:
    """Axes (3, 3) of a device whose x, y and z point to where the words of `AXES` state.

    Raises `Unclear` for other words, and for axes that form no right-handed frame.
    """
    unknown = [word for word in (x, y, z) if word not in AXES]
    if unknown:
        raise Unclear(f"an axis points {', '.join(AXES)}, not '{unknown[0]}'")
    R = np.array([AXES[x], AXES[y], AXES[z]]).T
    if abs(np.linalg.det(R) - 1.0) > 1e-9:
        raise Unclear(f"axes {x}, {y}, {z} do not form a right-handed frame")
    return R


def axes_of_angles(rpy: Sequence[float]) -> Array:
    """Axes (3, 3) from roll, pitch and yaw in radians."""
    return rpy_matrix(*rpy)


def axes_of_motions(right: Array, up: Array) -> Array:
    """Axes (3, 3) from the way (3,) of the device while the hand went to the right, and then up.

    Raises
    ------
    Unclear
        When a motion was too short, or both were not at right angles.
    """
    for way, word in ((right, "right"), (up, "up")):
        if not np.linalg.norm(way) >= SHORTEST:
            raise Unclear(
                f"the hand moved {1000 * np.linalg.norm(way):.0f} mm to the {word};"
                f" move at least {1000 * SHORTEST:.0f} mm"
            )
    x, y = right / np.linalg.norm(right), -up / np.linalg.norm(up)
    off = abs(math.asin(np.clip(x @ y, -1.0, 1.0)))
    if off > SQUARE:
        raise Unclear(f"right and up were {np.rad2deg(np.pi / 2 - off):.0f}° apart; they must be about 90°")
    U, _, Vt = np.linalg.svd(np.array([x, y, np.cross(x, y)]))
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)
