"""What makes the extension better than its forerunner, each a test (benchmarks B1 to B15 of the specification)."""

import math
import time

import addon_utils
import bpy
import numpy as np
import pytest
from adf_studio import making, registration
from adf_studio.check_operators import check_file
from adf_studio.decompose_operators import Job
from adf_studio.ligature.adf import Resolver, read_any
from adf_studio.ligature.authoring.shapes import Shape
from adf_studio.ligature.mesh import load_mesh
from adf_studio.mesh_reading import points_of
from adf_studio.object_operators import solid_of
from adf_studio.poses import rest_pose
from adf_studio.read_file import import_file
from adf_studio.solids import own_solid
from adf_studio.write_file import export_file

from .scene import body, model, scene_print, select


def test_b1_enabling_and_disabling_leaves_nothing_behind():
    def names():
        return {n for n in dir(bpy.types) if "ADF_" in n} | {
            n for owner in (bpy.types.Object, bpy.types.Collection, bpy.types.Scene) for n in dir(owner) if n == "adf"
        }

    handlers = [len(getattr(bpy.app.handlers, n)) for n in ("depsgraph_update_post", "load_post", "undo_post")]
    assert names()
    for _ in range(2):
        addon_utils.disable("adf_studio", default_set=True)
        assert names() == set()
        assert [len(getattr(bpy.app.handlers, n)) for n in ("depsgraph_update_post", "load_post", "undo_post")] == [
            h - own for h, own in zip(handlers, (1, 2, 1))
        ]
        assert addon_utils.enable("adf_studio", default_set=True) is not None
    assert len({c.__name__ for m in registration.MODULES for c in m.CLASSES}) == sum(
        len(m.CLASSES) for m in registration.MODULES
    )


def test_b6_export_leaves_the_scene_as_it_was(tmp_path):
    collection = model()
    part = body()
    part.modifiers.new("array", "ARRAY")
    part.hide_set(True)
    before = scene_print()
    export_file(collection, tmp_path / "m.yaml")
    assert scene_print() == before


@pytest.mark.parametrize("case", ["scaled", "mirrored", "array", "parented", "hidden", "excluded", "monitor"])
def test_b7_geometry_is_written_as_it_is_seen(tmp_path, case):
    collection = model()
    part = body(location=(1.0, 2.0, 3.0))
    extent, place, volume = np.array([1.0, 1.0, 1.0]), np.array([1.0, 2.0, 3.0]), 1.0
    if case == "scaled":
        part.scale, extent, volume = (2.0, 1.0, 0.5), np.array([2.0, 1.0, 0.5]), 1.0
    if case == "mirrored":
        part.scale = (-1.0, 1.0, 1.0)
        part.data.vertices[0].co.x = -2.0
        extent = np.array([2.5, 1.0, 1.0])
        volume = None
    if case == "array":
        modifier = part.modifiers.new("array", "ARRAY")
        modifier.count = 3
        extent, volume = np.array([3.0, 1.0, 1.0]), 3.0
    if case == "parented":
        other = bpy.data.objects.new("holder", None)
        bpy.context.scene.collection.objects.link(other)
        other.location, other.rotation_euler = (5.0, 0.0, 0.0), (0.0, 0.0, math.pi / 2)
        part.parent = other
        place = np.array([3.0, 1.0, 3.0])
    if case == "hidden":
        part.hide_set(True)
    if case == "monitor":
        part.hide_viewport = True
        modifier = part.modifiers.new("array", "ARRAY")
        modifier.count = 2
        extent, volume = np.array([2.0, 1.0, 1.0]), 2.0
    if case == "excluded":
        bpy.context.view_layer.layer_collection.children[collection.name].exclude = True
    export_file(collection, tmp_path / "m.yaml")
    element = read_any(tmp_path / "m.yaml", Resolver([tmp_path])).elements("bodies")[0]
    np.testing.assert_allclose(element.pose("location")[0], place, atol=1e-6)
    mesh = load_mesh(tmp_path / "high_res" / element.text("mesh"), Resolver([tmp_path]))
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), extent, atol=1e-6)
    faces = np.vstack([p.faces for p in mesh.parts])
    a, b, c = (mesh.vertices[faces[:, i]] for i in range(3))
    signed = np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0
    assert signed > 0.0  # the winding is outwards, mirrored or not
    if volume is not None:
        assert signed == pytest.approx(volume, rel=1e-5)


