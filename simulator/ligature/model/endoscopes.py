"""Stereo endoscopes of the da Vinci Research Kit as cameras: resolution, field of view, distance of the eyes.

Nominal values of the kind of scope, named as the dVRK names them; single scopes differ by some percent, so that work
on real pictures wants its own calibration (``camera intrinsics`` of the format). Metres, radians, pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ligature.model.lookup import UnknownNameError
from ligature.model.scene import Camera


@dataclass(frozen=True)
class Endoscope:
    """One kind of scope: picture size, angle across its diagonal, distance of the eyes, where the values come from."""

    resolution: tuple[int, int]
    diagonal_view: float
    eye_separation: float
    rate: float
    source: str

    @property
    def focal_length(self) -> float:
        """Focal length in pixels, which are square."""
        return math.hypot(*self.resolution) / 2 / math.tan(self.diagonal_view / 2)

    @property
    def field_of_view(self) -> float:
        """Vertical field of view, the format's ``field view angle``."""
        return 2 * math.atan(self.resolution[1] / 2 / self.focal_length)


_VIDEO = "dVRK wiki, Video Pipeline, and jhu-dvrk/dvrk-ros, dvrk_robot/video.md"
_SCOPE = "wide-angle scope of 12 mm, 60 degrees across the picture, as its maker states; eyes as calibrations of the "
_SCOPE += "Hamlyn Centre's da Vinci videos have it (Mountney et al. 2010), 5 to 5.7 mm"

ENDOSCOPES = {
    "Classic_SD": Endoscope(
        (640, 480), np.radians(60.0), 0.0054, 30.0, f"S-Video of NTSC in square pixels ({_VIDEO}); {_SCOPE}"
    ),
    "Classic_HD": Endoscope((1280, 720), np.radians(60.0), 0.0054, 60.0, f"720p over SDI ({_VIDEO}); {_SCOPE}"),
    "Si_HD": Endoscope((1920, 1080), np.radians(60.0), 0.0054, 30.0, f"1080i over SDI ({_VIDEO}); {_SCOPE}"),
}
"""By the name that `set_endoscope_type` of an ECM takes, without its `_STRAIGHT`, `_UP` or `_DOWN`."""

WORKING_DISTANCE = 0.1
"""Where the eyes' axes meet: the scopes are meant for tissue at 5 to 15 cm."""


def seen_through(camera: Camera, name: str) -> Camera:
    """``camera`` with the lens of an endoscope, at the place it has; a ``stereo`` block gets the scope's eyes.

    Raises
    ------
    UnknownNameError
        A `KeyError`, when no endoscope is called ``name``; the message lists the known ones.
    """
    scope = ENDOSCOPES.get(name)
    if scope is None:
        raise UnknownNameError(f"unknown endoscope '{name}'; choose one of {', '.join(ENDOSCOPES)}")
    return replace(
        camera,
        field_of_view=scope.field_of_view,
        resolution=scope.resolution,
        intrinsics=None,
        projection=None,
        orthographic_width=None,
        stereo=None if camera.stereo is None else (scope.eye_separation, WORKING_DISTANCE),
    )
