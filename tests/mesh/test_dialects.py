"""Mesh files of different programs: whatever the form of a file, its triangles are read, and by material."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ligature.adf import Resolver, Severity
from ligature.mesh import Mesh, MeshError, load_mesh

from tests.fuzz.dialects import Soup, obj, stl

DIALECTS = 300


def triangles(mesh: Mesh) -> list[np.ndarray]:
    """Corners (m, 3, 3) of each part."""
    return [part.vertices[part.faces] for part in mesh.parts]


def test_every_obj_has_its_triangles_by_material(tmp_path: Path) -> None:
    for number in range(DIALECTS):
        soup = Soup(number)
        content, library = obj(soup, number)
        (tmp_path / "part.obj").write_bytes(content)
        (tmp_path / "part.mtl").write_bytes(library)
        mesh = load_mesh(tmp_path / "part.obj", Resolver([tmp_path]))
        assert [part.name for part in mesh.parts] == soup.names, number
        for index, corners in enumerate(triangles(mesh)):
            np.testing.assert_allclose(corners, soup.triangles(index), atol=1e-6, err_msg=str(number))
        assert not [d for d in mesh.diagnostics if d.severity >= Severity.WARNING], number


def test_every_stl_has_its_triangles(tmp_path: Path) -> None:
    for number in range(DIALECTS):
        soup = Soup(number)
        (tmp_path / "part.stl").write_bytes(stl(soup, number))
        mesh = load_mesh(tmp_path / "part.stl", Resolver([tmp_path]))
        (corners,) = triangles(mesh)
        np.testing.assert_allclose(corners, soup.triangles(), atol=1e-6, err_msg=str(number))


@pytest.mark.parametrize("header", [b"solid part", b"\0"])
def test_a_binary_stl_that_was_cut_short_is_refused_whatever_its_header(header: bytes, tmp_path: Path) -> None:
    soup = Soup(0)
    data = header.ljust(80, b"\0") + len(soup.triangles()).to_bytes(4, "little") + b"\0" * 49
    (tmp_path / "part.stl").write_bytes(data)
    with pytest.raises(MeshError, match="it was cut short"):
        load_mesh(tmp_path / "part.stl", Resolver([tmp_path]))


@pytest.mark.parametrize("order", ["d 1.0\nTr 0.0\n", "Tr 0.0\nd 1.0\n"])
def test_a_material_that_is_opaque_by_d_is_opaque_whatever_tr_says(order: str, tmp_path: Path) -> None:
    (tmp_path / "part.mtl").write_text(f"newmtl a\n{order}")
    (tmp_path / "part.obj").write_text("mtllib part.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (part,) = load_mesh(tmp_path / "part.obj", Resolver([tmp_path])).parts
    assert part.material is not None and part.material.alpha == 1.0


def test_materials_without_a_library_are_reported(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 3 2\n"
    (tmp_path / "part.mtl").write_text("newmtl a\nnewmtl b\n")
    for lines in (text, text + "mtllib part.mtl\n"):
        (tmp_path / "part.obj").write_text(lines)
        mesh = load_mesh(tmp_path / "part.obj", Resolver([tmp_path]))
        assert "2 materials up to 'b' are used before a material library defines them" in str(mesh.diagnostics[0])
