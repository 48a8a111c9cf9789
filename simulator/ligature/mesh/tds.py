"""Reads 3DS files: one part per object and material.

The format is a tree of chunks, each an id (2 bytes), a length (4 bytes, header included) and content.
No kept library reads it without a full asset importer, and scene files of the corpus name it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ligature.mesh.mesh import Array, Mesh, MeshPart, checked, failure

_MAIN, _EDITOR, _OBJECT, _TRIANGLES = 0x4D4D, 0x3D3D, 0x4000, 0x4100
_VERTICES, _FACES, _FACE_MATERIAL, _UVS = 0x4110, 0x4120, 0x4130, 0x4140


def read_3ds(data: bytes, path: Path) -> Mesh:
    """Read 3DS ``data`` of ``path``; raises `MeshError`."""
    if data[:2] != struct.pack("<H", _MAIN):
        raise failure(path, "this is not a 3DS file", hint="it should start with the bytes 4D 4D")
    try:
        parts = [
            part
            for main, start, end in _chunks(data, 0, len(data), path)
            if main == _MAIN
            for editor, start2, end2 in _chunks(data, start, end, path)
            if editor == _EDITOR
            for kind, start3, end3 in _chunks(data, start2, end2, path)
            if kind == _OBJECT
            for part in _object(data, start3, end3, path)
        ]
    except (struct.error, ValueError, IndexError) as error:
        raise failure(path, f"a chunk is cut short ({error})") from error
    if not parts:
        raise failure(path, "the file holds no triangle mesh")
    return Mesh(path, tuple(parts))


def _chunks(data: bytes, start: int, end: int, path: Path) -> Iterator[tuple[int, int, int]]:
    """Id, start and end of the content of each chunk between ``start`` and ``end``."""
    while start + 6 <= end:
        kind, length = struct.unpack_from("<HI", data, start)
        if length < 6 or start + length > end:
            raise failure(path, f"chunk {kind:#06x} at byte {start} has the impossible length {length}")
        yield kind, start + 6, start + length
        start += length


def _text(data: bytes, start: int, end: int) -> tuple[str, int]:
    stop = data.index(b"\0", start, end)
    return data[start:stop].decode("latin-1"), stop + 1


def _object(data: bytes, start: int, end: int, path: Path) -> Iterator[MeshPart]:
    name, start = _text(data, start, end)
    for kind, a, b in _chunks(data, start, end, path):
        if kind == _TRIANGLES:
            yield from _triangles(data, a, b, name, path)


def _triangles(data: bytes, start: int, end: int, name: str, path: Path) -> Iterator[MeshPart]:
    vertices: Array = np.zeros((0, 3))
    uvs: Array | None = None
    faces: NDArray[np.int32] = np.zeros((0, 3), dtype=np.int32)
    groups: list[tuple[str, NDArray[np.int64]]] = []
    for kind, a, b in _chunks(data, start, end, path):
        if kind == _VERTICES:
            vertices = checked(_array(data, a, b, "<f4", 3).astype(float), path)
        elif kind == _UVS:
            uvs = checked(_array(data, a, b, "<f4", 2).astype(float), path)
        elif kind == _FACES:
            faces = _array(data, a, b, "<u2", 4)[:, :3].astype(np.int32)
            count = struct.unpack_from("<H", data, a)[0]
            for sub, c, d in _chunks(data, a + 2 + 8 * count, b, path):
                if sub == _FACE_MATERIAL:
                    material, c = _text(data, c, d)
                    groups.append((material, _array(data, c, d, "<u2", 1).ravel().astype(np.int64)))
    if len(faces) and faces.max() >= len(vertices):
        raise failure(path, f"a face of '{name}' names vertex {faces.max()}, but there are {len(vertices)}")
    if uvs is not None and len(uvs) != len(vertices):
        uvs = None
    for material, rows in groups or [(name, np.arange(len(faces)))]:
        if len(rows) and rows.max() >= len(faces):
            raise failure(path, f"material '{material}' names face {rows.max()}, but there are {len(faces)}")
        yield MeshPart(material, vertices, faces[rows], None, uvs)


def _array(data: bytes, start: int, end: int, dtype: str, columns: int) -> NDArray[np.generic]:
    """A counted array of rows of ``columns`` values."""
    count = struct.unpack_from("<H", data, start)[0]
    item = np.dtype(dtype).itemsize * columns
    if start + 2 + count * item > end:
        raise ValueError(f"{count} rows do not fit")
    return np.frombuffer(data, dtype=dtype, count=count * columns, offset=start + 2).reshape(count, columns)
