"""3DS files: objects, materials, and damage."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from ligature.adf import Resolver
from ligature.mesh import Mesh, MeshError, load_mesh

from tests.fuzz.seeds import chunk, tds


@pytest.fixture
def read(tmp_path: Path):
    def make(data: bytes) -> Mesh:
        (tmp_path / "m.3DS").write_bytes(data)
        return load_mesh(tmp_path / "m.3DS", Resolver([tmp_path]))

    return make


def scene(objects: list[tuple[bytes, int, list[tuple[int, int, int]], list[tuple[bytes, list[int]]]]]) -> bytes:
    """A file of objects: name, number of vertices, faces, and faces by material."""
    content = b""
    for name, count, faces, groups in objects:
        vertices = b"".join(struct.pack("<3f", i, i * i, 0) for i in range(count))
        rows = b"".join(struct.pack("<4H", *face, 0) for face in faces)
        named = b"".join(
            chunk(0x4130, material + b"\0" + struct.pack(f"<H{len(rows_)}H", len(rows_), *rows_))
            for material, rows_ in groups
        )
        mesh = chunk(0x4110, struct.pack("<H", count) + vertices)
        mesh += chunk(0x4120, struct.pack("<H", len(faces)) + rows + named)
        content += chunk(0x4000, name + b"\0" + chunk(0x4100, mesh))
    return chunk(0x4D4D, chunk(0x3D3D, content))


def test_parts_are_objects_by_material_with_their_own_vertices(read) -> None:
    faces = [(0, 1, 2), (1, 2, 3), (3, 4, 5)]
    mesh = read(scene([(b"a", 6, faces, [(b"red", [0]), (b"blue", [1])]), (b"b", 3, faces[:1], [])]))
    assert [(part.name, len(part.vertices), part.faces.tolist()) for part in mesh.parts] == [
        ("red", 3, [[0, 1, 2]]),
        ("blue", 3, [[0, 1, 2]]),
        ("a", 3, [[0, 1, 2]]),
        ("b", 3, [[0, 1, 2]]),
    ]
    assert mesh.parts[1].vertices.tolist() == [[1, 1, 0], [2, 4, 0], [3, 9, 0]]


def test_materials_keep_colour_shine_transparency_and_texture(read, tmp_path: Path) -> None:
    (tmp_path / "red.png").touch()
    (part,) = read(tds()).parts
    assert part.material is not None and part.uvs is not None
    assert part.material.diffuse == (1.0, 0.0, 0.0) and part.material.alpha == 0.75
    assert part.material.shininess == 64.0 and part.material.texture == tmp_path / "red.png"


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (scene([(b"a", 2, [(0, 1, 2)], [])]), "a face of 'a' names vertex 2, but there are 2"),
        (scene([(b"a", 3, [(0, 1, 2)], [(b"red", [1])])]), "material 'red' names face 1, but there are 1"),
        (scene([]), "the file holds no triangle mesh"),
        (chunk(0x4D4D, b"\0" * 6), r"chunk 0x0000 has the impossible length 0 \(byte 6\)"),
        (chunk(0x4D4D, chunk(0x3D3D, chunk(0x4000, b"endless"))), "a name does not end"),
        (
            chunk(0x4D4D, chunk(0x3D3D, chunk(0x4000, b"a\0" + chunk(0x4100, chunk(0x4110, b"\xff\xff"))))),
            "65535 rows of 12 bytes do not fit into their chunk",
        ),
        (b"4DMM", "this is not a 3DS file; it should start with the bytes 4D 4D"),
    ],
)
def test_damage_is_named(read, data: bytes, text: str) -> None:
    with pytest.raises(MeshError, match=text):
        read(data)
