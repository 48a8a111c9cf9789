"""What single operators make: pieces by material, rings, previews of every joint type, dropped launch files."""

import os
from pathlib import Path

import bmesh
import bpy
import numpy as np
import pytest
from adf_studio.ligature.adf import Resolver, read_any, read_launch
from adf_studio.ligature.mesh import load_mesh
from adf_studio.mesh_making import shape_data
from adf_studio.poses import relative_pose, rest_pose, shape_of
from adf_studio.write_file import prepared

from .scene import body, model, scene_print, select


def test_faces_of_each_material_get_a_hull_of_their_own():
    model()
    part = body("two blocks")
    corners = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [*sides, *(tuple(i + 8 for i in side) for side in sides)]
    part.data = shape_data(np.vstack([corners, corners + [3.0, 0.0, 0.0]]), faces, "blocks")
    for name in ("red", "blue"):
        part.data.materials.append(bpy.data.materials.new(name))
    for polygon in part.data.polygons:
        polygon.material_index = int(polygon.index >= 6)
    select(part)
    assert bpy.ops.adf.add_hull(around="MATERIAL") == {"FINISHED"}
    extents = sorted(
        (min(v.co.x for v in hull.data.vertices), max(v.co.x for v in hull.data.vertices)) for hull in part.children
    )
    assert extents == [(0.0, 1.0), (3.0, 4.0)]
    assert part.adf.body.collision_mesh_type == "CONVEX_HULL"


def test_a_ring_follows_the_open_boundary_of_a_mesh_and_its_scale():
    model()
    bpy.ops.mesh.primitive_circle_add(vertices=64, radius=0.01, fill_type="NOTHING")
    sheet = bpy.context.object
    work = bmesh.new()
    bmesh.ops.create_circle(work, segments=64, radius=0.01)
    inner = list(work.edges)
    made = bmesh.ops.extrude_edge_only(work, edges=inner)
    for vertex in (item for item in made["geom"] if isinstance(item, bmesh.types.BMVert)):
        vertex.co *= 3.0
    work.to_mesh(sheet.data)
    work.free()
    sheet.scale = (2.0, 2.0, 2.0)
    select(sheet)
    bpy.ops.adf.make(role="BODY")
    assert bpy.ops.adf.add_ring(sides=8, radius=0.0005) == {"FINISHED"}
    assert len(sheet.children) == 16
    distances = sorted(np.linalg.norm(relative_pose(sheet, child)[:3, 3]) for child in sheet.children)
    np.testing.assert_allclose(distances[:8], 0.02 * np.cos(np.pi / 8), rtol=2e-3)
    np.testing.assert_allclose(distances[8:], 0.06 * np.cos(np.pi / 8), rtol=2e-3)
    assert {shape_of(child).kind for child in sheet.children} == {"CAPSULE"}
    closed = body("closed")
    with pytest.raises(RuntimeError, match="'closed': its mesh has no open boundary"):
        bpy.ops.adf.add_ring()
    assert not closed.children


MOVES = [
    ("revolute", "FREE", "RZ", np.pi / 2),
    ("prismatic", "FREE", "TX", 0.05),
    ("linear spring", "FREE", "TZ", 0.05),
    ("torsion spring", "FREE", "RZ", 1.0),
    ("cone twist", "RY", "RY", 0.7),
    ("p2p", "RX", "RX", np.pi),
    ("six dof", "TY", "TY", 0.02),
    ("six dof spring", "FREE", "TY", 0.02),
]


