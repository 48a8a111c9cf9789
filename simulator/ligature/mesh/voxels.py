"""Fills a closed mesh with hexahedra and binds its surface to them; metres, axes of the mesh.

A cell is tissue when the mesh fills at least half of it, so the grid's surface and the mesh's differ by up to half a
cell; each vertex of the mesh moves with the cell that is nearest to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.adf.diagnostics import length, span
from ligature.mesh.grid import Cut, Grid, build_grid
from ligature.mesh.surface import open_edges, weld

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

FULL = 0.5
"""Share of a cell that the mesh fills from which it is tissue."""

HELD_CELLS, FREE_CELLS = 600, 150
"""Cells of tissue whose cell size the file does not state, about; of one that nothing holds."""

CHUNK = 256
"""Points that are processed at a time."""

SAMPLES = 4
"""Points along each edge of a cell at which its filling is counted."""


class NoTissueError(ValueError):
    """A shape that cannot be filled with cells: what is wrong, and ``hint``, what would be right."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(f"{message}; {hint}")
        self.message, self.hint = message, hint


@dataclass(frozen=True, eq=False)
class Embedding:
    """Points that move with a grid.

    Parameters
    ----------
    nodes
        Corners of the cell that carries a point, (v, 8).
    weights
        Their shares, (v, 8); a point outside its cell is carried along by extrapolation.
    """

    nodes: Integers
    weights: Array

    def positions(self, x: Array) -> Array:
        """Positions (v, 3) of the points when those of the nodes are ``x`` (n, 3)."""
        return np.einsum("vk,vka->va", self.weights, x[self.nodes])


NOWHERE = Embedding(np.zeros((0, 8), dtype=np.int64), np.zeros((0, 8)))
"""An empty array of points."""


def voxelise(
    vertices: Array,
    triangles: NDArray[np.integer],
    cell: float | Sequence[float],
    cuts: Sequence[Cut] = (),
    slits: Sequence[Array] = (),
    planes: Sequence[Sequence[float]] = ((), (), ()),
) -> tuple[Grid, Embedding]:
    """Make a grid that fills a closed mesh, and bind the mesh's vertices to it.

    Parameters
    ----------
    vertices, triangles
        The mesh: (v, 3) m and (t, 3), of one or several closed parts, hollow ones too.
    cell
        Edge of a cell, m; one number or one for each axis. It is made smaller to fit the mesh's box.
    cuts
        Slits in the planes of the lattice.
    slits
        Boxes (2, 3) from corner to corner, m. One that is flat along an axis is a slit; cells in any other are
        missing. The lattice has planes at their faces.
    planes
        Further coordinates along x, y, z at which the lattice has planes, such as those between layers, m.

    Raises
    ------
    NoTissueError
        When the mesh is not closed, the cells are so large that none is filled, a slit lies outside, or slits leave
        nothing.
    """
    axes, filled, found = lattice(vertices, triangles, cell, slits, planes)
    grid = build_grid(axes, filled, cuts=[*cuts, *found], closing=(0, 1, 2) if slits else (0, 1))
    return grid, embed(grid, np.asarray(vertices, dtype=np.float64))


def lattice(
    vertices: Array,
    triangles: NDArray[np.integer],
    cell: float | Sequence[float],
    slits: Sequence[Array] = (),
    planes: Sequence[Sequence[float]] = ((), (), ()),
) -> tuple[list[Array], NDArray[np.bool_], list[Cut]]:
    """The lattice of `voxelise`: its planes along x, y, z (m), which cells are tissue (nx, ny, nz), the slits' cuts.

    NumPy alone does it, so that Blender, which lacks SciPy, can show the cells. Raises `NoTissueError` as `voxelise`.
    """
    welded, faces = _outward(vertices, triangles)
    low, high = welded.min(axis=0), welded.max(axis=0)
    edge = np.broadcast_to(np.asarray(cell, dtype=np.float64), 3)
    wanted = [[*planes[a], *(float(x) for box in slits for x in box[:, a])] for a in range(3)]
    axes = [_lattice(low[a], high[a], edge[a], wanted[a]) for a in range(3)]
    filled = _filling(welded[faces], axes) >= FULL
    if not filled.any():
        size, cells = " x ".join(length(x) for x in high - low), " x ".join(dict.fromkeys(length(x) for x in edge))
        raise NoTissueError(f"its shape of {size} fills no cell of {cells} to a half", "use smaller cells")
    cuts: list[Cut] = []
    for box in slits:
        flat = np.flatnonzero(box[0] == box[1])
        inside = [(a[:-1] + np.diff(a) / 2 > lo) & (a[:-1] + np.diff(a) / 2 < hi)
                  for a, lo, hi in zip(axes, box.min(axis=0), box.max(axis=0), strict=True)]  # fmt: skip
        if len(flat) > 1 or (len(flat) and not low[flat[0]] < box[0, flat[0]] < high[flat[0]]):
            raise NoTissueError(
                f"the slit {span(*box)} is not a rectangle or box inside the mesh",
                f"the mesh reaches {span(low, high)}; only a slit that is flat along one axis, within it, is one",
            )
        if len(flat):
            axis = int(flat[0])
            index = int(np.argmin(np.abs(axes[axis] - box[0, axis])))
            cuts.append(Cut(axis, index, np.multiply.outer(*(inside[a] for a in range(3) if a != axis))))
        else:
            filled &= ~(inside[0][:, None, None] & inside[1][:, None] & inside[2])
    if not filled.any():
        raise NoTissueError("its slits leave no cell", f"use smaller ones; the mesh reaches {span(low, high)}")
    return axes, filled, cuts


