"""Reads 3DS files: one part per object and material, in the file's own units.

The format is a tree of chunks, each an id (2 bytes), a length (4 bytes, header included) and content.
No kept library reads it without a full asset importer, and scene files of the corpus name it.
Findings name the byte, since the format has no lines. The keyframe section is not read: vertices
stand in the file as the scene shows them.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.adf.resolver import Resolver
from ligature.mesh.mesh import (
    MAX_PARTS,
    Array,
    Findings,
    Material,
    Mesh,
    MeshPart,
    Triple,
    checked,
    failure,
)
from ligature.mesh.texture import texture_file

_MAIN, _EDITOR, _OBJECT, _TRIANGLES = 0x4D4D, 0x3D3D, 0x4000, 0x4100
_VERTICES, _FACES, _FACE_MATERIAL, _UVS = 0x4110, 0x4120, 0x4130, 0x4140
_MATERIAL, _NAME, _AMBIENT, _DIFFUSE, _SPECULAR = 0xAFFF, 0xA000, 0xA010, 0xA020, 0xA030
_SHININESS, _TRANSPARENCY, _TEXTURE, _TEXTURE_FILE = 0xA040, 0xA050, 0xA200, 0xA300
_RGB_FLOAT, _RGB_BYTE, _PERCENT, _PERCENT_FLOAT = 0x0010, 0x0011, 0x0030, 0x0031

_MAX_SHININESS = 128.0
"""Exponent that stands for a shininess of 100 %."""


def read_3ds(data: bytes, path: Path, resolver: Resolver) -> Mesh:
    """Read 3DS ``data`` of ``path``; textures are looked up next to it. Raises `MeshError`."""
    if data[:2] != struct.pack("<H", _MAIN):
        raise failure(path, "this is not a 3DS file", hint="it should start with the bytes 4D 4D")
    return _Reader(data, path, resolver).read()


class _Reader:
    """The bytes of one file, and what is known of its materials."""

    def __init__(self, data: bytes, path: Path, resolver: Resolver) -> None:
        self.data, self.path, self.resolver = data, path, resolver
        self.findings = Findings()
        self.points: list[Array] = [np.zeros((0, 3))]

    def read(self) -> Mesh:
        editors = [
            (start, end)
            for main, a, b in self._chunks(0, len(self.data))
            if main == _MAIN
            for kind, start, end in self._chunks(a, b)
            if kind == _EDITOR
        ]
        chunks = [chunk for start, end in editors for chunk in self._chunks(start, end)]
        found = [self._material(start, end) for kind, start, end in chunks if kind == _MATERIAL]
        materials = {material.name: material for material in found}
        parts: list[MeshPart] = []
        for kind, start, end in chunks:
            if kind == _OBJECT:
                parts += self._object(start, end, materials)
            if len(parts) > MAX_PARTS:
                raise self._wrong(f"the file holds more than {MAX_PARTS} pairs of object and material", start)
        if not parts:
            raise failure(self.path, "the file holds no triangle mesh", hint="export an object with faces")
        return Mesh(self.path, tuple(parts), self.findings.all(), np.vstack(self.points))

    def _wrong(self, message: str, at: int) -> Exception:
        return failure(self.path, f"{message} (byte {at})", hint="the file is damaged or was cut short")

    def _chunks(self, start: int, end: int) -> Iterator[tuple[int, int, int]]:
        """Id, start and end of the content of each chunk between ``start`` and ``end``."""
        while start + 6 <= end:
            kind, length = struct.unpack_from("<HI", self.data, start)
            if length < 6 or start + length > end:
                raise self._wrong(f"chunk {kind:#06x} has the impossible length {length}", start)
            yield kind, start + 6, start + length
            start += length

    def _text(self, start: int, end: int) -> tuple[str, int]:
        """The zero-terminated text at ``start``, and where the rest begins."""
        stop = self.data.find(b"\0", start, end)
        if stop < 0:
            raise self._wrong("a name does not end", start)
        return self.data[start:stop].decode("latin-1"), stop + 1

    def _rows(self, start: int, end: int, dtype: str, columns: int) -> NDArray[Any]:
        """A counted array of rows of ``columns`` values."""
        count = struct.unpack_from("<H", self.data, start)[0] if start + 2 <= end else 0
        item = np.dtype(dtype).itemsize * columns
        if start + 2 + count * item > end:
            raise self._wrong(f"{count} rows of {item} bytes do not fit into their chunk", start)
        return np.frombuffer(self.data, dtype, count * columns, start + 2).reshape(count, columns)

    def _floats(self, start: int, end: int, columns: int) -> Array:
        with np.errstate(invalid="ignore"):  # the callers look for what is not a number
            return self._rows(start, end, "<f4", columns).astype(float)

    def _object(self, start: int, end: int, materials: dict[str, Material]) -> Iterator[MeshPart]:
        name, start = self._text(start, end)
        for kind, a, b in self._chunks(start, end):
            if kind == _TRIANGLES:
                yield from self._triangles(a, b, name, materials)

    def _triangles(self, start: int, end: int, name: str, materials: dict[str, Material]) -> Iterator[MeshPart]:
        vertices: Array = np.zeros((0, 3))
        uvs: Array | None = None
        faces: NDArray[np.int64] = np.zeros((0, 3), dtype=np.int64)
        groups: list[tuple[str, NDArray[np.int64]]] = []
        for kind, a, b in self._chunks(start, end):
            if kind == _VERTICES:
                vertices = checked(self._floats(a, b, 3), self.path)
            elif kind == _UVS:
                uvs = self._floats(a, b, 2)
            elif kind == _FACES:
                faces = self._rows(a, b, "<u2", 4)[:, :3].astype(np.int64)
                groups = [
                    self._group(c, d) for sub, c, d in self._chunks(a + 2 + 8 * len(faces), b) if sub == _FACE_MATERIAL
                ]
        self.points.append(vertices)
        if len(faces) and faces.max() >= len(vertices):
            message = f"a face of '{name}' names vertex {faces.max()}, but there are {len(vertices)}"
            raise self._wrong(message, start)
        if uvs is not None and (len(uvs) != len(vertices) or not np.isfinite(uvs).all()):
            self.findings.add(self.path, f"the texture coordinates of '{name}' are damaged and left out")
            uvs = None
        for material, rows in _by_material(groups, len(faces), name):
            if len(rows) and rows.max() >= len(faces):
                message = f"material '{material}' names face {rows.max()}, but there are {len(faces)}"
                raise self._wrong(message, start)
            used, inverse = np.unique(faces[rows], return_inverse=True)
            corners = inverse.reshape(-1, 3).astype(np.int32)
            of_part = None if uvs is None else uvs[used]
            yield MeshPart(material, vertices[used], corners, None, of_part, materials.get(material))

    def _group(self, start: int, end: int) -> tuple[str, NDArray[np.int64]]:
        """Name of a material and the faces that have it."""
        material, start = self._text(start, end)
        return material, self._rows(start, end, "<u2", 1).ravel().astype(np.int64)

    def _material(self, start: int, end: int) -> Material:
        material = Material("")
        for kind, a, b in self._chunks(start, end):
            if kind == _NAME:
                material = replace(material, name=self._text(a, b)[0])
            elif kind == _AMBIENT:
                material = replace(material, ambient=self._colour(a, b, material.ambient))
            elif kind == _DIFFUSE:
                material = replace(material, diffuse=self._colour(a, b, material.diffuse))
            elif kind == _SPECULAR:
                material = replace(material, specular=self._colour(a, b, material.specular))
            elif kind == _SHININESS:
                material = replace(material, shininess=_MAX_SHININESS * self._share(a, b, 0.25))
            elif kind == _TRANSPARENCY:
                material = replace(material, alpha=1.0 - self._share(a, b, 0.0))
            elif kind == _TEXTURE:
                material = replace(material, texture=self._texture(a, b))
        return material

    def _colour(self, start: int, end: int, default: Triple) -> Triple:
        for kind, a, b in self._chunks(start, end):
            if kind == _RGB_FLOAT and b - a >= 12:
                r, g, b_ = np.clip(np.nan_to_num(np.frombuffer(self.data, "<f4", 3, a)), 0.0, 1.0)
                return float(r), float(g), float(b_)
            if kind == _RGB_BYTE and b - a >= 3:
                return self.data[a] / 255.0, self.data[a + 1] / 255.0, self.data[a + 2] / 255.0
        return default

    def _share(self, start: int, end: int, default: float) -> float:
        """A percentage as a number in 0..1."""
        for kind, a, b in self._chunks(start, end):
            if kind == _PERCENT and b - a >= 2:
                return min(struct.unpack_from("<H", self.data, a)[0] / 100.0, 1.0)
            if kind == _PERCENT_FLOAT and b - a >= 4:
                value = struct.unpack_from("<f", self.data, a)[0] / 100.0
                return min(max(value, 0.0), 1.0) if value == value else default
        return default

    def _texture(self, start: int, end: int) -> Path | None:
        for kind, a, b in self._chunks(start, end):
            if kind == _TEXTURE_FILE:
                name = self._text(a, b)[0]
                return (
                    texture_file(name, self.path, 1, self.path.parent, self.resolver, self.findings) if name else None
                )
        return None


def _by_material(
    groups: list[tuple[str, NDArray[np.int64]]], faces: int, name: str
) -> list[tuple[str, NDArray[np.int64]]]:
    """The groups, and those faces that no group names under the object's own ``name``."""
    bare = np.ones(faces, dtype=bool)
    for _, rows in groups:
        bare[rows[rows < faces]] = False
    return [*groups, (name, np.flatnonzero(bare))] if bare.any() or not groups else groups