SOLIDS = [
    (Shape("BOX", size=(0.2, 0.4, 0.6)), [(0.16 + 0.36) / 12, (0.04 + 0.36) / 12, (0.04 + 0.16) / 12]),
    (Shape("SPHERE", radius=0.1), [0.004] * 3),
    (Shape("CYLINDER", radius=0.1, height=0.4), [(0.03 + 0.16) / 12] * 2 + [0.005]),
    (Shape("CONE", radius=0.1, height=0.4), [3 / 80 * (0.04 + 0.16)] * 2 + [0.003]),
]


@pytest.mark.parametrize(("shape", "moments"), SOLIDS, ids=lambda v: getattr(v, "kind", ""))
@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_b8_inertia_of_primitives_has_its_closed_form(shape, moments, scale):
    model()
    part = body()
    child = making.add_shape(part, shape, T_body=np.array([[1, 0, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1.0]]))
    child.scale = (scale,) * 3
    bpy.context.view_layer.update()
    solid = solid_of(part, "SHAPES", 100.0)
    np.testing.assert_allclose(np.diag(solid.inertia) / solid.mass, np.array(moments) * scale**2, rtol=1e-6)
    centre = [5, 6, 7 - (0.1 * scale if shape.kind == "CONE" else 0.0)]
    np.testing.assert_allclose(solid.centre, centre, rtol=1e-6)


def test_b8_inertia_of_a_scaled_shifted_mesh_is_exact_about_its_centre_of_mass():
    model()
    part = body()
    for vertex in part.data.vertices:
        vertex.co.x += 10.0
    part.scale = (2.0, 1.0, 1.0)
    select(part)
    part.adf.body.mass = 3.0
    bpy.ops.adf.set_inertia(source="MESH", given="MASS")
    found = [getattr(part.adf.body, f"inertia_i{a}") for a in "xyz"]
    np.testing.assert_allclose(found, [3 * 2 / 12, 3 * 5 / 12, 3 * 5 / 12], rtol=1e-6)
    frame = next(c for c in part.children if c.adf.role == "INERTIAL")
    np.testing.assert_allclose((np.linalg.inv(rest_pose(part)) @ rest_pose(frame))[:3, 3], [20.0, 0.0, 0.0], atol=1e-5)


def test_b9_textures_are_copied_and_the_material_file_is_in_the_readers_dialect(tmp_path):
    collection = model()
    part = body()
    material = bpy.data.materials.new("skin")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    shader = next(n for n in nodes if n.type == "BSDF_PRINCIPLED")
    for name, socket in (("colour.png", "Base Color"), ("bumps.png", "Normal")):
        image = bpy.data.images.new(name, 4, 4)
        image.filepath_raw, image.file_format = str(tmp_path / name), "PNG"
        image.save()
        node = nodes.new("ShaderNodeTexImage")
        node.image = image
        if socket == "Normal":
            bump = nodes.new("ShaderNodeNormalMap")
            links.new(node.outputs["Color"], bump.inputs["Color"])
            links.new(bump.outputs["Normal"], shader.inputs["Normal"])
        else:
            links.new(node.outputs["Color"], shader.inputs[socket])
    part.data.materials.append(material)
    export_file(collection, tmp_path / "out" / "m.yaml")
    high = tmp_path / "out" / "high_res"
    library = (high / "part.mtl").read_text()
    assert "\nmap_Kd colour.png\n" in library and "\nmap_Bump bumps.png\n" in library and "\nKd " in library
    for name in ("colour.png", "bumps.png"):
        assert (high / name).read_bytes() == (tmp_path / name).read_bytes()
    mesh = load_mesh(high / "part.OBJ", Resolver([tmp_path]))
    assert mesh.parts[0].material.normal_map == high / "bumps.png" and mesh.parts[0].uvs is not None


