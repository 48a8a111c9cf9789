"""Records of runs: what was written is read; what is cut off, damaged or cannot be written is reported."""

from __future__ import annotations

import os
import re
import resource
import struct
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, strategies
from hypothesis.strategies import DataObject, integers
from ligature.bus import record as records
from ligature.bus.record import MOST_UPDATES, Excerpt, Header, Moment, Record, RecordError, RecordWriter, is_record
from ligature.model.commands import BodyCommand, Command, CommandType, Reset
from ligature.robots.commands import ServoJp

Begin = Callable[[Path, RecordWriter], RecordWriter | Excerpt]

HEADER = Header('{"scene": "a.yaml"}', "ab" * 32)
COMMANDS: list[tuple[int, Command]] = [
    (1, ServoJp(0, (0.1, 0.2, 0.3))),
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


def test_a_part_of_a_run_holds_what_was_before_it_and_states_where_it_begins(tmp_path: Path) -> None:
    """The part begins between two commands of one update; what comes after its end is not in it."""
    (_, first), (_, second), (_, third) = COMMANDS
    writer = RecordWriter(tmp_path / "run.record", HEADER)
    writer.write(1, first)
    writer.write(4, second)
    part = Excerpt(tmp_path / "part.record", writer, writer.moment(4, "ef" * 32))
    writer.write(4, third)
    end = writer.moment(6, "01" * 32)
    writer.write(6, first)
    part.finish(end)
    writer.finish(9, "cd" * 32)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["part.record", "run.record"]
    record = Record.read(part.path)
    assert record == Record(HEADER, ((1, first), (4, second), (4, third)), 6, "01" * 32, 4, 2, "ef" * 32)
    seen: list[object] = []
    record.replay(lambda: seen.append("update"), seen.append, lambda: seen.append("begins"))
    assert seen == [first, *["update"] * 3, second, "begins", third, *["update"] * 2]
    assert Record.read(tmp_path / "run.record").begun == ""


def test_a_part_without_commands_begins_and_ends_after_the_right_updates(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path / "run.record", HEADER)
    Excerpt(tmp_path / "part.record", writer, writer.moment(3, "ef" * 32)).finish(writer.moment(5, "01" * 32))
    seen: list[object] = []
    Record.read(tmp_path / "part.record").replay(
        lambda: seen.append("update"), seen.append, lambda: seen.append("begins")
    )
    assert seen == [*["update"] * 2, "begins", *["update"] * 2]


def test_a_part_that_the_disk_does_not_take_leaves_nothing(tmp_path: Path) -> None:
    """/dev/full is a disk without room."""
    writer = RecordWriter(tmp_path / "run.record", HEADER)
    part = Excerpt(tmp_path / "part.record", writer, writer.moment(1, "ef" * 32))
    with open("/dev/full", "wb") as full:
        os.dup2(full.fileno(), part._file.fileno())
    with pytest.raises(OSError, match="No space left"):
        part.finish(writer.moment(2, "01" * 32))
    writer.finish(2, "cd" * 32)
    assert [path.name for path in tmp_path.iterdir()] == ["run.record"]


def test_a_journal_that_is_too_short_is_reported(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path / "run.record", HEADER)
    part = Excerpt(tmp_path / "part.record", writer, writer.moment(1, "ef" * 32))
    with pytest.raises(OSError, match="has been truncated"):
        part.finish(Moment(2, "01" * 32, 100_000))
    assert not list(tmp_path.glob("part*"))


def test_a_record_that_is_cut_off_anywhere_is_reported(whole: Path) -> None:
    data, commands = whole.read_bytes(), 0
    for end in range(data.index(b"\n") + 1, len(data)):
        whole.write_bytes(data[:end])
        with pytest.raises(RecordError, match="the recorded run did not end properly") as caught:
            Record.read(whole)
        (found,) = re.findall(r"cut off after (\d) commands", str(caught.value))
        assert commands <= int(found) <= commands + 1
        commands = int(found)
    assert commands == len(COMMANDS)


def test_what_is_no_record_is_reported(tmp_path: Path, whole: Path) -> None:
    other = tmp_path / "other"
    for data, message in (
        (b"", "line 1: not the header of a record"),
        (b"#ROSBAG V2.0\nabc", "line 1: not the header of a record"),
        (b'{"format": "ligature record 9", "options": "", "begin": ""}\n', "this version reads 'ligature record 3'"),
        (b'{"format": "ligature record 3", "begin": ""}\n', "not the header of a record of a run"),
        (whole.read_bytes()[:-60] + struct.pack("<QI", 9, 70_000), "invalid frame"),
        (whole.read_bytes()[:-60] + struct.pack("<QI", 2, 8), "invalid frame"),
    ):
        other.write_bytes(data)
        with pytest.raises(RecordError, match=message):
            Record.read(other)


@given(strategies.data())
def test_a_record_with_any_byte_changed_is_found_before_anything_is_simulated(draw: DataObject) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder, "run.record")
        writer = RecordWriter(path, HEADER)
        for update, command in COMMANDS:
            writer.write(update, command)
        writer.finish(9, "cd" * 32)
        content = bytearray(path.read_bytes())
        at = draw.draw(integers(0, len(content) - 1))
        content[at] ^= 1 << draw.draw(integers(0, 7))
        path.write_bytes(content)
        with pytest.raises(RecordError, match="run.record"):
            Record.read(path)


@given(integers(MOST_UPDATES + 1, 2**64 - 1))
def test_a_run_that_would_be_replayed_for_ever_is_refused(updates: int) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder, "run.record")
        writer = RecordWriter(path, HEADER)
        writer.finish(updates, "cd" * 32)
        with pytest.raises(RecordError, match=f"a run has {updates} updates; the maximum is {MOST_UPDATES}"):
            Record.read(path)


