"""Triangle surfaces: welding, closedness, convex hulls. Vertices (n, 3), faces (m, 3); any one length unit.

SciPy is imported by hulls and `shells` alone: Blender, which lacks it, can use all the rest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.mesh.hulls import convex_hull
from ligature.mesh.mesh import Array, MeshPart

Faces = NDArray[np.int32]

FLAT = 1e-9
"""Thickness over largest extent below which points count as lying in a plane, or in a line."""


def weld(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """Distinct vertices, and the faces that keep three different corners."""
    distinct, inverse = np.unique(vertices, axis=0, return_inverse=True)
    welded = inverse.reshape(-1)[faces].reshape(-1, 3)
    a, b, c = welded.T
    return distinct, welded[(a != b) & (b != c) & (c != a)].astype(np.int32)


def joined(parts: tuple[MeshPart, ...]) -> tuple[Array, Faces]:
    """All parts as one welded surface."""
    if not parts:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32)
    first = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    faces = np.vstack([part.faces + start for part, start in zip(parts, first, strict=True)])
    return weld(np.vstack([part.vertices for part in parts]), faces)


def open_edges(faces: Faces) -> int:
    """Number of edges of a welded surface that its faces do not pass equally often in both directions.

    Zero means that the surface is closed and consistently oriented.
    """
    if not len(faces):
        return 0
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    low, high = edges.min(axis=1), edges.max(axis=1)
    _, index = np.unique(low * (int(faces.max()) + 1) + high, return_inverse=True)
    balance = np.bincount(index, weights=np.where(edges[:, 0] == low, 1.0, -1.0))
    return int(np.count_nonzero(balance))


def shells(vertices: int, faces: Faces) -> NDArray[np.int64]:
    """Number (m,) of the piece of surface of each face, from 0; pieces of a welded surface share no vertex."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    a, b, c = faces.T
    joints = coo_matrix((np.ones(2 * len(faces)), (np.r_[a, b], np.r_[b, c])), shape=(vertices, vertices))
    of_vertex = connected_components(joints, directed=False)[1]
    return np.unique(of_vertex[a], return_inverse=True)[1].astype(np.int64)


def extent_rank(points: Array) -> int:
    """Number of dimensions that ``points`` span: 0 one place, 1 a line, 2 a plane, 3 a solid."""
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return int(np.count_nonzero(spread > FLAT * spread[0])) if spread[0] > 0.0 else 0


def hull_vertices(points: Array) -> Array:
    """The points (n, 3) that are corners of their convex hull, in their own order.

    Points in one plane give the corners of their polygon, points in one line its two ends.
    """
    distinct = np.sort(np.unique(points, axis=0, return_index=True)[1])
    points = points[distinct]
    if len(points) < 3:
        return points
    centred = points - points.mean(axis=0)
    rank = extent_rank(points)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    if rank == 1:
        along = centred @ axes[0]
        return points[np.sort([np.argmin(along), np.argmax(along)])]
    try:
        return points[np.sort(convex_hull(centred if rank == 3 else centred @ axes[:2].T).vertices)]
    except ValueError:  # thinner than Qhull's own tolerance: all points stand for the hull
        return points


def convex_surface(points: Array) -> tuple[Array, Faces]:
    """Corners (n, 3) and outward triangles (m, 3) of the hull of ``points`` (k, 3); ValueError for a flat one."""
    corners = hull_vertices(points)
    try:
        if len(corners) < 4:
            raise ValueError
        hull = convex_hull(corners - corners.mean(axis=0))
    except ValueError:
        raise ValueError("the points are coplanar: they enclose no volume") from None
    faces = hull.simplices.astype(np.int32)
    a, b, c = corners[faces[:, 0]], corners[faces[:, 1]], corners[faces[:, 2]]
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return corners, faces
