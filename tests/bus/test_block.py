"""Shared memory: the newest state for any reader, and nothing left behind."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator

import numpy as np
import pytest
from ligature.bus import Block, BusError
from ligature.bus.block import FOLDER, remove_leftovers

DTYPE = np.dtype([("tick", "u8"), ("values", "f8", (5000,))])
NAME = f"ligature-{os.getpid()}-0a0b0c0d"

WRITER = """
import sys, time, numpy as np
from ligature.bus import Block
dtype = np.dtype([("tick", "u8"), ("values", "f8", (5000,))])
block = Block.create(sys.argv[1], dtype)
state = np.zeros(1, dtype)
print("ready", flush=True)
end = time.monotonic() + 3.0
while time.monotonic() < end:
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


def test_states_are_never_torn() -> None:
    name = f"ligature-{os.getpid()}-0000beef"
    with subprocess.Popen([sys.executable, "-c", WRITER, name], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None and writer.stdout.readline() == "ready\n"
        reader, into, seen = Block.attach(name, DTYPE), np.zeros(1, DTYPE), set()
        end = time.monotonic() + 2.0
        while time.monotonic() < end:
            if reader.read(into):
                assert (into["values"][0] == into["tick"][0]).all()
                seen.add(int(into["tick"][0]))
        reader.close()
    assert len(seen) > 100


def test_nobody_to_attach_to_is_said() -> None:
    with pytest.raises(BusError, match="no simulator writes to shared memory 'ligature-1-none'"):
        Block.attach("ligature-1-none", DTYPE, patience=0.05)


def test_another_layout_is_refused(block: Block) -> None:
    with pytest.raises(BusError, match="belongs to another scene or version"):
        Block.attach(NAME, np.dtype([("tick", "u8"), ("values", "f8", (99999,))]), patience=0.05)


def test_blocks_of_dead_runs_are_removed() -> None:
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    leftover = FOLDER / f"ligature-{dead.pid}-12345678"
    leftover.write_bytes(b"x")
    mine = FOLDER / f"ligature-{os.getpid()}-12345678"
    mine.write_bytes(b"x")
    assert leftover.name in remove_leftovers()
    assert not leftover.exists() and mine.exists()
    mine.unlink()
