"""Divided triangles: the same surface, closed where it was closed, without long edges or without crossings."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from ligature.mesh.surface import open_edges, weld
from ligature.render.geometry import Triangles, box, flat_shaded
from ligature.render.refine import faces_of, split_at, split_edges


def ball(radius: float = 0.01, flat: bool = False) -> Triangles:
    mesh = trimesh.creation.icosphere(1, radius)
    if flat:
        return flat_shaded(mesh.vertices, np.asarray(mesh.faces, dtype=np.int32))
    vertices = np.asarray(mesh.vertices)
    return Triangles(vertices, vertices / radius, np.abs(vertices[:, :2]), np.asarray(mesh.faces, dtype=np.int32))


def surface(number: int, size: tuple[float, float, float]) -> Triangles:
    return [box(np.array(size)), ball(size[0]), ball(size[1], True)][number]


def volume(t: Triangles) -> float:
    return float(trimesh.Trimesh(t.positions, t.faces, process=False).volume)


def area(t: Triangles) -> float:
    return float(trimesh.Trimesh(t.positions, t.faces, process=False).area)


def openings(t: Triangles) -> int:
    return open_edges(weld(np.round(t.positions, 12), t.faces)[1])


SIZES = st.tuples(*[st.floats(0.005, 0.05)] * 3)


@given(number=st.integers(0, 2), size=SIZES, length=st.floats(0.002, 0.02))
def test_edges_become_short_and_the_surface_stays(number, size, length):
    before = surface(number, size)
    after = split_edges(before, length, 1_000_000)
    ends = after.positions[after.faces]
    assert np.linalg.norm(ends - np.roll(ends, 1, axis=1), axis=2).max() <= length
    assert openings(after) == 0
    assert area(after) == pytest.approx(area(before))
    assert volume(after) == pytest.approx(volume(before))
    assert np.linalg.norm(after.normals, axis=1) == pytest.approx(1.0)


@given(number=st.integers(0, 2), size=SIZES, axis=st.integers(0, 2), share=st.floats(-0.9, 0.9))
def test_no_triangle_passes_through_the_plane(number, size, axis, share):
    before = surface(number, size)
    place = share * before.positions[:, axis].max()
    after = split_at(before, axis, place)
    height = after.positions[after.faces][:, :, axis] - place
    assert not ((height.min(axis=1) < -1e-8) & (height.max(axis=1) > 1e-8)).any()
    assert openings(after) == 0
    assert area(after) == pytest.approx(area(before))
    assert volume(after) == pytest.approx(volume(before))


def test_at_most_so_many_faces_are_made():
    assert len(split_edges(box(np.ones(3)), 1e-3, 5000).faces) <= 5000


def test_coordinates_of_pictures_are_divided_as_places_are():
    flat = Triangles(
        np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0]]), np.tile([0.0, 0, 1], (3, 1)), np.array([[0.0, 0], [1, 0], [0, 1]]),
        np.array([[0, 1, 2]], dtype=np.int32),
    )  # fmt: skip
    fine = split_at(split_edges(flat, 0.1, 10_000), 0, 0.333)
    assert fine.uvs == pytest.approx(fine.positions[:, :2] * [0.5, 1.0])


def test_faces_that_are_kept_keep_their_corners():
    before = box(np.ones(3))
    after = faces_of(before, np.arange(len(before.faces)) < 4)
    assert after.positions[after.faces] == pytest.approx(before.positions[before.faces[:4]])
    assert len(after.positions) == len(np.unique(before.faces[:4]))
