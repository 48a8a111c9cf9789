"""Exports stay in their folder, replace nothing that is not theirs, and ask before they read elsewhere."""

import contextlib
import difflib
import json
import os
from pathlib import Path

import bpy
import pytest
from adf_studio.launch_file import export_scene
from adf_studio.ligature.adf import Resolver, read_any
from adf_studio.ligature.mesh import load_mesh
from adf_studio.read_file import import_file
from adf_studio.steps import finished
from adf_studio.write_file import ExportError, ForeignFiles, export_file, members, prepared

from .scene import body, corpus_sample, model

OBJ = "mtllib part.mtl\nusemtl skin\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
CLIMBING = """bodies: [BODY a, BODY b]
joints: []
high resolution path: ../../../meshes/tools/high_res/   # beside the models
low resolution path: ../../../meshes/tools/low_res/
BODY a:
  name: a
  mesh: part.OBJ
  mass: 1.0
BODY b:
  name: b
  mesh: part.OBJ
  mass: 1.0
"""


def snapshot(folder):
    return {path: path.read_bytes() if path.is_file() else None for path in sorted(folder.rglob("*"))}


def climbing(tmp_path):
    """A model whose meshes lie beside the folder of its file, as those of AMBF do, in a scene that may read them."""
    base = tmp_path / "scene"
    for folder in ("high_res", "low_res"):
        (base / "meshes" / "tools" / folder).mkdir(parents=True)
        (base / "meshes" / "tools" / folder / "part.OBJ").write_text(OBJ)
        (base / "meshes" / "tools" / folder / "part.mtl").write_text("newmtl skin\nKd 1 0 0\nmap_Kd ../skins/red.png\n")
    (base / "meshes" / "tools" / "skins").mkdir()
    (base / "meshes" / "tools" / "skins" / "red.png").write_bytes(b"a picture")
    model = base / "descriptions" / "multi-bodies" / "tools" / "mine.yaml"
    model.parent.mkdir(parents=True)
    model.write_text(CLIMBING)
    (base / "package.xml").write_text("<package/>")
    return model


def world_around(target):
    """A tree around a target with files where paths that climb would end."""
    folder = target
    for _ in range(4):
        folder = folder.parent
        for name in ("meshes/tools/high_res/part.OBJ", "high_res/part.OBJ", "low_res/part.OBJ"):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text("of somebody else")


def test_every_real_file_stays_in_the_folder_that_it_is_exported_to(corpus, tmp_path):
    original = {p: p.stat().st_mtime_ns for p in corpus.rglob("*")}
    copied = 0
    for number, file in enumerate(corpus_sample(corpus)):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        done = import_file(file, bpy.context.scene)
        around = tmp_path / str(number)
        target = around / "a" / "b" / "c" / "mine.yaml"
        target.parent.mkdir(parents=True)
        world_around(target.parent)
        before = snapshot(around)
        exported = export_file(done.collection, target)
        assert all(target.parent in path.parents for path in exported.files), file
        after = snapshot(around)
        assert {p: v for p, v in after.items() if target.parent not in p.parents} == {
            p: v for p, v in before.items() if target.parent not in p.parents
        }, file
        if done.collection.adf.kind == "MODEL":
            copied += same_meshes(done, target)
    assert {p: p.stat().st_mtime_ns for p in corpus.rglob("*")} == original
    assert copied > 10


