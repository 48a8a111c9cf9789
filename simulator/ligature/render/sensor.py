"""What a lens and an image sensor do to an ideal picture: distortion, exposure, noise of colour and depth.

The same seed, camera and tick give the same noise. Pixels have whole-number centres; depth in metres.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.optics import NO_DISTORTION
from ligature.render.camera import CameraView
from ligature.render.target import Frame

Array = NDArray[np.float64]

UNDISTORT_ROUNDS = 20
WIDEST = 2.0
"""Largest factor by which a picture is drawn larger than shown, so that distorted corners are filled."""


LIMITS = {"exposure": 32.0, "noise": 10.0, "depth_noise": 1000.0}
"""Largest magnitudes that a sensor takes: beyond them there is nothing to be seen."""


@dataclass(frozen=True)
class ImageSensor:
    """A lens and a sensor.

    Parameters
    ----------
    exposure
        Stops by which the picture is brighter than drawn: 1 doubles the light.
    noise
        Standard deviation of each colour channel, as a part of full scale.
    distortion
        Plumb-bob coefficients k1, k2, p1, p2, k3 of the lens.
    depth_noise
        Standard deviation of depth in metres.
    seed
        Seed of all noise.

    Raises
    ------
    ValueError
        When a number is not finite or beyond `LIMITS`, or a standard deviation is negative; and from `view`, when the
        distortion cannot be undone over the picture.
    """

    exposure: float = 0.0
    noise: float = 0.0
    distortion: tuple[float, float, float, float, float] = NO_DISTORTION
    depth_noise: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not np.isfinite(self.distortion).all():
            raise ValueError(f"the distortion of a sensor must be finite, not {self.distortion}")
        for name, most in LIMITS.items():
            value, least = getattr(self, name), -most if name == "exposure" else 0.0
            if not least <= value <= most:
                raise ValueError(f"the {name} of a sensor lies between {least:g} and {most:g}, not at {value:g}")

    def view(self, view: CameraView) -> CameraView:
        """What has to be drawn to show ``view`` through this lens: a larger picture where the lens bends corners in."""
        if not self._bends(view):
            return view
        left, top, right, bottom = _margins(self.distortion, _key(view), view.width, view.height)
        width, height = view.width + left + right, view.height + top + bottom
        projection = view.projection.copy()
        projection[0] *= view.width / width
        projection[1] *= view.height / height
        projection[0, 2] += (right - left) / width
        projection[1, 2] += (top - bottom) / height
        return replace(view, projection=projection, width=width, height=height)

    def expose(self, frame: Frame, view: CameraView, moment: tuple[int, ...]) -> Frame:
        """The picture of ``view``, from a ``frame`` drawn of ``self.view(view)``; each ``moment`` has its own noise."""
        if self == IDEAL:
            return frame
        if self._bends(view):
            frame = self._distorted(frame, view)
        rgb, depth = frame.rgb, frame.depth  # either is empty when it was not asked for
        random = np.random.default_rng((self.seed, *moment))
        if self.exposure:
            rgb = _brightness(self.exposure)[rgb]
        if self.noise:
            grain = random.standard_normal(rgb.shape, dtype=np.float32)
            rgb = np.clip(rgb + np.float32(255.0 * self.noise) * grain + 0.5, 0, 255).astype(np.uint8)
        if self.depth_noise:
            depth = depth + np.float32(self.depth_noise) * random.standard_normal(depth.shape, dtype=np.float32)
        return replace(frame, rgb=rgb, depth=depth)

    def _bends(self, view: CameraView) -> bool:
        return any(self.distortion) and not view.orthographic

    def _distorted(self, frame: Frame, view: CameraView) -> Frame:
        """Colour between pixels is mixed; everything else is that of the nearest pixel."""
        left, top, right, bottom = _margins(self.distortion, _key(view), view.width, view.height)
        u, v = _sources(self.distortion, _key(view), view.width, view.height)
        u = np.clip(u + left, 0, view.width + left + right - 1.001)
        v = np.clip(v + top, 0, view.height + top + bottom - 1.001)
        nearest = np.rint(v).astype(np.int32), np.rint(u).astype(np.int32)
        bent: dict[str, Any] = {}
        for field in fields(frame):
            values = getattr(frame, field.name)
            if values.size:
                bent[field.name] = _between(values, u, v) if field.name == "rgb" else values[nearest]
        return replace(frame, **bent)


IDEAL = ImageSensor()
"""A pinhole camera without faults."""


def distort(points: Array, distortion: tuple[float, ...]) -> Array:
    """Where the lens shows ideal ``points`` (..., 2) of the plane z = 1 (OpenCV's plumb-bob model)."""
    k1, k2, p1, p2, k3 = distortion
    x, y = points[..., 0], points[..., 1]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=-1,
    )


