"""Reads Wavefront OBJ files, one part per material.

Parts follow the order of ``newmtl`` in the material libraries; ``o`` and ``g`` do not split.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ligature.adf.diagnostics import Severity
from ligature.adf.lacking import lack_of
from ligature.adf.resolver import ResolutionError, Resolver
from ligature.mesh.mesh import (
    DAMAGED,
    MAX_PARTS,
    MAX_TRIANGLES,
    REDUCE,
    Array,
    Findings,
    Material,
    Mesh,
    MeshPart,
    checked,
    failure,
)
from ligature.mesh.mtl import read_mtl

MAX_FACE_VERTICES = 256
"""Most vertices of one face that the reference reads; more, as caps of CAD exports have, are noted."""

MAX_LIBRARIES = 64
MAX_INDEX_DIGITS = 32
"""Longest face corner in characters; converting longer numbers takes quadratic time."""

_IGNORED = frozenset(("o", "g", "s", "l", "p", "vp", "mg"))
"""Statements that are legal and do not matter for triangles by material."""

_NUMERIC = frozenset(("v", "vt", "vn", "f"))
"""Statements behind which a comment may stand; elsewhere a ``#`` may be part of a name."""

_LIBRARY_NAME = re.compile(r"\S.*?\.mtl(?=\s|$)", re.IGNORECASE)


def read_obj(data: bytes, path: Path, resolver: Resolver) -> Mesh:
    """Read OBJ ``data`` of ``path``; material libraries are looked up next to it. Raises `MeshError`."""
    return _Reader(path, resolver).read(data.decode("utf-8-sig", "replace"))


