"""What follows from a camera's lens and place, as parameters below its name: intrinsics, the size of a pixel, the pose.

They are for reading; a lens is changed by the parameters of `ligature.ros.parameters`. Metres, pixels.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import rospy
from numpy.typing import NDArray

from ligature.model.frames import inverse, pose7_matrix
from ligature.model.optics import T_CAMERA_OPTICAL, Calibration

Array = NDArray[np.float64]

FACTS = "facts"
MOVED = 1e-9


def facts(calibration: Calibration, pose: Array, frame: str) -> dict[str, Any]:
    """The facts of a camera.

    Parameters
    ----------
    calibration
        Of its pictures.
    pose
        Of the camera frame in world axes (7,).
    frame
        Name of its optical frame.

    Returns
    -------
    dict
        ``K`` (9,) and ``T_camera_world`` (16,) in rows, the latter from the world to the optical frame; ``width`` and
        ``height``; ``pixel_radius``, half the edge of what a pixel in the middle shows at a distance of one metre.
    """
    T = inverse(pose7_matrix(pose) @ T_CAMERA_OPTICAL)
    return {
        "frame": frame,
        "width": calibration.width,
        "height": calibration.height,
        "K": np.asarray(calibration.K, dtype=float).reshape(-1).tolist(),
        "pixel_radius": float(0.5 / np.asarray(calibration.K).reshape(3, 3)[0, 0]),
        "T_camera_world": T.reshape(-1).tolist(),
    }


class CameraFacts:
    """Keeps the facts of cameras on the parameter server, each written when it has changed."""

    def __init__(self) -> None:
        self._written: dict[str, dict[str, Any]] = {}

    def write(self, found: Mapping[str, dict[str, Any]]) -> None:
        """Write the facts by the topics of their cameras; raises what a master that does not answer raises."""
        for topic, values in found.items():
            if _differ(values, self._written.get(topic)):
                rospy.set_param(f"{topic}/{FACTS}", values)
                self._written[topic] = values


def _differ(values: dict[str, Any], before: dict[str, Any] | None) -> bool:
    if before is None or any(values[name] != before[name] for name in ("frame", "width", "height")):
        return True
    numbers = ("K", "pixel_radius", "T_camera_world")
    one, other = (np.concatenate([np.ravel(each[name]) for name in numbers]) for each in (values, before))
    return bool(np.abs(one - other).max() > MOVED)
