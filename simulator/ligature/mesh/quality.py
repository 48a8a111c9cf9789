"""How well convex pieces stand for a mesh: volume and Hausdorff distance. Metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ligature.kernels import compiled
from ligature.mesh.inertia import hull_properties, mass_properties
from ligature.mesh.mesh import Array
from ligature.mesh.surface import Faces, convex_surface

SAMPLES = 4000
"""Points on each surface from which distances are measured."""

_NUDGE = 1e-6
"""Step outwards, over the extent, that decides whether a face of a hull is covered by another hull."""


def volume_error(vertices: Array, faces: Faces, hulls: Sequence[Array]) -> float | None:
    """``|sum of hulls − mesh| / mesh`` by volume; None when the mesh is not closed and has no volume."""
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
    outwards = _NUDGE * float(np.ptp(skin[0], axis=0).max()) * _normals(*skin)
    outside, face = sample_surface(*skin, SAMPLES, rng)
    outside = outside[~_inside(outside + outwards[face], planes)]
    on_mesh, _ = sample_surface(vertices, faces, SAMPLES, rng)
    feet, face = nearest_points(on_mesh, *skin)
    gaps = np.linalg.norm(on_mesh - feet, axis=1)
    inner = _inside(feet + outwards[face], planes)
    gaps[inner] = cKDTree(outside).query(on_mesh[inner])[0]
    sticking_out = np.linalg.norm(outside - nearest_points(outside, vertices, faces)[0], axis=1)
    return float(max(gaps.max(), sticking_out.max()))


def sample_surface(
    vertices: Array, faces: Faces, count: int, rng: np.random.Generator
) -> tuple[Array, NDArray[np.int64]]:
    """Points (count, 3) spread evenly over the triangles by area, and the triangle (count,) of each."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = rng.choice(len(faces), size=count, p=area / area.sum())
    u, v = rng.random((2, count, 1))
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
    return a[chosen] + u * (b - a)[chosen] + v * (c - a)[chosen], chosen


def nearest_points(points: Array, vertices: Array, faces: Faces) -> tuple[Array, NDArray[np.int64]]:
    """The exact nearest point (n, 3) of a surface to each of ``points`` (n, 3), and its triangle (n,)."""
    corners = vertices[faces]
    centres = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    first = cKDTree(centres).query(points)[1]
    found: tuple[Array, NDArray[np.int64]] = _nearest(points, np.ascontiguousarray(corners), centres, radii, first)
    return found


@compiled
def _nearest(
    points: Array, corners: Array, centres: Array, radii: Array, first: NDArray[np.int64]
) -> tuple[Array, NDArray[np.int64]]:
    """Starts at triangles ``first`` (n,); passes over triangles whose bounding ball is farther."""
    found, triangle = np.empty_like(points), first.copy()
    foot = np.empty(3)
    for i in range(points.shape[0]):
        p, k = points[i], first[i]
        _foot(p, corners[k, 0], corners[k, 1], corners[k, 2], found[i])
        best = _distance(p, found[i])
        for k in range(corners.shape[0]):
            if _distance(p, centres[k]) < best + radii[k]:
                _foot(p, corners[k, 0], corners[k, 1], corners[k, 2], foot)
                gap = _distance(p, foot)
                if gap < best:
                    best = gap
                    triangle[i] = k
                    found[i] = foot
    return found, triangle


@compiled
def _distance(p: Array, q: Array) -> float:
    x, y, z = p[0] - q[0], p[1] - q[1], p[2] - q[2]
    return float((x * x + y * y + z * z) ** 0.5)


@compiled
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


def _normals(vertices: Array, faces: Faces) -> Array:
    """Unit normal (m, 3) of each triangle, zero for one without area."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)


def _planes(corners: Array, faces: Faces) -> Array:
    """Outward unit normal and offset (k, 4) of each face of a hull."""
    normal = _normals(corners, faces)
    solid = normal.any(axis=1)
    return np.column_stack([normal[solid], np.einsum("ij,ij->i", normal, corners[faces[:, 0]])[solid]])


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
