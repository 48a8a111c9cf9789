"""Commands that signals end at any moment; `python -m tests.fuzz.signals` does so at hundreds."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from ligature.process import signals_held

from tests.fuzz.signals import COMMANDS, end

WARM = sorted(command for command in COMMANDS if not command.startswith("cold"))


@pytest.mark.parametrize("command", WARM)
def test_a_command_that_signals_end_leaves_nothing_behind(command: str) -> None:
    ending = end(command, 0)
    assert not ending.faults, f"{ending}\n{ending.output}"


STUCK = """
import hashlib, os, signal, sys, threading
from ligature.cli import command

signal.signal(signal.SIGINT, signal.default_int_handler)
command.take_interrupts()
threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
print("working", flush=True)
hashlib.pbkdf2_hmac("sha256", b"", b"", 10**9)  # minutes in which Python calls no handler, as while LLVM compiles
"""


def test_an_interrupt_ends_a_command_that_compiles_for_minutes() -> None:
    done = subprocess.run([sys.executable, "-c", STUCK], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (128 + signal.SIGINT, "working\n", "")


def test_a_signal_waits_for_the_end_of_a_file(tmp_path: Path) -> None:
    code = f"""
import os, signal
from pathlib import Path
from ligature.render.files import staged

with staged(Path({str(tmp_path / "whole")!r})) as part:
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        os.kill(os.getpid(), number)
    part.write_text("all of it")
print("later")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGTERM, "", "")
    assert [path.name for path in tmp_path.iterdir()] == ["whole"]
    assert (tmp_path / "whole").read_text() == "all of it"


def test_what_took_a_signal_before_takes_it_after() -> None:
    taken: list[int] = []
    before = signal.signal(signal.SIGHUP, lambda number, frame: taken.append(number))
    try:
        with signals_held():
            signal.raise_signal(signal.SIGHUP)
            assert not taken
        assert taken == [signal.SIGHUP]
        signal.raise_signal(signal.SIGHUP)
        assert len(taken) == 2
    finally:
        signal.signal(signal.SIGHUP, before)
