"""Reads STL files, binary and ASCII, as one part without shared vertices; an empty file has no part."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ligature.mesh.mesh import MAX_TRIANGLES, Array, Mesh, MeshPart, checked, failure

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84


def read_stl(data: bytes, path: Path) -> Mesh:
    """Read STL ``data`` of ``path``; raises `MeshError`."""
    if len(data) >= _HEADER:
        count = int.from_bytes(data[80:84], "little")
        if len(data) == _HEADER + _RECORD.itemsize * count:
            return _mesh(_binary(data, count, path), path)
    if data.lstrip()[:5].lower() == b"solid":
        return _mesh(_ascii(data.decode("ascii", "replace"), path), path)
    if len(data) < _HEADER:
        raise failure(path, f"the file ends after {len(data)} bytes", hint="a binary STL has at least 84")
    count = int.from_bytes(data[80:84], "little")
    if len(data) < _HEADER + _RECORD.itemsize * count:
        there = (len(data) - _HEADER) // _RECORD.itemsize
        raise failure(path, f"the file announces {count} triangles but holds {there}", hint="it was cut short")
    return _mesh(_binary(data, count, path), path)


def _binary(data: bytes, count: int, path: Path) -> Array:
    if count > MAX_TRIANGLES:
        raise failure(path, f"the mesh has more than {MAX_TRIANGLES} triangles")
    records = np.frombuffer(data, dtype=_RECORD, count=count, offset=_HEADER)
    if not np.isfinite(records["corners"]).all():
        raise failure(path, "a vertex is not finite", hint="export the mesh again without nan or inf")
    return records["corners"].astype(float)


def _ascii(text: str, path: Path) -> Array:
    corners: list[list[float]] = []
    for number, line in enumerate(text.split("\n"), 1):
        words = line.split()
        if words[:1] != ["vertex"]:
            continue
        try:
            x, y, z = (float(word) for word in words[1:4])
        except ValueError:
            raise failure(path, "a vertex needs three numbers", number) from None
        corners.append([x, y, z])
    if len(corners) % 3:
        raise failure(path, f"{len(corners)} vertices do not make whole triangles")
    return np.array(corners, dtype=float).reshape(-1, 3, 3)


def _mesh(corners: Array, path: Path) -> Mesh:
    if not len(corners):
        return Mesh(path, ())
    vertices = checked(corners.reshape(-1, 3), path)
    faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    return Mesh(path, (MeshPart("", vertices, faces, np.repeat(normal, 3, axis=0)),))
