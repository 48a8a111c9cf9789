"""Records of runs: what was written is read; what is cut off, damaged or cannot be written is told."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from ligature.bus.record import Header, Record, RecordError, RecordWriter, is_record
from ligature.model.commands import ArmCommand, BodyCommand, Command, CommandType, Reset

HEADER = Header('{"scene": "a.yaml"}', "ab" * 32)
COMMANDS: list[tuple[int, Command]] = [
    (1, ArmCommand(0, "servo_jp", (0.1, 0.2, 0.3))),
    (1, Reset(True)),
    (7, BodyCommand(3, CommandType.FORCE, (1.0, 0.0, 1e-300, 0.0, 0.0, 0.0))),
]


@pytest.fixture
def whole(tmp_path: Path) -> Path:
    path = tmp_path / "run.record"
    writer = RecordWriter(path, HEADER)
    for update, command in COMMANDS:
        writer.write(update, command)
    assert not path.exists(), "half a record has the final name"
    writer.finish(9, "cd" * 32)
    return path


def test_a_record_is_read_as_it_was_written(whole: Path) -> None:
    assert [file.name for file in whole.parent.iterdir()] == ["run.record"]
    assert is_record(whole)
    record = Record.read(whole)
    assert record == Record(HEADER, tuple(COMMANDS), 9, "cd" * 32)


def test_commands_are_replayed_between_the_updates_they_came_between(whole: Path) -> None:
    seen: list[object] = []
    Record.read(whole).replay(lambda: seen.append("update"), seen.append)
    first, second, third = (command for _, command in COMMANDS)
    assert seen == [first, second, *["update"] * 6, third, *["update"] * 2]


@pytest.mark.parametrize("share", [0.3, 0.6, 0.99])
def test_a_record_that_is_cut_off_is_told_so(whole: Path, share: float) -> None:
    data = whole.read_bytes()
    begin = data.index(b"\n") + 1
    whole.write_bytes(data[: begin + int(share * (len(data) - begin))])
    with pytest.raises(RecordError, match=r"cut off after \d commands: the run that wrote it did not come to its end"):
        Record.read(whole)


def test_what_is_no_record_is_told_so(tmp_path: Path, whole: Path) -> None:
    other = tmp_path / "other"
    for data, message in (
        (b"", "is no record of a run"),
        (b"#ROSBAG V2.0\nabc", "is no record of a run"),
        (b'{"format": "ligature record 9", "options": "", "begin": ""}\n', "this version reads 'ligature record 1'"),
        (b'{"format": "ligature record 1", "begin": ""}\n', "is no record of a run"),
        (whole.read_bytes()[:-44] + struct.pack("<QI", 9, 70_000), "no frame of a record"),
        (whole.read_bytes()[:-44] + struct.pack("<QI", 2, 8), "no frame of a record"),
    ):
        other.write_bytes(data)
        with pytest.raises(RecordError, match=message):
            Record.read(other)


def test_bytes_that_are_no_command_are_told_with_their_place(whole: Path) -> None:
    data = whole.read_bytes()
    begin = data.index(b"\n") + 1
    whole.write_bytes(data[:begin] + struct.pack("<QI", 1, 3) + b"\xfe\x00\x00" + data[begin:])
    with pytest.raises(RecordError, match=rf"at byte {begin + 12}: these bytes are no command"):
        Record.read(whole)


def test_records_replace_nothing(whole: Path) -> None:
    before = whole.read_bytes()
    with pytest.raises(FileExistsError, match="records replace nothing"):
        RecordWriter(whole, HEADER)
    assert whole.read_bytes() == before


def test_a_full_disk_leaves_nothing_under_the_final_name(tmp_path: Path) -> None:
    """/dev/full is a disk without room: the file that is written to becomes it."""
    path = tmp_path / "run.record"
    (tmp_path / "run.record.active").symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left"):
        RecordWriter(path, HEADER)
    assert not path.exists()
