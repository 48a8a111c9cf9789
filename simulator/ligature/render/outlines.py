"""Smooths the steps of edges in a finished picture, for renderers to which several samples a pixel are dear.

Morphological anti-aliasing (Reshetov 2009; Jimenez et al., SMAA, 2012, without diagonals): along a run of pixels of
which each differs from its neighbour across the run, the edge is taken for the straight line that the crossing edges
at the run's two ends suggest, and each pixel mixed with its neighbour by the area that the line cuts off.
"""

from __future__ import annotations

from typing import Any

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
    rgb = np.empty((*rgba.shape[:2], 3), dtype=np.uint8)
    _smooth(rgba, rgba.view("<u4")[..., 0], rgb, KEY_STEP if keyed else 0)
    return rgb


@released
def _smooth(rgba: NDArray[np.uint8], pixels: NDArray[np.uint32], rgb: NDArray[np.uint8], step: int) -> None:
    """Fill ``rgb`` (h, w, 3) with the smooth picture of ``rgba`` (h, w, 4), whose keys jump by ``step`` at edges.

    ``pixels`` (h, w) are the same with the four bytes of a pixel as one number, its key in the highest.
    """
    height, width = pixels.shape
    below, right = np.zeros((height, width), dtype=np.uint8), np.zeros((height, width), dtype=np.uint8)
    lies, stands = np.empty(height * width, dtype=np.int32), np.empty(height * width, dtype=np.int32)
    lie = stand = 0
    padded = 8 * ((width + 7) // 8)
    downwards, rightwards = np.zeros(padded, dtype=np.bool_), np.zeros(padded, dtype=np.bool_)
    eights = downwards.view(np.uint64), rightwards.view(np.uint64)
    for y in range(height):
        down = min(y + 1, height - 1)
        _find_jumps(pixels[y], pixels[down], step, downwards)
        _find_jumps(pixels[y, :-1], pixels[y, 1:], step, rightwards)
        for k in range(len(eights[0])):
            if eights[0][k] == 0 and eights[1][k] == 0:
                continue
            for x in range(8 * k, min(8 * k + 8, width)):
                if downwards[x]:
                    below[y, x] = _contrast(pixels[y, x], pixels[down, x])
                    lies[lie] = y * width + x
                    lie += below[y, x] > 0
                if rightwards[x]:
                    right[y, x] = _contrast(pixels[y, x], pixels[y, x + 1])
                    stands[stand] = y * width + x
                    stand += right[y, x] > 0
    lying, standing = np.zeros((height, width), dtype=np.bool_), np.zeros((height, width), dtype=np.bool_)
    lies = _strong(below, right, lies[:lie], lying, False)
    stands = _strong(right, below, stands[:stand], standing, True)
    _drop_keys(pixels.reshape(-1), rgb.reshape(-1))
    _mix(rgba, rgb, lying, standing, lies, False)
    _mix(rgba, rgb, standing, lying, _by_columns(stands, width), True)


@compiled
def _find_jumps(a: NDArray[np.uint32], b: NDArray[np.uint32], step: int, jumps: NDArray[np.bool_]) -> None:
    """Write where the keys of two rows of pixels are ``step`` or more apart, counted around; for 0, everywhere."""
    past, span = np.uint32(step - 1), np.uint32(2 * step - 2)
    if step == 0:
        jumps[: len(a)] = True
        return
    for x in range(len(a)):
        jumps[x] = (((a[x] >> np.uint32(24)) - (b[x] >> np.uint32(24)) + past) & np.uint32(255)) > span


@compiled
def _drop_keys(pixels: NDArray[np.uint32], rgb: NDArray[np.uint8]) -> None:
    """Fill ``rgb`` (3 n) with the lower three bytes of ``pixels`` (n): three numbers of four bytes for four of them."""
    whole = len(pixels) // 4
    numbers = rgb[: 12 * whole].view(np.uint32)
    for i in range(whole):
        a, b, c, d = pixels[4 * i], pixels[4 * i + 1], pixels[4 * i + 2], pixels[4 * i + 3]
        numbers[3 * i] = (a & np.uint32(0xFFFFFF)) | (b << np.uint32(24))
        numbers[3 * i + 1] = ((b >> np.uint32(8)) & np.uint32(0xFFFF)) | (c << np.uint32(16))
        numbers[3 * i + 2] = ((c >> np.uint32(16)) & np.uint32(0xFF)) | (d << np.uint32(8))
    for i in range(4 * whole, len(pixels)):
        for k in range(3):
            rgb[3 * i + k] = (pixels[i] >> np.uint32(8 * k)) & np.uint32(0xFF)


@compiled
def _contrast(a: np.uint32, b: np.uint32) -> np.int32:
    """The largest difference of a channel of two pixels; 0 where that is no edge."""
    most = np.int32(0)
    for shift in (0, 8, 16):
        most = max(most, abs(np.int32((a >> shift) & 255) - np.int32((b >> shift) & 255)))
    return most if most >= CONTRAST else np.int32(0)


@compiled
def _strong(
    along: NDArray[np.uint8],
    across: NDArray[np.uint8],
    places: NDArray[np.int32],
    edges: NDArray[np.bool_],
    turned: bool,
) -> NDArray[np.int32]:
    """Set ``edges`` where one is not far weaker than others, of which it returns the ``places``.

    ``along`` and ``across`` are the contrasts of edges that lie and stand, or ``turned``, that stand and lie.
    """
    width, kept = along.shape[1], 0
    rows = along.shape[1] if turned else along.shape[0]
    found = np.empty_like(places)
    for place in places:
        y, x = (place % width, place // width) if turned else (place // width, place % width)
        up, down, left = max(y - 1, 0), min(y + 1, rows - 1), max(x - 1, 0)
        most = max(_at(along, up, x, turned), _at(along, down, x, turned))
        most = max(most, _at(across, y, left, turned), _at(across, y, x, turned))
        most = max(most, _at(across, down, left, turned), _at(across, down, x, turned))
        if _at(along, y, x, turned) >= DOMINANCE * most:
            edges[place // width, place % width] = True
            found[kept] = place
            kept += 1
    return found[:kept]


@compiled
def _at(array: NDArray[Any], y: int, x: int, turned: bool) -> Any:
    """An element of an array, or of the ``turned`` one, whose rows are its columns."""
    return array[x, y] if turned else array[y, x]


@compiled
def _by_columns(places: NDArray[np.int32], width: int) -> NDArray[np.int32]:
    """``places`` that go row by row, column by column."""
    starts = np.zeros(width + 1, dtype=np.int64)
    for place in places:
        starts[place % width + 1] += 1
    starts = np.cumsum(starts)
    found = np.empty_like(places)
    for place in places:
        found[starts[place % width]] = place
        starts[place % width] += 1
    return found


@compiled
def _mix(
    rgba: NDArray[np.uint8],
    rgb: NDArray[np.uint8],
    lying: NDArray[np.bool_],
    standing: NDArray[np.bool_],
    places: NDArray[np.int32],
    turned: bool,
) -> None:
    """Mix along all ``lying`` edges, at ``places`` row by row; of ``turned`` edges rows are the picture's columns."""
    width, row, end_of_run = lying.shape[1], -1, -1
    columns = lying.shape[0] if turned else width
    for place in places:
        y, x = (place % width, place // width) if turned else (place // width, place % width)
        if y == row and x <= end_of_run:
            continue
        first = x
        while (
            x + 1 < columns
            and _at(lying, y, x + 1, turned)
            and not _at(standing, y, x, turned)
            and not _at(standing, y + 1, x, turned)
        ):
            x += 1
        last, length = x, x - first + 1
        row, end_of_run = y, last
        start = end = 0.0  # how high above the run, in pixels, the line begins and ends
        if first > 0:
            start = 0.5 * (int(_at(standing, y, first - 1, turned)) - int(_at(standing, y + 1, first - 1, turned)))
        if last < columns - 1:
            end = 0.5 * (int(_at(standing, y, last, turned)) - int(_at(standing, y + 1, last, turned)))
        if length == 1 and start * end < 0.0 and _is_rise(standing, y, last, start > 0.0, turned):
            continue
        if start != 0.0 or end != 0.0:
            reach = 0.5 * length if start * end < 0.0 else min(0.5 * length, BEND)
            for i in range(int(np.ceil(reach))):
                share = _area(i, reach)
                _blend(rgba, rgb, y, first + i, start * share, turned)
                _blend(rgba, rgb, y, last - i, end * share, turned)


@compiled
def _is_rise(standing: NDArray[np.bool_], y: int, x: int, falls: bool, turned: bool) -> bool:
    """Whether a run of one pixel only joins two longer runs across it, which state better how the line goes."""
    height = standing.shape[1] if turned else standing.shape[0]
    above, below = (x - 1, x) if falls else (x, x - 1)
    return y > 0 and _at(standing, y - 1, above, turned) and y + 2 < height and _at(standing, y + 2, below, turned)


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
