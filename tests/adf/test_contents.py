"""Files of an unexpected kind are recognised by their beginning, and scene files are not taken for one."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.adf.contents import BEGINNING, content_of, mistaken

KINDS = {
    "a PLY mesh": b"ply\nformat ascii 1.0\n",
    "an OFF mesh": b"COFF\n4 4 0\n",
    "an OBJ mesh": b"v 0 0 1\n",
    "an STL mesh": b"solid part\n  facet normal 0 0 1\n",
    "a COLLADA model": b"<?xml version='1.0'?>\n<COLLADA/>",
    "a URDF robot": b"<robot name='a'/>",
    "an SDF model": b"<sdf version='1.6'/>",
    "an MJCF model": b"<mujoco/>",
    "an XML file": b"<?xml version='1.0'?><launch/>",
    "a ROS bag": b"#ROSBAG V2.0\n",
    "a compressed file": b"\x1f\x8b\x08",
    "a picture": b"GIF89a",
}
COMMENTS = st.lists(st.sampled_from([b"# made by hand\n", b"\n", b"  ", b"#\n"]), max_size=4).map(b"".join)


@given(COMMENTS, st.sampled_from(sorted(KINDS)), st.binary(max_size=200))
def test_a_kind_is_recognised_behind_comments_whatever_follows(before: bytes, kind: str, rest: bytes) -> None:
    content = content_of(before + KINDS[kind] + b"\n" + rest)
    assert content is not None and (content[0] == kind or kind == "an XML file")
    assert content[1]


@given(
    COMMENTS, st.sampled_from([b"bodies: [B]\n", b"vn: 3\n", b"object: o\n", b"plywood: 1\n", b"solid: 1\n", b"g: 1\n"])
)
def test_a_scene_file_is_none_of_them(before: bytes, text: bytes) -> None:
    assert content_of(before + text) is None


@pytest.mark.parametrize("count", [0, 1, 2**28 - 1, 2**28])
@pytest.mark.parametrize("size", [133, 134, 200])
@pytest.mark.parametrize("unused", [0, 1])
def test_binary_stl_is_a_count_of_triangles_with_an_unused_attribute(count: int, size: int, unused: int) -> None:
    data = (b"\xff" * 80 + struct.pack("<I", count) + b"\xff" * 48 + struct.pack("<H", unused) + b"\xff" * 66)[:size]
    assert (content_of(data) is not None) is (0 < count < 2**28 and size >= 134 and not unused)


def test_only_the_beginning_counts(tmp_path: Path) -> None:
    assert content_of(b" " * (BEGINNING - 4) + b"ply\n") is not None
    assert content_of(b" " * (BEGINNING - 3) + b"ply\n") is None
    file = tmp_path / "file"
    file.write_bytes(KINDS["a ROS bag"])
    assert mistaken(file, "a picture") == f"'{file}' is a ROS bag"
    assert mistaken(file, "a ROS bag") == ""
    file.write_bytes(b"bodies: []\n")
    assert mistaken(file, "a ROS bag") == ""
