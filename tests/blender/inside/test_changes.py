"""One object of a real file is changed in Blender: the text changes in its keys and in what must follow, nowhere else."""

import json
import os
import random
import zlib
from collections import Counter

import bpy
import numpy as np
import pytest
from adf_studio import making
from adf_studio.check_operators import check_file, mend
from adf_studio.ligature.adf.nodes import parse, plain
from adf_studio.ligature.adf.reader import read_text
from adf_studio.ligature.adf.schema import BY_PATH, LISTS
from adf_studio.ligature.authoring.placement import JointKeys, child_pose, matrix_of, moved_child_pose, pose_of
from adf_studio.placing import place
from adf_studio.poses import rest_pose
from adf_studio.read_file import import_file
from adf_studio.write_file import ExportError, members, prepared

from .scene import corpus_sample

MESHES = ("mesh", "collision mesh", "collision mesh type")
SHAPES = (
    "shape", "geometry", "compound shape", "collision shape", "collision geometry", "collision offset",
    "compound collision shape", "inertial offset",
)  # fmt: skip
GEOMETRY = ("parent pivot", "child pivot", "parent axis", "child axis", "offset", "child offset", "joint offset")
POSES = ("location", "look at", "up", "direction")
PLACED = ("BODY", "JOINT", "GHOST_OBJECT", "SENSOR", "ACTUATOR", "CAMERA", "LIGHT")
REPORT = os.environ.get("LIGATURE_REPORT")


def leaves(value, path=()):
    """Every value of a file in its own digits, by its place; the lists of objects apart."""
    if isinstance(value, dict):
        for key, item in value.items():
            if not (not path and key in LISTS):
                yield from leaves(item, (*path, key))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from leaves(item, (*path, index))
    else:
        yield path, value


def listed(root):
    return {name: plain(root.get(name)) or [] for name in LISTS if root.get(name) is not None}


class Edit:
    """A file that was opened, one of its objects, and what may change in the text."""

    def __init__(self, file, obj, done):
        self.file, self.obj, self.done = file, obj, done
        self.key, self.role = obj.adf.key, obj.adf.role
        self.objects = members(done.collection)
        self.allowed = {}
        self.gone, self.new = set(), set()

    def allow(self, key, *names):
        self.allowed.setdefault(key, set()).update(names)

    def joints(self):
        return [
            o for o in self.objects if o.adf.role == "JOINT" and self.obj in (o.adf.parent_object, o.adf.child_object)
        ]

    def below(self):
        return [o for o in self.obj.children_recursive if o.adf.role in PLACED]


def move(edit, rng):
    edit.obj.location.x += 0.001
    edit.allow(edit.key, "location", "look at")
    follow(edit, "parent pivot", "child pivot")


def turn(edit, rng):
    edit.obj.rotation_mode = "QUATERNION"
    axis = np.array(rng.choice([(0, 0, 1), (1, 0, 0), (0.6, 0, 0.8)]), dtype=float)
    half = 0.5 * rng.choice([0.01, 0.3, 1.0])
    w, x, y, z = edit.obj.rotation_quaternion
    a = np.array([np.cos(half), *(np.sin(half) * axis)])
    edit.obj.rotation_quaternion = (
        w * a[0] - x * a[1] - y * a[2] - z * a[3], w * a[1] + x * a[0] + y * a[3] - z * a[2],
        w * a[2] - x * a[3] + y * a[0] + z * a[1], w * a[3] + x * a[2] - y * a[1] + z * a[0],
    )  # fmt: skip
    edit.allow(edit.key, *POSES)
    follow(edit, *GEOMETRY)


def follow(edit, *names):
    """Joints follow the body that they join, and a joint that is moved is moved itself."""
    if edit.role == "JOINT":
        edit.allow(edit.key, *names)
    for joint in edit.joints():
        edit.allow(joint.adf.key, *names)


def scale(edit, rng):
    if edit.role not in ("BODY", "GHOST_OBJECT"):
        return False
    edit.obj.scale = (rng.choice([0.5, 2.0, 3.0]),) * 3
    edit.allow(edit.key, *MESHES, *SHAPES)
    for obj in edit.below():
        edit.allow(obj.adf.key, *POSES, *SHAPES, *MESHES, *GEOMETRY)
    follow(edit, "parent pivot", "child pivot")
    return True


