"""Signed distances of points to shapes against brute force."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from ligature.mesh.distance import BOX, CAPSULE, CONE, CYLINDER, HULL, SPHERE, signed_distance
from ligature.mesh.hulls import hull_planes

SHAPES = {
    BOX: ((0.4, 0.6, 1.0), trimesh.creation.box((0.4, 0.6, 1.0))),
    SPHERE: ((0.5, 0, 0), trimesh.creation.icosphere(5, 0.5)),
    CYLINDER: ((0.3, 0.8, 0), trimesh.creation.cylinder(0.3, 0.8, sections=256)),
    CAPSULE: ((0.2, 1.0, 0), trimesh.creation.capsule(0.6, 0.2, count=(128, 128))),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_distance_and_normal_agree_with_the_surface(kind: int) -> None:
    size, mesh = SHAPES[kind]
    if kind == CAPSULE:
        mesh.vertices -= mesh.bounds.mean(axis=0)
    rng, normal, none = np.random.default_rng(kind), np.empty(3), np.zeros((0, 4))
    points = rng.uniform(-1, 1, size=(300, 3))
    surface, _ = trimesh.sample.sample_surface(mesh, 200_000, seed=1)
    from scipy.spatial import cKDTree

    nearest = cKDTree(surface).query(points)[0]
    for point, gap in zip(points, nearest, strict=True):
        d = signed_distance(kind, np.array(size, dtype=float), none, point, normal)
        assert abs(d) == pytest.approx(gap, abs=0.01)
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        step = signed_distance(kind, np.array(size, dtype=float), none, point + 1e-6 * normal, np.empty(3))
        assert step >= d - 1e-12


def test_a_cone_is_negative_inside_and_positive_outside() -> None:
    size, none, normal = np.array([0.5, 1.0, 0.0]), np.zeros((0, 4)), np.empty(3)
    assert signed_distance(CONE, size, none, np.array([0.0, 0.0, -0.4]), normal) < 0
    assert signed_distance(CONE, size, none, np.array([0.0, 0.0, 0.6]), normal) > 0
    assert signed_distance(CONE, size, none, np.array([0.4, 0.0, 0.3]), normal) > 0


def test_a_hull_is_its_planes_and_a_flat_one_is_a_slab() -> None:
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    normal = np.empty(3)
    assert signed_distance(HULL, np.zeros(3), hull_planes(cube), np.array([0.5, 0.5, 1.25]), normal) == pytest.approx(
        0.25
    )
    assert normal == pytest.approx([0, 0, 1])
    square = hull_planes(cube[cube[:, 2] == 0])
    assert signed_distance(HULL, np.zeros(3), square, np.array([0.5, 0.5, 0.1]), normal) == pytest.approx(0.1)
    assert signed_distance(HULL, np.zeros(3), square, np.array([0.5, 0.5, 0.0]), normal) == pytest.approx(0.0)
