"""Closed meshes filled with cells: volumes, holes, and surfaces that move along."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.mesh.grid import Cut
from ligature.mesh.voxels import embed, voxelise
from ligature.model.material import TissueMaterial
from ligature.tissue.elastic import ElasticGrid


def _volume(grid):
    return grid.sizes.prod(axis=1).sum()


@settings(max_examples=20, deadline=None)
@given(
    size=st.tuples(*[st.floats(0.01, 0.05)] * 3), at=st.tuples(*[st.floats(-0.2, 0.2)] * 3),
    cell=st.floats(0.003, 0.02),
)  # fmt: skip
def test_box_is_filled_exactly_and_its_vertices_lie_on_the_corners(size, at, cell):
    box = trimesh.creation.box(size)
    box.apply_translation(at)
    grid, bound = voxelise(box.vertices, box.faces, cell)
    assert _volume(grid) == pytest.approx(np.prod(size))
    assert (grid.sizes <= cell * (1 + 1e-6)).all()
    np.testing.assert_allclose(bound.positions(grid.nodes), box.vertices, atol=1e-12)


@pytest.mark.parametrize("name", ["sphere", "ring", "shell", "concave"])
def test_volume_approaches_that_of_the_mesh(name):
    mesh = {
        "sphere": lambda: trimesh.creation.icosphere(3, 0.02),
        "ring": lambda: trimesh.creation.torus(0.02, 0.007),
        "shell": lambda: trimesh.util.concatenate(
            [trimesh.creation.icosphere(3, 0.02), _inverted(trimesh.creation.icosphere(3, 0.01))]
        ),
        "concave": lambda: trimesh.creation.annulus(0.008, 0.02, 0.015),
    }[name]()
    errors = []
    for cell in (0.005, 0.0025):
        grid, bound = voxelise(mesh.vertices, mesh.faces, cell)
        errors.append(abs(_volume(grid) / mesh.volume - 1.0))
        np.testing.assert_allclose(bound.positions(grid.nodes), mesh.vertices, atol=1e-12)
        np.testing.assert_allclose(bound.weights.sum(axis=1), 1.0)
    assert errors[1] < 0.12


def _inverted(mesh):
    mesh.invert()
    return mesh


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_embedded_surface_follows_any_affine_motion(seed):
    rng = np.random.default_rng(seed)
    mesh = trimesh.creation.torus(0.02, 0.007, major_sections=12, minor_sections=8)
    grid, bound = voxelise(mesh.vertices, mesh.faces, 0.006)
    A, b = np.eye(3) + 0.3 * rng.normal(size=(3, 3)), rng.normal(size=3)
    np.testing.assert_allclose(bound.positions(grid.nodes @ A.T + b), mesh.vertices @ A.T + b, atol=1e-9)


def test_cut_mesh_parts_and_its_surface_with_it():
    box = trimesh.creation.box((0.04, 0.02, 0.01)).subdivide().subdivide()
    mask = np.zeros((8, 2), dtype=bool)
    mask[2:6, 1] = True
    grid, bound = voxelise(box.vertices, box.faces, 0.005, cuts=[Cut(1, 2, mask)])
    elastic = ElasticGrid(grid, [TissueMaterial(1e5)], grid.site[:, 2] == 0)
    load = np.zeros_like(elastic.x)
    load[grid.lips[:, 0], 1], load[grid.lips[:, 1], 1] = -0.02, 0.02
    for _ in range(100):
        elastic.advance(elastic.predict(load))
    gap = np.diff(elastic.x[grid.lips], axis=1)[:, 0, 1]
    assert gap.min() > 1e-4
    moved = bound.positions(elastic.x) - box.vertices
    assert moved[box.vertices[:, 1] > 0.003, 1].max() > 0.0 > moved[box.vertices[:, 1] < -0.003, 1].min()


def test_points_outside_are_carried_by_the_nearest_cell():
    box = trimesh.creation.box((0.02, 0.02, 0.02))
    grid, _ = voxelise(box.vertices, box.faces, 0.01)
    far = np.array([[0.013, 0.004, 0.0]])
    np.testing.assert_allclose(embed(grid, far).positions(grid.nodes), far, atol=1e-12)


def test_open_mesh_is_rejected():
    box = trimesh.creation.box((0.02, 0.02, 0.02))
    with pytest.raises(ValueError, match="open edges"):
        voxelise(box.vertices, box.faces[:-1], 0.01)


def test_cells_larger_than_what_the_mesh_fills_are_rejected():
    thin = trimesh.creation.box((0.1, 0.1, 0.001))
    slanted = trimesh.transformations.rotation_matrix(0.7, [1, 0.3, 0])
    thin.apply_transform(slanted)
    with pytest.raises(ValueError, match="use smaller cells"):
        voxelise(thin.vertices, thin.faces, 0.1)