def recolour(edit, rng):
    group = getattr(edit.obj.adf, edit.role.lower())
    if not hasattr(group, "color_components_diffuse_g"):
        return False
    group.color_components_diffuse_g = 0.4321
    edit.allow(edit.key, "color components")
    return True


def rename(edit, rng):
    edit.obj.name = "another name"
    edit.allow(edit.key, "name")


def reparent(edit, rng):
    others = [o for o in edit.objects if o.adf.role == "BODY" and o is not edit.obj and o is not edit.obj.parent]
    if edit.role in ("BODY",) or not others:
        return False
    other = rng.choice(others)
    if edit.role == "JOINT":
        if other is edit.obj.adf.child_object:
            return False
        edit.obj.adf.parent_object = other
        edit.allow(edit.key, "parent", *GEOMETRY)
        return True
    T = rest_pose(edit.obj)
    edit.obj.parent = other
    edit.obj.matrix_parent_inverse.identity()
    place(edit.obj, np.linalg.inv(rest_pose(other)) @ T)
    edit.allow(edit.key, "parent", *POSES)
    return True


def duplicate(edit, rng):
    copy = edit.obj.copy()
    edit.obj.users_collection[0].objects.link(copy)
    with pytest.raises(ExportError, match="have one identifier"):
        prepared(edit.done.collection, edit.file)
    making.make_own(copy)
    edit.new.add(copy.adf.key)


def delete(edit, rng):
    """What names the object is refused, and mended as Check Scene offers."""
    edit.gone.add(edit.key)
    names = {joint.adf.key for joint in edit.joints()}
    hanging = [o for o in edit.objects if o.parent is edit.obj and o.adf.role not in ("JOINT", *making.PARTS)]
    for obj in hanging:
        edit.allow(obj.adf.key, "parent", *POSES)
    bpy.data.objects.remove(edit.obj)
    if names or hanging:
        with pytest.raises(ExportError, match="was deleted"):
            prepared(edit.done.collection, edit.file)
        for finding, obj in check_file(edit.done.collection):
            assert finding.rule == "deleted-body"
            mend(obj, finding.fix)
    for joint in [o for o in edit.done.collection.all_objects if o.adf.role == "JOINT" and not o.adf.key]:
        bpy.data.objects.remove(joint)
    edit.gone |= names


CHANGES = {f.__name__: f for f in (move, turn, scale, recolour, rename, reparent, duplicate, delete)}


def changed_file(file, name):
    """A file with one change, drawn by the names of both: the edit and the text; None where there is nothing to change."""
    rng = random.Random(zlib.crc32(f"{file.name} {file.parent.name} {name}".encode()))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    done = import_file(file, bpy.context.scene)
    candidates = (
        [o for o in members(done.collection) if o.adf.role in PLACED] if done.collection.adf.kind != "OTHER" else []
    )
    candidates = [
        o for o in candidates if o.adf.role != "JOINT" or None not in (o.adf.parent_object, o.adf.child_object)
    ]
    rng.shuffle(candidates)
    for obj in candidates[:6]:
        edit = Edit(file, obj, done)
        if CHANGES[name](edit, rng) is not False:
            return edit, prepared(done.collection, file).text
    return None


def joint_errors(document):
    """How far each joint's bodies stand from where it holds them, by key: a motion (4, 4)."""
    bodies = {b.key: b for b in document.elements("bodies")}
    found = {}
    for joint in document.elements("joints"):
        ends = [bodies.get(joint.text(name)) for name in ("parent", "child")]
        if None in ends:
            continue
        scales = [body.number("scale") or 1.0 for body in ends]
        pivots = [tuple(s * v for v in joint.vector(f"{n} pivot")) for s, n in zip(scales, ("parent", "child"))]
        keys = JointKeys(
            *pivots, joint.vector("parent axis"), joint.vector("child axis"),
            joint.number("offset") if joint.has("offset") else joint.number("child offset"), joint.number("joint offset"),
        )  # fmt: skip
        inertial = [matrix_of(b.pose("inertial offset")) for b in ends]
        T_parent, T_child = (matrix_of(b.pose("location")) for b in ends)
        zero = T_parent @ child_pose(keys, *inertial, joint.text("type") == "prismatic")
        found[joint.key] = zero @ np.linalg.inv(T_child), scales
    return found


