"""What is brought in and written back unchanged is the same file, byte for byte; a change is one line."""

import json
import os
import time
from pathlib import Path

import bpy
import numpy as np
import pytest
from adf_studio.launch_file import preparing_scene
from adf_studio.ligature.adf import AdfError, Resolver, read_any
from adf_studio.ligature.authoring.placement import matrix_of
from adf_studio.poses import rest_pose
from adf_studio.read_file import import_file
from adf_studio.steps import finished
from adf_studio.write_file import export_file, prepared

EVERY = 1 if os.environ.get("LIGATURE_WHOLE_CORPUS") else 4
"""Which files are brought in and written back: all, or the last of so many."""


def files(corpus):
    found = sorted(corpus.rglob("*.yaml"))
    assert len(found) > 50
    return [file for file in found if file.name != "compound_example.yaml"][::-EVERY]


def test_every_real_file_comes_back_byte_for_byte_and_its_bodies_stand_where_it_states(corpus):
    kinds, worst = set(), 0.0
    for file in files(corpus):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        if "multibody configs" in file.read_text(errors="replace"):
            continue  # a launch file is opened with all that it names, below
        try:
            done = import_file(file, bpy.context.scene)
        except AdfError as error:
            pytest.fail(str(error))
        kinds.add(done.document.kind)
        written = prepared(done.collection, file).files  # what an export in its place would write
        assert written == {file: file.read_bytes()}, file
        worst = max(worst, pose_error(done))
    assert worst <= 1e-6
    assert kinds == {"model", "world", "input devices", "colors"} or (EVERY > 1 and "model" in kinds)


def launches(corpus):
    own = Path(os.environ["LIGATURE_ROOT"]) / "scenes"
    found = [f for f in sorted(corpus.rglob("*.yaml")) if "multibody configs" in f.read_text(errors="replace")]
    return [*found, *sorted(own.glob("*/launch*.yaml"))]


def test_every_launch_file_comes_back_with_all_that_it_names(corpus, tmp_path):
    found = launches(corpus)
    assert len(found) >= 8
    for number, file in enumerate(found[::-EVERY]):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        bpy.ops.adf.import_launch(filepath=str(file))
        launch = read_any(file, Resolver.for_file(file))
        named = [launch.world, launch.devices, launch.colours, *launch.models]
        here = [r.text for r in named if r is not None and r.path is not None]
        assert here, file
        world = bpy.context.scene.adf.world
        if world is not None and world.adf.world.environment:
            here.append(os.path.join(os.path.dirname(launch.world.text), world.adf.world.environment))
        done = finished(preparing_scene(bpy.context.scene, file)).export  # what an export in its place would write
        assert {path.resolve(): data for path, data in done.files.items()} == {
            path: path.read_bytes()
            for path in {(file.parent / name).resolve() for name in (".", *here)} - {file.parent.resolve()}
        } | {file.resolve(): file.read_bytes()}, file
        target = tmp_path / str(number) / "a" / "launch.yaml"
        assert bpy.ops.adf.export_scene(filepath=str(target)) == {"FINISHED"}
        assert all(target.parent in p.parents for p in (tmp_path / str(number)).rglob("*") if p.is_file())
        for name in here:  # paths that climb end below the folder
            copy = target.parent / name.replace("../", "")
            lines = zip(copy.read_text().splitlines(), (file.parent / name).read_text().splitlines(), strict=True)
            changed = [(a, b) for a, b in lines if a != b]
            assert all("resolution path" in b or "environment" in b for _, b in changed), (name, changed)


def test_a_file_that_is_no_yaml_is_refused_with_its_place(corpus):
    with pytest.raises(AdfError, match=r"compound_example.yaml:\d+:\d+: error: invalid YAML"):
        import_file(next(corpus.rglob("compound_example.yaml")), bpy.context.scene)


def test_one_changed_mass_changes_one_line(corpus, tmp_path):
    file = next(corpus.rglob("LND_400006_SIMPLE/psm1.yaml"))
    done = import_file(file, bpy.context.scene)
    body = next(o for o in done.collection.objects if o.adf.key == "BODY tool gripper1 simple")
    body.adf.body.mass = 0.125
    export_file(done.collection, tmp_path / "psm1.yaml")
    before, after = file.read_text().split("\n"), (tmp_path / "psm1.yaml").read_text().split("\n")
    assert [b for a, b in zip(before, after) if a != b] == ["  mass: 0.125"] and len(before) == len(after)


def pose_error(done):
    """Greatest difference of a body's pose from that in its file, as a share of its distance where that is above 1."""
    bpy.context.view_layer.update()
    elements = {e.key: e for e in done.document.elements("bodies")}
    errors = [0.0]
    for obj in done.collection.objects:
        if obj.adf.key in elements and obj.adf.role == "BODY":
            T = matrix_of(elements[obj.adf.key].pose("location"))
            scale = max(1.0, np.abs(T[:3, 3]).max())
            found = rest_pose(obj)
            errors += [np.abs(found - T)[:3, :3].max(), np.abs(found - T)[:3, 3].max() / scale]
            errors.append(np.abs(np.array(obj.matrix_world) - T).max() / scale)
    return max(errors)