@pytest.mark.parametrize(("kind", "axis", "moved", "most"), MOVES, ids=[move[0] for move in MOVES])
def test_a_preview_moves_every_type_of_joint_along_its_own_axis(kind, axis, moved, most):
    model()
    parent, child = body("parent"), body("child", location=(0.3, 0.2, 0.1))
    select(child, parent)
    bpy.ops.adf.connect(type=kind)
    joint = next(o for o in bpy.data.objects if o.adf.role == "JOINT")
    if kind.startswith("six dof"):
        joint.adf.joint.joint_limits_linear_low_y, joint.adf.joint.joint_limits_linear_high_y = -0.02, 0.02
    before = scene_print()
    T_joint, T_child = rest_pose(joint), rest_pose(child)
    bpy.context.view_layer.objects.active = joint
    assert bpy.ops.adf.move_joint(axis=axis, part=1.0) == {"FINISHED"}
    motion = np.linalg.inv(T_joint) @ rest_pose(child) @ np.linalg.inv(T_child) @ T_joint
    index = "XYZ".index(moved[1])
    if moved[0] == "T":
        np.testing.assert_allclose(motion[:3, 3], most * np.eye(3)[index], atol=1e-6)
        np.testing.assert_allclose(motion[:3, :3], np.eye(3), atol=1e-6)
    else:
        a, b = (index + 1) % 3, (index + 2) % 3
        np.testing.assert_allclose([motion[a, a], motion[b, a]], [np.cos(most), np.sin(most)], atol=1e-6)
    bpy.ops.adf.rest_pose()
    assert scene_print() == before


def test_a_locked_axis_is_reported_with_those_that_move():
    model()
    parent, child = body("parent"), body("child", location=(1, 0, 0))
    select(child, parent)
    bpy.ops.adf.connect(type="fixed")
    bpy.context.view_layer.objects.active = next(o for o in bpy.data.objects if o.adf.role == "JOINT")
    with pytest.raises(RuntimeError, match="is locked there; it moves nowhere"):
        bpy.ops.adf.move_joint()
    bpy.context.object.adf.joint.type = "revolute"
    with pytest.raises(RuntimeError, match="is locked there; it moves RZ"):
        bpy.ops.adf.move_joint(axis="TX")


OPERATORS = [
    ("make", {"role": "GHOST_OBJECT"}), ("add_shape", {}), ("fit_shape", {"kind": "CAPSULE"}), ("add_hull", {}),
    ("measure_collision", {}), ("set_inertia", {}), ("add", {"role": "SENSOR"}), ("add_needle", {}), ("add_suture", {"form": "CHAIN"}),
    ("add_hole", {}), ("add_grasp", {}), ("add_endoscope", {}), ("check", {}), ("fix", {"everything": True}),
    ("new_file", {"kind": "WORLD", "name": "w"}), ("add_to_launch", {"path": "w.yaml"}),
]  # fmt: skip


def users(objects):
    """What a user has arranged of objects, as a text each."""
    layer = bpy.context.view_layer
    return [
        f"{o.name} {o.data.name} {np.array(o.matrix_world).tolist()} {o.parent} {o.hide_get()} {o.hide_render} {o.hide_viewport} "
        f"{o.select_get()} {layer.objects.active is o} {o.display_type} {len(o.modifiers)} {[c.name for c in o.users_collection]}"
        for o in objects
    ]


def test_no_operator_selects_renames_moves_or_hides_what_the_user_has(tmp_path):
    model()
    part = body("part")
    part.adf.body.collision_margin = 0.9  # which has a fix
    bpy.ops.mesh.primitive_cube_add(location=(0.3, 0.2, 0.1), rotation=(0.1, 0.2, 0.3))
    other = bpy.context.object
    hidden = other.copy()
    bpy.context.scene.collection.objects.link(hidden)
    hidden.hide_set(True)
    select(part)
    bpy.context.view_layer.update()
    before = users([part, other, hidden])
    export = ("export_scene", {"filepath": str(tmp_path / "launch.yaml")})
    for name, arguments in [*OPERATORS[1:], export, ("import_launch", export[1]), OPERATORS[0]]:
        assert getattr(bpy.ops.adf, name)(**arguments) == {"FINISHED"}, name
        bpy.context.view_layer.update()
        assert users([part, other, hidden]) == before, name