@pytest.mark.parametrize("name", CHANGES)
def test_one_change_touches_its_own_keys_and_what_must_follow(corpus, name):
    counts, lines = Counter(), {}
    for file in corpus_sample(corpus):
        found = changed_file(file, name)
        if found is None:
            continue
        edit, text = found
        source = edit.done.collection.adf.source
        before, after = parse(source, file), parse(text, file)
        old, new = dict(leaves(plain(before))), dict(leaves(plain(after)))
        differing = {path for path in old.keys() | new.keys() if old.get(path) != new.get(path)}
        label = f"{file.name}: {name} '{edit.key}'"
        for path in differing:
            if path[0] in edit.gone or path[0] in edit.new:
                continue
            assert path[0] in edit.allowed and path[1] in edit.allowed[path[0]], (
                label,
                path,
                old.get(path),
                new.get(path),
            )
        for kind, names in listed(before).items():
            kept = [n for n in names if n not in edit.gone]
            found_names = listed(after).get(kind, [])
            assert [n for n in found_names if n not in edit.new] == kept, label
        assert all((path[0] in edit.gone) for path in old if path[0] not in {p[0] for p in new}), label
        if name == "move" and edit.role == "BODY" and (edit.key, "location", "position", "x") in old:
            assert {p for p in differing if p[0] == edit.key} == {(edit.key, "location", "position", "x")}, label
        if name == "rename":
            assert differing == {(edit.key, "name")}, label
        if not edit.gone and not edit.new and name in ("move", "turn", "rename"):
            olds, news = source.splitlines(), text.splitlines()
            same_length = len(olds) == len(news)
            if same_length:
                count = sum(a != b for a, b in zip(olds, news))
                assert count <= len(differing), label
                lines[str(file.relative_to(corpus))] = count
        comments = [line.strip() for line in source.splitlines() if line.strip().startswith("#")]
        if not edit.gone:
            assert [line.strip() for line in text.splitlines() if line.strip().startswith("#")] == comments, label
        check_motion(edit, name, text, source, label)
        counts[str(file)] += 1
    assert sum(counts.values()) >= 3
    if REPORT:
        with open(REPORT, "a") as stream:
            stream.write(json.dumps({"change": name, "files": len(counts), "lines": lines}) + "\n")


def check_motion(edit, name, text, source, label):
    """The scene differs as it should: the body by its motion, joints hold it as well or badly as before."""
    if name not in ("move", "turn") or edit.done.collection.adf.kind != "MODEL":
        return
    first, last = (read_text(t, edit.file, "model") for t in (source, text))
    if edit.role == "BODY":
        a, b = (next(e for e in d.elements("bodies") if e.key == edit.key) for d in (first, last))
        found, T = matrix_of(b.pose("location")), rest_pose(edit.obj)
        far = max(1.0, np.abs(T[:3, 3]).max())
        assert np.abs(found - T)[:3].max() < 3e-6 * far, label
        if name == "move":
            shift = np.subtract(b.pose("location")[0], a.pose("location")[0])
            np.testing.assert_allclose(shift, [0.001, 0.0, 0.0], atol=3e-7 * far, err_msg=label)
    errors, now = joint_errors(first), joint_errors(last)
    for key, (error, _) in errors.items():
        if edit.role == "BODY" and key not in edit.allowed:
            np.testing.assert_allclose(now[key][0], error, atol=1e-12, err_msg=f"{label} {key}")