class _Reader:
    """State while an OBJ file is read line by line.

    A face corner is a distinct (vertex, texture coordinate, normal) triple of indices, -1 for absent.
    Most corners occur several times, so that each spelling is parsed and checked only once.
    """

    def __init__(self, path: Path, resolver: Resolver) -> None:
        self.path, self.resolver, self.findings = path, resolver, Findings()
        self.points: list[list[float]] = []
        self.point_lines: list[int] = []
        self.uvs: list[list[float]] = []
        self.normals: list[list[float]] = []
        self.materials: list[Material] = []
        self.material_index: dict[str, int] = {}
        self.unknown: dict[str, int] = {}
        self.named_library = self.relative = False
        self.libraries: set[Path] = set()
        self.corners: dict[tuple[int, int, int], int] = {}
        self.spellings: dict[str, int] = {}
        self.faces: dict[int, list[int]] = {}
        self.current = 0
        self.line = 0
        self.triangles = 0

    def read(self, text: str) -> Mesh:
        for self.line, line in _logical_lines(text):
            words = line.split()
            if not words:
                continue
            word = words[0]
            if "#" in line and word in _NUMERIC:
                words = line.partition("#")[0].split()
            if word == "v":
                self.points.append(self._numbers(words[1:4], 3))
                self.point_lines.append(self.line)
            elif word == "f":
                self._face(words[1:])
            elif word == "vt":
                self.uvs.append((self._numbers(words[1:3], 1) + [0.0])[:2])
            elif word == "vn":
                self.normals.append(self._numbers(words[1:4], 3))
            elif word == "usemtl":
                self._use(line.strip()[len(word) :].strip())
            elif word == "mtllib":
                self._libraries(line.strip()[len(word) :].strip())
            elif word not in _IGNORED and not word.startswith("#"):
                self.findings.add(self.path, f"'{word[:40]}' is not a statement that is read", self.line)
        return self._mesh()

    def _numbers(self, words: list[str], least: int) -> list[float]:
        if len(words) < least:
            raise failure(self.path, f"{least} numbers were expected, {len(words)} found", self.line, DAMAGED)
        try:
            return list(map(float, words))
        except ValueError:
            raise failure(self.path, f"'{' '.join(words)[:80]}' are not numbers", self.line, DAMAGED) from None

    def _use(self, name: str) -> None:
        index = self.material_index.get(name)
        if index is not None:
            self.current = index
        elif not self.materials:
            self.unknown.setdefault(name, self.line)
        else:
            kept = self.materials[self.current].name
            self.findings.add(
                self.path,
                f"material '{name[:80]}' is in no material library; '{kept[:80]}' stays in force",
                self.line,
                "faces of both are one part",
            )

    def _libraries(self, text: str) -> None:
        """Read the libraries of one ``mtllib`` line: one name that may hold blanks, or several names."""
        self.named_library = True
        whole = self._library(text)
        names = [text] if whole else _LIBRARY_NAME.findall(text) or text.split()
        for name in names:
            library = self._library(name)
            if library is None:
                self.findings.add(
                    self.path,
                    f"material library '{name[:200]}' cannot be read",
                    self.line,
                    f"put it next to the mesh, in {self.path.parent}; without it all faces are one part",
                )
            elif library not in self.libraries:
                self._read_library(library)

    def _library(self, name: str) -> Path | None:
        try:
            library = self.resolver.resolve(name, self.path.parent)
        except ResolutionError:
            return None
        return library if lack_of(library) is None else None

    def _read_library(self, library: Path) -> None:
        self.libraries.add(library)
        if len(self.libraries) > MAX_LIBRARIES:
            raise failure(self.path, f"more than {MAX_LIBRARIES} material libraries are named", self.line, "join them")
        try:
            text = self.resolver.read_bytes(library).decode("utf-8-sig", "replace")
        except ResolutionError as error:
            raise failure(self.path, error.diagnostic.message, self.line, error.diagnostic.hint) from error
        for material in read_mtl(text, library, self.path.parent, self.resolver, self.findings):
            self.material_index.setdefault(material.name, len(self.materials))
            self.materials.append(material)
        if len(self.materials) > MAX_PARTS:
            raise failure(self.path, f"the mesh has more than {MAX_PARTS} materials", self.line, "join alike ones")

    def _face(self, words: list[str]) -> None:
        count = len(words)
        if count < 3:
            message = "a face has fewer than 3 vertices and is left out"
            self.findings.add(self.path, message, self.line, "write an edge as 'l'")
            return
        if count > MAX_FACE_VERTICES:
            message = f"a face has {count} vertices; the reference reads at most {MAX_FACE_VERTICES}"
            self.findings.add(self.path, message, self.line, "triangulate the mesh", Severity.INFO)
        known = self.spellings
        corners = [known[word] if word in known else self._corner(word) for word in words]
        triangles = self.faces.setdefault(self.current, [])
        for i in range(1, count - 1):
            triangles += (corners[0], corners[i], corners[i + 1])
        self.triangles += count - 2
        if self.triangles > MAX_TRIANGLES:
            raise failure(self.path, f"the mesh has more than {MAX_TRIANGLES} triangles", self.line, REDUCE)

    def _corner(self, word: str) -> int:
        """Number of the corner that ``word`` spells, seen for the first time."""
        indices = word.split("/")
        try:
            if len(word) > MAX_INDEX_DIGITS or not 1 <= len(indices) <= 3:
                raise ValueError
            v = int(indices[0])
            vt, vn = (int(text) if text else None for text in (indices[1:] + ["", ""])[:2])
        except ValueError:
            raise failure(
                self.path,
                f"'{word[:40]}' is not a face corner",
                self.line,
                "write v, v/vt, v//vn or v/vt/vn",
            ) from None
        triple = (
            self._index(v, len(self.points), "vertex"),
            -1 if vt is None else self._index(vt, len(self.uvs), "texture coordinate"),
            -1 if vn is None else self._index(vn, len(self.normals), "normal"),
        )
        number = self.corners.setdefault(triple, len(self.corners))
        if "-" not in word:  # what a relative index means changes with every vertex
            self.spellings[word] = number
        return number

    def _index(self, index: int, available: int, what: str) -> int:
        if 1 <= index <= available:
            return index - 1
        if -available <= index < 0:
            if not self.relative:
                self.relative = True
                message = "negative indices count back from the last vertex; the reference does not read them"
                self.findings.add(self.path, message, self.line, severity=Severity.INFO)
            return available + index
        raise failure(
            self.path,
            f"a face names {what} {index}, but {available} are defined so far",
            self.line,
            "indices count from 1, or back from -1 for the last",
        )

    def _mesh(self) -> Mesh:
        if not self.points:
            raise failure(self.path, "the file holds no vertex", hint="export an object with faces")
        self._report_unknown()
        points = checked(np.array(self.points, dtype=float), self.path, self.point_lines)
        uvs = self._finite(self.uvs, 2, "texture coordinates")
        normals = self._finite(self.normals, 3, "normals")
        corners = np.array(list(self.corners), dtype=np.int64).reshape(-1, 3)
        materials: list[Material | None] = [*self.materials] or [None]
        parts = [
            _part(material, np.array(self.faces.get(index, []), dtype=np.int64), corners, points, uvs, normals)
            for index, material in enumerate(materials)
        ]
        if not self.faces:
            parts[0] = replace(parts[0], vertices=points)
        return Mesh(self.path, tuple(parts), self.findings.all(), points)

    def _report_unknown(self) -> None:
        """State that several materials are one part because no library, or only a later one, defines them."""
        if len(self.unknown) > 1 and (self.materials or not self.named_library):
            last, line = list(self.unknown.items())[-1]
            message = (
                f"{len(self.unknown)} materials up to '{last[:80]}' are used before a material library defines them"
            )
            self.findings.add(
                self.path, message, line, "name it by 'mtllib' first; without it their faces are one part"
            )

    def _finite(self, rows: list[list[float]], columns: int, what: str) -> Array | None:
        """Rows as an array (n, columns), or None when there are none or some are not finite."""
        values = np.array(rows, dtype=float).reshape(-1, columns)
        if not np.isfinite(values).all():
            self.findings.add(self.path, f"the {what} hold nan or inf and are left out", 1, "export the mesh again")
            return None
        return values if len(values) else None


def _logical_lines(text: str) -> Iterator[tuple[int, str]]:
    """Number and text of each line; a line that ends in a backslash goes on in the next one."""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if "\\" not in text:
        yield from enumerate(lines, 1)
        return
    begun: list[str] = []
    for number, line in enumerate(lines, 1):
        stripped = line.rstrip()
        if stripped.endswith("\\"):
            begun.append(stripped[:-1])
        else:
            yield number - len(begun), " ".join([*begun, line]) if begun else line
            begun = []


def _part(
    material: Material | None,
    rows: NDArray[np.int64],
    corners: NDArray[np.int64],
    points: Array,
    uvs: Array | None,
    normals: Array | None,
) -> MeshPart:
    """One part from its corner numbers (3 a triangle); vertices are the distinct corners."""
    used, inverse = np.unique(rows, return_inverse=True)
    v, vt, vn = corners[used].T
    return MeshPart(
        material.name if material else "",
        points[v],
        inverse.reshape(-1, 3).astype(np.int32),
        normals[vn] if normals is not None and len(vn) and vn.min() >= 0 else None,
        uvs[vt] if uvs is not None and len(vt) and vt.min() >= 0 else None,
        material,
    )