def test_a_copy_made_in_blender_gets_an_identifier_a_name_and_mesh_files_of_its_own(tmp_path):
    collection = model()
    part = body("part")
    target = {"filepath": str(tmp_path / "m.yaml"), "collection": collection.name}
    bpy.ops.adf.fit_shape(kind="BOX")
    bpy.ops.adf.export_file(**target)
    select(*part.children, part)
    bpy.ops.object.duplicate()
    copy = bpy.context.object
    copy.data.vertices[0].co.x -= 1.0
    with pytest.raises(RuntimeError, match="have one identifier, 'BODY part'; Check Scene can give the copy its own"):
        bpy.ops.adf.export_file(**target)
    bpy.ops.adf.check()
    findings = bpy.context.scene.adf.findings
    assert [(f.rule, f.object, f.fixable) for f in findings] == [("identifier-twice", copy, True)]
    bpy.ops.adf.fix(everything=True)
    assert part.adf.key == "BODY part" and (copy.adf.key, copy.adf.body.name) == ("BODY part.001", "part_001")
    before = (tmp_path / "high_res" / "part.OBJ").read_bytes()
    assert bpy.ops.adf.export_file(**target) == {"FINISHED"}
    document = read_any(tmp_path / "m.yaml", Resolver([tmp_path]))
    assert [e.text("mesh") for e in document.elements("bodies")] == ["part.OBJ", "part_001.OBJ"]
    assert not document.diagnostics and (tmp_path / "high_res" / "part.OBJ").read_bytes() == before


@pytest.mark.parametrize("modified", [False, True])
def test_what_is_being_edited_is_written_as_it_is_seen(tmp_path, modified):
    collection = model()
    part = body("part")
    if modified:
        part.modifiers.new("array", "ARRAY").count = 2
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.resize(value=(3.0, 1.0, 1.0))
    meshes = len(bpy.data.meshes)
    bpy.ops.adf.export_file(filepath=str(tmp_path / "m.yaml"), collection=collection.name)
    assert bpy.context.mode == "EDIT_MESH" and len(bpy.data.meshes) == meshes
    mesh = load_mesh(tmp_path / "high_res" / "part.OBJ", Resolver([tmp_path]))
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [6.0 if modified else 3.0, 1.0, 1.0], atol=1e-6)
    assert mesh.parts[0].uvs is not None
    bpy.ops.object.mode_set(mode="OBJECT")


def test_a_joint_whose_body_was_deleted_is_reported_and_nothing_is_written(tmp_path):
    collection = model()
    parent, child = body("parent"), body("child", location=(1, 0, 0))
    select(child, parent)
    bpy.ops.adf.connect(type="revolute")
    target = {"filepath": str(tmp_path / "m.yaml"), "collection": collection.name}
    bpy.ops.adf.export_file(**target)
    before = (tmp_path / "m.yaml").read_bytes()
    bpy.data.objects.remove(child)
    with pytest.raises(
        RuntimeError, match="'parent-child' has no child body; choose one in the Physics tab, or delete it"
    ):
        bpy.ops.adf.export_file(**target)
    assert (tmp_path / "m.yaml").read_bytes() == before
    bpy.ops.adf.check()
    assert [f.object.name for f in bpy.context.scene.adf.findings] == ["parent-child"]


def test_a_joint_to_a_body_of_another_file_names_it_with_its_namespace(tmp_path):
    for name in ("one", "two"):
        bpy.ops.adf.new_file(kind="MODEL", name=name, namespace=f"/ambf/env/{name}/")
        body(f"{name}_body")
    select(bpy.data.objects["one_body"], bpy.data.objects["two_body"])
    bpy.ops.adf.connect(type="revolute")
    target = tmp_path / "launch.yaml"
    bpy.ops.adf.export_scene(filepath=str(target))
    ends = {"parent": "BODY two_body", "child": "/ambf/env/one/BODY one_body"}
    joint = read_any(tmp_path / "two.yaml", Resolver([tmp_path])).elements("joints")[0]
    assert {name: joint.text(name) for name in ends} == ends and joint.text("name") == "two_body-one_body"
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.adf.import_launch(filepath=str(target))
    made = next(o for o in bpy.data.objects if o.adf.role == "JOINT")
    assert made.adf.child_object is bpy.data.objects["one_body"]
    text = (tmp_path / "two.yaml").read_bytes()
    bpy.ops.adf.export_scene(filepath=str(target))
    assert (tmp_path / "two.yaml").read_bytes() == text


def test_what_would_not_be_written_as_it_looks_is_reported():
    model()
    bpy.ops.curve.primitive_bezier_circle_add()
    bpy.context.object.name = "rim"
    select(bpy.context.object)
    bpy.ops.adf.make(role="BODY")
    bpy.context.scene.unit_settings.system, bpy.context.scene.unit_settings.scale_length = "METRIC", 0.001
    bpy.ops.adf.check()
    report = {f.rule: f.message for f in bpy.context.scene.adf.findings}
    assert report["not-a-mesh"] == "rim: its shape is a curve, which is not written"
    assert report["unit-scale"] == "Scene: its unit scale is 0.001, and lengths are written as metres"