def test_a_shape_of_a_compound_is_moved_in_its_own_lines(tmp_path):
    text = """bodies: [BODY a]
joints: []
BODY a:
  name: a
  mass: 1.0
  compound collision shape:
  # the first
  - shape: BOX
    geometry: {x: 0.10, y: 0.2, z: 0.3}  # metres
    offset:
      position: {x: 0.100, y: 0.0, z: 0.0}
      orientation: {r: 0.0, p: 0.0, y: 0.0}
    mine: kept
  - {shape: SPHERE, geometry: {radius: 0.0500}, offset: {position: {x: 0, y: 0, z: 1}, orientation: {r: 0, p: 0, y: 0}}}
  - shape: CAPSULE
    name: tip
    geometry: {radius: 0.000186, height: 2.381e-3, axis: Z}
    offset: {position: {x: 0, y: 0, z: 2}, orientation: {r: 0, p: 0, y: 0}}
"""
    file = tmp_path / "m.yaml"
    file.write_text(text)

    def export(change):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        done = import_file(file, bpy.context.scene)
        body = members(done.collection)[0]
        shapes = sorted((c for c in body.children if c.adf.role == "SHAPE"), key=lambda c: c.adf.shape.order)
        change(shapes)
        return prepared(done.collection, file).text

    def moved(shapes):
        shapes[0].location.x += 0.001

    def thicker(shapes):
        shapes[2].adf.shape.radius = 0.000187

    def removed(shapes):
        bpy.data.objects.remove(shapes[1])

    def copied(shapes):
        copy = shapes[0].copy()
        shapes[0].users_collection[0].objects.link(copy)
        copy.location.z = 3.0

    assert export(lambda shapes: None) == text
    assert export(moved) == text.replace("x: 0.100,", "x: 0.101,")
    assert export(thicker) == text.replace("radius: 0.000186", "radius: 0.000187")
    assert export(removed) == "".join(line for line in text.splitlines(True) if "SPHERE" not in line)
    after = export(copied)
    assert all(line in after.splitlines() for line in text.splitlines())
    assert plain(parse(after, file))["BODY a"]["compound collision shape"][1]["offset"]["position"]["z"] == "3.0"


def test_a_ray_of_a_sensor_is_changed_in_its_own_line(tmp_path):
    text = """bodies: []
joints: []
sensors: [SENSOR s]
SENSOR s:
  name: s
  type: Proximity
  array:
  -  # the first
    offset: {x: 0.0, y: 0.0, z: -0.010}
    direction: {x: -1.0, y: 0.0, z: 0.0}
    mine: kept
  - &second
    offset: {x: 0.0, y: 0.0, z: -0.02}
    direction: {x: -1.0, y: 0.0, z: 0.0}
  - *second
  range: 0.1
"""
    file = tmp_path / "m.yaml"
    file.write_text(text)
    done = import_file(file, bpy.context.scene)
    sensor = members(done.collection)[0]
    assert prepared(done.collection, file).text == text
    sensor.adf.sensor.array[1].offset[2] = -0.03
    assert prepared(done.collection, file).text.count("-0.03") == 1
    sensor.adf.sensor.array[0].offset[0] = 0.25
    after = prepared(done.collection, file).text
    assert "    offset: {x: 0.25, y: 0.0, z: -0.010}" in after and "mine: kept" in after and "# the first" in after
    sensor.adf.sensor.array.remove(0)
    after = prepared(done.collection, file).text
    assert len(plain(parse(after, file))["SENSOR s"]["array"]) == 2


def test_a_joint_whose_bodies_stand_elsewhere_stays_when_one_is_moved(tmp_path):
    text = """bodies: [BODY a, BODY b]
joints: [JOINT j]
BODY a: {name: a, mass: 1.0, location: {position: {x: 0, y: 0, z: 0}, orientation: {r: 0, p: 0, y: 0}}}
BODY b: {name: b, mass: 1.0, location: {position: {x: 0, y: 0, z: 0}, orientation: {r: 0, p: 0, y: 0}}}
JOINT j:
  name: j
  type: revolute
  parent: BODY a
  child: BODY b
  parent axis: {x: 0, y: 0.0, z: -2}
  child axis: {x: 0, y: 1, z: 0}
  parent pivot: {x: 0.5, y: 0, z: 0.300}
  child pivot: {x: 0, y: 0.25, z: 0}
  offset: 0.7
"""
    file = tmp_path / "m.yaml"
    file.write_text(text)
    done = import_file(file, bpy.context.scene)
    b = next(o for o in members(done.collection) if o.adf.key == "BODY b")
    b.location.x += 0.001
    at = text.index("BODY b: {")
    assert prepared(done.collection, file).text == text[:at] + text[at:].replace("{x: 0,", "{x: 0.001,", 1)
    joint = next(o for o in members(done.collection) if o.adf.role == "JOINT")
    joint.location.z += 0.01
    after = read_text(prepared(done.collection, file).text, file, "model")
    keys = after.elements("joints")[0]
    assert keys.vector("parent pivot") == (0.5, 0.0, 0.31) and keys.vector("parent axis") == (0.0, 0.0, -2.0)
    assert keys.number("offset") == 0.7


