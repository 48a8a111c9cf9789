"""Boxes around shapes, against Bullet itself, and inertial frames that files leave out."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pybullet
import pytest
from ligature.mesh import box_inertia
from ligature.model.extents import estimate_size, mesh_centroid
from ligature.model.frames import frame, matrix_quaternion, pose_matrix, rpy_matrix
from ligature.model.shapes import Box, Capsule, Collider, Cone, Cylinder, Hull, Plane, Shape, Sphere, TriMesh

TURN = rpy_matrix(0.5, 0.3, -0.2)
BULLETS = {
    "box": (Box(np.array([0.2, 0.4, 0.6])), pybullet.GEOM_BOX, {"halfExtents": [[0.1, 0.2, 0.3]]}),
    "capsule": (Capsule(0.1, 0.6), pybullet.GEOM_CAPSULE, {"radii": [0.1], "lengths": [0.4]}),
    "cylinder": (Cylinder(0.1, 0.6), pybullet.GEOM_CYLINDER, {"radii": [0.1], "lengths": [0.6]}),
    "sphere": (Sphere(0.1), pybullet.GEOM_SPHERE, {"radii": [0.1]}),
}


@pytest.mark.parametrize("name", BULLETS)
def test_a_turned_shape_weighs_as_bullets_box_around_it(name: str) -> None:
    shape, kind, sizes = BULLETS[name]
    client = pybullet.connect(pybullet.DIRECT)
    try:
        place = {
            "collisionFramePositions": [[0, 0, 0]],
            "collisionFrameOrientations": [matrix_quaternion(TURN).tolist()],
        }
        made = pybullet.createCollisionShapeArray(shapeTypes=[kind], **sizes, **place, physicsClientId=client)
        body = pybullet.createMultiBody(3.0, made, physicsClientId=client)
        bullets = pybullet.getDynamicsInfo(body, -1, physicsClientId=client)[2]
    finally:
        pybullet.disconnect(client)
    size = estimate_size((Collider(shape, frame(TURN, (0, 0, 0))),), np.eye(4), 0.001)
    assert size is not None
    assert np.allclose(box_inertia(3.0, size), bullets, rtol=1e-6)


def test_the_box_spans_all_shapes_along_the_axes_of_the_inertial_frame() -> None:
    balls = tuple(Collider(Sphere(0.1), frame(np.eye(3), (x, 0, 0))) for x in (-1.0, 2.0))
    assert np.allclose(estimate_size(balls, np.eye(4), 0.0), (3.2, 0.2, 0.2))
    quarter = pose_matrix((5, 5, 5), (0, 0, np.pi / 2))
    assert np.allclose(estimate_size(balls, quarter, 0.0), (0.2, 3.2, 0.2))


@pytest.mark.parametrize("seed", range(10))
def test_shapes_anywhere_span_the_box_of_their_corners_wherever_the_inertial_frame_is(seed: int) -> None:
    rng = np.random.default_rng(seed)
    parts, corners = [], []
    for kind in rng.permutation(["mesh", "box", "mesh"]):
        T = frame(np.eye(3), rng.uniform(-2, 2, 3))
        points = rng.uniform(-1, 3, (8, 3))
        if kind == "box":
            size = rng.uniform(0.1, 1.0, 3)
            points = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
        shape: Shape = Box(size) if kind == "box" else TriMesh(points, np.array([[0, 1, 2]], dtype=np.int32))
        parts.append(Collider(shape, T))
        corners.append(points + T[:3, 3])
    found = estimate_size(tuple(parts), frame(np.eye(3), rng.uniform(-5, 5, 3)), 0.0)
    assert found is not None and np.allclose(found, np.ptp(np.concatenate(corners), axis=0))


def test_a_mesh_is_larger_by_its_margin_and_a_hull_by_bullets_default_too() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
    faces = np.array([[0, 1, 2]], dtype=np.int32)
    mesh, hull = (Collider(shape, np.eye(4)) for shape in (TriMesh(corners, faces), Hull(corners)))
    assert np.allclose(estimate_size((mesh,), np.eye(4), 0.01), np.array([1, 2, 3]) + 2 * 0.01)
    assert np.allclose(estimate_size((hull,), np.eye(4), 0.01), np.array([1, 2, 3]) + 2 * (0.01 + 0.04))


def test_a_cone_reaches_from_rim_to_apex_and_two_margins_beyond() -> None:
    upright = estimate_size((Collider(Cone(0.1, 0.5), np.eye(4)),), np.eye(4), 0.01)
    assert np.allclose(upright, np.array([0.2, 0.2, 0.5]) + 4 * 0.01)
    lying = Collider(Cone(0.1, 0.5), frame(rpy_matrix(0, np.pi / 2, 0), (0, 0, 0)))
    assert np.allclose(estimate_size((lying,), np.eye(4), 0.0), (0.5, 0.2, 0.2))


@pytest.mark.parametrize("seed", range(10))
def test_a_cone_anywhere_spans_the_points_of_its_rim_and_its_apex(seed: int) -> None:
    rng = np.random.default_rng(seed)
    radius, height = rng.uniform(0.1, 1.0, 2)
    angles = np.linspace(0.0, 2.0 * np.pi, 20_000)
    rim = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(len(angles), -height / 2)])
    T = frame(rpy_matrix(*rng.uniform(-np.pi, np.pi, 3)), rng.uniform(-2, 2, 3))
    points = np.vstack([rim, (0.0, 0.0, height / 2)]) @ T[:3, :3].T
    found = estimate_size((Collider(Cone(radius, height), T),), np.eye(4), 0.0)
    assert found is not None and np.allclose(found, np.ptp(points, axis=0), atol=1e-6)


@pytest.mark.parametrize("shapes", [(), (Collider(Plane(np.array([0.0, 0, 1]), 0.0), np.eye(4)),)])
def test_nothing_finite_has_no_box(shapes: tuple[Collider, ...]) -> None:
    assert estimate_size(shapes, np.eye(4), 0.001) is None


def test_primitives_have_no_centroid_of_a_mesh() -> None:
    shape: Shape = Sphere(1.0)
    assert mesh_centroid((Collider(shape, np.eye(4)),)) is None


TETRAHEDRON = "v 1 0 0\nv 5 0 0\nv 1 4 0\nv 1 0 4\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def body_with_mesh(folder: Path, keys: str) -> ligature.Scene:
    (folder / "t.obj").write_text(TETRAHEDRON)
    (folder / "m.yaml").write_text(f"bodies: [B]\nB: {{name: b, mesh: t.obj, {keys}}}\n")
    return ligature.load(folder / "m.yaml")


def test_without_inertial_offset_the_frame_is_at_the_meshs_centroid_and_shapes_stay_on_the_visual(
    tmp_path: Path,
) -> None:
    (body,) = body_with_mesh(tmp_path, "mass: 2").bodies
    assert np.allclose(body.T_body_inertial, frame(np.eye(3), (2, 1, 1)))
    assert np.allclose(body.colliders[0].T_body_shape, np.eye(4))
    assert np.allclose(body.inertia, box_inertia(2.0, np.full(3, 4.002)))


def test_a_given_inertial_offset_is_taken_as_it_is(tmp_path: Path) -> None:
    (body,) = body_with_mesh(tmp_path, "mass: 2, inertial offset: {position: {x: 0, y: 0, z: 1}}").bodies
    assert np.allclose(body.T_body_inertial, frame(np.eye(3), (0, 0, 1)))


def test_without_mass_the_given_inertial_offset_has_no_effect(tmp_path: Path) -> None:
    (body,) = body_with_mesh(tmp_path, "inertial offset: {position: {x: 0, y: 0, z: 1}}").bodies
    assert np.allclose(body.T_body_inertial, frame(np.eye(3), (2, 1, 1)))
