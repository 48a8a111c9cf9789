"""Bad input is reported with the object or file that it is about, and leaves the scene and all files as they were."""

import resource
import signal
from pathlib import Path

import bpy
import pytest
from adf_studio import making
from adf_studio.ligature.adf import Resolver, read_any
from adf_studio.ligature.authoring.shapes import Shape

from .scene import body, model, scene_print, select

GOOD_OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
MODEL = "bodies: [BODY part]\njoints: []\nhigh resolution path: ./\nBODY part:\n  name: part\n  mesh: part.OBJ\n  mass: 1.0\n"


def snapshot(folder):
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def fails(operator, words, **arguments):
    """Runs an operator that must report an error which states ``words``; returns the report."""
    before = scene_print()
    with pytest.raises(RuntimeError, match=words) as report:
        operator(**arguments)
    assert scene_print() == before
    return str(report.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"a: [1\nb: }", r"bad.yaml:2:\d+: error: invalid YAML"),
        (b"\x00\xff\xfe\x80", "bad.yaml"),
        (b"", "bad.yaml"),
        (b"- 1\n- 2\n", "bad.yaml"),
        (b"bodies: *nowhere\n", r"bad.yaml:1:\d+"),
        (None, "bad.yaml"),
    ],
    ids=["not yaml", "binary", "empty", "list", "alias", "missing"],
)
def test_a_malformed_file_is_refused_with_its_place(tmp_path, content, words):
    model()
    if content is not None:
        (tmp_path / "bad.yaml").write_bytes(content)
    fails(bpy.ops.adf.import_file, words, filepath=str(tmp_path / "bad.yaml"))


def test_a_folder_is_no_scene_file(tmp_path):
    fails(bpy.ops.adf.import_file, str(tmp_path.name), filepath=str(tmp_path))
    fails(bpy.ops.adf.import_launch, str(tmp_path.name), filepath=str(tmp_path))


def opened(path):
    """Brings a file in and returns its collection with what was reported about it."""
    from adf_studio.read_file import import_file

    done = import_file(path, bpy.context.scene)
    return done.collection, "\n".join(done.problems)


@pytest.mark.parametrize(
    "text",
    ["v a b c\nf 1 1 1\n", "v 0 0 0\nf 1 2 9\n", "v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", "", "\x00\x01\x02", "f 1 2 3\n"],
    ids=["words", "index", "nan", "empty", "binary", "no vertex"],
)  # fmt: skip
def test_a_malformed_mesh_is_reported_with_its_body_and_never_overwritten(tmp_path, text):
    (tmp_path / "m.yaml").write_text(MODEL)
    (tmp_path / "part.OBJ").write_text(text)
    before = snapshot(tmp_path)
    collection, report = opened(tmp_path / "m.yaml")
    assert "BODY part" in report and "part.OBJ" in report and "outside" not in report
    bpy.ops.adf.export_file(filepath=str(tmp_path / "m.yaml"), collection=collection.name)
    assert snapshot(tmp_path) == before


def test_one_bad_object_costs_itself_only(tmp_path):
    (tmp_path / "part.OBJ").write_text(GOOD_OBJ)
    text = MODEL.replace("joints: []", "joints: [JOINT a]")
    (tmp_path / "m.yaml").write_text(text + "JOINT a:\n  name: a\n  type: hinge\n  parent: BODY part\n")
    collection, report = opened(tmp_path / "m.yaml")
    assert "JOINT a" in report and "child axis" in report
    assert "BODY part" in {obj.adf.key for obj in collection.objects}
    bpy.ops.adf.export_file(filepath=str(tmp_path / "out.yaml"), collection=collection.name)
    assert (tmp_path / "out.yaml").read_bytes() == (tmp_path / "m.yaml").read_bytes()


def test_a_missing_texture_is_reported_with_its_body_and_its_name_stays_in_the_file(tmp_path):
    (tmp_path / "m.yaml").write_text(MODEL)
    (tmp_path / "part.OBJ").write_text("mtllib part.mtl\nusemtl skin\n" + GOOD_OBJ)
    (tmp_path / "part.mtl").write_text("newmtl skin\nKd 1 0 0\nmap_Kd gone.png\n")
    before = snapshot(tmp_path)
    collection, report = opened(tmp_path / "m.yaml")
    assert "BODY part" in report and "gone.png" in report
    bpy.ops.adf.export_file(filepath=str(tmp_path / "m.yaml"), collection=collection.name)
    assert snapshot(tmp_path) == before


def test_a_texture_that_cannot_be_read_is_reported_with_its_body(tmp_path):
    collection = model()
    part = body()
    material = bpy.data.materials.new("skin")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("gone.png", 4, 4)
    node.image.filepath_raw, node.image.source = str(tmp_path / "gone.png"), "FILE"
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    part.data.materials.append(material)
    from adf_studio.write_file import export_file

    done = export_file(collection, tmp_path / "m.yaml")
    assert any("'part'" in problem and "gone.png" in problem for problem in done.problems)
    assert "map_Kd" not in (tmp_path / "high_res" / "part.mtl").read_text()


