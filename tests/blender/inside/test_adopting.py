"""Scenes of the original add-on and of Blender's own rigid bodies become models that state the same."""

import itertools
from math import radians

import bpy
import numpy as np
import pytest
from adf_studio.adopt_operators import REPORT
from adf_studio.adopting import JOINTS, ROLES, adopt
from adf_studio.ligature.adf import Resolver, read_any
from adf_studio.ligature.authoring.placement import JointKeys, child_pose, joint_pose, matrix_of
from adf_studio.poses import rest_pose, scaling, shape_of
from adf_studio.write_file import export_file

from .scene import cube, in_simulator, select
from .trees import quaternion, random_tree, turned

P = bpy.props
ITEMS = {
    "ambf_object_type": ROLES, "ambf_constraint_type": JOINTS, "ambf_constraint_axis": "XYZ",
    "ambf_collision_type": ("MESH", "SINGULAR_SHAPE", "COMPOUND_SHAPE"),
}  # fmt: skip
FIELDS = {
    **{name: lambda items=items: P.EnumProperty(items=[(i, i, "") for i in items]) for name, items in ITEMS.items()},
    "ambf_rigid_body_mass": lambda: P.FloatProperty(default=1.0),
    "ambf_rigid_body_is_static": lambda: P.BoolProperty(),
    "ambf_rigid_body_specify_inertia": lambda: P.BoolProperty(),
    **{f"ambf_rigid_body_inertia_{a}": lambda: P.FloatProperty(default=1.0) for a in "xyz"},
    "ambf_rigid_body_linear_inertial_offset": lambda: P.FloatVectorProperty(size=3),
    "ambf_rigid_body_static_friction": lambda: P.FloatProperty(default=0.5),
    "ambf_collision_groups": lambda: P.BoolVectorProperty(size=20),
    "ambf_object_parent": lambda: P.PointerProperty(type=bpy.types.Object),
    "ambf_object_child": lambda: P.PointerProperty(type=bpy.types.Object),
    "ambf_constraint_name": lambda: P.StringProperty(),
    "ambf_constraint_limits_enable": lambda: P.BoolProperty(default=True),
    "ambf_constraint_limits_lower": lambda: P.FloatProperty(default=-60.0),
    "ambf_constraint_limits_higher": lambda: P.FloatProperty(default=60.0),
    "ambf_constraint_enable_controller_gains": lambda: P.BoolProperty(),
    "ambf_constraint_controller_p_gain": lambda: P.FloatProperty(default=10.0),
    "ambf_constraint_max_motor_impulse": lambda: P.FloatProperty(default=0.05),
}  # fmt: skip


class ShapeItem(bpy.types.PropertyGroup):
    """A primitive as the specification describes it."""

    ambf_collision_shape: P.EnumProperty(items=[(i, i, "") for i in ("CONE", "CYLINDER", "CAPSULE", "SPHERE", "BOX")])
    ambf_collision_shape_radius: P.FloatProperty(default=1.0)
    ambf_collision_shape_height: P.FloatProperty(default=1.0)
    ambf_collision_shape_xyz_dims: P.FloatVectorProperty(size=3, default=(1, 1, 1))
    ambf_collision_shape_axis: P.EnumProperty(items=[(i, i, "") for i in "XYZ"])
    ambf_collision_shape_linear_offset: P.FloatVectorProperty(size=3)
    ambf_collision_shape_angular_offset: P.FloatVectorProperty(size=3, subtype="EULER")


@pytest.fixture
def original():
    """Properties as the add-on has them; they are gone once the scene is made, as where it is not enabled."""
    bpy.utils.register_class(ShapeItem)
    for name, make in FIELDS.items():
        setattr(bpy.types.Object, name, make())
    bpy.types.Object.ambf_collision_shape_prop_collection = P.CollectionProperty(type=ShapeItem)
    bpy.types.Scene.ambf_namespace = P.StringProperty(default="/ambf/env/")
    present = [True]

    def remove():
        if present[0]:
            for name in (*FIELDS, "ambf_collision_shape_prop_collection"):
                delattr(bpy.types.Object, name)
            del bpy.types.Scene.ambf_namespace
            bpy.utils.unregister_class(ShapeItem)
            present[0] = False

    yield remove
    remove()


