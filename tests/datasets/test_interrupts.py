"""Interrupts of programs that record."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

LOSING = """
import os, signal, sys, weakref

class Held:
    pass

def lose(_):
    os.kill(os.getpid(), signal.{name})
    sum(range(1000))
"""
LOST = """
from ligature.datasets.interrupts import interrupted_once

ended = []
try:
    with interrupted_once():
        held = Held()
        watch = weakref.ref(held, lose)
        try:
            del held
            while True:
                pass
        finally:
            for name in ("SIGTERM", "SIGINT", "SIGHUP"):
                os.kill(os.getpid(), getattr(signal, name))
            for _ in range(3 * 10**6):
                pass
            ended.append("cleaned up")
except KeyboardInterrupt as interrupt:
    print(*ended, *interrupt.args)
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_an_interrupt_that_is_lost_comes_again_and_never_into_the_clean_up(name: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", (LOSING + LOST).replace("{name}", name)], capture_output=True, text=True, timeout=60
    )
    assert done.stdout == f"cleaned up {int(getattr(signal, name))}\n", done.stderr
    assert done.returncode == 0


WRITING = """
from ligature.datasets import interrupts
from ligature.process import signals_held

interrupts._LATER = 30.0  # its alarm is sent below
held = Held()
watch = weakref.ref(held, lose)
try:
    with interrupts.interrupted_once():
        if {before}:
            del held
        with signals_held():
            if {before}:
                signal.raise_signal(signal.SIGALRM)
            else:
                del held
            print("whole")
        print("not interrupted")
except KeyboardInterrupt as interrupt:
    print(*interrupt.args)
"""


@pytest.mark.parametrize("before", [True, False], ids=["lost before", "while writing"])
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_an_interrupt_waits_for_what_is_being_written(name: str, before: bool) -> None:
    code = (LOSING + WRITING).replace("{name}", name).replace("{before}", str(before))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == f"whole\n{int(getattr(signal, name))}\n", done.stderr
    assert done.returncode == 0
