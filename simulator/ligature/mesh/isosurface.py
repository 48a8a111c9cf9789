"""The surface of a field on a lattice where it passes a level, by surface nets.

Each cell of the lattice that the surface passes has one vertex, in the middle of where it cuts the cell's edges, and
each edge that it cuts one quadrilateral (Gibson, Constrained elastic surface nets, MICCAI 1998). The surface is closed:
all around the field is outside.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Faces = NDArray[np.int32]

MARGIN = 2
"""Samples around a part of a field on which its faces and their normals depend."""

_CORNERS = np.array(list(product((0, 1), repeat=3)))


def isosurface(field: NDArray[np.number], level: float) -> tuple[Array, Faces]:
    """Vertices (v, 3), in indices of the ``field`` (nx, ny, nz), and faces (t, 3), outwards from where it is ``level``.

    Raises ValueError for a level that is not above 0, the value around the field.
    """
    _check(level)
    cells, shares, faces, _ = _net(np.pad(field, 1), level)
    return (cells - 1) + shares, faces


def part_of_isosurface(
    field: NDArray[np.number], level: float, low: Sequence[int], high: Sequence[int]
) -> tuple[Array, Array, Faces]:
    """The faces of `isosurface` around edges that begin between ``low`` and ``high`` (3,), and nothing else.

    Edges begin at samples from -1, outside the field, to the last one; ``high`` does not belong to them. Parts that
    divide these places among them have all faces once, and where they meet the same vertices to the bit.

    Returns
    -------
    vertices, normals, faces
        (v, 3) in indices of the field; (v, 3) unit vectors, means over all faces around a vertex, those of
        neighbouring parts included; (t, 3).
    """
    _check(level)
    begin = np.array(low) - MARGIN
    window = np.zeros(np.array(high) + MARGIN - begin, dtype=field.dtype)
    start, end = np.maximum(begin, 0), np.minimum(np.array(high) + MARGIN, field.shape)
    nothing = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32)
    if not (start < end).all():
        return nothing
    inner = tuple(slice(a, b) for a, b in zip(start - begin, end - begin, strict=True))
    window[inner] = field[tuple(slice(a, b) for a, b in zip(start, end, strict=True))]
    cells, shares, faces, place = _net(window, level)
    own = ((place >= MARGIN) & (place < np.array(window.shape) - MARGIN)).all(axis=1)
    if not own.any():
        return nothing
    vertices = (cells + begin) + shares
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a)
    sums: Array = np.stack(
        [np.bincount(faces.ravel(), np.repeat(areas[:, k], 3), len(vertices)) for k in range(3)], axis=1
    )
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    normals: Array = np.divide(sums, length, out=np.zeros_like(sums), where=length > 0.0)
    used, numbers = np.unique(faces[own], return_inverse=True)
    return vertices[used], normals[used], numbers.reshape(-1, 3).astype(np.int32)


def _check(level: float) -> None:
    if not level > 0.0:
        raise ValueError(f"the level of the surface is {level:g}; it must be above 0, the value around the field")


def _net(f: NDArray[np.number], level: float) -> tuple[NDArray[np.int64], Array, Faces, NDArray[np.int64]]:
    """Cells with a vertex and where it is in each, (v, 3) twice; faces (t, 3) and the samples (t, 3) of their edges.

    Edges on the boundary of the lattice ``f``, to which a cell is missing, have no face.
    """
    inside = f >= level
    corners = sum(_shifted(inside, corner).astype(np.int8) for corner in _CORNERS)
    cells = np.argwhere((corners > 0) & (corners < 8))
    number = np.full(np.array(f.shape) - 1, -1, dtype=np.int32)
    number[tuple(cells.T)] = np.arange(len(cells), dtype=np.int32)
    faces, places = zip(*(_quads(inside, number, axis) for axis in range(3)), strict=True)
    return cells, _shares(f, level, cells), np.vstack(faces), np.vstack(places)


def _shifted(values: NDArray[np.bool_], corner: NDArray[np.int64]) -> NDArray[np.bool_]:
    """The values at one corner of all cells."""
    view: NDArray[np.bool_] = values[tuple(slice(c, n - 1 + c) for c, n in zip(corner, values.shape, strict=True))]
    return view


def _shares(f: NDArray[np.number], level: float, cells: NDArray[np.int64]) -> Array:
    """The mean of the points at which the edges of each cell are cut, from 0 to 1 in the cell."""
    total, count = np.zeros((len(cells), 3)), np.zeros(len(cells))
    for axis in range(3):
        for corner in _CORNERS[_CORNERS[:, axis] == 0]:
            begin = cells + corner
            end = begin + np.eye(3, dtype=np.int64)[axis]
            a, b = f[tuple(begin.T)].astype(float), f[tuple(end.T)].astype(float)
            cut = (a >= level) != (b >= level)
            total[cut] += corner
            total[cut, axis] += (level - a[cut]) / (b[cut] - a[cut])
            count[cut] += 1.0
    found: Array = total / np.maximum(count, 1.0)[:, None]
    return found


def _quads(inside: NDArray[np.bool_], number: Faces, axis: int) -> tuple[Faces, NDArray[np.int64]]:
    """Two triangles around each edge along ``axis`` that is cut, and where these edges begin."""
    others = [k for k in range(3) if k != axis]
    within = [slice(None)] * 3
    for k in others:
        within[k] = slice(1, -1)
    low, high = inside[tuple(within)], inside[tuple(within)]
    below, above = [slice(None)] * 3, [slice(None)] * 3
    below[axis], above[axis] = slice(None, -1), slice(1, None)
    low, high = low[tuple(below)], high[tuple(above)]
    place = np.argwhere(low != high)
    outwards = low[tuple(place.T)]
    place[:, others] += 1
    i, j = np.eye(3, dtype=np.int64)[(axis + 1) % 3], np.eye(3, dtype=np.int64)[(axis + 2) % 3]
    a, b, c, d = (number[tuple((place - back).T)] for back in (0 * i, i, i + j, j))
    b, d = np.where(outwards, b, d), np.where(outwards, d, b)
    return np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]), np.vstack([place, place])
