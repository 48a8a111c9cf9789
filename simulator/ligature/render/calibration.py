"""What calibrations of a scene's cameras would find, pairs and eyes included (`ligature.model.optics`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ligature.model.optics import EYES, NO_DISTORTION, Calibration, eye_pose, pair, single
from ligature.model.scene import Camera
from ligature.render.camera import view_of

Array = NDArray[np.float64]

Eye = tuple[int, str]
"""Index of a camera, and which of its eyes; empty for the camera itself."""


def calibrations(
    cameras: Sequence[Camera],
    poses: Array,
    partners: Mapping[int, int],
    distortion: Mapping[int, tuple[float, ...]] | None = None,
    resolution: tuple[int, int] | None = None,
) -> dict[Eye, Calibration]:
    """Calibration of every camera and eye.

    ``poses`` (n, 7) of the camera frames in world axes, ``partners`` right by left camera
    (`ligature.model.optics.stereo_partners`), ``distortion`` the plumb-bob coefficients of cameras that have any.
    """
    lenses = distortion or {}

    def alone(camera: Camera, eye: str) -> Calibration:
        view = view_of(camera, poses[camera.index], resolution, eye)
        return single(view.intrinsics, view.width, view.height, lenses.get(camera.index, NO_DISTORTION))

    found = {(c.index, eye): alone(c, eye) for c in cameras for eye in ("", *(EYES if c.stereo else ()))}
    couples = [((left, ""), (right, "")) for left, right in partners.items()]
    couples += [((c.index, "left"), (c.index, "right")) for c in cameras if c.stereo]
    for left, right in couples:
        stand = [eye_pose(cameras[index], poses[index], eye) for index, eye in (left, right)]
        found[left], found[right] = pair(found[left], found[right], *stand)
    return found
