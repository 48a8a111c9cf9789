"""How well convex pieces stand for a mesh: volume and Hausdorff distance. Metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ligature.mesh.inertia import hull_properties, mass_properties
from ligature.mesh.mesh import Array
from ligature.mesh.surface import Faces, convex_surface

SAMPLES = 4000
"""Points on each surface from which distances are measured."""

_INSIDE = 1e-9
"""Depth below all planes of a hull, over its extent, at which a point counts as inside."""


def volume_error(vertices: Array, faces: Faces, hulls: Sequence[Array]) -> float | None:
    """|sum of hulls − mesh| / mesh by volume; None when the mesh is not closed and has no volume."""
    try:
        volume = mass_properties(vertices, faces).volume
    except ValueError:
        return None
    return abs(sum(_volume(hull) for hull in hulls) - volume) / volume


def hausdorff_distance(vertices: Array, faces: Faces, hulls: Sequence[Array], seed: int = 0) -> float:
    """Hausdorff distance between a surface and the outside of the union of ``hulls``, each (n, 3).

    The larger of: from `SAMPLES` points of the outside to the surface, and from as many points of
    the surface to the outside. Where hulls meet inside the union is no outside. Distances are
    exact, but for points of the surface so deep inside that the nearest face is such an inner one:
    these are measured to the sampled outside, which may be too large by the samples' spacing.
    """
    rng = np.random.default_rng(seed)
    surfaces = [convex_surface(hull) for hull in hulls]
    planes = [_planes(*surface) for surface in surfaces]
    skin = _concatenated(surfaces)
    outside = sample_surface(*skin, SAMPLES, rng)
    outside = outside[~_inside(outside, planes)]
    on_mesh = sample_surface(vertices, faces, SAMPLES, rng)
    feet = nearest_points(on_mesh, *skin)
    gaps = np.linalg.norm(on_mesh - feet, axis=1)
    inner = _inside(feet, planes)
    gaps[inner] = cKDTree(outside).query(on_mesh[inner])[0]
    sticking_out = np.linalg.norm(outside - nearest_points(outside, vertices, faces), axis=1)
    return float(max(gaps.max(), sticking_out.max()))


def sample_surface(vertices: Array, faces: Faces, count: int, rng: np.random.Generator) -> Array:
    """Points (count, 3) spread evenly over the triangles by area."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = rng.choice(len(faces), size=count, p=area / area.sum())
    u, v = rng.random((2, count, 1))
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
    return a[chosen] + u * (b - a)[chosen] + v * (c - a)[chosen]


def nearest_points(points: Array, vertices: Array, faces: Faces) -> Array:
    """The exact nearest point (n, 3) of a surface to each of ``points`` (n, 3)."""
    corners = vertices[faces]
    centres = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    first = vertices[cKDTree(vertices).query(points)[1]]
    return np.asarray(_nearest(points, np.ascontiguousarray(corners), centres, radii, first))


@njit(cache=True)
def _nearest(points: Array, corners: Array, centres: Array, radii: Array, first: Array) -> Array:
    """Improves on the points ``first`` (n, 3); triangles whose bounding ball is farther are passed over."""
    found = first.copy()
    foot = np.empty(3)
    for i in range(points.shape[0]):
        p = points[i]
        best = _distance(p, found[i])
        for k in range(corners.shape[0]):
            if _distance(p, centres[k]) < best + radii[k]:
                _foot(p, corners[k, 0], corners[k, 1], corners[k, 2], foot)
                gap = _distance(p, foot)
                if gap < best:
                    best = gap
                    found[i] = foot
    return found


@njit(cache=True)
def _distance(p: Array, q: Array) -> float:
    x, y, z = p[0] - q[0], p[1] - q[1], p[2] - q[2]
    return float((x * x + y * y + z * z) ** 0.5)


@njit(cache=True)
def _foot(p: Array, a: Array, b: Array, c: Array, foot: Array) -> None:
    """Write the nearest point of a triangle to ``foot``: in its plane when inside, else on an edge."""
    ab, ac, ap = b - a, c - a, p - a
    normal = np.cross(ab, ac)
    square = normal @ normal
    if square > 0.0:
        v = np.cross(ap, ac) @ normal / square
        w = np.cross(ab, ap) @ normal / square
        if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
            foot[:] = a + v * ab + w * ac
            return
    best = np.inf
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        length = edge @ edge
        along = 0.0 if length == 0.0 else float((p - start) @ edge / length)
        candidate = start + min(max(along, 0.0), 1.0) * edge
        gap = _distance(p, candidate)
        if gap < best:
            best = gap
            foot[:] = candidate


def _volume(hull: Array) -> float:
    return hull_properties(hull).volume


def _planes(corners: Array, faces: Faces) -> NDArray[np.float64]:
    """Outward unit normal and offset (m, 4) of each triangle of a hull, moved inwards by a hair."""
    a, b, c = (corners[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    normal = normal[length > 0] / length[length > 0, None]
    offset = np.einsum("ij,ij->i", normal, a[length > 0]) - _INSIDE * np.ptp(corners, axis=0).max()
    return np.column_stack([normal, offset])


def _inside(points: Array, planes: Sequence[Array]) -> NDArray[np.bool_]:
    """Which of ``points`` (n, 3) lie inside one of the hulls."""
    inside = np.zeros(len(points), dtype=bool)
    for hull in planes:
        inside |= (points @ hull[:, :3].T < hull[:, 3]).all(axis=1)
    return inside


def _concatenated(surfaces: Sequence[tuple[Array, Faces]]) -> tuple[Array, Faces]:
    first = np.cumsum([0] + [len(corners) for corners, _ in surfaces[:-1]])
    faces = [faces + start for (_, faces), start in zip(surfaces, first, strict=True)]
    return np.vstack([corners for corners, _ in surfaces]), np.vstack(faces)
