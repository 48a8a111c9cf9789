"""Sixteen hundred files of strangers that are no scenes, and the hostile ones that were thought of; `make fuzz` runs more."""

from __future__ import annotations

import bz2
import json
import os
import struct
import time
from pathlib import Path
from typing import Any

import pytest

from tests.fuzz import readers
from tests.fuzz.readers import READERS, Reader, Refused, attempt
from tests.fuzz.run import READERS as CAMPAIGN
from tests.fuzz.run import run


def test_no_file_of_a_stranger_crashes_hangs_or_surprises() -> None:
    outcome = run(100 * len(READERS), jobs=2, campaign=CAMPAIGN, chunk=200)
    assert outcome.failures == []
    for reader in READERS:
        assert outcome.ended[f"{reader.kind} refused"] > 5, reader.kind
        assert outcome.ended[f"{reader.kind} clean"] + outcome.ended[f"{reader.kind} refused"] == 100


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.kind)
def test_every_seed_is_read(reader: Reader, tmp_path: Path) -> None:
    from tests.fuzz.seeds import OBJ

    (tmp_path / "part.obj").write_text(OBJ)
    path = tmp_path / reader.name
    path.write_bytes(reader.seed())
    assert attempt(reader, path) == "clean"


def refusal(read: Any, path: Path, seconds: float = 5.0) -> str:
    begin = time.monotonic()
    with pytest.raises(Refused) as refused:
        read(path)
    assert time.monotonic() - begin < seconds
    return str(refused.value)


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ("[]", "are list, not names with values"),
        ("nonsense", "are not JSON"),
        ("[" * 100_000, "are not JSON"),
        ('{"scene": 7}', "option 'scene' of the run is '7'"),
        ('{"scene": "a", "rate": "fast"}', "option 'rate' of the run is 'fast'"),
        ('{"scene": "a", "rate": 1e300}', "1e+300 updates per second"),
        ('{"scene": "a", "speed": NaN}', "at speed nan"),
        ('{"scene": "a", "models": [1, "b"]}', "option 'models'"),
        ('{"scene": "a", "shell": "rm"}', "unknown name 'shell'"),
        ("{}", "name no scene"),
    ],
)
def test_options_of_a_record_are_checked(options: str, why: str, tmp_path: Path) -> None:
    head = json.dumps({"format": "ligature record 3", "options": options, "begin": "00"}).encode() + b"\n"
    path = tmp_path / "a.record"
    path.write_bytes(readers.sealed(head + struct.pack("<QI", 9, 0xFFFFFFFF) + bytes(32) + bytes(16)))
    assert why in refusal(readers.read_record, path)


def bag_of(path: Path, definition: str, type_: str = "evil_msgs/Evil", md5: str = "0" * 32) -> None:
    """A bag with one message whose definition is ``definition``."""
    import rosbag
    import rospy
    from std_msgs.msg import String

    class Evil(String):  # type: ignore[misc]
        _type, _md5sum, _full_text = type_, md5, definition

    with rosbag.Bag(str(path), "w") as bag:
        bag.write("/evil", Evil("a"), rospy.Time(1))


EXPLOITS = (
    'string data\nstring X=""";__import__("os").environ.setdefault("LIGATURE_EVIL","1");b=3#\nint32 c #\\',
    "string data\nbool X=__import__('os').environ.setdefault('LIGATURE_EVIL','1')",
    "string data\nint32 X=__import__('os').environ.setdefault('LIGATURE_EVIL','1')",
    'string data # \\"""\n"""\n__import__("os").environ.setdefault("LIGATURE_EVIL","1")',
)


@pytest.mark.parametrize("definition", EXPLOITS)
@pytest.mark.parametrize("type_", ["evil_msgs/Evil", "std_msgs/String", "a/b'];import os#"])
def test_no_bag_runs_code(definition: str, type_: str, tmp_path: Path) -> None:
    """genpy puts definitions into Python text; with the first of these its own reader does run code."""
    path = tmp_path / "a.bag"
    bag_of(path, definition, type_)
    try:
        readers.read_bag(path)
    except Refused as error:
        assert "a.bag" in str(error)
    assert "LIGATURE_EVIL" not in os.environ


def test_the_exploit_would_work_without_us(monkeypatch: pytest.MonkeyPatch) -> None:
    """The test above can fail: the same text, given to genpy as it is, does what it says."""
    import genpy.dynamic

    monkeypatch.setenv("LIGATURE_EVIL", "")
    monkeypatch.delenv("LIGATURE_EVIL")
    genpy.dynamic.generate_dynamic("evil_msgs/Evil", EXPLOITS[0])
    assert os.environ.pop("LIGATURE_EVIL") == "1"


def test_a_chunk_of_a_bag_that_becomes_gigabytes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "b.bag"
    data = readers.bag_bytes("bz2")
    begin = data.index(b"BZh")
    size = data[begin - 4 : begin]
    packed = data[begin : begin + struct.unpack("<I", size)[0]]
    bomb = bz2.compress(b"\0" * (300 << 20))
    path.write_bytes(data[:begin] + (bomb + b"\0" * len(packed))[: len(packed)] + data[begin + len(packed) :])
    assert "b.bag" in refusal(readers.read_bag, path, 20.0)
    import rosbag
    from ligature.ros import bags

    with pytest.raises(bags.BagError, match="more than 256 MiB"):
        rosbag.bag.bz2.decompress(bomb)


LAUGHS = "<!DOCTYPE r [" + "<!ENTITY a0 'ha'>" + "".join(
    f"<!ENTITY a{n} '{f'&a{n - 1};' * 10}'>" for n in range(1, 12)
)  # fmt: skip


@pytest.mark.parametrize(("name", "root"), [("robot.urdf", "robot"), ("robot.sdf", "sdf"), ("robot.xml", "mujoco")])
@pytest.mark.parametrize(
    ("text", "why"),
    [
        (LAUGHS + "]>\n<{root} name='&a11;'/>", ":1:13: error: declares a document type"),
        ("<!DOCTYPE r [<!ENTITY f SYSTEM 'file:///etc/passwd'>]>\n<{root} name='a'>&f;</{root}>", ":1:13: error: declares"),
        ("<{root} name='a'>" + "<link>" * 5000, ":1:"),
        ("<{root} name='a'>\n  <link name='b'>\n</{root}>", ":3:3: error: not well-formed XML: mismatched tag"),
        ("", ":1:1: error: not well-formed XML: no element found"),
    ],
)  # fmt: skip
def test_xml_is_looked_at_before_a_library_reads_it(name: str, root: str, text: str, why: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text(text.replace("{root}", root))
    assert f"{path}{why}" in refusal(readers.convert_robot, path)


def test_entities_are_found_in_every_encoding(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_bytes(("\ufeff" + LAUGHS + "]><robot name='&a11;'/>").encode("utf-16-le"))
    assert "declares a document type" in refusal(readers.convert_robot, path)


@pytest.mark.parametrize("side", [8_300, 12_000, 30_000])
def test_a_picture_of_few_bytes_and_many_pixels_is_refused(side: int, tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(readers.png_head(side, side) + readers.png_of(8, 8)[33:])
    assert "pixels" in refusal(readers.read_any_picture, path, 1.0)


def test_no_picture_starts_another_program(tmp_path: Path) -> None:
    """Pillow hands PostScript to Ghostscript, whatever the file is called."""
    path = tmp_path / "a.png"
    path.write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 100 100\n%%EndComments\nshowpage\n")
    assert "none of PNG" in refusal(readers.read_any_picture, path)