def robot():
    """A base, a link on a joint about its Y, and a ghost, as the add-on's users make them."""
    base = cube("/ambf/env/arm/base link", 0.2)
    base.ambf_object_type, base.ambf_rigid_body_is_static = "RIGID_BODY", True
    link = cube("/ambf/env/arm/link", 0.1, (0.1, 0.2, 0.3))
    link.ambf_object_type, link.ambf_rigid_body_mass = "RIGID_BODY", 0.25
    link.ambf_rigid_body_specify_inertia = True
    link.ambf_rigid_body_inertia_x, link.ambf_rigid_body_inertia_y, link.ambf_rigid_body_inertia_z = 0.01, 0.02, 0.03
    link.ambf_rigid_body_linear_inertial_offset = (0.0, 0.0, 0.05)
    link.ambf_rigid_body_static_friction = 0.75
    link.ambf_collision_groups = [i in (0, 3) for i in range(20)]
    link.ambf_collision_type = "COMPOUND_SHAPE"
    for kind, offset in (("CAPSULE", (0.0, 0.0, 0.01)), ("BOX", (0.02, 0.0, 0.0))):
        item = link.ambf_collision_shape_prop_collection.add()
        item.ambf_collision_shape, item.ambf_collision_shape_linear_offset = kind, offset
        item.ambf_collision_shape_radius, item.ambf_collision_shape_height = 0.02, 0.08
        item.ambf_collision_shape_axis, item.ambf_collision_shape_xyz_dims = "X", (0.01, 0.02, 0.03)
    joint = bpy.data.objects.new("/ambf/env/arm/hinge", None)
    bpy.context.scene.collection.objects.link(joint)
    joint.location, joint.rotation_euler = (0.1, 0.1, 0.3), (0.0, 0.0, 0.5)
    joint.ambf_object_type, joint.ambf_constraint_type, joint.ambf_constraint_axis = "CONSTRAINT", "REVOLUTE", "Y"
    joint.ambf_object_parent, joint.ambf_object_child = base, link
    joint.ambf_constraint_limits_lower, joint.ambf_constraint_limits_higher = -30.0, 45.0
    joint.ambf_constraint_enable_controller_gains, joint.ambf_constraint_controller_p_gain = True, 20.0
    joint.ambf_constraint_max_motor_impulse = 0.5
    ghost = cube("/ambf/env/arm/feeler", 0.05, (0.1, 0.2, 0.4))
    ghost.ambf_object_type, ghost.ambf_object_parent = "GHOST_OBJECT", link
    bpy.context.scene.ambf_namespace = "/ambf/env/arm/"


@pytest.mark.parametrize("enabled", [True, False])
def test_a_scene_of_the_original_add_on_states_the_same_as_a_model(tmp_path, original, enabled):
    robot()
    if not enabled:
        original()
    bpy.context.view_layer.update()
    assert bpy.ops.adf.adopt() == {"FINISHED"}
    report = bpy.data.texts[REPORT].as_string()
    assert report.startswith("taken: 2 bodies, 1 joints, 1 ghosts, 2 primitives") and "hinge' is a joint" not in report
    collection = bpy.context.scene.adf.models[0].collection
    where = {o.adf.key: rest_pose(o) for o in collection.objects}
    export_file(collection, tmp_path / "arm.yaml")
    document = read_any(tmp_path / "arm.yaml", Resolver([tmp_path]))
    assert [d.message for d in document.diagnostics if d.severity.name == "ERROR"] == []
    assert document.top.text("namespace") == "/ambf/env/arm/"
    base, link = document.elements("bodies")
    assert (base.key, base.number("mass"), link.key, link.number("mass")) == ("BODY base link", 0.0, "BODY link", 0.25)
    assert [link.number(f"inertia.i{a}") for a in "xyz"] == [0.01, 0.02, 0.03]
    assert link.pose("inertial offset")[0] == (0.0, 0.0, 0.05) and link.number("friction.static") == 0.75
    assert link.numbers("collision groups") == (0, 3)
    capsule, box = link.children("compound collision shape")
    assert (capsule.text("shape"), capsule.number("geometry.radius"), capsule.number("geometry.height")) == (
        "CAPSULE",
        0.02,
        0.08,
    )
    assert capsule.text("geometry.axis") == "X" and capsule.pose("offset")[0] == (0.0, 0.0, 0.01)
    assert [box.number(f"geometry.{a}") for a in "xyz"] == [0.01, 0.02, 0.03] and box.pose("offset")[0] == (
        0.02,
        0.0,
        0.0,
    )
    joint = document.elements("joints")[0]
    assert (joint.text("parent"), joint.text("child"), joint.text("type")) == (
        "BODY base link",
        "BODY link",
        "revolute",
    )
    assert joint.number("joint limits.low") == pytest.approx(radians(-30.0), abs=1e-6)
    assert joint.number("joint limits.high") == pytest.approx(radians(45.0), abs=1e-6)
    assert (joint.number("controller.P"), joint.number("max motor impulse")) == (20.0, 0.5)
    np.testing.assert_allclose(joint.vector("parent axis"), [-np.sin(0.5), np.cos(0.5), 0.0], atol=1e-6)
    np.testing.assert_allclose(joint.vector("parent pivot"), [0.1, 0.1, 0.3], atol=1e-6)
    keys = JointKeys(
        *(joint.vector(n) for n in ("parent pivot", "child pivot", "parent axis", "child axis")),
        joint.number("offset"), joint.number("joint offset"),
    )  # fmt: skip
    inertial = [matrix_of(b.pose("inertial offset")) for b in (base, link)]
    np.testing.assert_allclose(child_pose(keys, *inertial), where["BODY link"], atol=1e-5)
    np.testing.assert_allclose(joint_pose(keys, *inertial)[:3, 3], [0.1, 0.1, 0.3], atol=1e-6)
    ghost = document.elements("ghost objects")[0]
    assert ghost.text("parent") == "BODY link"
    assert ghost.pose("location")[0] == (0.0, 0.0, 0.1)  # 0.4 - 0.3, of which single precision leaves 0.09999999


