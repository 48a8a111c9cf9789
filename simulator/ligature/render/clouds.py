"""Draws clouds of points into a picture: squares of some pixels that hide what is behind them, and nothing before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ligature.model.clouds import LARGEST, Cloud
from ligature.render.camera import CameraView
from ligature.render.target import Frame

Array = NDArray[np.float64]


def with_clouds(frame: Frame, clouds: Sequence[Cloud], view: CameraView) -> Frame:
    """``frame``, which has depth, with ``clouds``; their pixels have the id 0 and no normal."""
    depth = frame.depth.copy()
    layers = {name: getattr(frame, name).copy() for name in ("rgb", "ids", "normals") if getattr(frame, name).size}
    for cloud in clouds:
        _draw(cloud, view, depth, layers)
    return replace(frame, depth=depth, **layers)


def _draw(cloud: Cloud, view: CameraView, depth: NDArray[np.float32], layers: dict[str, NDArray]) -> None:  # type: ignore[type-arg]
    points = np.column_stack([cloud.points, np.ones(len(cloud.points))])
    eye = points @ view.view.T
    clip, away = eye @ view.projection.T, -eye[:, 2]
    seen = (away > view.near) & (away < view.far)
    ndc = clip[seen, :2] / clip[seen, 3:]
    size = min(max(cloud.size, 1), LARGEST)
    corner = np.floor((ndc * (0.5, -0.5) + 0.5) * (view.width, view.height) - 0.5 * (size - 1)).astype(np.int64)
    near, colours = away[seen].astype(np.float32), cloud.colours[seen]
    for row in range(size):
        for column in range(size):
            x, y = corner[:, 0] + column, corner[:, 1] + row
            inside = (x >= 0) & (x < view.width) & (y >= 0) & (y < view.height)
            _write(y[inside] * view.width + x[inside], near[inside], colours[inside], depth, layers)


def _write(
    pixels: NDArray[np.int64],
    near: NDArray[np.float32],
    colours: NDArray[np.uint8],
    depth: NDArray[np.float32],
    layers: dict[str, NDArray],  # type: ignore[type-arg]
) -> None:
    """Write points at flat indices of ``pixels`` where nothing is nearer, neither the scene nor another point."""
    flat = depth.reshape(-1)
    before = flat[pixels]
    np.minimum.at(flat, pixels, near)
    won = (near < before) & (near == flat[pixels])
    for name, layer in layers.items():
        values = layer.reshape(-1, *layer.shape[2:])
        values[pixels[won]] = colours[won] if name == "rgb" else 0