SECTIONS = {
    "BODY": "bodies", "JOINT": "joints", "GHOST_OBJECT": "ghost objects", "SENSOR": "sensors", "ACTUATOR": "actuators",
    "CAMERA": "cameras", "LIGHT": "lights", "SOFT_BODY": "soft bodies", "VOLUME": "volumes", "SUTURE": "sutures",
}  # fmt: skip


def test_b11_every_section_is_authored_and_read_back(tmp_path):
    collection = model()
    parent, child = body("parent"), body("child", location=(2, 0, 0))
    select(child, parent)
    bpy.ops.adf.connect(type="revolute")
    for role in SECTIONS:
        if role not in ("BODY", "JOINT"):
            select(parent)
            bpy.ops.adf.add(role=role, name=f"a {role.lower()}")
    soft = next(o for o in collection.objects if o.adf.role == "SOFT_BODY")
    soft.adf.soft_body.mesh, soft.adf.soft_body.mass = "soft.OBJ", 1.0
    volume = next(o for o in collection.objects if o.adf.role == "VOLUME").adf.volume
    volume.images_path, volume.images_prefix, volume.images_format, volume.images_count = "./scan/", "slice", "png", 8
    assert bpy.ops.adf.export_file(filepath=str(tmp_path / "m.yaml"), collection=collection.name) == {"FINISHED"}
    document = read_any(tmp_path / "m.yaml", Resolver([tmp_path]))
    assert {name: len(document.elements(name)) for name in SECTIONS.values() if document.elements(name)} == {
        name: 2 if name == "bodies" else 1 for name in SECTIONS.values()
    }
    text = (tmp_path / "m.yaml").read_bytes()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    again = import_file(tmp_path / "m.yaml", bpy.context.scene).collection
    assert {o.adf.role for o in again.objects} >= set(SECTIONS)
    export_file(again, tmp_path / "m.yaml")
    assert (tmp_path / "m.yaml").read_bytes() == text


def test_b12_nothing_unreferenced_and_nothing_empty_is_written(tmp_path):
    collection = model()
    first = body("first")
    second = first.copy()
    bpy.context.scene.collection.objects.link(second)
    second.name = "second"
    second.adf.key = ""
    making.give_role(second, "BODY", collection)
    export_file(collection, tmp_path / "m.yaml")
    files = sorted(p.name for p in (tmp_path / "high_res").iterdir())
    assert files == ["first.OBJ", "first.mtl"]  # linked duplicates share one file
    text = (tmp_path / "m.yaml").read_text()
    assert text.count("mesh: first.OBJ") == 2
    empty = bpy.data.objects.new("nothing", bpy.data.meshes.new("nothing"))
    collection.objects.link(empty)
    making.give_role(empty, "BODY", collection)
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    assert bpy.ops.adf.check() == {"FINISHED"}
    with pytest.raises(Exception, match="'nothing' has no face"):
        export_file(collection, tmp_path / "m.yaml")
    assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before


def test_b13_a_decomposition_can_be_cancelled_at_once_and_is_kept(monkeypatch, tmp_path):
    pytest.importorskip("coacd")
    monkeypatch.setattr("adf_studio.compat.cache_folder", lambda: str(tmp_path))
    model()
    bpy.ops.mesh.primitive_monkey_add()
    part = bpy.context.object
    select(part)
    bpy.ops.adf.make(role="BODY")
    vertices, faces = points_of(own_solid(part))
    settings = {"threshold": 0.3, "max_convex_hull": 6, "resolution": 500, "mcts_iterations": 20, "mcts_nodes": 8}
    job = Job(vertices, faces, settings)
    start = time.monotonic()
    job.cancel()
    assert time.monotonic() - start < 0.5 and job.finished
    job = Job(vertices, faces, settings)
    report = set()
    while not job.finished:
        report.add(job.progress)
        time.sleep(0.05)
    report.add(job.progress)
    assert (1, 0.0) in report and max(share for _, share in report) == 1.0 and max(parts for parts, _ in report) >= 2
    pieces = job.pieces()
    start = time.monotonic()
    again = Job(vertices, faces, settings)
    assert again.finished and time.monotonic() - start < 0.5
    assert len(again.pieces()) == len(pieces) >= 2