SIMULATED = """
import json, sys, ligature
scene = ligature.load(sys.argv[1])
simulation = ligature.Simulation(scene, dt=1e-3)
def stand(): return {b.identity.name: simulation.bodies[b.identity.identifier].pose.tolist() for b in scene.bodies}
start = stand()
simulation.step(200)
joints = [[j.type.value, j.low, j.high, simulation.joints[j.identity.identifier].position] for j in scene.joints]
print(json.dumps({"mass": {b.identity.name: b.mass for b in scene.bodies}, "start": start, "end": stand(), "joints": joints}))
"""


def simulated(file):
    """Masses, poses at the start and after 0.2 s, and joints of an exported file, by Ligature's own Python."""
    return in_simulator(SIMULATED, file)


def reopened(tmp_path):
    """The scene as it comes back from its blend file."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.context.view_layer.update()


@pytest.mark.parametrize("enabled", [True, False])
def test_a_blend_file_of_the_original_add_on_is_adopted_exported_and_simulated(tmp_path, original, enabled):
    robot()
    if not enabled:
        original()
    reopened(tmp_path)
    where = {
        name: np.array(bpy.data.objects[f"/ambf/env/arm/{name}"].matrix_world)[:3, 3] for name in ("base link", "link")
    }
    export_file(adopt(bpy.context.scene).collection, tmp_path / "arm.yaml")
    found = simulated(tmp_path / "arm.yaml")
    assert found["mass"] == {"baselink": 0.0, "link": 0.25}
    for name, place in where.items():
        np.testing.assert_allclose(found["start"][name.replace(" ", "")][:3], place, atol=1e-6)
    ((kind, low, high, position),) = found["joints"]
    assert kind == "revolute" and (low, high) == pytest.approx((radians(-30.0), radians(45.0)), abs=1e-6)
    assert low - 0.01 <= position <= high + 0.01
    np.testing.assert_allclose(found["end"]["baselink"], found["start"]["baselink"], atol=1e-12)
    pivot = np.array([0.1, 0.1, 0.3])  # the link swings about its joint, at the distance that it had
    for when in ("start", "end"):
        distance = np.linalg.norm(np.array(found[when]["link"][:3]) - pivot)
        assert distance == pytest.approx(0.1, abs=1e-4)


def test_a_blend_file_with_rigid_bodies_is_adopted_exported_and_simulated(tmp_path):
    cube("floor", 1.0, (0.0, 0.0, -0.5))
    bpy.ops.rigidbody.object_add()
    bpy.context.object.rigid_body.type = "PASSIVE"
    cube("stone", 0.1, (0.0, 0.0, 2.0))
    bpy.ops.rigidbody.object_add()
    bpy.context.object.rigid_body.mass, bpy.context.object.rigid_body.collision_shape = 1.5, "BOX"
    reopened(tmp_path)
    export_file(adopt(bpy.context.scene).collection, tmp_path / "m.yaml")
    found = simulated(tmp_path / "m.yaml")
    assert found["mass"] == {"floor": 0.0, "stone": 1.5}
    np.testing.assert_allclose(found["start"]["stone"][:3], [0.0, 0.0, 2.0], atol=1e-6)
    fallen = 2.0 - found["end"]["stone"][2]
    assert fallen == pytest.approx(0.5 * 9.8 * 0.2**2, rel=0.03)  # damping of 0.04 takes some


def test_rigid_bodies_of_blender_become_bodies_and_joints(tmp_path):
    objects = []
    for name, place in (("table", (0, 0, 0)), ("arm", (0.0, 0.0, 1.0))):
        obj = cube(name, 0.5, place)
        bpy.ops.rigidbody.object_add()
        objects.append(obj)
    table, arm = objects
    table.rigid_body.type, arm.rigid_body.mass = "PASSIVE", 2.5
    arm.rigid_body.collision_shape, table.rigid_body.collision_shape = "BOX", "MESH"
    arm.rigid_body.friction, arm.rigid_body.restitution = 0.8, 0.2
    hinge = bpy.data.objects.new("hinge", None)
    bpy.context.scene.collection.objects.link(hinge)
    hinge.location = (0.0, 0.0, 0.5)
    bpy.context.view_layer.objects.active = hinge
    hinge.select_set(True)
    bpy.ops.rigidbody.constraint_add(type="HINGE")
    own = hinge.rigid_body_constraint
    own.object1, own.object2, own.use_limit_ang_z = table, arm, True
    own.limit_ang_z_lower, own.limit_ang_z_upper = -0.5, 0.75  # left-handed, as Blender's own physics shows
    done = adopt(bpy.context.scene)
    assert (done.bodies, done.joints, done.shapes) == (2, 1, 1) and any("bounding box" in text for text in done.guessed)
    export_file(done.collection, tmp_path / "m.yaml")
    document = read_any(tmp_path / "m.yaml", Resolver([tmp_path]))
    bodies = {b.text("name"): b for b in document.elements("bodies")}
    assert bodies["table"].number("mass") == 0.0 and bodies["arm"].number("mass") == 2.5
    assert bodies["arm"].number("friction.static") == 0.8 and bodies["arm"].number("restitution") == 0.2
    assert bodies["arm"].text("collision shape") == "BOX"
    joint = document.elements("joints")[0]
    assert joint.vector("parent axis") == (0.0, 0.0, 1.0) and joint.vector("child pivot") == (0.0, 0.0, -0.5)
    assert (joint.number("joint limits.low"), joint.number("joint limits.high")) == (-0.75, 0.5)


LIMITED = [f"{half}_{axis}" for half in ("lin", "ang") for axis in "xyz"]
FREE = {"HINGE": ("ang_z",), "SLIDER": ("lin_x",), "PISTON": ("lin_x", "ang_x"), "GENERIC": LIMITED}
"""Axes along or about which constraints of Blender move, of which the tests leave one."""


def limited_pair(seed):
    """A resting and a moving body with a constraint of one free axis, which gravity drives to an end of it.

    Returns the moving body.
    """
    rng = np.random.default_rng(seed)
    scene = bpy.context.scene
    bpy.ops.rigidbody.world_add()
    kind = str(rng.choice(list(FREE)))
    free = str(rng.choice(FREE[kind]))
    turn, origin = quaternion(rng), rng.uniform(-1.0, 1.0, 3)
    R = np.array(turn.to_matrix())
    arm = rng.choice([-1.0, 1.0], 3) * rng.uniform(0.6, 1.0, 3)
    pair = []
    for name, place, sort in (("rest", origin, "PASSIVE"), ("moves", origin + R @ arm, "ACTIVE")):
        obj = cube(name, 0.1, place)
        turned(obj, rng)
        bpy.ops.rigidbody.object_add(type=sort)
        own = obj.rigid_body
        own.collision_shape, own.use_deactivation, own.restitution = "BOX", False, 0.0
        own.linear_damping = own.angular_damping = 0.5
        pair.append(obj)
    pin = bpy.data.objects.new("pin", None)
    scene.collection.objects.link(pin)
    pin.location, pin.rotation_mode, pin.rotation_quaternion = origin, "QUATERNION", turn
    select(pin)
    bpy.ops.rigidbody.constraint_add(type=kind)
    own = pin.rigid_body_constraint
    own.object1, own.object2 = pair
    for axis in LIMITED:
        low, high = -rng.uniform(0.1, 0.3), rng.uniform(0.4, 0.8)
        ends = (low, high) if rng.random() < 0.5 else (-high, -low)
        setattr(own, f"use_limit_{axis}", True)
        for end, value in zip(("lower", "upper"), ends if axis == free else (0.0, 0.0), strict=True):
            setattr(own, f"limit_{axis}_{end}", float(value))
    along = R[:, "xyz".index(free[-1])]
    pull = along if free.startswith("lin") else np.cross(along, R @ arm)
    pull = rng.choice([-1.0, 1.0]) * pull / np.linalg.norm(pull) + rng.uniform(-0.3, 0.3, 3)
    scene.gravity = (9.8 * pull / np.linalg.norm(pull)).tolist()
    bpy.context.view_layer.update()
    return pair[1]


SETTLE = """
import json, sys
import ligature
found = []
for path in sys.argv[1:]:
    simulation = ligature.Simulation(ligature.load(path))
    index = next(body.index for body in simulation.scene.bodies if body.identity.name == "moves")
    simulation.step(10000)
    found.append(simulation.state[0]["body_pose"][index, :3].tolist())
    simulation.close()
