"""Work in steps: ended after any of them it leaves no trace, and later it does what it does at once."""

import json
import os
import random
import shutil
from pathlib import Path

import bpy
import pytest
from adf_studio import steps
from adf_studio.steps import all_or_nothing, finished, part

from .scene import select

FURTHER = [(0, 1), (2, 15), (16, 63), (64, 1023)]
"""Between which numbers of steps one is drawn after which an operator is ended."""

KINDS = ("objects", "meshes", "materials", "images", "cameras", "lights", "curves", "texts", "scenes", "collections")


def as_text(value):
    """A property as text that is the same whenever the value is."""
    if isinstance(value, bpy.types.ID):
        return value.name_full
    if isinstance(value, bpy.types.PropertyGroup):
        given = [p.identifier for p in value.bl_rna.properties if p.identifier != "rna_type"]
        given = [name for name in given if value.is_property_set(name)]
        return {name: as_text(getattr(value, name)) for name in given}
    if value is None or isinstance(value, (str, int, float)):
        return value
    return [as_text(item) for item in value]


def whole_print():
    """Everything of the blend file that these operators could change, as text."""
    view = bpy.context.view_layer
    listed = {kind: sorted(item.name_full for item in getattr(bpy.data, kind)) for kind in KINDS}
    objects = {
        obj.name: [
            [list(row) for row in (*obj.matrix_basis, *obj.matrix_parent_inverse)],
            [getattr(item, "name", "") for item in (obj.data, obj.parent)],
            obj.name in view.objects and obj.select_get(),
            as_text(obj.adf),
        ]
        for obj in bpy.data.objects
    }
    files = {c.name: [c.children.keys(), c.objects.keys(), as_text(c.adf)] for c in bpy.data.collections}
    shown = [(s.collection.children.keys(), s.collection.objects.keys(), as_text(s.adf)) for s in bpy.data.scenes]
    return json.dumps([listed, objects, files, shown, getattr(view.objects.active, "name", "")], indent=0)


