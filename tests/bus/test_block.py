"""Shared memory: the newest state for any reader, and nothing left behind."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from ligature.bus import Block, BusError
from ligature.bus.block import RETRIES
from ligature.bus.leftovers import FOLDER, remove, remove_leftovers

DTYPE = np.dtype([("tick", "u8"), ("values", "f8", (5000,))])
NAME = f"ligature-{os.getpid()}-0a0b0c0d"

WRITER = """
import select, sys, numpy as np
from ligature.bus import Block
dtype = np.dtype([("tick", "u8"), ("values", "f8", (5000,))])
block = Block.create(sys.argv[1], dtype)
state = np.zeros(1, dtype)
print("ready", flush=True)
while not select.select([sys.stdin], [], [], 0.0)[0]:  # until the reader closes it
    state["tick"] += 1
    state["values"] = state["tick"][0]
    block.write(state)
block.close()
"""


@pytest.fixture
def block() -> Iterator[Block]:
    made = Block.create(NAME, DTYPE)
    yield made
    made.close()


def test_a_reader_gets_the_newest_state(block: Block) -> None:
    state = np.zeros(1, DTYPE)
    for tick in (1, 2, 3):
        state["tick"] = tick
        block.write(state)
    reader = Block.attach(NAME, DTYPE)
    into = np.zeros(1, DTYPE)
    assert reader.read(into) and into["tick"][0] == 3
    reader.close()


def test_attach_takes_the_former_name_of_its_timeout() -> None:
    with pytest.warns(DeprecationWarning, match="'patience' is deprecated; write 'timeout'") as warned:
        begin = time.monotonic()
        with pytest.raises(BusError, match="no simulator writes to shared memory"):
            Block.attach("ligature-1-00", DTYPE, patience=0.0)
    assert time.monotonic() - begin < 60.0, "the default timeout was used"
    assert warned[0].filename == __file__


def test_states_are_never_torn() -> None:
    name = f"ligature-{os.getpid()}-0000beef"
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as writer:
        assert writer.stdout is not None and writer.stdout.readline() == "ready\n"
        reader, into, seen = Block.attach(name, DTYPE), np.zeros(1, DTYPE), set()
        begin = time.monotonic()  # on a busy machine two seconds are too short for a hundred states
        while time.monotonic() < begin + 2.0 or len(seen) <= 100 and time.monotonic() < begin + 60.0:
            if reader.read(into):
                assert (into["values"][0] == into["tick"][0]).all()
                seen.add(int(into["tick"][0]))
        reader.close()
    assert len(seen) > 100


def test_nobody_to_attach_to_is_stated() -> None:
    with pytest.raises(BusError, match="no simulator writes to shared memory 'ligature-1-none'"):
        Block.attach("ligature-1-none", DTYPE, timeout=0.05)


def test_waiting_for_a_simulator_can_be_given_up() -> None:
    begin = time.monotonic()
    with pytest.raises(BusError, match="no simulator writes"):
        Block.attach("ligature-1-none", DTYPE, cancelled=lambda: time.monotonic() - begin > 0.1)
    assert time.monotonic() - begin < 2.0


def test_a_block_without_a_state_is_waited_for(block: Block) -> None:
    with pytest.raises(BusError, match="no simulator writes"):
        Block.attach(NAME, DTYPE, timeout=0.05)
    threading.Timer(0.2, lambda: block.write(np.ones(1, DTYPE))).start()
    reader, into = Block.attach(NAME, DTYPE, timeout=5.0), np.zeros(1, DTYPE)
    assert reader.read(into) and into["tick"][0] == 1
    reader.close()


def test_a_block_that_is_just_being_made_is_not_mistaken_for_another() -> None:
    empty = FOLDER / f"ligature-{os.getpid()}-00000001"
    empty.touch()
    with pytest.raises(BusError, match="no simulator writes"):
        Block.attach(empty.name, DTYPE, timeout=0.05)
    empty.unlink()


def test_a_writer_that_stops_in_the_middle_of_a_state_holds_up_no_reader(block: Block) -> None:
    """As one does that the machine takes the processor from, or that dies there."""
    block.write(np.ones(1, DTYPE))
    reader, into = Block.attach(NAME, DTYPE), np.zeros(1, DTYPE)
    half = np.full(1, 2, DTYPE).view("u1")
    block._states[(int(block.figures["sequence"][0]) + 1) % 2][: len(half) // 2] = half[: len(half) // 2]
    assert reader.read(into) and into.tobytes() == np.ones(1, DTYPE).tobytes()
    assert reader.retried == 0
    reader.close()


def test_a_reader_gives_up_on_a_writer_that_is_always_faster(block: Block, monkeypatch: pytest.MonkeyPatch) -> None:
    block.write(np.ones(1, DTYPE))
    reader = Block.attach(NAME, DTYPE)
    monkeypatch.setattr(time, "sleep", lambda _: None)

    class Fast:
        """A place in which each copy meets a state that was finished meanwhile."""

        def __array__(self, dtype: object = None, copy: object = None) -> np.ndarray:
            block.write(np.ones(1, DTYPE))
            return np.zeros(DTYPE.itemsize, "u1")

    reader._states = [Fast(), Fast()]  # type: ignore[list-item]
    assert not reader.read(np.zeros(1, DTYPE))
    assert reader.retried == RETRIES
    reader.close()


def test_too_little_shared_memory_is_reported_before_anything_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(
        BusError, match=r"cannot allocate \d+ MB of shared memory for '/dev/shm/ligature-\d+-0+2': No space left"
    ):
        Block.create(f"ligature-{os.getpid()}-00000002", DTYPE)
    assert not (FOLDER / f"ligature-{os.getpid()}-00000002").exists()


def test_a_folder_that_takes_no_file_is_reported_and_a_name_twice_is_an_error_of_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ligature.bus.block.FOLDER", tmp_path / "none")
    with pytest.raises(BusError, match="cannot make the shared memory '.*/none/twice': No such file or directory"):
        Block.create("twice", DTYPE)
    monkeypatch.setattr("ligature.bus.block.FOLDER", tmp_path)
    made = Block.create("twice", DTYPE)
    with pytest.raises(FileExistsError):
        Block.create("twice", DTYPE)
    made.close()


def test_a_closed_block_leaves_no_file_open(block: Block) -> None:
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(3):
        Block.attach(NAME, DTYPE, empty=True).close()
        with pytest.raises(BusError):
            Block.attach(NAME, np.dtype([("tick", "u8"), ("values", "f8", (99999,))]), timeout=0.0)
    assert len(os.listdir("/proc/self/fd")) == before


def test_another_layout_is_refused(block: Block) -> None:
    with pytest.raises(BusError, match="belongs to another scene or version"):
        Block.attach(NAME, np.dtype([("tick", "u8"), ("values", "f8", (99999,))]), timeout=0.05)


def dead_pid() -> int:
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    return dead.pid


def test_blocks_of_dead_runs_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ligature.bus.leftovers.FOLDER", tmp_path)  # other runs that start remove leftovers too
    leftover = tmp_path / f"ligature-{dead_pid()}-12345678"
    leftover.write_bytes(b"x")
    mine = tmp_path / f"ligature-{os.getpid()}-12345678"
    mine.write_bytes(b"x")
    assert leftover.name in remove_leftovers()
    assert not leftover.exists() and mine.exists()
    mine.unlink()


def test_the_block_of_one_run_is_removed_whoever_lives_and_may_be_gone_already() -> None:
    mine = FOLDER / f"ligature-{os.getpid()}-76543210"
    mine.touch()
    remove(mine.name)
    assert not mine.exists()
    remove(mine.name)


def test_leftovers_of_another_user_are_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ligature.bus.leftovers.FOLDER", tmp_path)
    leftover = tmp_path / f"ligature-{dead_pid()}-87654321"
    leftover.touch()

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    with monkeypatch.context() as patched:
        patched.setattr(Path, "unlink", refuse)
        assert leftover.name not in remove_leftovers()
    leftover.unlink()


def test_findings_are_kept_once_each_and_the_oldest_gives_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ligature.bus.block.FOLDER", tmp_path)
    block = Block.create("findings", np.dtype([("x", "f8")]))
    for number in (*range(10), 5, 5, 9):
        block.note(2, f"finding {number} " + "é" * 300)
    texts = [bytes(row["text"]).decode("utf-8", "ignore") for row in block.figures["findings"][0]]
    assert sorted(text.split()[1] for text in texts) == [str(number) for number in range(2, 10)]
    block.close()
