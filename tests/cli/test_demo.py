"""``ligature demo`` runs a program of its own: what it is given, and how a user ends it."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

STARTS = "import sys, time; print(sys.argv[1:], __name__, flush=True)\n"
BUSY = {
    "python": "while True: pass",
    "asleep": "time.sleep(100)",
    "importing": "import importlib\nwhile True: importlib.reload(importlib.import_module('json'))",
    "compiled": "import numpy as np\nwhile True: np.linalg.svd(np.ones((300, 300)))",
}


def started(folder: Path, work: str) -> subprocess.Popen[str]:
    """A program that the command runs, once it is at work."""
    program = folder / "program.py"
    program.write_text(STARTS + work)
    command = f"from ligature.cli.demo import _wait; import sys; sys.exit(_wait([{str(program)!r}, '--seed', '3']))"
    pipe = subprocess.PIPE
    run = subprocess.Popen([sys.executable, "-c", command], stdout=pipe, stderr=pipe, text=True)
    assert run.stdout is not None
    assert run.stdout.readline() == "['--seed', '3'] __main__\n"
    return run


@pytest.mark.parametrize("work", BUSY)
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_demonstration_ends_by_a_signal_without_a_word(tmp_path: Path, work: str, number: int, status: int) -> None:
    run = started(tmp_path, BUSY[work])
    time.sleep(0.3)
    run.send_signal(number)
    out, errors = run.communicate(timeout=20)
    assert (run.returncode, out, errors) == (status, "", "")


def test_a_demonstration_that_fails_keeps_its_status_and_reason(tmp_path: Path) -> None:
    run = started(tmp_path, "sys.exit('the needle is lost')")
    _, errors = run.communicate(timeout=20)
    assert (run.returncode, errors) == (1, "the needle is lost\n")