def undistort(points: Array, distortion: tuple[float, ...]) -> Array:
    """The ideal points (..., 2) that the lens shows at ``points``, by fixed-point iteration."""
    ideal = points.copy()
    for _ in range(UNDISTORT_ROUNDS):
        ideal += points - distort(ideal, distortion)
    return ideal


def _between(rgb: NDArray[np.uint8], u: Array, v: Array) -> NDArray[np.uint8]:
    """Colours at columns ``u`` and rows ``v``, mixed from the four pixels around (bilinear)."""
    x, y = u.astype(np.int32), v.astype(np.int32)
    fx, fy = (u - x)[..., None], (v - y)[..., None]
    upper = rgb[y, x] * (1 - fx) + rgb[y, x + 1] * fx
    lower = rgb[y + 1, x] * (1 - fx) + rgb[y + 1, x + 1] * fx
    mixed: NDArray[np.uint8] = (upper * (1 - fy) + lower * fy + 0.5).astype(np.uint8)
    return mixed


def _key(view: CameraView) -> tuple[float, ...]:
    return tuple(view.intrinsics.ravel().tolist())


@lru_cache(maxsize=16)
def _sources(distortion: tuple[float, ...], key: tuple[float, ...], width: int, height: int) -> tuple[Array, Array]:
    """Column and row (h, w) of the ideal picture that each pixel shows."""
    K = np.array(key).reshape(3, 3)
    u, v = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(K).T
    with np.errstate(over="ignore", invalid="ignore"):
        ideal = undistort(rays[..., :2], distortion)
    if not np.isfinite(ideal).all():
        raise ValueError(
            f"a lens with the distortion {distortion} cannot be inverted over the whole picture; "
            "give smaller coefficients"
        )
    pixels = np.concatenate([ideal, np.ones_like(u)[..., None]], axis=-1) @ K.T
    return pixels[..., 0], pixels[..., 1]


@lru_cache(maxsize=16)
def _margins(
    distortion: tuple[float, ...], key: tuple[float, ...], width: int, height: int
) -> tuple[int, int, int, int]:
    """Pixels that the ideal picture needs beyond the left, top, right and bottom edge."""
    u, v = _sources(distortion, key, width, height)
    most_wide, most_high = int((WIDEST - 1) / 2 * width), int((WIDEST - 1) / 2 * height)

    def needed(pixels: float, most: int) -> int:
        return min(max(int(np.ceil(pixels)) + 1, 0), most)

    return (
        needed(-u.min(), most_wide),
        needed(-v.min(), most_high),
        needed(u.max() - (width - 1), most_wide),
        needed(v.max() - (height - 1), most_high),
    )


@lru_cache(maxsize=16)
def _brightness(stops: float) -> NDArray[np.uint8]:
    """Table (256,) of sRGB levels after the light changed by ``stops`` (IEC 61966-2-1)."""
    level = np.arange(256) / 255.0
    linear = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)
    linear = np.clip(linear * 2.0**stops, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.rint(255.0 * encoded).astype(np.uint8)
