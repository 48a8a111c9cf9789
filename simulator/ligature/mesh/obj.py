"""Reads Wavefront OBJ and MTL files, one part per material (ADF specification §12.4).

Parts follow the order of ``newmtl`` in the material libraries; ``o`` and ``g`` do not split.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ligature.adf.resolver import ResolutionError, Resolver
from ligature.mesh.mesh import MAX_TRIANGLES, Array, Material, Mesh, MeshPart, Triple, checked, failure

MAX_FACE_VERTICES = 256
_COLOURS = ("Ka", "Kd", "Ks")


class _Faces:
    """Triangles of one material as rows of (v, vt, vn) indices, -1 for absent."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, int, int]] = []


class _Reader:
    """State while an OBJ file is read line by line."""

    def __init__(self, path: Path, resolver: Resolver) -> None:
        self.path, self.resolver = path, resolver
        self.points: list[list[float]] = []
        self.uvs: list[list[float]] = []
        self.normals: list[list[float]] = []
        self.materials: list[Material] = []
        self.faces: dict[int, _Faces] = {}
        self.current = 0
        self.line = 0
        self.triangles = 0

    def read(self, text: str) -> Mesh:
        handlers = {"v": self._point, "vt": self._uv, "vn": self._normal, "f": self._face}
        named = {"usemtl": self._use, "mtllib": self._library}
        for self.line, line in enumerate(text.split("\n"), 1):
            word, _, rest = line.strip().partition(" ")
            if word in handlers:
                handlers[word](rest.split())
            elif word in named:
                named[word](rest.strip())
        return self._mesh()

    def _numbers(self, words: list[str], least: int, most: int) -> list[float]:
        if len(words) < least:
            raise failure(self.path, f"{least} numbers were expected, {len(words)} found", self.line)
        try:
            return [float(word) for word in words[:most]]
        except ValueError:
            raise failure(self.path, f"'{' '.join(words[:most])}' are not numbers", self.line) from None

    def _point(self, words: list[str]) -> None:
        self.points.append(self._numbers(words, 3, 3))

    def _uv(self, words: list[str]) -> None:
        self.uvs.append((self._numbers(words, 1, 2) + [0.0])[:2])

    def _normal(self, words: list[str]) -> None:
        self.normals.append(self._numbers(words, 3, 3))

    def _use(self, name: str) -> None:
        names = [material.name for material in self.materials]
        if name in names:
            self.current = names.index(name)

    def _library(self, name: str) -> None:
        try:
            library = self.resolver.resolve(name, self.path.parent)
            text = self.resolver.read_bytes(library).decode("utf-8", "replace")
        except ResolutionError:
            return
        self.materials += read_mtl(text, library)

    def _face(self, words: list[str]) -> None:
        if not 3 <= len(words) <= MAX_FACE_VERTICES:
            raise failure(
                self.path,
                f"a face has {len(words)} vertices; 3 to {MAX_FACE_VERTICES} are allowed",
                self.line,
            )
        corners = [self._corner(word) for word in words]
        rows = self.faces.setdefault(self.current, _Faces()).rows
        for i in range(1, len(corners) - 1):
            rows += [corners[0], corners[i], corners[i + 1]]
        self.triangles += len(corners) - 2
        if self.triangles > MAX_TRIANGLES:
            raise failure(self.path, f"the mesh has more than {MAX_TRIANGLES} triangles", self.line)

    def _corner(self, word: str) -> tuple[int, int, int]:
        parts = (word.split("/") + ["", ""])[:3]
        try:
            v, vt, vn = (int(part) - 1 if part else -1 for part in parts)
        except ValueError:
            raise failure(
                self.path, f"'{word}' is not a face corner", self.line, "write v, v/vt, v//vn or v/vt/vn"
            ) from None
        for index, available, what in (
            (v, len(self.points), "vertex"),
            (vt, len(self.uvs), "texture coordinate"),
            (vn, len(self.normals), "normal"),
        ):
            if index >= available or index < -1 or (index == -1 and what == "vertex"):
                raise failure(
                    self.path,
                    f"a face names {what} {index + 1}, but {available} are defined so far",
                    self.line,
                    "indices count from 1 and may not be negative",
                )
        return v, vt, vn

    def _mesh(self) -> Mesh:
        if not self.points:
            raise failure(self.path, "the file holds no vertex")
        points = checked(np.array(self.points, dtype=float), self.path)
        uvs = checked(np.array(self.uvs, dtype=float).reshape(-1, 2), self.path)
        normals = checked(np.array(self.normals, dtype=float).reshape(-1, 3), self.path)
        count = max(len(self.materials), 1)
        parts = []
        for index in range(count):
            material = self.materials[index] if self.materials else None
            rows = np.array(self.faces[index].rows if index in self.faces else [], dtype=np.int64).reshape(-1, 3)
            parts.append(_part(material, rows, points, uvs, normals))
        if not self.faces:
            parts[0] = replace(parts[0], vertices=points)
        return Mesh(self.path, tuple(parts))


def _part(material: Material | None, rows: NDArray[np.int64], points: Array, uvs: Array, normals: Array) -> MeshPart:
    """One part from its corner rows (3 a triangle); vertices are the distinct corners."""
    distinct, inverse = np.unique(rows, axis=0, return_inverse=True)
    faces = inverse.reshape(-1, 3).astype(np.int32)
    has_uv = bool(len(uvs)) and bool(len(distinct)) and bool((distinct[:, 1] >= 0).all())
    has_normal = bool(len(normals)) and bool(len(distinct)) and bool((distinct[:, 2] >= 0).all())
    return MeshPart(
        material.name if material else "",
        points[distinct[:, 0]] if len(distinct) else np.zeros((0, 3)),
        faces,
        normals[distinct[:, 2]] if has_normal else None,
        uvs[distinct[:, 1]] if has_uv else None,
        material,
    )


def read_obj(data: bytes, path: Path, resolver: Resolver) -> Mesh:
    """Read OBJ ``data`` of ``path``; material libraries are looked up next to it. Raises `MeshError`."""
    return _Reader(path, resolver).read(data.decode("utf-8", "replace"))


def read_mtl(text: str, path: Path) -> list[Material]:
    """The materials of an MTL file, in order; unknown and unreadable lines have no effect, as in AMBF."""
    materials: list[Material] = []
    for line in text.split("\n"):
        word, _, rest = line.strip().partition(" ")
        rest = rest.strip()
        if word == "newmtl":
            materials.append(Material(rest))
        elif materials:
            materials[-1] = _with(materials[-1], word, rest, path)
    return materials


def _with(material: Material, word: str, rest: str, path: Path) -> Material:
    if word in ("map_Kd", "map_Bump") and rest and "\0" not in rest:
        texture = path.parent / rest
        return replace(material, texture=texture) if word == "map_Kd" else replace(material, normal_map=texture)
    try:
        values = [float(v) for v in rest.split()]
    except ValueError:
        return material
    if not values or not np.isfinite(values).all():
        return material
    if word in _COLOURS and len(values) >= 3:
        return _coloured(material, word, (values[0], values[1], values[2]))
    if word == "Ns":
        return replace(material, shininess=values[0])
    if word in ("d", "Tr"):
        return replace(material, alpha=values[0])
    return material


def _coloured(material: Material, word: str, colour: Triple) -> Material:
    if word == "Ka":
        return replace(material, ambient=colour)
    if word == "Kd":
        return replace(material, diffuse=colour)
    return replace(material, specular=colour)
