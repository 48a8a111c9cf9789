"""Interrupts while a command starts."""

from __future__ import annotations

import functools
import random
import signal
import subprocess
import sys

import pytest

COMMAND = ["check", "needle_pick"]
LOSING = """
import os, signal, sys, weakref

where, heeded = sys.argv.pop(), sys.argv.pop() == "heeded"
signal.signal(signal.SIGINT, signal.default_int_handler if heeded else signal.SIG_IGN)
from ligature.cli import command

class Interrupts:
    # sends SIGINT where Python passes over what its handler raises: while an object is cleaned up
    def find_spec(self, name, path=None, target=None):
        if name == where:
            class Lock:
                pass
            lock = Lock()
            watch = weakref.ref(lock, lambda _: (os.kill(os.getpid(), signal.SIGINT), sum(range(1000))))
            del lock

sys.meta_path.insert(0, Interrupts())
command.ligature()
"""


ASKING = """
import atexit, sys
from ligature.cli import command

asked = []
sys.meta_path.insert(0, type("Finder", (), {"find_spec": lambda self, name, *_: asked.append(name)})())
atexit.register(lambda: print("ASKED", *sorted(set(asked) & set(sys.modules))))
command.ligature()
"""


@functools.cache
def imported() -> list[str]:
    """Modules that the import system is asked for while the command runs."""
    words = [sys.executable, "-c", ASKING, *COMMAND]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300, check=True)
    return done.stdout.partition("ASKED ")[2].split()


def started(where: str, caller: str) -> subprocess.CompletedProcess[str]:
    """The command, interrupted as it imports the module ``where``; whoever starts it has the signal ``heeded`` or ``ignored``."""
    words = [sys.executable, "-c", LOSING, *COMMAND, caller, where]
    return subprocess.run(words, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize("seed", range(6))
def test_an_interrupt_in_any_import_ends_the_command(seed: int) -> None:
    module = random.Random(seed).choice(imported())
    done = started(module, "heeded")
    assert done.returncode == -signal.SIGINT, (module, done.stdout, done.stderr)
    assert "Traceback" not in done.stderr


def test_what_a_command_imports_late_is_among_them() -> None:
    assert {"ligature.cli.main", "ligature.model.builder"} <= set(imported())


def test_an_interrupt_that_the_caller_ignores_is_ignored() -> None:
    done = started("typer", "ignored")
    assert done.returncode == 0 and "0 errors" in done.stdout, done.stderr


AGAIN = """
import os, signal, threading
from ligature.cli import command

for _ in range(20):  # as a program does that calls commands and takes the signal back
    signal.signal(signal.SIGINT, signal.default_int_handler)
    command.take_interrupts()
print(sum(thread.name == "interrupts" for thread in threading.enumerate()), len(os.listdir("/proc/self/fd")) < 20)
"""


def test_one_thread_watches_a_process_however_many_commands_it_runs() -> None:
    done = subprocess.run([sys.executable, "-c", AGAIN], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.split() == ["1", "True"]
