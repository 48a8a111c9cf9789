"""Files of strangers that are no scenes, and the hostile ones that were thought of; `make fuzz` runs more."""

from __future__ import annotations

import bz2
import json
import os
import signal
import struct
import time
from pathlib import Path
from typing import Any

import h5py
import pytest

from tests.fuzz import learning, readers
from tests.fuzz.readers import READERS, Reader, Refused, attempt
from tests.fuzz.run import READERS as CAMPAIGN
from tests.fuzz.run import run

EACH = 20
"""Files of each kind."""


def test_no_file_of_a_stranger_crashes_hangs_or_surprises() -> None:
    outcome = run(EACH * len(READERS), jobs=2, campaign=CAMPAIGN, chunk=200)
    assert outcome.failures == []
    for reader in READERS:
        assert outcome.ended[f"{reader.kind} refused"] > 2, reader.kind
        assert outcome.ended[f"{reader.kind} clean"] + outcome.ended[f"{reader.kind} refused"] == EACH


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
        ('{"scene": "a", "rate": 1e300}', "not 1e+300 and 1"),
        ('{"scene": "a", "speed": NaN}', "not 1000 and nan"),
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


# --- datasets ---------------------------------------------------------------------------------


def hostile_dataset(path: Path, change: Any) -> str:
    """What is reported of a dataset after ``change``."""
    path.write_bytes(learning.dataset_bytes())
    with h5py.File(path, "r+") as file:
        change(file)
    return refusal(learning.read_dataset, path, 30.0)


def replaced(name: str, **what: Any) -> Any:
    """A change that puts another array in the place of one."""

    def change(file: Any) -> None:
        del file[name]
        file.create_dataset(name, **what)

    return change


def linked(name: str, link: Any) -> Any:
    """A change that puts a link in the place of what was there."""

    def change(file: Any) -> None:
        del file[name]
        file[name] = link

    return change


PHASE = "episode_0000/phase"


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (replaced(PHASE, shape=(1 << 44,), dtype="u1", chunks=True), "claims 17592186044416 bytes and has 0"),
        (
            replaced(PHASE, shape=(3,), dtype="u1", external=[("/etc/passwd", 0, 3)]),
            "refers to data in another file",
        ),
        (linked("episode_0001", h5py.ExternalLink("/etc/other.h5", "/")), "is a link to '/etc/other.h5'"),
        (linked("episode_0001", h5py.ExternalLink("../a.h5.episodes/episode_0001.h5", "/")), "is a link to '../a.h5"),
        (linked("arms/PSM1", h5py.SoftLink("/arms")), "'arms/PSM1' is a link"),
        (lambda file: file.__setitem__("episode_0000/again", file["episode_0000"]), "occurs twice"),
        (replaced(PHASE, data=[7, 7, 7]), "has phase 7; the number of phases is 3"),
        (replaced(PHASE, data=[0.5, 0.5, 0.5]), "must be 3 numbers"),
        (replaced("episode_0000/arms/PSM1/measured_js", data=[[0.0] * 6] * 3), "it must be 3 × 3 × 6 numbers"),
        (
            replaced("episode_0000/arms/PSM1/local_action_cp", data=[[float("nan")] * 7] * 3),
            "has values that are not a valid pose",
        ),
        (lambda file: file.attrs.__setitem__("gestures", ["a", "b"]), "it has 3 phases and 2 gestures of them"),
        (
            lambda file: (file.pop("id_names", None), file.create_group("id_names")),
            "'id_names' is not a list of strings",
        ),
        (lambda file: file.attrs.pop("rate"), "attribute 'rate' of '/' is missing; it is a number above 0"),
        (lambda file: file["episode_0001"].attrs.__setitem__("samples", "three"), "must be a whole number"),
    ],
)
def test_a_dataset_that_claims_leads_away_or_lacks_something_is_refused(change: Any, why: str, tmp_path: Path) -> None:
    assert why in (words := hostile_dataset(tmp_path / "a.h5", change)), words


@pytest.mark.parametrize("place", ["/", "/episode_0000", "/episode_0000/arms", "/arms"])
@pytest.mark.parametrize("name", [b"episode_\xff", b"\xed\xa0\x80", b"a\x1b[2Jb", b"\xc3("])
def test_names_in_a_dataset_that_are_no_text_do_no_harm(place: str, name: bytes, tmp_path: Path) -> None:
    from ligature.cli.main import app
    from typer.testing import CliRunner

    path = tmp_path / "a.h5"
    path.write_bytes(learning.dataset_bytes())
    with h5py.File(path, "r+") as file:
        h5py.h5g.create(file[place].id, name)
    result = CliRunner().invoke(app, ["dataset", "info", str(path)])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code in (0, 1) and (result.exit_code == 0 or "a.h5" in result.output)


@pytest.mark.parametrize(
    "error", [UnicodeEncodeError("utf-8", "\udcff", 0, 1, "no"), KeyError("\udcff"), OSError("\udcff")]
)
def test_what_hdf5_says_of_odd_bytes_names_the_file_and_can_be_printed(error: Exception, tmp_path: Path) -> None:
    from ligature.datasets.store import DatasetError, damaged

    with pytest.raises(DatasetError, match=r"a\.h5' is damaged") as found, damaged(tmp_path / "a.h5"):
        raise error
    assert str(found.value).encode("utf-8")


def test_a_file_on_which_hdf5_crashes_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The library reads some damaged files beyond their ends; the look at them happens in another process."""
    from ligature.datasets import probe

    monkeypatch.setattr(probe, "opened", lambda *_: os.kill(os.getpid(), signal.SIGKILL))
    path = tmp_path / "a.h5"
    path.write_bytes(learning.dataset_bytes())
    assert "is damaged: reading it crashes (SIGKILL)" in refusal(learning.read_dataset, path)


# --- what else is text ------------------------------------------------------------------------


def test_ranges_that_multiply_are_refused_before_they_do(tmp_path: Path) -> None:
    path = tmp_path / "ranges.yaml"
    for text, why in (
        ("a: &a [1]\nmass: [*a, *a]\n", "line 2: write the range out, without an alias"),
        (f"mass: {'[' * 20_000}", "without lists in it"),
        ("mass: [1, 2]\n" * 10_000, "more than 64 KiB"),
        ("mass: [1.2, 0.8]", "write the lower one first"),
    ):
        path.write_text(text)
        words = refusal(learning.read_ranges, path, 2.0)
        assert why in words and "ranges.yaml" in words


def test_a_teleoperation_file_that_is_no_text_is_named_with_the_place(tmp_path: Path) -> None:
    path = tmp_path / "teleop.yaml"
    path.write_bytes(b"camera: ECM\nprefix: \xff\n")
    assert f"{path}:2:9: error: byte 0xff is not UTF-8" in refusal(readers.read_teleop, path)