def test_bytes_that_are_no_command_are_reported_with_their_place(whole: Path) -> None:
    data = whole.read_bytes()
    begin = data.index(b"\n") + 1
    whole.write_bytes(data[:begin] + struct.pack("<QI", 1, 3) + b"\xfe\x00\x00" + data[begin:])
    with pytest.raises(RecordError, match=rf"at byte {begin + 12}: invalid command bytes"):
        Record.read(whole)


@pytest.mark.parametrize("begin", [
    lambda path, journal: RecordWriter(path, HEADER),
    lambda path, journal: Excerpt(path, journal, journal.moment(1, "ef" * 32)),
], ids=["run", "part"])  # fmt: skip
@given(names=strategies.sets(strategies.sampled_from(["a.record", "a.record.active"])), late=strategies.booleans())
def test_records_replace_nothing(begin: Begin, names: set[str], late: bool) -> None:
    """Neither a record nor what is recorded or was left by a killed run, nor what appears under the name meanwhile."""
    with TemporaryDirectory() as folder:
        journal, path = RecordWriter(Path(folder, "journal"), HEADER), Path(folder, "a.record")
        for name in names:
            Path(folder, name).write_text(name)
        if names:
            with pytest.raises(FileExistsError, match="choose another name"):
                begin(path, journal)
        else:
            record = begin(path, journal)
            if late:
                path.write_text("a.record")
            with pytest.raises(FileExistsError, match="is in '.*a.record.active'") if late else nullcontext():
                end = journal.moment(2, "01" * 32)
                record.finish(end) if isinstance(record, Excerpt) else record.finish(2, "01" * 32)
            assert Record.read(Path(folder, "a.record.active") if late else path).updates == 2
            names = {"a.record"} if late else set()
        assert all(Path(folder, name).read_text() == name for name in names)
        journal.abandon()


def test_a_full_disk_leaves_nothing_under_the_final_name(tmp_path: Path) -> None:
    """Files may have 10 bytes."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10, limits[1]))
        with pytest.raises(OSError, match="File too large"):
            RecordWriter(tmp_path / "run.record", HEADER)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not list(tmp_path.iterdir())


def test_the_longest_run_is_read(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path / "run.record", HEADER)
    writer.finish(MOST_UPDATES, "cd" * 32)
    assert Record.read(tmp_path / "run.record").updates == MOST_UPDATES == 10**9


def test_a_file_larger_than_any_record_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file is sparse, so that it takes no space; to read it would take 4 GiB of memory."""
    monkeypatch.setattr(Path, "read_bytes", lambda path: pytest.fail(f"{path} is read"))
    path = tmp_path / "run.record"
    path.touch()
    os.truncate(path, 4 * 2**30 + 1)
    with pytest.raises(RecordError, match="has more than 4 GiB, the maximum size of a record"):
        Record.read(path)


@given(integers(-40, 40))
def test_a_record_is_read_up_to_the_largest_size(more: int) -> None:
    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        path = Path(folder, "run.record")
        RecordWriter(path, HEADER).finish(9, "cd" * 32)
        patch.setattr(records, "MOST_FILE_BYTES", path.stat().st_size + more)
        if more >= 0:
            assert Record.read(path).updates == 9
        else:
            with pytest.raises(RecordError, match="the maximum size of a record"):
                Record.read(path)


def open_files(folder: Path) -> set[str]:
    """The files below a folder that this process has open."""
    links = (Path("/proc/self/fd", name) for name in os.listdir("/proc/self/fd"))
    return {target.name for link in links if link.is_symlink() and (target := link.readlink()).is_relative_to(folder)}


def test_commands_are_on_the_disk_after_a_flush_and_when_a_run_is_given_up(tmp_path: Path) -> None:
    """What a killed run leaves is what `flush` handed over; who gives a run up keeps everything and no open file."""
    writer = RecordWriter(tmp_path / "run.record", HEADER)
    part = tmp_path / "run.record.active"
    size = part.stat().st_size
    for update, command in COMMANDS:
        writer.write(update, command)
        writer.flush()
        assert part.stat().st_size > size
        size = part.stat().st_size
    writer.write(9, COMMANDS[0][1])
    assert open_files(tmp_path) == {part.name}
    assert writer.abandon() == part
    assert part.stat().st_size > size
    assert open_files(tmp_path) == set()


def test_a_part_that_is_dropped_leaves_no_file_open(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path / "run.record", HEADER)
    part = Excerpt(tmp_path / "part.record", writer, writer.moment(1, "ef" * 32))
    assert open_files(tmp_path) == {"run.record.active", "part.record.active"}
    part.drop()
    assert open_files(tmp_path) == {"run.record.active"}
    assert [path.name for path in tmp_path.iterdir()] == ["run.record.active"]


@given(strategies.lists(integers(0, 200_000), min_size=2, max_size=2).map(sorted), integers(0, 70_000))
def test_any_bytes_of_a_journal_are_copied(ends: list[int], more: int) -> None:
    """Those from the first to the last that were asked for, in parts, and nothing that was written after them."""
    begin, end = ends
    content = bytes(i * 7 % 251 for i in range(end + more))
    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr(records, "_CHUNK", 65_536)
        with Path(folder, "journal").open("w+b") as file:
            journal = records.Journal(file, HEADER)
            head = journal.moment(1, "").size
            file.write(content)
            file.flush()
            copied: list[bytes] = []
            journal.copy(copied.append, head + begin, head + end)
            assert b"".join(copied) == content[begin:end]
            assert all(0 < len(part) <= 65_536 for part in copied)