def reference():
    """Processor seconds of Python's own work, half as many as a phantom takes on any machine, however busy."""
    start = time.process_time()
    json.loads(json.dumps([{"index": i, "place": [0.5 * i, float(i), 2.0 * i]} for i in range(50_000)], indent=1))
    return time.process_time() - start


def test_the_phantom_opens_and_is_written_within_seconds(corpus, tmp_path):
    file = next(corpus.rglob("Simple/phantom.yaml"))
    before, start = reference(), time.process_time()
    done = import_file(file, bpy.context.scene)
    bpy.context.view_layer.update()
    opened = time.process_time() - start
    start = time.process_time()
    export_file(done.collection, tmp_path / "phantom.yaml")
    written = time.process_time() - start
    assert (tmp_path / "phantom.yaml").read_bytes() == file.read_bytes()
    unit = max(before, reference())
    assert opened < 6.0 * unit and written < 6.0 * unit, (opened, written, unit)


def test_references_to_other_files_are_kept_and_resolved_when_those_are_open(corpus):
    folder = next(corpus.rglob("LND_400006_SIMPLE"))
    ghosts = next(f for f in sorted(corpus.rglob("ghosts*.yaml")))
    done = import_file(ghosts, bpy.context.scene)
    texts = {o.adf.parent_text for o in done.collection.objects if o.adf.role == "GHOST_OBJECT"}
    assert any("BODY" in text for text in texts)
    assert folder.is_dir()


def test_one_instrument_is_written_as_two_files(corpus, tmp_path):
    file = next(corpus.rglob("LND_400006_SIMPLE/psm1.yaml"))
    done = import_file(file, bpy.context.scene)
    export_file(done.collection, tmp_path / "psm1.yaml")
    done.collection.adf.filepath = str(tmp_path / "psm1.yaml")
    layers = bpy.context.view_layer
    layers.active_layer_collection = layers.layer_collection.children[done.collection.name]
    bpy.ops.adf.add_variant(filepath="psm2.yaml", namespace="/ambf/env/psm2/", location=(0.5, 0.0, 0.0))
    assert bpy.ops.adf.export_variants() == {"FINISHED"}
    first, second = (read_any(tmp_path / f"psm{i}.yaml", Resolver([tmp_path])) for i in (1, 2))
    assert second.top.text("namespace") == "/ambf/env/psm2/"
    for a, b in zip(first.elements("bodies"), second.elements("bodies"), strict=True):
        shift = np.subtract(b.pose("location")[0], a.pose("location")[0])
        np.testing.assert_allclose(shift, [0.5, 0.0, 0.0], atol=1e-6)
        assert a.key == b.key
    assert (tmp_path / "psm1.yaml").read_bytes() == file.read_bytes()


def test_a_moved_body_writes_its_own_pose_only(corpus, tmp_path):
    file = next(corpus.rglob("Simple/phantom.yaml"))
    done = import_file(file, bpy.context.scene)
    body = next(o for o in done.collection.objects if o.adf.key == "BODY Barrier")
    body.location.x += 0.25
    export_file(done.collection, tmp_path / "phantom.yaml")
    before, after = file.read_text().split("\n"), (tmp_path / "phantom.yaml").read_text().split("\n")
    changed = [(a, b) for a, b in zip(before, after) if a != b]
    assert len(before) == len(after) and len(changed) == 1 and changed[0][1].strip().startswith("x: ")


def test_a_vehicle_comes_back_with_keys_that_blender_does_not_hold_and_aliases(tmp_path):
    text = """bodies: [BODY c]
joints: []
vehicles: [VEHICLE v]
BODY c: {name: c, mass: 1.0}
wheel: &wheel {mesh: wheel.OBJ, radius: 0.30, width: 0.10, friction: 1, mine: kept}   # all four
VEHICLE v:
  name: v
  chassis: BODY c
  wheels:
  - *wheel
  # the second
  - mesh: wheel.OBJ
    width: 0.20
    radius: 0.3
    suspension: {stiffness: 10, damping: 1, compression: 1, rest length: 0.10}
    steering limits: {low: -0.5, high: 0.5}
  - *wheel
"""
    file = tmp_path / "v.yaml"
    file.write_text(text)
    done = import_file(file, bpy.context.scene)
    assert prepared(done.collection, file).text == text
    vehicle = next(o for o in done.collection.objects if o.adf.role == "VEHICLE")
    vehicle.adf.vehicle.wheels[1].radius = 0.25
    assert prepared(done.collection, file).text == text.replace("    radius: 0.3\n", "    radius: 0.25\n")
    vehicle.adf.vehicle.wheels[2].radius = 0.25
    after = prepared(done.collection, file).text
    expanded = "  - {mesh: wheel.OBJ, radius: 0.25, width: 0.10, friction: 1, mine: kept}\n"
    assert after == text.replace("    radius: 0.3\n", "    radius: 0.25\n")[: -len("  - *wheel\n")] + expanded