def same_meshes(done, target):
    """The meshes that could be read are there, with equal triangles; how many."""
    copy, inside, count = read_any(target, Resolver([target.parent])), Resolver([target.parent]), 0
    around = Resolver.for_file(done.document.path)
    pairs = zip(done.document.elements("bodies"), copy.elements("bodies"), strict=True)
    for old, new in pairs:
        for key, name in (("high resolution path", "mesh"), ("low resolution path", "collision mesh")):
            files = []
            for document, element in ((done.document, old), (copy, new)):
                folder = document.path.parent / document.top.text(key) / element.text(key)
                files.append(folder / (element.text(name) or element.text("mesh")))
            if not old.text("mesh") or not around.exists(files[0]):
                continue
            if files[0].suffix.lower() == ".obj" or count < 3:
                first, second = load_mesh(files[0].resolve(), around), load_mesh(files[1].resolve(), inside)
                assert (first.vertices == second.vertices).all(), (files[0], files[1])
            assert files[0].read_bytes() == files[1].read_bytes()
            count += 1
    return count


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"], ids=["Unix", "Windows", "old Mac"])
def test_meshes_that_lie_outside_come_below_the_folder_with_their_textures(tmp_path, end):
    file = climbing(tmp_path)
    for part in (tmp_path / "scene").rglob("part.*"):
        part.write_bytes(part.read_bytes().replace(b"\n", end.encode()))
    done = import_file(file, bpy.context.scene)
    target = tmp_path / "X" / "a" / "b" / "c" / "mine.yaml"
    target.parent.mkdir(parents=True)
    world_around(target.parent)
    before = snapshot(tmp_path)
    export_file(done.collection, target)
    after = snapshot(tmp_path)
    new = {path.relative_to(target.parent).as_posix() for path in after if path not in before}
    texts = ("high_res", "low_res")
    assert new == {"mine.yaml", *texts, *(f"{t}/{n}" for t in texts for n in ("part.OBJ", "part.mtl", "red.png"))}
    assert all(after[path] == data for path, data in before.items())
    expected = CLIMBING.replace("../../../meshes/tools/high_res/", "./high_res/")
    assert target.read_text() == expected.replace("../../../meshes/tools/low_res/", "./low_res/")
    library = (target.parent / "high_res" / "part.mtl").read_bytes().decode()
    assert library == end.join(["newmtl skin", "Kd 1 0 0", "map_Kd red.png", ""])


def test_a_changed_mesh_that_lay_outside_is_written_beside_the_file_that_is_saved_in_place(tmp_path):
    file = climbing(tmp_path)
    done = import_file(file, bpy.context.scene)
    a = next(o for o in members(done.collection) if o.adf.key == "BODY a")
    a.data = a.data.copy()
    a.data.vertices[0].co.x -= 1.0
    before = snapshot(tmp_path)
    export_file(done.collection, file)
    after = snapshot(tmp_path)
    assert all(path == file or after[path] == data for path, data in before.items())
    new = [path for path in after if path not in before]
    assert new and all(file.parent in path.parents for path in new)
    document = read_any(file, Resolver.for_file(file))
    mesh = file.parent / document.top.text("high resolution path") / document.elements("bodies")[0].text("mesh")
    assert os.path.normpath(mesh) == str(file.parent / "high_res" / "a.OBJ")
    lines = [line for line in difflib.ndiff(CLIMBING.splitlines(), file.read_text().splitlines()) if line[0] in "+-"]
    assert lines == [
        "-   mesh: part.OBJ",
        "+   mesh: ../../../descriptions/multi-bodies/tools/high_res/a.OBJ",
        "+   collision mesh: part.OBJ",
    ]


def test_a_link_that_leads_out_of_the_folder_is_not_followed(tmp_path):
    collection = model()
    body()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "chosen").mkdir()
    (tmp_path / "chosen" / "high_res").symlink_to(tmp_path / "elsewhere")
    with contextlib.suppress(ExportError):
        export_file(collection, tmp_path / "chosen" / "m.yaml")
    assert not any((tmp_path / "elsewhere").iterdir())


def test_files_of_others_are_listed_and_replaced_with_consent_only(tmp_path):
    collection = model()
    body("part")
    (tmp_path / "high_res").mkdir()
    (tmp_path / "high_res" / "part.OBJ").write_text("of somebody else")
    target = {"filepath": str(tmp_path / "m.yaml"), "collection": collection.name}
    before = snapshot(tmp_path)
    with pytest.raises(RuntimeError, match=r"part.OBJ' would be replaced.*Replace Files"):
        bpy.ops.adf.export_file(**target)
    with pytest.raises(ForeignFiles) as refused:
        export_file(collection, tmp_path / "m.yaml")
    assert refused.value.files == [tmp_path / "high_res" / "part.OBJ"] and snapshot(tmp_path) == before
    assert bpy.ops.adf.export_file(**target, replace=True) == {"FINISHED"}
    assert "of somebody else" not in (tmp_path / "high_res" / "part.OBJ").read_text()
    bpy.data.objects["part"].data.vertices[0].co.x -= 1.0
    assert bpy.ops.adf.export_file(**target) == {"FINISHED"}  # by now they are its own