BENT = """bodies: [BODY a, BODY b]
joints: [JOINT j]
BODY a: {{name: a, mass: 0.0, location: {a}}}
BODY b: {{name: b, mass: 1.0, scale: 2.0, location: {b}}}
JOINT j: {{name: j, type: {kind}, parent: BODY a, child: BODY b, parent pivot: {{x: 0.1, y: 0.2, z: 0.0}},
  child pivot: {{x: 0.0, y: -0.1, z: 0.05}}, parent axis: {{x: 0, y: 1, z: 0}}, child axis: {{x: 0.6, y: 0, z: -0.8}},
  offset: 0.7, joint limits: {{low: -2, high: 2}}}}
"""
BENT_KEYS = JointKeys((0.1, 0.2, 0.0), (0.0, -0.2, 0.1), (0.0, 1.0, 0.0), (0.6, 0.0, -0.8), 0.7)


def adf_pose(T):
    (x, y, z), (r, p, yaw) = pose_of(T)
    return f"{{position: {{x: {x}, y: {y}, z: {z}}}, orientation: {{r: {r}, p: {p}, y: {yaw}}}}}"


@pytest.mark.parametrize("moved", ["BODY a", "BODY b", "JOINT j"])
@pytest.mark.parametrize("turns", [False, True], ids=["shifted", "turned"])
@pytest.mark.parametrize(("kind", "position"), [("revolute", 1.1), ("torsion spring", -0.6), ("prismatic", 0.3)])
def test_a_bent_joint_keeps_its_position_when_one_of_its_ends_moves(tmp_path, kind, position, turns, moved):
    prismatic = kind == "prismatic"
    T_a = matrix_of(((0.3, -0.2, 0.5), (0.4, -0.3, 1.2)))
    T_b = T_a @ moved_child_pose(BENT_KEYS, position, prismatic=prismatic)
    file = tmp_path / "m.yaml"
    file.write_text(BENT.format(a=adf_pose(T_a), b=adf_pose(T_b), kind=kind))
    done = import_file(file, bpy.context.scene)
    obj = next(o for o in members(done.collection) if o.adf.key == moved)
    obj.location.x += 0.001
    obj.rotation_euler.z += 0.2 * turns
    after = read_text(prepared(done.collection, file).text, file, "model")
    a, b = (matrix_of(body.pose("location")) for body in after.elements("bodies"))
    (joint,) = after.elements("joints")
    keys = JointKeys(
        joint.vector("parent pivot"), tuple(2.0 * v for v in joint.vector("child pivot")),
        joint.vector("parent axis"), joint.vector("child axis"), joint.number("offset"), joint.number("joint offset"),
    )  # fmt: skip
    np.testing.assert_allclose(a @ moved_child_pose(keys, position, prismatic=prismatic), b, atol=5e-6)
    assert moved != "BODY b" or abs(b[0, 3] - T_b[0, 3] - 0.001) < 1e-6


def test_a_joint_to_a_body_that_is_not_open_is_not_moved_in_silence(tmp_path):
    file = tmp_path / "m.yaml"
    file.write_text("""bodies: [BODY a]
joints: [JOINT j]
BODY a: {name: a, mass: 1.0}
JOINT j: {name: j, type: fixed, parent: BODY a, child: other/BODY far, parent pivot: {x: 0, y: 0, z: 0},
  child pivot: {x: 0, y: 0, z: 0}, parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}}
""")
    done = import_file(file, bpy.context.scene)
    a, joint = members(done.collection)
    a.location.x = 1.0
    assert prepared(done.collection, file).text.count("x: 1.0") == 1
    joint.location.x = 1.0
    assert [
        n.startswith("'j' was moved, and joins a body that is not open") for n in prepared(done.collection, file).notes
    ] == [True]


@pytest.mark.parametrize(("listed", "kind"), LISTS.items())
def test_an_object_that_is_renamed_is_written_whether_or_not_its_kind_has_a_name(tmp_path, listed, kind):
    file = tmp_path / "m.yaml"
    file.write_text(
        f"{listed}: [thing]\nthing: {{mass: 1.0, hardware name: MTML, simulated multibody: x.yaml, parent: BODY a}}\n"
    )
    done = import_file(file, bpy.context.scene)
    objects = members(done.collection)
    assert objects or kind != "input device"
    for obj in objects:
        obj.name = "Another"
    root = parse(prepared(done.collection, file).text, file)
    if objects:
        assert plain(root.get("thing")).get("name") == ("Another" if "name" in BY_PATH[kind] else None)
