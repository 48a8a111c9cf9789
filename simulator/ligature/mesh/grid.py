"""Structured grids of hexahedra: cells on a lattice, with cuts, holes, layers and matching lips; metres.

SciPy is imported where it is used: Blender, which lacks it, can import this module.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

FACES: Integers = np.array([[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]])
"""Corners of the faces -x, +x, -y, +y, -z, +z of a cell, counter-clockwise seen from outside, (6, 4)."""


@dataclass(frozen=True, eq=False)
class Cut:
    """A slit along lattice faces: the faces between the cells ``index - 1`` and ``index`` of ``axis``.

    ``mask`` states which of them are cut, over the cells of the two other axes in their order.
    """

    axis: int
    index: int
    mask: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Grid:
    """Hexahedra on a lattice whose lines may be unevenly spaced.

    Parameters
    ----------
    axes
        Coordinates of the lattice planes of x, y and z, m.
    nodes
        Positions at rest, (n, 3) m.
    site
        Lattice indices of the nodes, (n, 3); both lips of a cut share them.
    cells
        Nodes of the cells, (m, 8); bits 0, 1, 2 of a corner's number count along x, y, z.
    cell_site
        Lattice indices of the cells, (m, 3).
    layer
        Which material fills a cell, (m,).
    faces
        Nodes of the faces on the surface, counter-clockwise from outside, (q, 4).
    face_cell
        Cells behind those faces, (q,).
    lips
        Pairs of nodes that face each other across a cut or a gap, (p, 2), and the axis across, (p,): the second
        node lies on the side of larger coordinates.
    """

    axes: tuple[Array, Array, Array]
    nodes: Array
    site: Integers
    cells: Integers
    cell_site: Integers
    layer: Integers
    faces: Integers
    face_cell: Integers
    lips: Integers
    lip_axis: Integers

    def pieces(self) -> Integers:
        """Number of the connected piece that each node belongs to, from 0 on, (n,)."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        row, column = np.repeat(self.cells[:, :1], 7, axis=1).reshape(-1), self.cells[:, 1:].reshape(-1)
        n = len(self.nodes)
        graph = coo_matrix((np.ones(len(row)), (row, column)), shape=(n, n))
        return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)

    @property
    def sizes(self) -> Array:
        """Edges of the cells at rest, (m, 3) m."""
        return self.nodes[self.cells[:, 7]] - self.nodes[self.cells[:, 0]]


def build_grid(
    axes: Sequence[Array],
    filled: NDArray[np.bool_] | None = None,
    layer: Integers | None = None,
    cuts: Sequence[Cut] = (),
    closing: Sequence[int] = (0, 1),
) -> Grid:
    """Make a grid of the filled cells of a lattice.

    Cells share a node when a way of uncut common faces leads from one to the other around it. So cuts double
    their inner nodes and leave those at their ends whole, and cells that only meet at an edge stay apart.

    Parameters
    ----------
    axes
        Increasing coordinates of the lattice planes of x, y, z, m.
    filled
        Cells that are tissue, (nx, ny, nz); all when None.
    layer
        Material index of the cells, (nx, ny, nz); all 0 when None.
    cuts
        Slits.
    closing
        Axes across which walls that face each other over a gap of missing cells become lips.

    Raises
    ------
    ValueError
        When the lattice is empty or not increasing, or a cut lies outside.
    """
    x, y, z = (np.asarray(a, dtype=np.float64) for a in axes)
    lines = (x, y, z)
    for name, line in zip("xyz", lines, strict=True):
        if line.ndim != 1 or len(line) < 2 or not (np.diff(line) > 0).all():
            raise ValueError(f"lattice planes of {name} must be two or more increasing coordinates, not {line}")
    shape = tuple(len(line) - 1 for line in lines)
    filled = np.ones(shape, dtype=bool) if filled is None else np.asarray(filled, dtype=bool)
    if filled.shape != shape or not filled.any():
        raise ValueError(f"filled must mark at least one of the {shape} cells, not have shape {filled.shape}")
    layers = np.zeros(shape, dtype=np.int64) if layer is None else np.asarray(layer, dtype=np.int64)
    number = np.full(shape, -1)
    cell_site = np.argwhere(filled.transpose(2, 1, 0))[:, ::-1]  # x varies first
    number[tuple(cell_site.T)] = np.arange(len(cell_site))
    joined = _joined(number, cuts, shape)
    corner_node, site = _nodes(number, joined, cell_site)
    faces, face_cell = _surface(number, joined, corner_node)
    lips, lip_axis = _lips(number, joined, corner_node, closing)
    nodes = np.stack([line[site[:, a]] for a, line in enumerate(lines)], axis=1)
    return Grid(
        lines, nodes, site, corner_node, cell_site, layers[tuple(cell_site.T)], faces, face_cell, lips, lip_axis
    )  # type: ignore[arg-type]


