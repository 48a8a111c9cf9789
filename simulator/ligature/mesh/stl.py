"""Reads STL files, binary and ASCII, as one part without shared vertices; an empty file has no part."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ligature.adf.diagnostics import Severity
from ligature.mesh.mesh import DAMAGED, MAX_TRIANGLES, REDUCE, Array, Findings, Mesh, MeshPart, checked, failure

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84
_SOLID = re.compile(rb"(?:\xef\xbb\xbf)?\s*solid", re.IGNORECASE)
_LINE_END = re.compile("\r\n|\r|\n")


def read_stl(data: bytes, path: Path) -> Mesh:
    """Read STL ``data`` of ``path``; raises `MeshError`."""
    if _is_text(data):
        return _ascii(data.decode("utf-8-sig", "replace"), path)
    if len(data) < _HEADER:
        raise failure(path, f"the file ends after {len(data)} bytes", hint="a binary STL has at least 84")
    count = int.from_bytes(data[80:_HEADER], "little")
    there = (len(data) - _HEADER) // _RECORD.itemsize
    if there < count:
        raise failure(path, f"the file announces {count} triangles but holds {there}", hint="it was cut short")
    return _binary(data, count, path)


def _is_text(data: bytes) -> bool:
    """Whether data are ASCII: many exporters begin the header of a binary file with ``solid``, too.

    The number of triangles in it, which is below 2^24, has a zero byte then.
    """
    return _SOLID.match(data) is not None and b"\0" not in data[:_HEADER]


def _binary(data: bytes, count: int, path: Path) -> Mesh:
    if count > MAX_TRIANGLES:
        raise failure(path, f"the mesh has more than {MAX_TRIANGLES} triangles", hint=REDUCE)
    records = np.frombuffer(data, dtype=_RECORD, count=count, offset=_HEADER)
    with np.errstate(invalid="ignore"):  # what is not a number is refused below
        corners = records["corners"].astype(float).reshape(-1, 3)
    return _mesh(checked(corners, path), path, Findings())


def _ascii(text: str, path: Path) -> Mesh:
    findings = Findings()
    findings.add(path, "the STL file is ASCII; the reference reads binary files only", severity=Severity.INFO)
    corners: list[list[float]] = []
    lines: list[int] = []
    for number, words in _vertices(text):
        try:
            x, y, z = words
            corners.append([float(x), float(y), float(z)])
        except ValueError:
            raise failure(path, "a vertex needs three numbers", number, DAMAGED) from None
        lines.append(number)
    if len(corners) % 3:
        raise failure(path, f"{len(corners)} vertices do not make whole triangles", lines[-1], DAMAGED)
    if len(corners) > 3 * MAX_TRIANGLES:
        raise failure(path, f"the mesh has more than {MAX_TRIANGLES} triangles", lines[3 * MAX_TRIANGLES], REDUCE)
    return _mesh(checked(np.array(corners, dtype=float).reshape(-1, 3), path, lines), path, findings)


def _vertices(text: str) -> Iterator[tuple[int, list[str]]]:
    """Line and the three words behind each ``vertex``, in whatever case; a line may hold a whole facet."""
    for number, line in enumerate(_LINE_END.split(text), 1):
        keywords = line.lower().split()
        if "vertex" not in keywords:
            continue
        words, in_name = line.split(), False  # a name may hold any word
        for at, keyword in enumerate(keywords):
            if keyword == "vertex" and not in_name:
                yield number, words[at + 1 : at + 4]
            elif keyword in ("solid", "endsolid", "facet"):
                in_name = keyword != "facet"


def _mesh(vertices: Array, path: Path, findings: Findings) -> Mesh:
    """A mesh of the triangles that each three of ``vertices`` (3 m, 3) make, with their normals."""
    if not len(vertices):
        findings.add(path, "the file holds no triangle")
        return Mesh(path, (), findings.all())
    corners = vertices.reshape(-1, 3, 3)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    return Mesh(path, (MeshPart("", vertices, faces, np.repeat(normal, 3, axis=0)),), findings.all())
