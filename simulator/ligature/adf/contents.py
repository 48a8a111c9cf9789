"""Recognises files of an unexpected kind by their beginning, and names what to do with them."""

from __future__ import annotations

import re
from pathlib import Path

from ligature.paths import open_file

BEGINNING = 4096
"""Bytes of a file that are looked at."""

_CONVERT = "convert it to OBJ, STL or 3DS, for example with Blender"
_MESH = "name it as 'mesh' of a body in a model file"
_ROBOT = "'ligature convert' writes it as an ADF model"
_UNPACK = "unpack it first"
_OTHER = "give a scene file, which is YAML"

_SIGNS = (
    (rb"ply\s", "a PLY mesh", _CONVERT),
    (rb"C?OFF\s", "an OFF mesh", _CONVERT),
    (rb"glTF", "a glTF model", _CONVERT),
    (rb"Kaydara FBX", "an FBX model", _CONVERT),
    (rb"(?:v|vn|vt|f) +[-+.\d]|(?:mtllib|usemtl|o|g) +\S", "an OBJ mesh", _MESH),
    (rb"solid\b.*\n\s*facet\b", "an STL mesh", _MESH),
    (rb"BLENDER", "a Blender file", "export it with the Blender extension of Ligature"),
    (rb"<.*<?COLLADA\b", "a COLLADA model", _CONVERT),
    (rb"<.*<?robot\b", "a URDF robot", _ROBOT),
    (rb"<.*<?sdf\b", "an SDF model", _ROBOT),
    (rb"<.*<?mujoco\b", "an MJCF model", _ROBOT),
    (rb"<\?xml|<!DOCTYPE|<html", "an XML file", _OTHER),
    (rb'\{"format": "ligature record', "a record of a run", "'ligature replay' simulates it again"),
    (rb"#ROSBAG", "a ROS bag", "'ligature replay' plays it back"),
    (rb"\x89HDF", "an HDF5 file", "'ligature dataset info' describes datasets"),
    (rb"PK\x03\x04", "a zip archive", _UNPACK),
    (rb"\x1f\x8b|BZh|\xfd7zXZ", "a compressed file", _UNPACK),
    (rb"\x89PNG|\xff\xd8\xff|GIF8", "a picture", _OTHER),
    (rb"%PDF", "a PDF document", _OTHER),
    (rb"\x7fELF", "a program", _OTHER),
)
_PATTERNS = tuple((re.compile(sign, re.DOTALL), what, remedy) for sign, what, remedy in _SIGNS)
_COMMENT = re.compile(rb"(?:#(?!ROSBAG)[^\n]*)?\s+")


def content_of(data: bytes) -> tuple[str, str] | None:
    """What a file that begins with ``data`` is, and what to do with it; None for what is not recognised."""
    data, start = data[:BEGINNING], 0
    while comment := _COMMENT.match(data, start):
        start = comment.end()
    for pattern, what, remedy in _PATTERNS:
        if pattern.match(data, start):
            return what, remedy
    return None if not _binary_stl(data) else ("an STL mesh", _MESH)


def mistaken(path: Path, wanted: str) -> str:
    """``'PATH' is WHAT`` for a file that is recognised as something else than ``wanted``, else empty.

    Raises OSError where there is no file to read.
    """
    with open_file(path) as file:
        content = content_of(file.read(BEGINNING))
    return "" if content is None or content[0] == wanted else f"'{path}' is {content[0]}"


def _binary_stl(data: bytes) -> bool:
    """Whether data begin as binary STL: 80 bytes, a number of triangles, and the first one's unused attribute."""
    return len(data) >= 134 and 0 < int.from_bytes(data[80:84], "little") < 2**28 and data[132:134] == b"\0\0"