def test_a_launch_file_among_dropped_files_is_opened_with_all_that_it_names():
    folder = Path(os.environ["LIGATURE_ROOT"]) / "scenes" / "suturing_small"
    bpy.ops.adf.import_file(directory=str(folder), files=[{"name": "launch.yaml"}])
    stored = bpy.context.scene.adf
    assert len(stored.models) >= 1 and all(entry.collection for entry in stored.models) and stored.world is not None
    assert Path(stored.filepath) == folder / "launch.yaml"


def test_a_scene_without_a_world_is_written_with_all_files_that_a_launch_file_must_name(tmp_path):
    model()
    body()
    target = tmp_path / "scene" / "launch.yaml"
    assert bpy.ops.adf.export_scene(filepath=str(target)) == {"FINISHED"}
    launch = read_launch(target, Resolver.for_file(target))
    named = [launch.world, launch.devices, launch.colours, *launch.models]
    assert len(named) == 4 and all(reference.path.is_file() for reference in named)
    world = read_any(launch.world.path, Resolver([tmp_path]))
    assert world.kind == "world"
    reported = [d.message for d in world.diagnostics if d.severity.name != "DEBUG"]
    assert reported == ["world 'world.yaml' names no environment"]  # that is so


def test_a_world_without_surroundings_comes_back_as_a_world(tmp_path):
    model()
    body()
    bpy.ops.adf.new_file(kind="WORLD", name="world")
    bpy.ops.adf.add(role="LIGHT", name="lamp", hang=False)
    target = tmp_path / "launch.yaml"
    bpy.ops.adf.export_scene(filepath=str(target))
    text = (tmp_path / "world.yaml").read_bytes()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.adf.import_launch(filepath=str(target))
    world = bpy.context.scene.adf.world
    assert world.adf.kind == "WORLD" and [o.adf.role for o in world.objects] == ["LIGHT"]
    bpy.ops.adf.export_scene(filepath=str(target))
    assert (tmp_path / "world.yaml").read_bytes() == text


def test_files_can_be_dropped_where_blender_takes_them():
    if not hasattr(bpy.types, "FileHandler"):
        pytest.skip("Blender takes dropped files from 4.1 on")
    handler = bpy.types.ADF_FH_import
    assert handler.bl_import_operator == "adf.import_file"
    assert handler.bl_file_extensions.split(";") == [".yaml", ".yml", ".ambf"]
    names = bpy.ops.adf.import_file.get_rna_type().properties.keys()
    assert {"filepath", "directory", "files"} <= set(names)  # what Blender hands a dropped file over in


