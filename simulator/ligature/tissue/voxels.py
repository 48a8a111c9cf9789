"""Fills a closed mesh with hexahedra and binds its surface to them; metres, axes of the mesh.

A cell is tissue when the mesh fills at least half of it, so the grid's surface and the mesh's differ by up to half a
cell; each vertex of the mesh moves with the cell that is nearest to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from ligature.tissue.grid import Cut, Grid, build_grid

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

FULL = 0.5
"""Share of a cell that the mesh fills from which it is tissue."""

SAMPLES = 4
"""Points along each edge of a cell at which its filling is counted."""


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


def voxelise(
    vertices: Array, triangles: Integers, cell: float | Sequence[float], cuts: Sequence[Cut] = ()
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

    Raises
    ------
    ValueError
        When the mesh is not closed, or the cells are so large that none is filled.
    """
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    mesh.merge_vertices()
    if not mesh.is_watertight:
        raise ValueError("the mesh has open edges, so it encloses no tissue; close it or give it a thickness")
    low, high = mesh.bounds
    count = np.maximum(np.ceil((high - low) / np.asarray(cell, dtype=np.float64) - 1e-6).astype(np.int64), 1)
    axes = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, count, strict=True)]
    share = _filling(mesh, axes)
    filled = share >= FULL
    if not filled.any():
        raise ValueError(f"no cell of {cell} m is filled by the mesh of {high - low} m; use smaller cells")
    grid = build_grid(axes, filled, cuts=cuts)
    return grid, embed(grid, np.asarray(vertices, dtype=np.float64))


def _filling(mesh: trimesh.Trimesh, axes: Sequence[Array]) -> Array:
    """Share of each cell that lies inside the mesh, (nx, ny, nz), by rays along z through a lattice of points.

    A ray adds the mesh's crossings up with their directions, so parts that overlap count once.
    """
    shape = tuple(len(a) - 1 for a in axes)
    inner = (np.arange(SAMPLES) + 0.5) / SAMPLES
    across = [(a[:-1, None] + inner * np.diff(a)[:, None]).reshape(-1) for a in axes]
    x, y = np.meshgrid(across[0], across[1], indexing="ij")
    # Off the vertices' own lattice, so that no ray meets an edge of an axis-aligned mesh.
    shift = 1e-7 * np.array([np.sqrt(2.0), np.sqrt(3.0)]) * np.ptp(mesh.vertices, axis=0)[:2]
    winding = np.zeros((x.shape[0], x.shape[1], len(across[2])))
    for a, b, c in mesh.triangles:
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


def embed(grid: Grid, points: Array) -> Embedding:
    """Bind points (v, 3) to the cells that contain them, or to the nearest ones."""
    low, high = grid.nodes[grid.cells[:, 0]], grid.nodes[grid.cells[:, 7]]
    nodes = np.zeros((len(points), 8), dtype=np.int64)
    weights = np.zeros((len(points), 8))
    corner = np.array([[k & 1, k >> 1 & 1, k >> 2] for k in range(8)], dtype=bool)
    for i, point in enumerate(points):
        outside = np.maximum(np.maximum(low - point, point - high), 0.0)
        c = int(np.argmin((outside**2).sum(axis=1)))
        at = (point - low[c]) / (high[c] - low[c])
        nodes[i] = grid.cells[c]
        weights[i] = np.where(corner, at, 1.0 - at).prod(axis=1)
    return Embedding(nodes, weights)
