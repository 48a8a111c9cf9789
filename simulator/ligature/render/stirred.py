"""Which places of a shadow map moving things may throw their shadows on: what else is lit there is lit as before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import compiled

CELL = 4
"""Edge of a cell of the map of such places, in texels of the shadow map."""

MARGIN = 2.5
"""Texels around a place that a look-up there may read: three quarters to the next sample, one for its interpolation,
and what rounding adds."""

SMALL = 3
"""Cells across up to which the box of a triangle is taken for the triangle."""

LEAST_W = 1e-4
"""Least w of a point before the light; near planes are farther away."""


def stirred_cells(size: int) -> NDArray[np.uint8]:
    """An empty map of the places of a shadow map of ``size`` texels: rows upwards, as textures have them."""
    return np.zeros((size // CELL, size // CELL), dtype=np.uint8)


def stir(
    cells: NDArray[np.uint8], to_clip: NDArray[np.float64], points: NDArray[np.float64], faces: NDArray[np.int32]
) -> None:
    """Set those of ``cells`` to 255 at whose look-ups ``faces`` (m, 3) of ``points`` (n, 3) may be met.

    ``to_clip`` (3, 4) leads from the points to x, y and w of the light's clip coordinates.
    """
    _stir(cells, np.ascontiguousarray(to_clip), points, faces, MARGIN / CELL)


def cells_of(places: NDArray[np.float32], size: int) -> NDArray[np.int32]:
    """The numbers (h, w) of the cells in which ``places`` (h, w, 2) lie, x and y of 0 to 1 in a map of ``size`` texels.

    Places outside, which are lit always, have the number -1.
    """
    edge = size // CELL
    with np.errstate(invalid="ignore"):
        inside = ((places >= 0.0) & (places <= 1.0)).all(axis=-1)
    columns, rows = np.minimum(np.where(inside, np.moveaxis(places, -1, 0), 0.0) * edge, edge - 1).astype(np.int32)
    return np.where(inside, rows * edge + columns, -1).astype(np.int32)


class Readers:
    """Which pixels read each cell of a shadow map: those of cell c are ``pixels[starts[c] : starts[c + 1]]``."""

    def __init__(self, cells: NDArray[np.int32], size: int) -> None:
        numbers = cells.reshape(-1)
        order = np.argsort(numbers, kind="stable").astype(np.int32)
        outside = int((numbers < 0).sum())
        self.pixels = order[outside:]
        self.starts = np.searchsorted(numbers[self.pixels], np.arange((size // CELL) ** 2 + 1)).astype(np.int32)

    def of(self, cells: NDArray[np.uint8]) -> NDArray[np.int32]:
        """The pixels that read those of ``cells`` that are set."""
        return _readers(self.pixels, self.starts, cells.reshape(-1))


@compiled
def _readers(pixels: NDArray[np.int32], starts: NDArray[np.int32], cells: NDArray[np.uint8]) -> NDArray[np.int32]:
    count = 0
    for cell in range(len(cells)):
        if cells[cell]:
            count += starts[cell + 1] - starts[cell]
    found, at = np.empty(count, dtype=np.int32), 0
    for cell in range(len(cells)):
        if cells[cell]:
            for k in range(starts[cell], starts[cell + 1]):
                found[at] = pixels[k]
                at += 1
    return found


@compiled
def box_of(pixels: NDArray[np.int32], facets: NDArray[np.int32], drawn: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """The least x and y of ``pixels`` of a picture, how wide they lie and how high; 0 where there are none.

    Sets ``drawn`` for their ``facets`` (h, w), of which -1 is none.
    """
    height, width = facets.shape
    left, low, right, high = width, height, -1, -1
    for pixel in pixels:
        y, x = pixel // width, pixel % width
        left, right, low, high = min(left, x), max(right, x), min(low, y), max(high, y)
        if facets[y, x] >= 0:
            drawn[facets[y, x]] = True
    return left, low, max(right - left + 1, 0), max(high - low + 1, 0)


@compiled
def far_at(
    pixels: NDArray[np.int32], depths: NDArray[np.float32], box: tuple[int, int, int, int]
) -> NDArray[np.float32]:
    """``depths`` (h, w) in a ``box`` that holds ``pixels``, where these are as far as can be."""
    left, low, width, height = box
    found = depths[low : low + height, left : left + width].copy()
    for pixel in pixels:
        found[pixel // depths.shape[1] - low, pixel % depths.shape[1] - left] = 1.0
    return found


@compiled
def _stir(
    cells: NDArray[np.uint8],
    to_clip: NDArray[np.float64],
    points: NDArray[np.float64],
    faces: NDArray[np.int32],
    margin: float,
) -> None:
    half = 0.5 * len(cells)
    clip, x, y = np.empty((len(points), 3)), np.empty(len(points)), np.empty(len(points))
    for i in range(len(points)):
        for k in range(3):
            row, point = to_clip[k], points[i]
            clip[i, k] = row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3]
        w = max(clip[i, 2], LEAST_W)
        x[i], y[i] = half * (clip[i, 0] / w + 1.0), half * (clip[i, 1] / w + 1.0)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        behind = int(clip[a, 2] <= LEAST_W) + int(clip[b, 2] <= LEAST_W) + int(clip[c, 2] <= LEAST_W)
        if behind == 0:
            _stir_triangle(cells, x[a], y[a], x[b], y[b], x[c], y[c], margin)
        elif behind < 3:
            _stir_cut(cells, clip, faces[f], margin)


@compiled
def _stir_cut(cells: NDArray[np.uint8], clip: NDArray[np.float64], face: NDArray[np.int32], margin: float) -> None:
    """Set the cells of what lies before the light of a triangle that begins behind it."""
    half = 0.5 * len(cells)
    x, y, count = np.empty(4), np.empty(4), 0
    for k in range(3):
        a, b = clip[face[k]], clip[face[(k + 1) % 3]]
        if a[2] > LEAST_W:
            x[count], y[count] = half * (a[0] / a[2] + 1.0), half * (a[1] / a[2] + 1.0)
            count += 1
        if (a[2] > LEAST_W) != (b[2] > LEAST_W):
            t = (LEAST_W - a[2]) / (b[2] - a[2])
            x[count] = half * ((a[0] + t * (b[0] - a[0])) / LEAST_W + 1.0)
            y[count] = half * ((a[1] + t * (b[1] - a[1])) / LEAST_W + 1.0)
            count += 1
    for k in range(1, count - 1):
        _stir_triangle(cells, x[0], y[0], x[k], y[k], x[k + 1], y[k + 1], margin)


@compiled
def _stir_triangle(
    cells: NDArray[np.uint8], ax: float, ay: float, bx: float, by: float, cx: float, cy: float, margin: float
) -> None:
    """Set the cells that a triangle comes nearer to than ``margin``, in cells, and at its corners a few more."""
    last = float(len(cells) - 1)
    left = int(min(max(np.floor(min(ax, bx, cx) - margin), 0.0), last + 1.0))
    right = int(min(max(np.floor(max(ax, bx, cx) + margin), -1.0), last))
    low = int(min(max(np.floor(min(ay, by, cy) - margin), 0.0), last + 1.0))
    high = int(min(max(np.floor(max(ay, by, cy) + margin), -1.0), last))
    if right - left < SMALL and high - low < SMALL:
        for j in range(low, high + 1):
            for i in range(left, right + 1):
                cells[j, i] = 255
        return
    if (bx - ax) * (cy - ay) < (by - ay) * (cx - ax):
        bx, by, cx, cy = cx, cy, bx, by
    for j in range(low, high + 1):
        first, end = float(left), float(right)
        for edge in range(3):
            if edge == 0:
                px, py, along, up = ax, ay, bx - ax, by - ay
            elif edge == 1:
                px, py, along, up = bx, by, cx - bx, cy - by
            else:
                px, py, along, up = cx, cy, ax - cx, ay - cy
            # which cells of the row, with their margin, have a part on the left of the edge
            reach = along * ((j + 1.0 + margin if along > 0.0 else j - margin) - py)
            if up > 0.0:
                end = min(end, px + reach / up + margin)
            elif up < 0.0:
                first = max(first, px + reach / up - 1.0 - margin)
            elif reach < 0.0:
                end = -1.0
        for i in range(int(max(np.floor(first), left)), int(np.floor(end)) + 1):
            cells[j, i] = 255