def _pair(array: NDArray, axis: int) -> tuple[NDArray, NDArray]:
    """Views of the cells below and above the inner lattice planes of ``axis``."""
    lower, upper = [slice(None)] * 3, [slice(None)] * 3
    lower[axis], upper[axis] = slice(None, -1), slice(1, None)
    return array[tuple(lower)], array[tuple(upper)]


def _joined(number: Integers, cuts: Sequence[Cut], shape: tuple[int, ...]) -> list[NDArray[np.bool_]]:
    """For each axis, which neighbours across its inner planes are one piece."""
    joined = []
    for axis in range(3):
        a, b = _pair(number, axis)
        joined.append((a >= 0) & (b >= 0))
    for cut in cuts:
        if not 0 < cut.index < shape[cut.axis]:
            raise ValueError(f"cut at plane {cut.index} of axis {cut.axis} lies outside 1 … {shape[cut.axis] - 1}")
        plane = [slice(None)] * 3
        plane[cut.axis] = cut.index - 1  # type: ignore[call-overload]
        joined[cut.axis][tuple(plane)] &= ~np.asarray(cut.mask, dtype=bool)
    return joined


def _nodes(number: Integers, joined: list[NDArray[np.bool_]], cell_site: Integers) -> tuple[Integers, Integers]:
    """Node of every corner of every cell (m, 8), and the nodes' lattice indices (n, 3)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    m = len(cell_site)
    links = []
    for axis in range(3):
        a, b = _pair(number, axis)
        a, b = a[joined[axis]], b[joined[axis]]
        for corner in range(8):
            if not corner >> axis & 1:
                links.append(np.stack([8 * a + corner + (1 << axis), 8 * b + corner]))
    row, column = np.concatenate(links, axis=1)
    graph = coo_matrix((np.ones(len(row)), (row, column)), shape=(8 * m, 8 * m))
    n, label = connected_components(graph, directed=False)
    corner_site = (cell_site[:, None, :] + np.array([[c & 1, c >> 1 & 1, c >> 2] for c in range(8)])).reshape(-1, 3)
    first = np.full(n, 8 * m)
    np.minimum.at(first, label, np.arange(8 * m))
    site = corner_site[first]
    order = np.lexsort((first, site[:, 0], site[:, 1], site[:, 2]))
    rank = np.empty(n, dtype=np.int64)
    rank[order] = np.arange(n)
    return rank[label].reshape(m, 8).astype(np.int64), site[order]


def _surface(number: Integers, joined: list[NDArray[np.bool_]], corner_node: Integers) -> tuple[Integers, Integers]:
    """Faces without a neighbour that they are one piece with."""
    open_face = np.ones((len(corner_node), 6), dtype=bool)
    for axis in range(3):
        a, b = _pair(number, axis)
        open_face[a[joined[axis]], 2 * axis + 1] = False
        open_face[b[joined[axis]], 2 * axis] = False
    cell, face = np.nonzero(open_face)
    return corner_node[cell[:, None], FACES[face]], cell.astype(np.int64)


def _lips(
    number: Integers, joined: list[NDArray[np.bool_]], corner_node: Integers, closing: Sequence[int]
) -> tuple[Integers, Integers]:
    """Nodes that face each other across cuts, and across gaps of missing cells along the axes ``closing``."""
    found: dict[tuple[int, int], int] = {}
    for axis in range(3):
        lanes = np.moveaxis(number, axis, 0)
        whole = np.moveaxis(joined[axis], axis, 0)
        for j, k in np.ndindex(lanes.shape[1:]):
            last, gap = -1, False
            for i, cell in enumerate(lanes[:, j, k].tolist()):
                if cell < 0:
                    gap = True
                    continue
                if last >= 0 and not (whole[i - 1, j, k] if not gap else False) and (not gap or axis in closing):
                    for corner in range(8):
                        if not corner >> axis & 1:
                            a = int(corner_node[last, corner + (1 << axis)])
                            b = int(corner_node[cell, corner])
                            if a != b:
                                found.setdefault((a, b), axis)
                last, gap = cell, False
    pairs = sorted(found)
    return np.array(pairs, dtype=np.int64).reshape(-1, 2), np.array([found[p] for p in pairs], dtype=np.int64)
