"""Primitive shapes: their meshes have their volumes, their inertias are exact, fitted ones hold the points."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.adf.frames import frame, rpy_matrix
from ligature.authoring.shapes import Shape, fitted, oriented, shape_mesh, shape_properties, shapes_properties
from ligature.mesh.inertia import mass_properties

SHAPES = [
    Shape("BOX", size=(1.0, 2.0, 3.0)),
    Shape("SPHERE", radius=0.4),
    *(Shape(kind, radius=0.3, height=1.5, axis=axis) for kind in ("CYLINDER", "CAPSULE", "CONE") for axis in "XYZ"),
]


def triangles(faces: list[tuple[int, ...]]) -> np.ndarray:
    return np.array([(f[0], f[i], f[i + 1]) for f in faces for i in range(1, len(f) - 1)], dtype=np.int32)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: f"{s.kind} {s.axis}")
def test_the_mesh_of_a_shape_is_closed_outward_and_nearly_as_heavy(shape: Shape) -> None:
    vertices, faces = shape_mesh(shape)
    mesh, exact = mass_properties(vertices, triangles(faces)), shape_properties(shape)
    a, b, c = (vertices[triangles(faces)[:, i]] for i in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0.0
    assert mesh.mass == pytest.approx(exact.mass, rel=0.06)
    np.testing.assert_allclose(mesh.centre, exact.centre, atol=1e-9)
    np.testing.assert_allclose(mesh.inertia / mesh.mass, exact.inertia / exact.mass, rtol=0.08, atol=1e-9)


@pytest.mark.parametrize(
    ("shape", "across", "along"),
    [
        (Shape("CYLINDER", radius=0.1, height=0.4), (3 * 0.01 + 0.16) / 12, 0.005),
        (Shape("CONE", radius=0.1, height=0.4), 3 / 80 * (4 * 0.01 + 0.16), 0.003),
        (Shape("SPHERE", radius=0.1), 0.004, 0.004),
    ],
)
def test_inertia_per_mass_has_its_closed_form(shape: Shape, across: float, along: float) -> None:
    found = shape_properties(shape, density=700.0)
    np.testing.assert_allclose(np.diag(found.inertia) / found.mass, [across, across, along], rtol=1e-12)


def test_a_turned_shifted_shape_obeys_steiner_and_rotation() -> None:
    shape, R, p = Shape("BOX", size=(1.0, 2.0, 3.0)), rpy_matrix(0.3, -0.4, 1.0), np.array([5.0, -1.0, 2.0])
    own = shape_properties(shape)
    placed = shapes_properties([(shape, frame(R, p)), (Shape("SPHERE", radius=0.5), np.eye(4))])
    ball = shape_properties(Shape("SPHERE", radius=0.5))
    centre = own.mass * p / (own.mass + ball.mass)
    shift = lambda m, d: m * (d @ d * np.eye(3) - np.outer(d, d))  # noqa: E731
    expected = R @ own.inertia @ R.T + shift(own.mass, p - centre) + ball.inertia + shift(ball.mass, centre)
    np.testing.assert_allclose(placed.inertia, expected, rtol=1e-9)


@pytest.mark.parametrize("kind", ["BOX", "SPHERE", "CYLINDER", "CAPSULE", "CONE"])
def test_a_fitted_shape_holds_all_points(kind: str) -> None:
    points = np.random.default_rng(3).normal(size=(200, 3)) * [1.0, 0.2, 0.3] + [5.0, 6.0, 7.0]
    shape, T = fitted(kind, points)
    vertices, faces = shape_mesh(shape)
    t = triangles(faces)
    a, b, c = (vertices[t[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    outside = ((points - T[:3, 3])[:, None, :] - a) @ np.eye(3)
    assert np.einsum("pfi,fi->pf", outside, normals).max() < 0.05  # the shown mesh lies a little inside the shape
    if kind in ("CYLINDER", "CAPSULE", "CONE"):
        assert shape.axis == "X"


def test_principal_axes_put_the_longest_along_z() -> None:
    points = np.random.default_rng(3).normal(size=(200, 3)) * [1.0, 5.0, 0.3]
    assert abs(oriented(points)[1, 2]) > 0.99
    assert np.linalg.det(oriented(points)[:3, :3]) == pytest.approx(1.0)


def test_geometry_keys_and_shapes_are_two_forms_of_one_thing() -> None:
    for shape in [*SHAPES, Shape("PLANE", normal=(0.0, 1.0, 0.0), offset=0.5)]:
        again = Shape.of(shape.kind, shape.geometry())
        assert again.geometry() == shape.geometry()
    with pytest.raises(ValueError, match="a plane has no volume"):
        shape_properties(Shape("PLANE"))
    with pytest.raises(ValueError, match="all points lie in one place"):
        fitted("BOX", np.ones((4, 3)))