print(json.dumps(found))
"""


def test_adopted_joints_stop_where_blender_s_own_physics_stops_them(tmp_path):
    paths, expected = [], []
    for seed in range(16):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        body = limited_pair(seed)
        for frame in range(1, 241):
            bpy.context.scene.frame_set(frame)
        body = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
        expected.append(np.array(body.matrix_world)[:3, 3])
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        limited_pair(seed)
        adopt(bpy.context.scene).collection.adf.model.gravity = bpy.context.scene.gravity
        paths.append(tmp_path / str(seed) / "launch.yaml")
        bpy.ops.adf.export_scene(filepath=str(paths[-1]))
    found = in_simulator(SETTLE, *paths)
    for seed, place, wanted in zip(range(16), found, expected, strict=True):
        np.testing.assert_allclose(place, wanted, atol=0.01, err_msg=str(seed))


SHAPES_OF_BLENDER = ("BOX", "SPHERE", "CAPSULE", "CYLINDER", "CONE")


@pytest.mark.parametrize("seed", range(8))
def test_random_rigid_bodies_keep_names_masses_and_sizes(seed):
    rng = np.random.default_rng(seed)
    objects = [obj for obj in random_tree(seed, modifiers=False) if obj.type == "MESH"]
    masses, sizes = {}, {}
    for obj in objects:
        select(obj)
        bpy.ops.rigidbody.object_add()
        own = obj.rigid_body
        own.type = str(rng.choice(["ACTIVE", "PASSIVE"]))
        own.mass, own.collision_shape = float(rng.uniform(0.1, 5.0)), str(rng.choice(SHAPES_OF_BLENDER))
        own.kinematic, own.enabled = bool(rng.random() < 0.2), bool(rng.random() < 0.8)
        masses[obj] = own.mass if own.type == "ACTIVE" and own.enabled and not own.kinematic else 0.0
        points = np.array([vertex.co for vertex in obj.data.vertices]) @ scaling(obj)[:3, :3].T
        sizes[obj] = np.ptp(points, axis=0)
    constraints = []
    for number, (one, other) in enumerate(itertools.pairwise(objects)):
        pin = bpy.data.objects.new(f"pin{number}", None)
        bpy.context.scene.collection.objects.link(pin)
        select(pin)
        bpy.ops.rigidbody.constraint_add(type=str(rng.choice(["FIXED", "POINT", "HINGE", "MOTOR"])))
        own = pin.rigid_body_constraint
        own.object1, own.object2, own.enabled = one, other, bool(rng.random() < 0.7)
        constraints.append(own)
    wanted = sum(own.enabled and own.type != "MOTOR" for own in constraints)
    done = adopt(bpy.context.scene)
    assert (done.bodies, done.joints, len(done.left)) == (len(objects), wanted, len(constraints) - wanted)
    for own in constraints:
        if not own.enabled:
            assert f"'{own.id_data.name}': its constraint is switched off" in done.left
    for obj, mass in masses.items():
        assert obj.adf.key == f"BODY {obj.name.rpartition('/')[2]}"
        assert obj.adf.body.mass == pytest.approx(mass)
        shape = shape_of(next(child for child in obj.children if child.adf.role == "SHAPE"))
        width = max(sizes[obj] if shape.kind == "SPHERE" else sizes[obj][:2])
        if shape.kind == "BOX":
            stated, size = shape.size, sizes[obj]
        elif shape.kind == "SPHERE":
            stated, size = [shape.radius], [width / 2.0]
        else:
            least = width if shape.kind == "CAPSULE" else 0.0
            stated, size = [shape.radius, shape.height], [width / 2.0, max(sizes[obj][2], least)]
        np.testing.assert_allclose(stated, size, rtol=1e-4, atol=1e-6)


def test_a_scene_without_either_is_refused():
    cube("plain")
    with pytest.raises(RuntimeError, match="no object has properties of the AMBF add-on, nor a rigid body"):
        bpy.ops.adf.adopt()
