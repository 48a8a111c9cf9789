"""Smooths the steps of edges in a finished picture, for renderers to which several samples a pixel are dear.

Morphological anti-aliasing (Reshetov 2009; Jimenez et al., SMAA, 2012, without diagonals): along a run of pixels of
which each differs from its neighbour across the run, the edge is taken for the straight line that the crossing edges
at the run's two ends suggest, and each pixel mixed with its neighbour by the area that the line cuts off.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import compiled, released

CONTRAST = 20
"""Smallest difference in any channel, of 255, that is an edge."""

DOMINANCE = 0.5
"""Part of the strongest difference beside it that an edge has to reach."""

KEY_STEP = 6
"""Smallest difference of keys, of 256 around, between two surfaces or two sides of a crease."""

BEND = 8.0
"""How far in pixels a corner at one end of a run is felt; a line from one side to the other has any length."""


def smoothed(rgba: NDArray[np.uint8], keyed: bool = True) -> NDArray[np.uint8]:
    """Colours (h, w, 3) of ``rgba`` (h, w, 4) with smooth edges.

    Where ``keyed``, alpha is a number of the surface seen and its direction, counted around from 0 to 255, and
    edges are only where it jumps: outlines and creases, but not what is painted on a surface.
    """
    rgba = np.ascontiguousarray(rgba)
    keys, step = np.ascontiguousarray(rgba[..., 3]), KEY_STEP if keyed else 0
    lies = np.flatnonzero(_jumps(keys[:-1], keys[1:], step))
    stands = np.flatnonzero(_jumps(keys[:, :-1], keys[:, 1:], step))
    rgb = np.empty((*keys.shape, 3), dtype=np.uint8)
    _smooth(rgba, rgb, lies, stands)
    return rgb


def _jumps(a: NDArray[np.uint8], b: NDArray[np.uint8], step: int) -> NDArray[np.bool_]:
    """Where two keys are at least ``step`` apart, counted around: bytes wrap as keys do."""
    return (a - b + np.uint8(step - 1)) > 2 * step - 2 if step else np.ones(a.shape, dtype=np.bool_)


@released
def _smooth(
    rgba: NDArray[np.uint8], rgb: NDArray[np.uint8], lies: NDArray[np.int64], stands: NDArray[np.int64]
) -> None:
    """Fill ``rgb`` (h, w, 3) with the smooth picture of ``rgba`` (h, w, 4).

    Edges may be between the pixels and those below of which the numbers are in ``lies``, and those right of ``stands``.
    """
    height, width = rgba.shape[:2]
    below, right = np.zeros((height, width), dtype=np.uint8), np.zeros((height, width), dtype=np.uint8)
    _differ(rgba, below, lies, 1, 0)
    _differ(rgba, right, stands, 0, 1)
    lying, standing = _edges(below, right)
    for y in range(height):
        for x in range(width):
            rgb[y, x, 0], rgb[y, x, 1], rgb[y, x, 2] = rgba[y, x, 0], rgba[y, x, 1], rgba[y, x, 2]
    _mix(rgba, rgb, lying, standing, False)
    _mix(rgba, rgb, np.ascontiguousarray(standing.T), np.ascontiguousarray(lying.T), True)


@compiled
def _differ(rgba: NDArray[np.uint8], out: NDArray[np.uint8], places: NDArray[np.int64], down: int, along: int) -> None:
    """Write the largest difference of a channel to the pixel ``down`` and ``along``; ``places`` count such pairs."""
    width = out.shape[1] - along
    for place in places:
        y, x = place // width, place % width
        most = np.int32(0)
        for c in range(3):
            most = max(most, abs(np.int32(rgba[y, x, c]) - np.int32(rgba[y + down, x + along, c])))
        out[y, x] = most


@compiled
def _edges(below: NDArray[np.uint8], right: NDArray[np.uint8]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Where an edge lies below a pixel, and where one stands on its right: strong, and not far weaker than others."""
    height, width = below.shape
    lying, standing = np.zeros((height, width), dtype=np.bool_), np.zeros((height, width), dtype=np.bool_)
    for y in range(height):
        up, down = max(y - 1, 0), min(y + 1, height - 1)
        for x in range(width):
            if below[y, x] < CONTRAST and right[y, x] < CONTRAST:
                continue
            left, far = max(x - 1, 0), min(x + 1, width - 1)
            if below[y, x] >= CONTRAST:
                most = max(below[up, x], below[down, x], right[y, left], right[y, x], right[down, left], right[down, x])
                lying[y, x] = below[y, x] >= DOMINANCE * most
            if right[y, x] >= CONTRAST:
                most = max(right[y, left], right[y, far], below[up, x], below[y, x], below[up, far], below[y, far])
                standing[y, x] = right[y, x] >= DOMINANCE * most
    return lying, standing


@compiled
def _mix(
    rgba: NDArray[np.uint8], rgb: NDArray[np.uint8], lying: NDArray[np.bool_], standing: NDArray[np.bool_], turned: bool
) -> None:
    """Mix along all ``lying`` edges; of ``turned`` edges rows are the picture's columns."""
    height, width = lying.shape
    for y in range(height - 1):
        x = 0
        while x < width:
            if not lying[y, x]:
                x += 1
                continue
            first = x
            while x + 1 < width and lying[y, x + 1] and not standing[y, x] and not standing[y + 1, x]:
                x += 1
            last, length = x, x - first + 1
            x += 1
            start = end = 0.0  # how high above the run, in pixels, the line begins and ends
            if first > 0:
                start = 0.5 * (int(standing[y, first - 1]) - int(standing[y + 1, first - 1]))
            if last < width - 1:
                end = 0.5 * (int(standing[y, last]) - int(standing[y + 1, last]))
            if length == 1 and start * end < 0.0 and _is_rise(standing, y, last, start > 0.0):
                continue
            if start != 0.0 or end != 0.0:
                reach = 0.5 * length if start * end < 0.0 else min(0.5 * length, BEND)
                for i in range(int(np.ceil(reach))):
                    share = _area(i, reach)
                    _blend(rgba, rgb, y, first + i, start * share, turned)
                    _blend(rgba, rgb, y, last - i, end * share, turned)


@compiled
def _is_rise(standing: NDArray[np.bool_], y: int, x: int, falls: bool) -> bool:
    """Whether a run of one pixel only joins two longer runs across it, which state better how the line goes."""
    height = len(standing)
    above, below = (x - 1, x) if falls else (x, x - 1)
    return y > 0 and standing[y - 1, above] and y + 2 < height and standing[y + 2, below]


@compiled
def _area(i: int, reach: float) -> float:
    """Area of pixel ``i`` below a line that falls from 1 at the start to 0 at ``reach`` pixels."""
    u, v = float(i), min(i + 1.0, reach)
    return (v - u) * (1.0 - 0.5 * (v + u) / reach)


@compiled
def _blend(rgba: NDArray[np.uint8], rgb: NDArray[np.uint8], y: int, x: int, area: float, turned: bool) -> None:
    """Give the pixel above the edge a share of the one below; the other way round where ``area`` is negative."""
    if area == 0.0:
        return
    to, source = (y, y + 1) if area > 0.0 else (y + 1, y)
    share = abs(area)
    for c in range(3):
        if turned:
            rgb[x, to, c] = np.uint8(rgb[x, to, c] + share * (float(rgba[x, source, c]) - rgb[x, to, c]) + 0.5)
        else:
            rgb[to, x, c] = np.uint8(rgb[to, x, c] + share * (float(rgba[source, x, c]) - rgb[to, x, c]) + 0.5)
