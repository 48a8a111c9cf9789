"""Random chains: mirrored, posed, given gains. What is compared is where points of the bodies are in the world."""

import json

import bpy
import numpy as np
import pytest
from adf_studio.batch_operators import moved_inertia
from adf_studio.ligature.adf import Resolver, read_any
from adf_studio.mesh_reading import points_of
from adf_studio.mirroring import mirrored_name
from adf_studio.poses import rest_pose
from adf_studio.preview_operators import behind, motion_along, ranges_of, show, shown
from adf_studio.solids import own_solid
from adf_studio.write_file import export_file

from .chains import random_chain
from .scene import body, model, scene_print, select

SEEDS = range(6)


def world_points(obj):
    """The object's mesh in the world, in an order that does not depend on that of its vertices."""
    points = points_of(own_solid(obj))[0]
    T = rest_pose(obj)
    points = points @ T[:3, :3].T + T[:3, 3]
    return points[np.lexsort(np.round(points, 4).T)]


def near(a, b, size=2e-5):
    np.testing.assert_allclose(a, b, atol=size)


def sorted_rows(points):
    return points[np.lexsort(np.round(points, 4).T)]


def reflected(points, axis):
    flip = np.ones(3)
    flip[axis] = -1.0
    return sorted_rows(points * flip)


def partner(obj):
    """What came of an object on the other side."""
    return bpy.data.objects[mirrored_name(obj.name)]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_chain_is_mirrored_at_rest_and_in_every_position(tmp_path, seed):
    """At the same positions of both chains' joints, bodies, shapes and ghosts of one are mirror images of the other's."""
    bodies, joints = random_chain(seed)
    axis = seed % 3
    select(bodies[0])
    assert bpy.ops.adf.mirror(across="XYZ"[axis]) == {"FINISHED"}
    collection = bpy.context.scene.adf.models[0].collection
    assert {obj.adf.role for obj in bpy.context.selected_objects} >= {"BODY", "JOINT", "GHOST_OBJECT", "SENSOR"}
    rng = np.random.default_rng(seed)
    for round_ in range(3):
        for one in bodies:
            near(world_points(partner(one)), reflected(world_points(one), axis))
            for part, image in zip(
                [c for c in one.children if c.adf.role in ("SHAPE", "HULL")],
                [c for c in partner(one).children if c.adf.role in ("SHAPE", "HULL")],
                strict=True,
            ):
                near(world_points(image), reflected(world_points(part), axis))
        ghost = bpy.data.objects["feeler_left"]
        shape, image = (next(c for c in g.children if c.adf.role == "SHAPE") for g in (ghost, partner(ghost)))
        near(world_points(image), reflected(world_points(shape), axis))
        positions = {}
        for joint in joints:
            image = next(o for o in collection.all_objects if o.adf.role == "JOINT" and
                         o.adf.child_object is partner(joint.adf.child_object))  # fmt: skip
            free, other = ranges_of(joint), ranges_of(image)
            if not free:
                continue
            name = str(rng.choice(list(free)))
            share = rng.uniform()
            low, high = free[name]
            value = low + share * (high - low)
            turned_round = joint.adf.joint.type.startswith("six dof") and name in ("TZ", "RX", "RY")
            assert other[name] == pytest.approx((-high, -low) if turned_round else (low, high), abs=1e-6)
            positions[joint.name] = {name: value}
            positions[image.name] = {name: -value if turned_round else value}
        if round_ < 2:
            show(bpy.context.scene, positions)
            bpy.context.view_layer.update()
    bpy.ops.adf.rest_pose()
    export_file(collection, tmp_path / "m.yaml")
    document = read_any(tmp_path / "m.yaml", Resolver([tmp_path]))
    assert document.ok and len(document.elements("bodies")) == 2 * len(bodies)
    stated = {b.text("name"): b for b in document.elements("bodies")}
    for one in bodies:
        a, b = stated[one.name], stated[mirrored_name(one.name)]
        assert a.number("mass") == b.number("mass")
        assert sorted(a.number(f"inertia.i{x}") for x in "xyz") == pytest.approx(
            sorted(b.number(f"inertia.i{x}") for x in "xyz")
        )


