"""What is brought in and written back unchanged is the same file, byte for byte; a change is one line."""

import time

import bpy
import numpy as np
import pytest
from adf_studio.ligature.adf import AdfError, Resolver, read_any
from adf_studio.ligature.authoring.placement import matrix_of
from adf_studio.placing import rest_pose
from adf_studio.read_file import import_file
from adf_studio.write_file import export_file


def files(corpus):
    found = sorted(corpus.rglob("*.yaml"))
    assert len(found) > 50
    return [file for file in found if file.name != "compound_example.yaml"]


def test_every_real_file_comes_back_byte_for_byte(corpus, tmp_path):
    for number, file in enumerate(files(corpus)):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        try:
            done = import_file(file, bpy.context.scene)
        except AdfError as error:
            pytest.fail(str(error))
        if "multibody configs" in done.document.text:
            continue  # launch files are imported whole
        target = tmp_path / f"{number}.yaml"
        result = export_file(done.collection, target) if done.collection.adf.kind == "OTHER" else None
        text = result.text if result else None
        if text is None:
            from adf_studio.write_file import text_of

            text = text_of(done.collection)
        assert text.encode() == file.read_bytes().removeprefix(b"\xef\xbb\xbf"), file


def test_a_file_that_is_no_yaml_is_refused_with_its_place(corpus):
    with pytest.raises(AdfError, match=r"compound_example.yaml:\d+:\d+: error: this is not YAML"):
        import_file(next(corpus.rglob("compound_example.yaml")), bpy.context.scene)


def test_one_changed_mass_changes_one_line(corpus, tmp_path):
    file = next(corpus.rglob("LND_400006_SIMPLE/psm1.yaml"))
    done = import_file(file, bpy.context.scene)
    body = next(o for o in done.collection.objects if o.adf.key == "BODY tool gripper1 simple")
    body.adf.body.mass = 0.125
    export_file(done.collection, tmp_path / "psm1.yaml")
    before, after = file.read_text().split("\n"), (tmp_path / "psm1.yaml").read_text().split("\n")
    assert [b for a, b in zip(before, after) if a != b] == ["  mass: 0.125"] and len(before) == len(after)


def test_bodies_stand_where_the_file_says(corpus):
    worst = 0.0
    for file in files(corpus):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        done = import_file(file, bpy.context.scene)
        bpy.context.view_layer.update()
        elements = {e.key: e for e in read_any(file, Resolver.for_file(file)).elements("bodies")}
        for obj in done.collection.objects:
            if obj.adf.key in elements and obj.adf.role == "BODY":
                T = matrix_of(elements[obj.adf.key].pose("location"))
                scale = max(1.0, np.abs(T[:3, 3]).max())
                worst = max(
                    worst, np.abs(rest_pose(obj) - T)[:3, :3].max(), np.abs(rest_pose(obj) - T)[:3, 3].max() / scale
                )
                worst = max(worst, np.abs(np.array(obj.matrix_world) - T).max() / scale)
    assert worst <= 1e-6


def test_the_phantom_opens_in_a_second_and_is_written_in_another(corpus, tmp_path):
    file = next(corpus.rglob("Simple/phantom.yaml"))
    start = time.process_time()
    done = import_file(file, bpy.context.scene)
    bpy.context.view_layer.update()
    opened = time.process_time() - start
    start = time.process_time()
    export_file(done.collection, tmp_path / "phantom.yaml")
    written = time.process_time() - start
    assert (tmp_path / "phantom.yaml").read_bytes() == file.read_bytes()
    # processor seconds, which other work on the machine lengthens little
    assert opened < 1.3 and written < 1.3, (opened, written)


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
