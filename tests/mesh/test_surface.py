"""Welding, closedness and hulls of triangle surfaces."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.mesh.mesh import MeshPart
from ligature.mesh.surface import convex_surface, extent_rank, hull_vertices, joined, open_edges, weld

from tests.mesh.shapes import CUBE, ell


def test_welding_joins_equal_vertices_and_drops_collapsed_faces() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0]], dtype=float)
    distinct, faces = weld(vertices, np.array([[0, 1, 2], [3, 1, 2], [0, 3, 1]], dtype=np.int32))
    assert len(distinct) == 3 and len(faces) == 2
    assert np.array_equal(distinct[faces[0]], distinct[faces[1]])


def test_an_ell_is_closed_until_a_face_is_missing_or_turned() -> None:
    _, faces = ell()
    assert open_edges(faces) == 0
    assert open_edges(faces[1:]) == 3
    turned = faces.copy()
    turned[0] = turned[0, ::-1]
    assert open_edges(turned) == 3


def test_parts_that_share_a_border_join_to_a_closed_surface() -> None:
    vertices, faces = ell()
    halves = [weld(vertices[half.ravel()], np.arange(30).reshape(-1, 3)) for half in (faces[:10], faces[10:])]
    whole, whole_faces = joined(tuple(MeshPart("", *half) for half in halves))
    assert len(whole) == 12 and len(whole_faces) == 20 and open_edges(whole_faces) == 0


@pytest.mark.parametrize(
    ("points", "rank", "corners"),
    [
        (CUBE[:1].repeat(3, axis=0), 0, 1),
        (np.outer([0.0, 2.0, 1.0, 3.0], [1.0, 2.0, 3.0]), 1, 2),
        (np.vstack([CUBE[:4], CUBE[:4].mean(axis=0)]), 2, 4),
        (np.vstack([CUBE, CUBE.mean(axis=0), CUBE[:2]]), 3, 8),
        (np.vstack([CUBE, CUBE.mean(axis=0)]) * 1e-6 + 0.3, 3, 8),
    ],
    ids=["place", "line", "plane", "solid", "solid of a micrometre"],
)
def test_hulls_keep_corners_only(points: np.ndarray, rank: int, corners: int) -> None:
    assert extent_rank(points) == rank
    found = hull_vertices(points)
    assert len(found) == corners
    assert all((point == points).all(axis=1).any() for point in found)


def test_the_surface_of_a_hull_points_outwards() -> None:
    points = np.random.default_rng(0).normal(size=(40, 3))
    corners, faces = convex_surface(points)
    a, b, c = (corners[faces[:, i]] for i in range(3))
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a - corners.mean(axis=0)) > 0).all()
    assert open_edges(faces) == 0 and len(np.unique(faces)) == len(corners)


def test_a_flat_hull_has_no_surface() -> None:
    with pytest.raises(ValueError, match="coplanar"):
        convex_surface(CUBE[:4])
