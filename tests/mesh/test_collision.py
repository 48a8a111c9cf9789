"""Collision pieces by kind, and what is stated of parts that make none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ligature.adf import Diagnostic, Resolver, Severity
from ligature.mesh import ConvexPart, Mesh, MeshError, MeshPart, collision_parts, load_mesh
from ligature.mesh.collision import MAX_POINTS

from tests.mesh.shapes import CUBE, ell


def mesh(*parts: tuple[str, np.ndarray]) -> Mesh:
    """A mesh of named parts whose faces do not matter."""
    faces = np.array([[0, 1, 2]], dtype=np.int32)
    return Mesh(Path("/m.obj"), tuple(MeshPart(name, points, faces) for name, points in parts))


def test_each_material_is_one_hull_of_its_scaled_corners() -> None:
    pieces = collision_parts(mesh(("a", np.vstack([CUBE, CUBE * 0.5])), ("b", CUBE + 2)), "hull", 0.1)
    assert [(piece.name, len(piece.vertices)) for piece in pieces] == [("a", 8), ("b", 8)]
    assert np.allclose(np.sort(pieces[1].vertices, axis=0), np.sort(0.1 * (CUBE + 2), axis=0))


def test_a_triangle_mesh_keeps_its_faces_welded() -> None:
    vertices, faces = ell()
    split = Mesh(Path("/m.stl"), (MeshPart("", vertices[faces.ravel()], np.arange(60, dtype=np.int32).reshape(-1, 3)),))
    (piece,) = collision_parts(split, "trimesh")
    assert not isinstance(piece, ConvexPart)
    assert len(piece.vertices) == 12 and len(piece.faces) == 20 and piece.faces.dtype == np.int32


def test_a_point_cloud_is_every_distinct_vertex() -> None:
    pieces = collision_parts(mesh(("a", CUBE), ("b", CUBE)), "points")
    assert len(pieces) == 8 and all(piece.vertices.shape == (1, 3) for piece in pieces)


def test_a_point_cloud_of_too_many_points_is_refused() -> None:
    many = np.random.default_rng(0).random((MAX_POINTS + 1, 3))
    with pytest.raises(MeshError, match="10001 distinct vertices, too many for a POINT_CLOUD; at most 10000"):
        collision_parts(mesh(("a", many)), "points")


def test_parts_without_a_piece_are_reported_where_they_are() -> None:
    found: list[Diagnostic] = []
    assert collision_parts(mesh(("two", CUBE[:2])), "hull", report=found.append) == ()
    collision_parts(mesh(("flat", CUBE[:4])), "hull", report=found.append)
    empty = Mesh(Path("/m.obj"), (MeshPart("", CUBE, np.zeros((0, 3), dtype=np.int32)),))
    assert collision_parts(empty, "trimesh", report=found.append) == ()
    assert [str(d) for d in found] == [
        "/m.obj:1:1: warning: material 'two' has 2 distinct vertices and collides with nothing; "
        "a convex hull needs 3 or more",
        "/m.obj:1:1: info: all vertices of material 'flat' lie in one plane; its hull is as thick as the collision margin",
        "/m.obj:1:1: warning: the mesh has no triangle and collides with nothing; add faces",
    ]


@pytest.mark.parametrize("scale", [float("nan"), float("inf"), 1e308])
def test_a_scale_that_makes_vertices_useless_is_refused(scale: float) -> None:
    with pytest.raises(MeshError, match="a vertex (is not finite|lies farther)"):
        collision_parts(mesh(("a", CUBE)), "hull", scale)


def test_another_kind_is_a_mistake_of_the_caller() -> None:
    with pytest.raises(ValueError, match="'hulls' is not a kind of collision; use one of hull, convex"):
        collision_parts(mesh(("a", CUBE)), "hulls")


def test_hulls_of_the_corpus_needle_are_those_of_the_specification(corpus: Path) -> None:
    """One of the 12 vertices of the first piece lies 2.6 µm inside the hull of the others."""
    folder = corpus / "suturing_scene" / "ADF" / "Phantoms" / "Simple" / "low_res"
    needle = load_mesh(folder / "NeedleCollision.OBJ", Resolver([corpus]))
    assert [len(np.unique(part.vertices, axis=0)) for part in needle.parts] == [12] + 8 * [6]
    found: list[Diagnostic] = []
    assert [len(p.vertices) for p in collision_parts(needle, "hull", report=found.append)] == [11] + 8 * [6]
    assert not [d for d in found if d.severity >= Severity.WARNING]