def test_a_file_that_was_edited_elsewhere_since_is_not_overwritten(tmp_path):
    file = tmp_path / "m.yaml"
    file.write_text("bodies: [BODY a]\njoints: []\nBODY a:\n  name: a\n  mass: 1.0\n")
    done = import_file(file, bpy.context.scene)
    members(done.collection)[0].adf.body.mass = 2.0
    edited = file.read_text().replace("joints", "# by hand\njoints")
    file.write_text(edited)
    with pytest.raises(ExportError, match="m.yaml' would be replaced"):
        export_file(done.collection, file)
    assert file.read_text() == edited


def test_a_scene_that_goes_elsewhere_takes_the_files_that_lay_outside_along(tmp_path):
    scene = tmp_path / "repository"
    (scene / "launch").mkdir(parents=True)
    (scene / "package.xml").write_text("<package/>")
    for folder in ("one", "two"):
        (scene / folder).mkdir()
        (scene / folder / "m.yaml").write_text(
            f"bodies: [BODY {folder}]\njoints: []\nBODY {folder}: {{name: a, mass: 1.0}}\n"
        )
    (scene / "launch" / "launch.yaml").write_text("multibody configs: [../one/m.yaml, ../two/m.yaml]  # both\n")
    bpy.ops.adf.import_launch(filepath=str(scene / "launch" / "launch.yaml"))
    before = snapshot(scene)
    target = tmp_path / "X" / "a" / "launch.yaml"
    export_scene(bpy.context.scene, target)
    assert snapshot(scene) == before
    assert "multibody configs: [one/m.yaml, two/m.yaml]  # both" in target.read_text()
    for folder in ("one", "two"):
        assert (target.parent / folder / "m.yaml").read_bytes() == (scene / folder / "m.yaml").read_bytes()
    outside = [p for p in (tmp_path / "X").rglob("*") if p.is_file() and target.parent not in p.parents]
    assert outside == []


def test_a_scene_saved_in_place_saves_the_files_that_it_was_opened_from(tmp_path):
    scene = tmp_path / "repository"
    (scene / "launch").mkdir(parents=True)
    (scene / "package.xml").write_text("<package/>")
    (scene / "one").mkdir()
    (scene / "one" / "m.yaml").write_text("bodies: [BODY a]\njoints: []\nBODY a:\n  name: a\n  mass: 1.0\n")
    launch = scene / "launch" / "launch.yaml"
    launch.write_text("multibody configs: [../one/m.yaml]\n")
    bpy.ops.adf.import_launch(filepath=str(launch))
    bpy.data.objects["a"].adf.body.mass = 2.0
    bpy.ops.adf.export_scene(filepath=str(launch))
    assert "mass: 2.0" in (scene / "one" / "m.yaml").read_text()
    assert launch.read_text() == "multibody configs: [../one/m.yaml]\n"


def outside(tmp_path):
    """A model in a scene of its own whose meshes lie outside it."""
    file = climbing(tmp_path)
    (tmp_path / "scene" / "package.xml").unlink()
    (file.parent / "package.xml").write_text("<package/>")
    return file


def test_meshes_outside_are_read_where_the_user_allows_it_once(tmp_path):
    file = outside(tmp_path)
    done = import_file(file, bpy.context.scene)
    first = done.problems[0]
    assert "Further Folder" in first and "--root" not in first
    assert [o.type for o in members(done.collection)] == ["EMPTY", "EMPTY"]
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    from adf_studio.read_file import outside_folders

    folders = finished(outside_folders(file))
    assert folders == [str(tmp_path / "scene" / "meshes" / "tools")]
    bpy.ops.adf.allow_folders(folders=json.dumps(folders))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"))
    assert finished(outside_folders(file)) == []
    done = import_file(file, bpy.context.scene)
    assert not done.problems and [o.type for o in members(done.collection)] == ["MESH", "MESH"]
    launch = file.parent / "launch.yaml"
    launch.write_text("multibody configs: [mine.yaml]\n")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert finished(outside_folders(launch)) == folders
    bpy.ops.adf.import_launch(filepath=str(launch), root=folders[0])
    assert all(o.type == "MESH" for o in members(bpy.context.scene.adf.models[0].collection))


def test_an_export_that_is_prepared_writes_nothing(tmp_path):
    file = climbing(tmp_path)
    done = import_file(file, bpy.context.scene)
    before = snapshot(tmp_path)
    prepared(done.collection, tmp_path / "X" / "m.yaml")
    assert snapshot(tmp_path) == before and isinstance(file, Path)
