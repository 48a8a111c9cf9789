"""OBJ files that AMBF's reader accepts: the same mesh gives the same bytes, and reads back as it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ligature.adf import Resolver
from ligature.authoring.objfile import MeshWriteError, Paint, Surface, obj_texts
from ligature.mesh import load_mesh

VERTICES = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.int32)
UVS = np.tile(np.array([[0.0, 0.0], [1, 0], [0, 1]]), (4, 1, 1))


def test_parts_materials_and_textures_come_back(tmp_path: Path) -> None:
    paint = Paint("blue skin", (0.1, 0.2, 0.9), alpha=0.5, texture="a colour.png", normal_map="normal.png")
    for name in (paint.texture, paint.normal_map):
        (tmp_path / name).write_bytes(b"x")
    surfaces = [Surface(paint, VERTICES, FACES, uvs=UVS), Surface(Paint("hull_001"), VERTICES + 2.0, FACES)]
    obj, mtl = obj_texts(surfaces, "m.mtl", "two parts")
    (tmp_path / "m.obj").write_text(obj)
    (tmp_path / "m.mtl").write_text(mtl)
    mesh = load_mesh(tmp_path / "m.obj", Resolver([tmp_path]))
    assert [part.name for part in mesh.parts] == ["blue_skin", "hull_001"]
    material = mesh.parts[0].material
    assert material is not None and material.diffuse == (0.1, 0.2, 0.9) and material.alpha == 0.5
    assert material.texture == tmp_path / "a colour.png" and material.normal_map == tmp_path / "normal.png"
    np.testing.assert_allclose(np.unique(mesh.parts[1].vertices, axis=0), np.unique(VERTICES + 2.0, axis=0))
    assert not mesh.diagnostics


def test_the_dialect_has_no_options_and_always_a_diffuse_colour() -> None:
    _, mtl = obj_texts([Surface(Paint("m", texture="t.png", normal_map="n.png"), VERTICES, FACES)], "m.mtl", "m")
    assert "\nmap_Bump n.png\n" in mtl and "\nmap_Kd t.png\n" in mtl and "\nKd 0.8 0.8 0.8\n" in mtl
    assert all(len(line) < 1000 for line in mtl.splitlines())


def test_the_same_mesh_gives_the_same_bytes() -> None:
    surface = Surface(Paint("m"), VERTICES * 1.1, FACES, normals=np.ones((4, 3, 3)))
    assert obj_texts([surface], "m.mtl", "m") == obj_texts([surface], "m.mtl", "m")
    assert "f 1//1 " in obj_texts([surface], "m.mtl", "m")[0]


def test_what_cannot_be_written_is_reported_with_its_name() -> None:
    with pytest.raises(MeshWriteError, match="'part' has no face"):
        obj_texts([Surface(Paint("m"), VERTICES, FACES[:0])], "m.mtl", "part")
    with pytest.raises(MeshWriteError, match="'part' has a vertex that is not finite"):
        obj_texts([Surface(Paint("m"), VERTICES * np.nan, FACES)], "m.mtl", "part")


def test_materials_whose_names_become_one_word_stay_two() -> None:
    surfaces = [Surface(Paint(name), VERTICES, FACES) for name in ("a b", "a_b", "a b")]
    obj, mtl = obj_texts(surfaces, "m.mtl", "parts")
    assert [line for line in obj.splitlines() if line.startswith("usemtl")] == [
        "usemtl a_b",
        "usemtl a_b_2",
        "usemtl a_b",
    ]
    assert "newmtl a_b_2" in mtl