JOINTS = {
    "cone twist": ["joint limits.x", "joint limits.y", "joint limits.z"],
    "linear spring": ["joint limits.low", "joint limits.high", "stiffness", "damping"],
    "p2p": [],
    "fixed": [],
    "six dof": ["joint limits.linear.low.x", "joint limits.angular.high.z"],
    "six dof spring": ["joint limits.linear.low.x", "stiffness.linear.x", "damping.angular.z"],
}


@pytest.mark.parametrize("kind", JOINTS)
def test_b14_every_joint_type_is_written_and_read_again(tmp_path, kind):
    collection = model()
    parent, child = body("parent"), body("child", location=(0.3, 0.2, 0.1))
    child.rotation_euler = (0.3, -0.5, 0.7)
    select(child, parent)
    bpy.ops.adf.connect(type=kind, pivot="CHILD", axis="Y")
    joint = next(o for o in collection.objects if o.adf.role == "JOINT")
    if kind == "linear spring":
        joint.adf.joint.equilibrium_point = 0.01
    export_file(collection, tmp_path / "m.yaml")
    document = read_any(tmp_path / "m.yaml", Resolver([tmp_path]))
    element = document.elements("joints")[0]
    assert element.value("type") == kind and all(element.has(path) for path in JOINTS[kind])
    if kind == "linear spring":
        assert element.number("equilibrium point") == pytest.approx(0.01)
    assert element.has("joint limits") == any(path.startswith("joint limits") for path in JOINTS[kind])
    assert not [f for f, _ in check_file(collection) if f.rule in ("joint-residual", "reference-unresolved")]


def test_b15_check_scene_lists_selects_and_mends():
    model()
    part = body()
    making.add_shape(part, Shape("SPHERE", radius=0.01))
    part.adf.body.collision_margin = 0.05
    part.adf.body.property_unset("mass")
    bpy.ops.adf.check()
    findings = bpy.context.scene.adf.findings
    assert {f.rule for f in findings} >= {"mass-missing", "thin-for-margin"}
    index = next(i for i, f in enumerate(findings) if f.rule == "thin-for-margin")
    assert findings[index].object is part and "part" in findings[index].message
    bpy.ops.adf.select_finding(index=index)
    assert bpy.context.view_layer.objects.active is part
    bpy.ops.adf.fix(everything=True)
    assert not {f.rule for f in bpy.context.scene.adf.findings} & {"mass-missing", "thin-for-margin"}
    assert part.adf.body.collision_margin == pytest.approx(0.002)


def test_a_previewed_joint_moves_its_child_and_comes_back(tmp_path):
    collection = model()
    base, link, tip = body("base"), body("link", location=(0, 0, 1)), body("tip", location=(0, 0, 2))
    for child, parent in ((link, base), (tip, link)):
        select(child, parent)
        bpy.ops.adf.connect(type="revolute", pivot="CHILD", axis="X")
    joint = next(o for o in collection.objects if o.adf.role == "JOINT" and o.adf.child_object is link)
    before = scene_print()
    bpy.context.view_layer.objects.active = joint
    bpy.ops.adf.move_joint(part=1.0)
    np.testing.assert_allclose(rest_pose(tip)[:3, 3], [0.0, -1.0, 1.0], atol=1e-6)
    with pytest.raises(RuntimeError, match="A joint is previewed"):
        bpy.ops.adf.export_file(filepath=str(tmp_path / "m.yaml"), collection=collection.name)
    bpy.ops.adf.rest_pose()
    assert scene_print() == before