def tree(folder):
    """Contents of all files below a folder."""
    return {path.relative_to(folder): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


class Counted:
    """Takes the steps of an operator in the place of `finished`: all, or a number of them that Esc still ends."""

    def __init__(self):
        self.most, self.count = None, 0

    def __call__(self, work):
        operator, self.count = work.gi_frame.f_locals["self"], 0
        try:
            while self.most is None or self.count < self.most or not operator.can_end:
                words, share = next(work)
                assert words and 0.0 <= share <= 1.0
                self.count += operator.can_end
        except StopIteration as end:
            return end.value
        work.close()
        return {"CANCELLED"}


@pytest.fixture
def counted(monkeypatch):
    counted = Counted()
    monkeypatch.setattr(steps, "finished", counted)
    return counted


def opened(scene, indices="0"):
    bpy.ops.adf.import_launch(filepath=str(scene), indices=indices)


def chosen(*roles):
    objects = [o for o in bpy.context.view_layer.objects if o.adf.role in roles]
    select(*objects, max(objects, key=lambda o: len(o.data.vertices) if o.type == "MESH" else 0))


def bodies(scene):
    opened(scene)
    chosen("BODY")


def joints(scene):
    opened(scene, "1")
    chosen("JOINT")


def shaped(scene):
    bodies(scene)
    bpy.ops.adf.fit_shape(kind="BOX")


def faulty(scene):
    opened(scene)
    for obj in [o for o in bpy.data.objects if o.adf.role == "BODY"]:
        obj.adf.body.property_unset("mass")
    bpy.ops.adf.check()


def variants(scene):
    opened(scene)
    layer = bpy.context.view_layer
    name = bpy.context.scene.adf.models[0].collection.name
    layer.active_layer_collection = layer.layer_collection.children[name]
    bpy.ops.adf.add_variant(filepath="other.yaml")
    bpy.ops.adf.add_variant(filepath="third.yaml")


def moved(scene):
    bodies(scene)
    for obj in bpy.context.selected_objects:
        obj.location.x += 0.001


def robot(scene):
    opened(scene)
    first = bpy.context.scene.adf.models[0].collection.name
    bpy.ops.adf.export_robot(filepath=str(scene.parent / "robot.urdf"), collection=first)


def nothing(scene):
    pass


CASES = {
    "import_file": (nothing, lambda s: {"filepath": str(s.parent / "pad.yaml"), "root": str(s.parent)}),
    "import_file several": (
        nothing,
        lambda s: {"directory": str(s.parent), "files": [{"name": n} for n in ("pad.yaml", "none.yaml", s.name)]},
    ),
    "import_launch": (nothing, lambda s: {"filepath": str(s)}),
    "import_launch again": (opened, lambda s: {"filepath": str(s)}),
    "import_robot": (robot, lambda s: {"filepath": str(s.parent / "robot.urdf")}),
    "export_file": (
        opened,
        lambda s: {
            "filepath": str(s.parent / "new" / "m.yaml"),
            "collection": bpy.context.scene.adf.models[0].collection.name,
        },
    ),
    "export_scene": (moved, lambda s: {"filepath": str(s)}),
    "export_scene elsewhere": (moved, lambda s: {"filepath": str(s.parent / "new" / "launch.yaml")}),
    "export_variants": (variants, lambda s: {}),
    "export_robot": (opened, lambda s: {"filepath": str(s.parent / "new.sdf"), "collection": "pad"}),
    "check": (opened, lambda s: {}),
    "fix": (faulty, lambda s: {"everything": True}),
    "low_resolution": (bodies, lambda s: {"vertices": 8}),
    "copy_shapes": (shaped, lambda s: {}),
    "set_gains": (joints, lambda s: {}),
    "set_inertia": (shaped, lambda s: {"source": "SHAPES"}),
    "mirror": (bodies, lambda s: {"across": "Y"}),
    "duplicate": (bodies, lambda s: {}),
}
"""What is there before an operator, and its arguments."""


def run(name, words):
    """What an operator returns, errors that it reports included."""
    try:
        return getattr(bpy.ops.adf, name.split()[0])(**words)
    except RuntimeError as error:
        return str(error)


@pytest.mark.parametrize("name", CASES)
def test_what_is_ended_after_any_step_leaves_no_trace(name, tmp_path, counted):
    prepare, arguments = CASES[name]
    kept, folder, found = tmp_path / "kept", tmp_path / "scenes", []
    ours = Path(os.environ["LIGATURE_ROOT"]) / "scenes"
    shutil.copytree(ours, kept, ignore=shutil.ignore_patterns("__pycache__"))  # other tests may write there meanwhile
    rng = random.Random(name)
    for ends in ([], FURTHER):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(kept, folder)
        scene, counted.most = folder / "blender_suturing" / "launch.yaml", None
        prepare(scene)
        words, files, before = arguments(scene), tree(folder), whole_print()
        for low, high in ends:  # later and later, until it comes to its end before that
            counted.most = rng.randint(low, high)
            if counted.most >= found[0]:
                break
            done = run(name, words)
            assert (done == {"CANCELLED"} or "none.yaml" in done) and counted.count == counted.most
            assert whole_print() == before
            assert tree(folder) == files
        counted.most = None
        done = run(name, words)
        assert done == {"FINISHED"} or "none.yaml" in done
        assert whole_print() != before or tree(folder) != files
        found += [counted.count, whole_print(), tree(folder)]
    assert found[0] >= 2
    assert found[:3] == found[3:]


def test_steps_are_taken_to_their_end_and_shares_grow():
    def two():
        yield "one", 0.0
        yield "two", 0.5
        return 7

    def whole():
        first = yield from part(two(), 0.0, 0.5)
        second = yield from part(two(), 0.5, 1.0)
        return first + second

    assert [share for _, share in whole()] == [0.0, 0.25, 0.5, 0.75]
    assert finished(whole()) == 14


def test_a_failure_takes_back_what_was_made_before_it():
    def fails():
        with all_or_nothing():
            bpy.data.objects.new("made", bpy.data.meshes.new("made"))
            yield "", 0.0
            raise ValueError("no")

    before = whole_print()
    with pytest.raises(ValueError, match="no"):
        finished(fails())
    assert whole_print() == before
