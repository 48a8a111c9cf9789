"""Surfaces of fields: where geometry knows them, closed and outward whatever the field."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from ligature.mesh.isosurface import isosurface
from ligature.mesh.surface import open_edges


@pytest.mark.parametrize("n", [12, 24, 48])
def test_the_surface_of_a_ball_is_that_of_the_ball_to_the_square_of_the_spacing(n: int) -> None:
    axis = np.linspace(-1.0, 1.0, n)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    radius = 0.7
    field = np.clip(0.5 + radius - np.sqrt(x * x + y * y + z * z), 0.0, 1.0)
    vertices, faces = isosurface(field, 0.5)
    spacing = 2.0 / (n - 1)
    vertices = vertices * spacing - 1.0
    surface = trimesh.Trimesh(vertices, faces, process=False)
    assert surface.is_watertight and surface.is_winding_consistent
    assert surface.volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=3 * (spacing / radius) ** 2)
    assert np.abs(np.linalg.norm(vertices, axis=1) - radius).max() < spacing**2
    assert np.einsum("ij,ij->i", surface.face_normals, surface.triangles_center).min() > 0.0


@settings(max_examples=100, deadline=None)
@given(
    field=arrays.arrays(float, st.tuples(*[st.integers(1, 5)] * 3), elements=st.floats(0.0, 1.0)),
    level=st.floats(0.01, 1.0),
)
def test_any_field_has_a_closed_surface_around_what_is_inside(field: np.ndarray, level: float) -> None:
    vertices, faces = isosurface(field, level)
    inside = field >= level
    assert bool(len(faces)) == bool(inside.any())
    if not len(faces):
        return
    assert open_edges(faces) == 0
    assert np.isfinite(vertices).all()
    assert (vertices >= -1.0).all() and (vertices <= np.array(field.shape)).all()
    # the winding number about each sample: 1 inside, 0 outside (solid angles: Van Oosterom and Strackee, 1983)
    for sample in np.argwhere(np.ones(field.shape, dtype=bool)):
        a, b, c = (vertices[faces[:, k]] - sample for k in range(3))
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        top = np.einsum("ij,ij->i", a, np.cross(b, c))
        dots = [np.einsum("ij,ij->i", *pair) for pair in ((a, b), (b, c), (c, a))]
        bottom = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
        if (np.abs(top) < 1e-9).any():
            continue  # on the surface to rounding
        turns = np.arctan2(top, bottom).sum() / (2 * np.pi)
        assert turns == pytest.approx(1.0 if inside[tuple(sample)] else 0.0, abs=1e-6)


@pytest.mark.parametrize("level", [0.0, -1.0, float("nan")])
def test_a_level_that_all_around_reaches_is_refused(level: float) -> None:
    with pytest.raises(ValueError, match="must be above 0"):
        isosurface(np.ones((2, 2, 2)), level)


@settings(max_examples=30, deadline=None)
@given(
    field=arrays.arrays(np.uint8, st.tuples(*[st.integers(1, 7)] * 3)),
    level=st.floats(0.5, 255.0),
    edge=st.integers(1, 5),
)
def test_parts_of_a_surface_are_the_surface(field: np.ndarray, level: float, edge: int) -> None:
    """Every triangle once, with the same corners to the bit, whatever the parts; and the normals of all of it."""
    from itertools import product

    from ligature.mesh.isosurface import part_of_isosurface

    vertices, faces = isosurface(field, level)
    found, normals = [], {}
    for low in product(*(range(-1, n, edge) for n in field.shape)):
        high = [min(a + edge, n) for a, n in zip(low, field.shape, strict=True)]
        v, n, f = part_of_isosurface(field, level, low, high)
        assert len(np.unique(f)) == len(v)
        found += [v[row].tobytes() for row in f]
        for point, normal in zip(v, n, strict=True):
            normals.setdefault(point.tobytes(), []).append(normal)
    assert sorted(found) == sorted(vertices[row].tobytes() for row in faces)
    areas = np.zeros_like(vertices)
    cross = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    for k in range(3):
        np.add.at(areas, faces[:, k], cross)
    for point, area in zip(vertices, areas, strict=True):
        length = np.linalg.norm(area)
        for normal in normals[point.tobytes()] if length > 1e-6 else ():
            assert normal == pytest.approx(area / length, abs=1e-6)
