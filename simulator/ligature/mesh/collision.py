"""Collision pieces of a mesh: hulls by material, triangle meshes, or points (as in AMBF).

Lengths in metres, in the mesh's own frame after scaling.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.adf.diagnostics import Diagnostic, Severity
from ligature.mesh.mesh import Array, Findings, Mesh, MeshPart, checked, failure
from ligature.mesh.surface import extent_rank, hull_vertices, weld

KINDS = ("hull", "convex", "trimesh", "points")

MAX_POINTS = 10_000
"""Most vertices of a mesh that collides as a cloud of points, each of which is a sphere."""

_EXTENT = ("one place", "one line", "one plane")


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


def collision_parts(
    mesh: Mesh, kind: str, scale: float = 1.0, report: Callable[[Diagnostic], None] | None = None
) -> tuple[ConvexPart | TrianglePart, ...]:
    """The pieces that ``mesh`` collides as.

    Parameters
    ----------
    mesh
        A mesh file, one part per material.
    kind
        ``"hull"`` or ``"convex"``: the convex hull of each part; ``"trimesh"``: the triangles of
        each part; ``"points"``: one `ConvexPart` of a single vertex for every distinct vertex.
    scale
        Factor on the vertices.
    report
        Takes findings: parts that make no piece and are left out, hulls without volume.

    Returns
    -------
    tuple
        The pieces, in the order of the mesh's parts.

    Raises
    ------
    ValueError
        For another ``kind``.
    MeshError
        When a point cloud has more than `MAX_POINTS` points, or ``scale`` makes vertices insane.
    """
    if kind not in KINDS:
        raise ValueError(f"'{kind}' is not a kind of collision; use one of {', '.join(KINDS)}")
    findings = Findings()
    if kind == "points":
        pieces = _points(mesh, scale)
    else:
        one = _triangles if kind == "trimesh" else _hull
        found = (one(mesh, part, scale, findings) for part in mesh.parts if len(part.vertices))
        pieces = tuple(piece for piece in found if piece is not None)
    if report is not None:
        for diagnostic in findings.all():
            report(diagnostic)
    return pieces


def _points(mesh: Mesh, scale: float) -> tuple[ConvexPart | TrianglePart, ...]:
    points = np.unique(_scaled(mesh, mesh.vertices, scale), axis=0)
    if len(points) > MAX_POINTS:
        message = f"the mesh has {len(points)} distinct vertices, too many for a POINT_CLOUD"
        raise failure(mesh.path, message, hint=f"at most {MAX_POINTS} are allowed; use CONVEX_HULL")
    return tuple(ConvexPart("point", point[None]) for point in points)


def _triangles(mesh: Mesh, part: MeshPart, scale: float, findings: Findings) -> TrianglePart | None:
    vertices, faces = weld(_scaled(mesh, part.vertices, scale), part.faces)
    if len(faces):
        return TrianglePart(part.name, vertices, faces)
    findings.add(mesh.path, f"{_called(part)} has no triangle and collides with nothing", hint="add faces")
    return None


def _hull(mesh: Mesh, part: MeshPart, scale: float, findings: Findings) -> ConvexPart | None:
    vertices = np.unique(_scaled(mesh, part.vertices, scale), axis=0)
    if len(vertices) < 3:
        message = f"{_called(part)} has {len(vertices)} distinct vertices and collides with nothing"
        findings.add(mesh.path, message, hint="a convex hull needs 3 or more")
        return None
    rank = extent_rank(vertices)
    if rank < 3:
        message = f"all vertices of {_called(part)} lie in {_EXTENT[rank]}"
        findings.add(mesh.path, message, 1, "its hull is as thick as the collision margin", Severity.INFO)
    return ConvexPart(part.name, hull_vertices(vertices))


def _scaled(mesh: Mesh, vertices: Array, scale: float) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused
        return checked(vertices * scale, mesh.path)


def _called(part: MeshPart) -> str:
    return f"material '{part.name[:80]}'" if part.name else "the mesh"
