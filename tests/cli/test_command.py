"""Interrupts while a command starts."""

from __future__ import annotations

import random
import signal
import subprocess
import sys

import pytest

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


def imported() -> list[str]:
    """Modules that the import system is asked for before the command does anything."""
    code = (
        "import os, signal, sys, weakref; from ligature.cli import command; asked = []; "
        "finder = type('Finder', (), {'find_spec': lambda self, name, *_: asked.append(name)})(); "
        "sys.meta_path.insert(0, finder); import ligature.cli.main; print(*sorted(set(asked) & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True)
    return done.stdout.split()


def started(where: str, caller: str) -> subprocess.CompletedProcess[str]:
    """The command, interrupted as it imports the module ``where``; whoever starts it has the signal ``heeded`` or ``ignored``."""
    words = [sys.executable, "-c", LOSING, "--help", caller, where]
    return subprocess.run(words, capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize("seed", range(6))
def test_an_interrupt_in_any_import_ends_the_command(seed: int) -> None:
    module = random.Random(seed).choice(imported())
    done = started(module, "heeded")
    assert done.returncode == -signal.SIGINT, (module, done.stdout, done.stderr)
    assert "Traceback" not in done.stderr


def test_an_interrupt_that_the_caller_ignores_is_ignored() -> None:
    done = started("typer", "ignored")
    assert done.returncode == 0 and "Usage" in done.stdout, done.stderr
