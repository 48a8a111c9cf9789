"""Materials and textures of OBJ files: what is honoured, and what is stated of the rest."""

from __future__ import annotations

from pathlib import Path

import pytest
from ligature.adf import Resolver, Severity
from ligature.mesh import Material, Mesh, MeshError, load_mesh

TRIANGLE = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture
def read(tmp_path: Path):
    def make(library: str, text: str = TRIANGLE) -> Mesh:
        folder = tmp_path / "meshes"
        folder.mkdir(exist_ok=True)
        (folder / "m.mtl").write_text(library)
        (folder / "m.obj").write_text(text)
        return load_mesh(folder / "m.obj", Resolver([folder]))

    return make


def material(mesh: Mesh) -> Material:
    assert mesh.parts[0].material is not None
    return mesh.parts[0].material


def warnings(mesh: Mesh) -> list[str]:
    return [str(d).split("/meshes/", 1)[1] for d in mesh.diagnostics if d.severity >= Severity.WARNING]


def test_colours_are_the_files_with_ambient_times_diffuse(read) -> None:
    found = material(read("newmtl a\nKd 0.5 0.2 1.0\nKa 0.5 1 0.1\nKs 0.1 0.2 0.3\nNs 96.1\nTr 0.25\n"))
    assert found.ambient == pytest.approx((0.25, 0.2, 0.1))
    assert found.diffuse == (0.5, 0.2, 1.0) and found.specular == (0.1, 0.2, 0.3)
    assert found.shininess == 96.1 and found.alpha == 0.25


def test_colours_are_kept_within_0_and_1(read) -> None:
    found = material(read("newmtl a\nKd 2 -1 0.5\nd 7\nNs -3\n"))
    assert found.diffuse == (1.0, 0.0, 0.5) and found.alpha == 1.0 and found.shininess == 0.0


def test_unreadable_values_are_warnings_and_other_keywords_are_noted_once(read) -> None:
    mesh = read("Kd 1 1 1\nnewmtl a\nKd red\nNs nan\nillum 2\nillum 3\nNi 1\n")
    assert warnings(mesh) == [
        "m.mtl:1:1: warning: 'Kd' comes before the first newmtl and has no effect",
        "m.mtl:3:1: warning: 'Kd red' has no effect; 3 finite numbers were expected",
        "m.mtl:4:1: warning: 'Ns nan' has no effect; 1 finite numbers were expected",
    ]
    assert [d.message for d in mesh.diagnostics if d.severity == Severity.DEBUG] == [
        "'illum' has no effect",
        "'Ni' has no effect",
    ]
    assert material(mesh) == Material("a")


@pytest.mark.parametrize(
    "name",
    [
        "wood.png",
        "./wood.png",
        "/home/author/my scene/wood.png",
        "C:\\Users\\author\\wood.png",
        "../elsewhere/wood.png",
    ],
)
def test_a_texture_is_found_next_to_the_mesh_whatever_its_folder(read, tmp_path: Path, name: str) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "wood.png").touch()
    mesh = read(f"newmtl a\nmap_Kd {name}\nmap_Bump -bm 0.5 wood.png\n")
    assert material(mesh).texture == material(mesh).normal_map == (tmp_path / "meshes" / "wood.png").resolve()
    assert warnings(mesh) == []


def test_a_texture_outside_the_scene_is_refused_by_name(read, tmp_path: Path) -> None:
    (tmp_path / "secret.png").touch()
    mesh = read("newmtl a\nmap_Kd ../secret.png\n")
    assert material(mesh).texture != tmp_path / "secret.png"
    (warning,) = warnings(mesh)
    assert warning.startswith("m.mtl:2:1: warning: texture: '") and "lies outside the scene's folders" in warning
    assert "allow it with --root" in warning


def test_a_texture_that_is_absent_is_a_warning(read) -> None:
    (warning,) = warnings(read("newmtl a\nmap_Kd no such.png\n"))
    assert warning.startswith("m.mtl:2:1: warning: texture 'no such.png' does not exist; looked for ")


def test_several_libraries_on_several_lines_or_one(read, tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "more of it.mtl").write_text("newmtl b\n")
    for lines in ("mtllib m.mtl\nmtllib more of it.mtl\n", "mtllib m.mtl more of it.mtl\n"):
        mesh = read("newmtl a\n", lines + TRIANGLE.split("\n", 1)[1] + "usemtl b\nf 1 2 3\nf 3 2 1\n")
        assert [(part.name, len(part.faces)) for part in mesh.parts] == [("a", 1), ("b", 2)]


def test_a_missing_library_and_an_unknown_material_are_warnings(read) -> None:
    mesh = read("newmtl a\n", "mtllib gone.mtl\n" + TRIANGLE + "usemtl c\nf 1 2 3\n")
    missing, unknown = warnings(mesh)
    assert missing.startswith("m.obj:1:1: warning: material library 'gone.mtl' cannot be read; put it next to the mesh")
    assert unknown == (
        "m.obj:7:1: warning: material 'c' is in no material library; 'a' stays in force; faces of both are one part"
    )


def test_a_library_named_a_thousand_times_is_read_once(read) -> None:
    mesh = read("newmtl a\n", "mtllib m.mtl\n" * 1000 + TRIANGLE)
    assert len(mesh.parts) == 1


def test_a_library_of_too_many_materials_is_refused(read) -> None:
    with pytest.raises(MeshError, match=r"m.mtl:4097:1: error: the library has more than 4096 materials"):
        read("newmtl a\n" * 5000)


def test_physically_based_keys_are_read_and_absent_ones_stay_unknown(read) -> None:
    found = material(read("newmtl a\nKe 0.1 0.2 0.3\nPr 0.4\nPm 1\nPc 0.5\nPcr 0.05\n"))
    assert found.emission == (0.1, 0.2, 0.3)
    assert (found.roughness, found.metallic, found.coat, found.coat_roughness) == (0.4, 1.0, 0.5, 0.05)
    plain = material(read("newmtl a\nKd 1 1 1\n"))
    assert (plain.roughness, plain.metallic, plain.coat) == (None, None, None)
