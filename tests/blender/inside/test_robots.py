"""URDF and SDF in Blender: random robots come in where their file states, and go out as what stands in Blender."""

import xml.etree.ElementTree as ElementTree

import bpy
import numpy as np
import pytest
from adf_studio.ligature.adf import Resolver
from adf_studio.ligature.authoring.robot import (
    Joint,
    Link,
    PlacedShape,
    Robot,
    read_sdf,
    read_urdf,
    sdf_text,
    urdf_text,
)
from adf_studio.ligature.authoring.shapes import Shape
from adf_studio.ligature.mesh import load_mesh
from adf_studio.ligature.mesh.inertia import box_properties
from adf_studio.poses import inertial_frame, relative_pose, rest_pose

from .chains import random_chain
from .scene import body, model, scene_print

SEEDS = range(5)
WRITERS = {"urdf": (urdf_text, read_urdf), "sdf": (sdf_text, read_sdf)}


def pose(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    T = np.eye(4)
    T[:3, :3] = q * np.sign(np.linalg.det(q))
    T[:3, 3] = rng.uniform(-0.5, 0.5, 3)
    return T


def random_robot(rng):
    links, joints = [], []
    for n in range(rng.integers(2, 7)):
        solid = box_properties(rng.uniform(0.02, 0.3, 3), 1000.0).placed(pose(rng))
        looks = tuple(
            PlacedShape(pose(rng), Shape("BOX", size=tuple(rng.uniform(0.01, 0.2, 3))), (1.0, 0.5, 0.25, 1.0))
            for _ in range(2)
        )
        links.append(Link(f"link{n}", np.eye(4) if n == 0 else pose(rng), None if n == 0 else solid, looks, looks))
        if n:
            axis = rng.normal(size=3)
            kind = str(rng.choice(["revolute", "prismatic", "fixed"]))
            limits = (None, None) if kind == "fixed" else (-0.5, 0.75)
            parent = f"link{rng.integers(0, n)}"
            joints.append(Joint(f"joint{n}", kind, parent, f"link{n}", pose(rng), axis / np.linalg.norm(axis), *limits))
    return Robot("arm", tuple(links), tuple(joints))


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_robot_stands_in_blender_as_its_file_states_and_goes_out_again(tmp_path, seed, kind):
    write, read = WRITERS[kind]
    source = tmp_path / f"arm.{kind}"
    source.write_text(write(random_robot(np.random.default_rng(seed)))[0])
    assert bpy.ops.adf.import_robot(filepath=str(source)) == {"FINISHED"}
    robot = read(source)
    for link in robot.links:
        obj = bpy.data.objects[link.name]
        np.testing.assert_allclose(rest_pose(obj), link.T, atol=1e-5)
        assert obj.adf.body.mass == pytest.approx(link.solid.mass if link.solid else 0.0, rel=1e-6)
        uses = [c.adf.shape.use for c in obj.children if c.adf.role == "SHAPE"]
        assert sorted(uses) == ["COLLISION"] * 2 + ["VISUAL"] * 2
        if link.solid is not None:
            np.testing.assert_allclose(inertial_frame(obj)[:3, 3], link.solid.centre, atol=1e-5)
    for joint in (joint for joint in robot.joints if joint.parent):  # others hold a link to the world: mass 0
        obj = bpy.data.objects[joint.name]
        np.testing.assert_allclose(rest_pose(obj)[:3, 3], joint.T[:3, 3], atol=1e-5)
        if joint.kind != "fixed":
            axis = rest_pose(obj)[:3, 0 if joint.kind == "prismatic" else 2]
            np.testing.assert_allclose(axis, joint.T[:3, :3] @ joint.axis, atol=1e-5)
            assert (obj.adf.joint.joint_limits_low, obj.adf.joint.joint_limits_high) == pytest.approx((-0.5, 0.75))
    before = scene_print()
    target = tmp_path / "out" / f"again.{kind}"
    target.parent.mkdir()
    assert bpy.ops.adf.export_robot(filepath=str(target), collection="arm") == {"FINISHED"}
    assert scene_print() == before
    again = read(target)
    here, there = ({link.name: link for link in one.links} for one in (robot, again))
    assert set(here) == set(there)
    for name, link in here.items():
        if link.solid is not None:
            one, two = link.solid.placed(link.T), there[name].solid.placed(there[name].T)
            np.testing.assert_allclose(two.centre, one.centre, atol=2e-5)
            np.testing.assert_allclose(two.inertia, one.inertia, atol=1e-5 * np.trace(one.inertia))
    assert {(j.name, j.kind, j.parent, j.child) for j in again.joints} >= {
        (j.name, j.kind, j.parent, j.child) for j in robot.joints
    }


@pytest.mark.parametrize("seed", SEEDS)
def test_a_chain_of_blender_goes_out_with_its_meshes_and_what_is_lost_is_listed(tmp_path, seed):
    bodies, joints = random_chain(seed)
    target = tmp_path / "chain.urdf"
    assert bpy.ops.adf.export_robot(filepath=str(target)) == {"FINISHED"}
    robot = read_urdf(target)
    links = {link.name: link for link in robot.links}
    for obj in bodies:
        link = links[obj.name]
        seen = next(look for look in link.visuals)
        mesh = load_mesh(tmp_path / seen.shape.name, Resolver([tmp_path]))
        T = link.T @ seen.T_link
        points = mesh.vertices @ T[:3, :3].T + T[:3, 3]
        world = np.array([obj.matrix_world @ v.co for v in obj.data.vertices])
        np.testing.assert_allclose(points.min(axis=0), world.min(axis=0), atol=1e-4)
        np.testing.assert_allclose(points.max(axis=0), world.max(axis=0), atol=1e-4)
        assert len(link.collisions) >= 1
        touched, child = link.collisions[0], next(c for c in obj.children if c.adf.role == "SHAPE")
        if isinstance(touched.shape, Shape) and child.adf.shape.kind == "BOX":
            place = link.T @ touched.T_link
            np.testing.assert_allclose(place[:3, 3], (rest_pose(obj) @ relative_pose(obj, child))[:3, 3], atol=1e-4)
    report = bpy.data.texts["Converted Robot"].as_string()
    assert "1 ghost object is left out" in report and "1 sensor is left out" in report
    for joint in joints:
        kind = joint.adf.joint.type
        found = next((j for j in robot.joints if j.name == joint.name.replace(" ", "_")), None)
        if kind == "six dof":
            assert found is None and f"joint '{joint.name}' is six dof" in report
        else:
            assert found.kind == {"torsion spring": "revolute", "linear spring": "prismatic"}.get(kind, kind)
    ElementTree.parse(target)  # as any reader has it


def test_files_of_others_are_replaced_with_consent_only(tmp_path):
    model()
    body("part")
    target = tmp_path / "part.urdf"
    target.write_text("of somebody else")
    with pytest.raises(RuntimeError, match="would be replaced"):
        bpy.ops.adf.export_robot(filepath=str(target))
    assert target.read_text() == "of somebody else" and [p.name for p in tmp_path.iterdir()] == ["part.urdf"]
    assert bpy.ops.adf.export_robot(filepath=str(target), replace=True) == {"FINISHED"}
    assert bpy.ops.adf.export_robot(filepath=str(target)) == {"FINISHED"}  # its own now


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("r.urdf", "<robot", "not well-formed XML"),
        ("r.sdf", "<sdf><model name='m'><link/></model></sdf>", "<link>: it has no name"),
        ("r.stl", "", "neither .urdf nor .sdf"),
        ("gone.urdf", None, "No such file"),
    ],
)
def test_a_file_that_is_no_robot_leaves_the_scene_alone(tmp_path, name, content, words):
    if content is not None:
        (tmp_path / name).write_text(content)
    before = scene_print()
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.adf.import_robot(filepath=str(tmp_path / name))
    assert scene_print() == before