def test_an_instance_of_a_collection_is_refused_before_anything_is_written(tmp_path):
    collection = model()
    parts = bpy.data.collections.new("parts")
    instance = bpy.data.objects.new("shown", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", parts
    bpy.context.scene.collection.objects.link(instance)
    bpy.context.view_layer.update()
    select(instance)
    bpy.ops.adf.make(role="BODY")
    words = (
        "'shown' shows the collection 'parts', whose objects are not written; use Object > Apply > Make Instances Real"
    )
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.adf.export_file(filepath=str(tmp_path / "m.yaml"), collection=collection.name)
    assert not any(tmp_path.iterdir())


def test_a_body_that_collides_as_a_triangle_mesh_is_reported_before_its_first_export(tmp_path):
    collection = model()
    part = body("part")
    words = "'part' moves and collides as a triangle mesh"
    assert [note.startswith(words) for note in prepared(collection, tmp_path / "m.yaml").notes] == [True]
    bpy.ops.adf.check()
    assert "concave-moving" in {f.rule for f in bpy.context.scene.adf.findings}
    bpy.ops.adf.fix(everything=True)
    assert part.adf.body.collision_mesh_type == "CONVEX_HULL" and not prepared(collection, tmp_path / "m.yaml").notes


def test_what_hung_on_a_deleted_body_is_reported_and_mended(tmp_path):
    file = tmp_path / "m.yaml"
    file.write_text(
        "bodies: [BODY a, BODY b]\njoints: [JOINT j]\nsensors: [SENSOR s]\n"
        "BODY a: {name: a, mass: 1.0}\nBODY b: {name: b, mass: 1.0}\n"
        "JOINT j: {name: j, type: fixed, parent: BODY a, child: BODY b, parent pivot: {x: 0, y: 0, z: 0},\n"
        "  child pivot: {x: 0, y: 0, z: 0}, parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}}\n"
        "SENSOR s: {name: s, type: Proximity, parent: BODY b, range: 0.1,\n"
        "  array: [{offset: {x: 0, y: 0, z: 0}, direction: {x: 1, y: 0, z: 0}}]}\n"
    )
    bpy.ops.adf.import_file(filepath=str(file))
    collection, before = bpy.data.collections["m"], file.read_bytes()
    select(bpy.data.objects["b"])
    bpy.ops.object.delete()  # as a user deletes it: joints still point to it
    with pytest.raises(RuntimeError, match="which was deleted"):
        bpy.ops.adf.export_file(filepath=str(file), collection=collection.name)
    assert file.read_bytes() == before
    bpy.ops.adf.check()
    assert {f.rule for f in bpy.context.scene.adf.findings} == {"deleted-body"}
    bpy.ops.adf.fix(everything=True)
    bpy.ops.adf.export_file(filepath=str(file), collection=collection.name)
    document = read_any(file, Resolver([tmp_path]))
    assert [e.key for e in document.elements("bodies")] == ["BODY a"] and not document.elements("joints")
    assert document.elements("sensors")[0].text("parent") == ""


def test_a_copy_of_a_body_takes_its_shapes_along_and_shares_its_mesh_file(tmp_path):
    collection = model()
    part = body("part")
    bpy.ops.adf.fit_shape(kind="BOX")
    bpy.ops.adf.set_inertia(source="MESH")
    target = {"filepath": str(tmp_path / "m.yaml"), "collection": collection.name}
    bpy.ops.adf.export_file(**target)
    before = {path.name for path in tmp_path.rglob("*")}
    select(part)
    assert bpy.ops.adf.duplicate() == {"FINISHED"}
    copy = bpy.context.object
    assert copy is not part and sorted(c.adf.role for c in copy.children) == sorted(c.adf.role for c in part.children)
    copy.location.x = 2.0
    bpy.ops.adf.export_file(**target)
    first, second = read_any(tmp_path / "m.yaml", Resolver([tmp_path])).elements("bodies")
    assert first.text("mesh") == second.text("mesh") and second.text("collision shape") == "BOX"
    assert second.pose("location")[0] == (2.0, 0.0, 0.0) and second.text("name") == "part_001"
    assert {path.name for path in tmp_path.rglob("*")} == before
    assert {c.name for c in bpy.data.collections if c.name.endswith("Shapes")} == {f"{collection.name} Shapes"}


def test_a_joint_shows_the_keys_of_its_type_with_their_units():
    from adf_studio.key_panels import has_effect, unit_of
    from adf_studio.ligature.adf.schema import BY_PATH

    model()
    parent, child = body("parent"), body("child", location=(1, 0, 0))
    select(child, parent)
    bpy.ops.adf.connect(type="fixed")
    group = next(o for o in bpy.data.objects if o.adf.role == "JOINT").adf.joint
    keys = BY_PATH["joint"]

    def shown(*paths):
        return [has_effect(group, "joint", keys[path]) for path in paths]

    paths = (
        "joint limits.low",
        "joint limits.x",
        "joint limits.linear.low.x",
        "stiffness",
        "stiffness.angular.z",
        "controller.P",
    )
    assert shown(*paths) == [False] * 6
    for kind, expected, unit in (
        ("revolute", [True, False, False, False, False, True], "rad"),
        ("prismatic", [True, False, False, False, False, True], "m"),
        ("torsion spring", [True, False, False, True, False, True], "rad"),
        ("cone twist", [False, True, False, False, False, False], "rad"),
        ("six dof spring", [False, False, True, False, True, False], "rad"),
    ):
        group.type = kind
        assert shown(*paths) == expected, kind
        assert unit_of(group, "joint", keys["joint limits.low"]) == unit, kind
    group.stiffness = 3.0
    assert shown("stiffness") == [True]  # the file gives it, so that it can be taken out
