"""Collision pieces of a mesh: hulls by material, triangle meshes, or points (ADF specification §12.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from ligature.mesh.mesh import Array, Mesh

KINDS = ("hull", "convex", "trimesh", "points")


@dataclass(frozen=True, eq=False)
class ConvexPart:
    """A convex piece: its corner ``vertices`` (n, 3), n >= 1; flat and line-like pieces are legal."""

    name: str
    vertices: Array


@dataclass(frozen=True, eq=False)
class TrianglePart:
    """A triangle mesh: ``vertices`` (n, 3) welded, ``faces`` (m, 3)."""

    name: str
    vertices: Array
    faces: NDArray[np.int32]


def collision_parts(mesh: Mesh, kind: str, scale: float = 1.0) -> tuple[ConvexPart | TrianglePart, ...]:
    """The pieces that ``mesh`` collides as; ``kind`` is one of `KINDS`, ``scale`` a factor on vertices.

    Parts with fewer than three distinct vertices make no hull and are left out.
    """
    if kind == "points":
        points = np.unique(mesh.vertices * scale, axis=0)
        return tuple(ConvexPart("point", point[None]) for point in points)
    pieces: list[ConvexPart | TrianglePart] = []
    for part in mesh.parts:
        if not len(part.vertices):
            continue
        vertices, faces = weld(part.vertices * scale, part.faces)
        if kind == "trimesh":
            if len(faces):
                pieces.append(TrianglePart(part.name, vertices, faces))
        elif len(vertices) >= 3:
            pieces.append(ConvexPart(part.name, hull_vertices(vertices)))
    return tuple(pieces)


def weld(vertices: Array, faces: NDArray[np.int32]) -> tuple[Array, NDArray[np.int32]]:
    """Distinct vertices, and the faces that keep three different corners."""
    distinct, inverse = np.unique(vertices, axis=0, return_inverse=True)
    welded = inverse.reshape(-1)[faces] if len(faces) else np.zeros((0, 3), dtype=np.int64)
    a, b, c = welded.T if len(welded) else (welded[:, 0],) * 3
    return distinct, welded[(a != b) & (b != c) & (c != a)].astype(np.int32)


def hull_vertices(points: Array) -> Array:
    """The points (n, 3) that are corners of their convex hull; all of them when they are coplanar."""
    if len(points) < 4:
        return points
    try:
        return points[np.sort(ConvexHull(points).vertices)]
    except QhullError:
        return points
