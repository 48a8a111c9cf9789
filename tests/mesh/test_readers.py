"""OBJ, MTL, STL and 3DS: parts by material, exact places of errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ligature.adf import Resolver
from ligature.mesh import Mesh, MeshError, collision_parts, load_mesh

from tests.fuzz.seeds import ASCII_STL, MTL, OBJ, binary_stl, tds


@pytest.fixture
def read(tmp_path: Path):
    def make(name: str, content: str | bytes, library: str | None = MTL) -> Mesh:
        if library is not None:
            (tmp_path / "part.mtl").write_text(library)
        data = content.encode() if isinstance(content, str) else content
        (tmp_path / name).write_bytes(data)
        return load_mesh(tmp_path / name, Resolver([tmp_path]))

    return make


def test_an_obj_has_one_part_per_material_in_library_order(read) -> None:
    mesh = read("cube.OBJ", OBJ)
    assert [(part.name, len(part.faces)) for part in mesh.parts] == [("red", 4), ("blue", 4)]
    assert mesh.parts[0].material is not None and mesh.parts[0].material.diffuse == (0.8, 0.1, 0.1)
    assert mesh.parts[0].material.texture is not None and mesh.parts[0].material.texture.name == "red.png"


def test_without_a_library_everything_is_one_part(read) -> None:
    assert [len(part.faces) for part in read("cube.obj", OBJ, library=None).parts] == [8]


def test_a_material_that_is_not_in_the_library_leaves_the_former_in_force(read) -> None:
    mesh = read("cube.obj", OBJ.replace("usemtl blue", "usemtl green"))
    assert [len(part.faces) for part in mesh.parts] == [8, 0]


def test_library_names_may_hold_blanks(read, tmp_path: Path) -> None:
    (tmp_path / "my part.mtl").write_text(MTL)
    assert len(read("cube.obj", OBJ.replace("part.mtl", "my part.mtl"), None).parts) == 2


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("f 1 2 9", r"bad.obj:20:1: error: a face names vertex 9, but 8 are defined so far; indices count from 1"),
        ("f 1 2 -9", "a face names vertex -9, but 8"),
        ("f 0 1 2", "a face names vertex 0, but 8"),
        ("f 1/9 2 3", "a face names texture coordinate 9, but 2"),
        ("f 1 two 3", "'two' is not a face corner; write v, v/vt, v//vn or v/vt/vn"),
        ("v 1 2", "3 numbers were expected, 2 found"),
        ("v 1 2 x", "'1 2 x' are not numbers"),
        ("v 1 2 nan", "a vertex is not finite"),
        ("v 1 2 1e9", "a vertex lies farther than 1e"),
    ],
)
def test_errors_of_an_obj_name_the_line(read, line: str, text: str) -> None:
    with pytest.raises(MeshError, match=text):
        read("bad.obj", OBJ + line + "\n")


@pytest.mark.parametrize("name", ["part.stl", "PART.STL"])
@pytest.mark.parametrize("content", [ASCII_STL, binary_stl()])
def test_stl_binary_and_ascii(read, name: str, content: str | bytes) -> None:
    (part,) = read(name, content).parts
    assert np.allclose(part.vertices[:3], [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert part.normals is not None and np.allclose(part.normals, [0, 0, 1])


def test_an_empty_stl_has_no_part(read) -> None:
    assert read("empty.stl", b"\0" * 84).parts == ()


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (binary_stl()[:-20], "announces 2 triangles but holds 1; it was cut short"),
        (b"short", "ends after 5 bytes"),
        (ASCII_STL.replace("vertex 1 0 0", "vertex 1 0"), "part.stl:5:1: error: a vertex needs three numbers"),
    ],
)
def test_errors_of_an_stl(read, content: str | bytes, text: str) -> None:
    with pytest.raises(MeshError, match=text):
        read("part.stl", content)


def test_a_3ds_has_one_part_per_material(read) -> None:
    (part,) = read("part.3ds", tds()).parts
    assert part.name == "red" and part.faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(("cut", "text"), [(60, "impossible length|cut short"), (1, "not a 3DS file")])
def test_errors_of_a_3ds(read, cut: int, text: str) -> None:
    with pytest.raises(MeshError, match=text):
        read("part.3ds", tds()[:cut])


def test_another_format_is_refused_by_name(read) -> None:
    with pytest.raises(MeshError, match=r"the mesh format of 'part.x' is not supported; use .obj, .stl, .3ds"):
        read("part.x", "vertices")


def test_every_corpus_mesh_is_read(corpus: Path) -> None:
    files = [f for f in sorted(corpus.rglob("*")) if f.suffix.lower() in (".obj", ".stl", ".3ds")]
    meshes = [load_mesh(file, Resolver([corpus])) for file in files]
    assert len(meshes) > 700 and sum(bool(mesh.parts) for mesh in meshes) > 700


def test_hulls_of_the_corpus_needle_and_phantom(corpus: Path) -> None:
    folder = corpus / "suturing_scene" / "ADF" / "Phantoms" / "Simple" / "low_res"
    count = {
        name: len(collision_parts(load_mesh(folder / name, Resolver([corpus])), "hull"))
        for name in ("NeedleCollision.OBJ", "PhantomCollision.OBJ")
    }
    assert count == {"NeedleCollision.OBJ": 9, "PhantomCollision.OBJ": 11}