def test_names_change_sides():
    pairs = {"left arm": "right arm", "arm_L": "arm_R", "arm.R.001": "arm.L.001", "Left": "Right", "hand-l": "hand-r"}
    assert {name: mirrored_name(name) for name in pairs} == pairs
    assert mirrored_name("Lever") == "Lever_mirrored"  # an L that is part of a word is none
    assert {mirrored_name(other): other for other in pairs.values()} == pairs


@pytest.mark.parametrize("seed", SEEDS)
def test_a_named_pose_moves_all_its_joints_and_comes_back(seed):
    """Joint by joint, from the root on: the child's motion in its parent is that of the joint alone."""
    bodies, joints = random_chain(seed, kinds=("revolute", "prismatic", "six dof"))
    before = scene_print()
    rest = {obj: rest_pose(obj) for obj in bodies}
    frames = {joint: rest_pose(joint) for joint in joints}
    rng = np.random.default_rng(seed)
    for joint in joints:
        bpy.context.view_layer.objects.active = joint
        name = str(rng.choice(list(ranges_of(joint))))
        bpy.ops.adf.move_joint(axis=name, part=float(rng.uniform()))
    positions = shown(bpy.context.scene)
    assert set(positions) == {joint.name for joint in joints}
    moved = {obj: rest_pose(obj) for obj in bodies}
    for joint in joints:
        (name, value), parent, child = *positions[joint.name].items(), joint.adf.parent_object, joint.adf.child_object
        T_parent_joint = np.linalg.inv(rest[parent]) @ frames[joint]
        motion = T_parent_joint @ motion_along(name, value) @ np.linalg.inv(T_parent_joint)
        near(np.linalg.inv(moved[parent]) @ moved[child], motion @ np.linalg.inv(rest[parent]) @ rest[child])
    assert bpy.ops.adf.store_pose(name="work") == {"FINISHED"}
    bpy.ops.adf.rest_pose()
    assert json.loads(bpy.context.scene.adf.models[0].collection.adf.poses["work"].positions)
    bpy.context.view_layer.objects.active = joints[-1]
    at_rest = scene_print()
    bpy.ops.adf.show_pose(name="work")
    for obj in bodies:
        near(rest_pose(obj), moved[obj])
    with pytest.raises(RuntimeError, match="A joint is previewed"):
        bpy.ops.adf.export_file(filepath="/tmp/never.yaml")
    bpy.ops.adf.rest_pose()
    assert scene_print() == at_rest and before is not None
    bpy.ops.adf.remove_pose(name="work")
    assert not len(bpy.context.scene.adf.models[0].collection.adf.poses)


@pytest.mark.parametrize("seed", SEEDS)
def test_gains_are_those_of_the_inertia_that_a_joint_moves(seed):
    """The inertia about an axis is what the kinetic energy of a turn about it shows, point by point of the bodies."""
    bodies, joints = random_chain(seed, kinds=("revolute", "prismatic"))
    select(*joints)
    bpy.ops.adf.set_gains(output="FORCE", frequency=2.0, damping=0.7)
    omega = 4.0 * np.pi
    for joint in joints:
        T, group = rest_pose(joint), joint.adf.joint
        expected = 0.0
        for one in behind(joint):
            own = one.adf.body
            frame = rest_pose(one) @ next(
                np.array(c.matrix_basis) for c in one.children if c.adf.role == "INERTIAL"
            )  # the frame is placed in the body without its scale
            if group.type == "prismatic":
                expected += own.mass
                continue
            # six points that have the body's mass and moments, and their speed at one radian a second
            moments = np.array([getattr(own, f"inertia_i{a}") for a in "xyz"])
            squares = np.maximum(moments.sum() / 2.0 - moments, 0.0) / own.mass
            points = np.concatenate([s * np.sqrt(3.0 * squares)[:, None] * np.eye(3) for s in (1.0, -1.0)])
            places = points @ frame[:3, :3].T + frame[:3, 3]
            speed = np.cross(T[:3, 2], places - T[:3, 3])
            expected += own.mass / 6.0 * float((speed**2).sum())
        assert moved_inertia(joint) == pytest.approx(expected, rel=1e-4)
        assert group.controller_p == pytest.approx(expected * omega**2, rel=1e-4)
        assert group.controller_d == pytest.approx(2.0 * 0.7 * expected * omega, rel=1e-4)
        assert group.controller_output_type == "FORCE"


