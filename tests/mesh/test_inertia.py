"""Mass properties against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from ligature.mesh import box_inertia, combined, hull_properties, mass_properties
from ligature.model.frames import rpy_matrix

SIZE = np.array([0.2, 0.3, 0.5])


def box(offset: np.ndarray | None = None, R: np.ndarray | None = None) -> trimesh.Trimesh:
    mesh = trimesh.creation.box(SIZE)
    vertices = mesh.vertices @ (np.eye(3) if R is None else R).T + (0 if offset is None else offset)
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def test_a_box_anywhere_has_the_inertia_of_a_box() -> None:
    offset, R = np.array([1.0, -2.0, 3.0]), rpy_matrix(0.3, 0.4, 0.5)
    mesh = box(offset, R)
    found = mass_properties(mesh.vertices, mesh.faces, density=1000.0)
    assert found.volume == pytest.approx(0.03, rel=1e-9) and found.mass == pytest.approx(30.0, rel=1e-9)
    assert found.centre == pytest.approx(offset, rel=1e-9)
    assert np.allclose(found.inertia, R @ np.diag(box_inertia(30.0, SIZE)) @ R.T, rtol=1e-6)
    moments, axes = found.principal()
    assert moments == pytest.approx(np.sort(box_inertia(30.0, SIZE)), rel=1e-6)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_hull_is_a_solid() -> None:
    assert hull_properties(box().vertices).volume == pytest.approx(0.03, rel=1e-9)
    with pytest.raises(ValueError, match="coplanar"):
        hull_properties(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], dtype=float))


def test_two_halves_make_the_whole() -> None:
    half = SIZE * [0.5, 1, 1]
    parts = []
    for side in (-1, 1):
        mesh = trimesh.creation.box(half)
        parts.append(mass_properties(mesh.vertices + [side * half[0] / 2, 0, 0], mesh.faces))
    whole = combined(parts)
    assert whole.mass == pytest.approx(0.03)
    assert np.allclose(whole.inertia, np.diag(box_inertia(0.03, SIZE)), rtol=1e-9, atol=1e-12)