def _outward(vertices: Array, triangles: NDArray[np.integer]) -> tuple[Array, NDArray[np.int32]]:
    """A closed surface, welded, with faces that look outwards; raises `NoTissueError` for another one."""
    welded, faces = weld(np.asarray(vertices, dtype=np.float64), np.asarray(triangles, dtype=np.int32))
    if len(welded) < 2 or not len(faces):
        raise NoTissueError("the mesh has no extent", "give a closed mesh, and a 'scale' that is not 0")
    if open_edges(faces):
        raise NoTissueError("the mesh has open edges, so it encloses no tissue", "close it or give it a thickness")
    # A mirrored mesh, as by a negative scale, looks inwards.
    return welded, faces if volume(welded, faces) > 0.0 else faces[:, ::-1]


def volume(vertices: Array, faces: NDArray[np.integer]) -> float:
    """Volume in a closed surface, negative where its faces look inwards."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def usual_cell(vertices: Array, held: bool) -> float:
    """Edge of a cell, m, of tissue whose file states none: about `HELD_CELLS` cells, fewer where nothing holds it."""
    return float(np.prod(np.ptp(vertices, axis=0)) / (HELD_CELLS if held else FREE_CELLS)) ** (1.0 / 3.0) or 1e-3


def _lattice(low: float, high: float, cell: float, planes: Sequence[float]) -> Array:
    """Lattice planes from ``low`` to ``high``, at most ``cell`` apart, with those of ``planes`` among them."""
    room = 1e-3 * min(cell, high - low)
    inner = sorted(x for x in set(planes) if low + room < x < high - room)
    ends = [low, *(x for x, before in zip(inner, [low, *inner], strict=False) if x - before > room), high]
    parts = [
        np.linspace(a, b, max(int(np.ceil((b - a) / cell - 1e-6)), 1) + 1) for a, b in zip(ends, ends[1:], strict=False)
    ]
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])


def _filling(triangles: Array, axes: Sequence[Array]) -> Array:
    """Share of each cell that lies inside triangles (t, 3, 3), (nx, ny, nz), by rays along z through a lattice.

    A ray adds the mesh's crossings up with their directions, so parts that overlap count once.
    """
    shape = tuple(len(a) - 1 for a in axes)
    inner = (np.arange(SAMPLES) + 0.5) / SAMPLES
    across = [(a[:-1, None] + inner * np.diff(a)[:, None]).reshape(-1) for a in axes]
    x, y = np.meshgrid(across[0], across[1], indexing="ij")
    # Off the vertices' own lattice, so that no ray meets an edge of an axis-aligned mesh.
    shift = 1e-7 * np.array([np.sqrt(2.0), np.sqrt(3.0)]) * np.ptp(triangles.reshape(-1, 3), axis=0)[:2]
    winding = np.zeros((x.shape[0], x.shape[1], len(across[2])))
    for a, b, c in triangles:
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0.0:
            continue
        i0, i1 = np.searchsorted(across[0] + shift[0], [min(a[0], b[0], c[0]), max(a[0], b[0], c[0])])
        j0, j1 = np.searchsorted(across[1] + shift[1], [min(a[1], b[1], c[1]), max(a[1], b[1], c[1])])
        px, py = x[i0:i1, j0:j1] + shift[0], y[i0:i1, j0:j1] + shift[1]
        u = ((px - a[0]) * (c[1] - a[1]) - (py - a[1]) * (c[0] - a[0])) / area
        v = ((b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0])) / area
        hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
        height = a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2])
        # Facing down, the triangle begins what lies above it; facing up it ends it.
        above = hit[:, :, None] & (across[2] > height[:, :, None])
        winding[i0:i1, j0:j1] -= np.sign(area) * above
    inside = winding > 0.5
    split = [n for size in shape for n in (size, SAMPLES)]
    return inside.reshape(split).mean(axis=(1, 3, 5))


def embed(grid: Grid, points: Array, beside: Array | None = None) -> Embedding:
    """Bind points to the cells that contain them, or to the nearest ones.

    Parameters
    ----------
    grid
        The cells.
    points
        Places at rest, (v, 3) m.
    beside
        Places (v, 3) m that choose the cells instead, for points on a slit: those off it, on the side that is meant.
    """
    low, high = grid.nodes[grid.cells[:, 0]], grid.nodes[grid.cells[:, 7]]
    corner = np.array([[k & 1, k >> 1 & 1, k >> 2] for k in range(8)], dtype=bool)
    places = points if beside is None else beside
    nearest = _containing(grid, places)
    rest = np.flatnonzero(nearest < 0)
    for begin in range(0, len(rest), CHUNK):
        chunk = rest[begin : begin + CHUNK]
        part = places[chunk, None]
        outside = np.maximum(np.maximum(low - part, part - high), 0.0)
        nearest[chunk] = np.argmin((outside**2).sum(axis=2), axis=1)
    at = ((points - low[nearest]) / (high - low)[nearest])[:, None]
    return Embedding(grid.cells[nearest], np.where(corner, at, 1.0 - at).prod(axis=2))


def _containing(grid: Grid, places: Array) -> Integers:
    """The cells that contain places (v, 3), (v,); -1 for none."""
    shape = tuple(len(axis) - 1 for axis in grid.axes)
    number = np.full(shape, -1, dtype=np.int64)
    number[tuple(grid.cell_site.T)] = np.arange(len(grid.cells))
    site = [np.searchsorted(axis, places[:, a], side="right") - 1 for a, axis in enumerate(grid.axes)]
    inside = np.all([(k >= 0) & (k < n) for k, n in zip(site, shape, strict=True)], axis=0)
    cell = number[tuple(np.clip(k, 0, n - 1) for k, n in zip(site, shape, strict=True))]
    return np.where(inside, cell, -1)