@pytest.mark.parametrize(("motor", "strength"), [("SOFT", 2.0), ("MEDIUM", 5.0), ("STIFF", 20.0)])
def test_motors_of_the_library_hold_their_load_as_many_times_as_they_state(motor, strength):
    """A beam of two weights at 0.2 and 0.4 m from its hinge, held level."""
    model()
    base, near_one, far_one = body("base"), body("near", location=(0.2, 0, 0)), body("far", location=(0.4, 0, 0))
    near_one.adf.body.mass, far_one.adf.body.mass = 1.5, 0.5
    for parent, child in ((base, near_one), (near_one, far_one)):
        select(child, parent)
        bpy.ops.adf.connect(type="fixed" if child is far_one else "revolute", axis="Y")
    hinge = next(o for o in bpy.data.objects if o.adf.role == "JOINT" and o.adf.child_object is near_one)
    hinge.location = (0.0, 0.0, 0.0)
    select(hinge)
    bpy.ops.adf.set_gains(motor=motor)
    level = 9.81 * (1.5 * 0.2 + 0.5 * 0.4)
    assert hinge.adf.joint.max_motor_impulse == pytest.approx(strength * level * 1e-3, rel=1e-5)


def test_a_joint_that_starts_away_from_zero_keeps_its_travel_on_the_other_side(tmp_path):
    file = tmp_path / "m.yaml"
    file.write_text(
        "bodies: [BODY a, BODY b]\njoints: [JOINT j]\n"
        "BODY a: {name: a, mass: 1.0, collision shape: BOX, collision geometry: {x: 1, y: 1, z: 1}}\n"
        "BODY b: {name: b_left, mass: 1.0, collision shape: BOX, collision geometry: {x: 1, y: 1, z: 1},\n"
        "  location: {position: {x: 0, y: 1, z: 0}, orientation: {r: 0, p: 0, y: 0.5}}}\n"
        "JOINT j: {name: j, type: revolute, parent: BODY a, child: BODY b, parent pivot: {x: 0, y: 1, z: 0},\n"
        "  child pivot: {x: 0, y: 0, z: 0}, parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1},\n"
        "  joint limits: {low: -1, high: 2}}\n"
    )
    bpy.ops.adf.import_file(filepath=str(file))
    select(bpy.data.objects["b_left"])
    bpy.ops.adf.mirror(across="X")
    image = next(o for o in bpy.data.objects if o.adf.role == "JOINT" and o.name != "j").adf.joint
    assert (image.joint_limits_low, image.joint_limits_high) == pytest.approx((-1.5, 1.5), abs=1e-6)


def test_what_cannot_be_mirrored_or_posed_is_reported():
    model()
    part = body("part")
    select(part)
    with pytest.raises(RuntimeError, match="preview joints of it"):
        bpy.ops.adf.store_pose(name="x")
    part.select_set(False)
    with pytest.raises(RuntimeError, match="Select bodies, or joints"):
        bpy.ops.adf.mirror()


@pytest.mark.parametrize("seed", SEEDS)
def test_mirroring_renames_nothing_that_was_there(seed):
    """Both sides are there already, and copies of them: the image of one finds its name taken."""
    model()
    rng = np.random.default_rng(seed)
    words = ("left claw", "right claw", "tip.L", "tip.R", "left " + "x" * 58)
    bodies = [body(words[rng.integers(len(words))], location=rng.normal(size=3)) for _ in range(12)]
    names, meshes = [b.name for b in bodies], [b.data.name for b in bodies]
    select(*[b for b in bodies if rng.random() < 0.6], bodies[0])
    assert bpy.ops.adf.mirror(across="X") == {"FINISHED"}
    assert [b.name for b in bodies] == names
    assert [b.data.name for b in bodies] == meshes