def test_names_that_would_share_a_mesh_file_get_one_each(tmp_path):
    collection = model()
    for name, size in (("a b", 1.0), ("a_b", 2.0), ("A_B", 3.0)):
        body(name, size=size)
    bpy.ops.adf.export_file(filepath=str(tmp_path / "m.yaml"), collection=collection.name)
    document = read_any(tmp_path / "m.yaml", Resolver([tmp_path]))
    meshes = {element.key: element.text("mesh") for element in document.elements("bodies")}
    assert len({name.lower() for name in meshes.values()}) == 3
    for name in meshes.values():
        assert (tmp_path / "high_res" / name).is_file()
    assert "0.5 " in (tmp_path / "high_res" / meshes["BODY a b"]).read_text()


def test_two_objects_with_one_identifier_are_refused(tmp_path):
    collection = model()
    part, other = body("part"), body("other")
    other.adf.key = part.adf.key
    words = "'(other|part)' and '(other|part)' have one identifier, 'BODY part'"
    fails(bpy.ops.adf.export_file, words, filepath=str(tmp_path / "m.yaml"), collection=collection.name)
    assert snapshot(tmp_path) == {}


def everything():
    """A model with an object of every role that has a place."""
    collection = model()
    part, other = body("part"), body("other", location=(2, 0, 0))
    select(other, part)
    bpy.ops.adf.connect(type="revolute")
    select(part)
    making.add_shape(part, Shape("SPHERE", radius=0.1))
    bpy.ops.adf.add_hull()
    bpy.ops.adf.set_inertia(source="MESH")
    for role in ("GHOST_OBJECT", "SENSOR", "ACTUATOR", "CAMERA", "LIGHT", "SUTURE", "VOLUME"):
        select(part)
        bpy.ops.adf.add(role=role)
    return collection


ROLES = (
    "BODY",
    "JOINT",
    "SHAPE",
    "HULL",
    "INERTIAL",
    "GHOST_OBJECT",
    "SENSOR",
    "ACTUATOR",
    "CAMERA",
    "LIGHT",
    "SUTURE",
)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 0.0], ids=["nan", "infinite", "no scale"])
def test_an_object_without_a_place_is_named_and_nothing_is_written(tmp_path, value):
    collection = everything()
    target = {"filepath": str(tmp_path / "m.yaml"), "collection": collection.name}
    bpy.ops.adf.export_file(**target)
    before = snapshot(tmp_path)
    for role in ROLES:
        obj = next(o for o in collection.all_objects if o.adf.role == role)
        change = "scale" if value == 0.0 else "location"
        kept = tuple(getattr(obj, change))
        setattr(obj, change, (value, *kept[1:]))
        report = "has a scale of zero" if value == 0.0 else "has a transform that is not finite"
        fails(bpy.ops.adf.export_file, f"'{obj.name}' {report}", **target)
        assert snapshot(tmp_path) == before
        setattr(obj, change, kept)
    assert bpy.ops.adf.export_file(**target) == {"FINISHED"}
    assert snapshot(tmp_path) == before


def test_a_number_that_is_none_is_named_with_its_key(tmp_path):
    collection = model()
    part = body()
    part.adf.body.mass = float("nan")
    words = "'part' has a mass that is not a finite number"
    fails(bpy.ops.adf.export_file, words, filepath=str(tmp_path / "m.yaml"), collection=collection.name)
    assert snapshot(tmp_path) == {}


def saved(tmp_path):
    """A scene that is on the disk, and then changed in Blender: model, mesh and world would all be written anew."""
    collection = model()
    part = body()
    bpy.ops.adf.new_file(kind="WORLD", name="world", namespace="/ambf/env/")
    bpy.ops.adf.export_scene(filepath=str(tmp_path / "launch.yaml"))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"), compress=False)
    part.location.x, part.data.vertices[0].co.x = 3.0, 7.0
    bpy.context.scene.adf.world.adf.world.gravity = (0.0, 0.0, -1.0)
    return collection


@pytest.mark.parametrize("place", ["/proc/nowhere/m.yaml", "{0}/file/m.yaml", "{0}/folder"])
def test_a_path_that_cannot_be_written_is_named(tmp_path, place):
    collection = saved(tmp_path)
    (tmp_path / "file").write_text("a file, no folder")
    (tmp_path / "folder").mkdir()
    before = snapshot(tmp_path)
    path = place.format(tmp_path)
    report = fails(bpy.ops.adf.export_file, "cannot be written", filepath=path, collection=collection.name)
    assert str(Path(path).parent) in report and collection.name in report
    assert snapshot(tmp_path) == before


def test_a_full_disk_leaves_every_file_of_the_scene_as_it_was(tmp_path):
    """The system refuses files above a size, as it refuses all on a full disk."""
    saved(tmp_path)
    before = snapshot(tmp_path)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, hard))
    try:
        fails(bpy.ops.adf.export_scene, r"cannot be written: File too large", filepath=str(tmp_path / "launch.yaml"))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert snapshot(tmp_path) == before
    assert bpy.ops.adf.export_scene(filepath=str(tmp_path / "launch.yaml")) == {"FINISHED"}
    assert snapshot(tmp_path) != before


def test_a_scene_whose_last_file_cannot_be_placed_is_not_half_written(tmp_path):
    saved(tmp_path)
    (tmp_path / "launch.yaml").unlink()
    (tmp_path / "launch.yaml").mkdir()
    before = snapshot(tmp_path)
    fails(bpy.ops.adf.export_scene, "launch.yaml' cannot be written", filepath=str(tmp_path / "launch.yaml"))
    assert snapshot(tmp_path) == before
