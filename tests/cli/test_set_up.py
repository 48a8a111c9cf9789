"""The set-up: no silent step, no hidden failure, Ctrl-C ends it."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.waiting import until

STEP = ROOT / ".ci" / "step.sh"


def step(folder: Path, *words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        ["sh", STEP, "doing something, about 9 s", *words],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
    )  # fmt: skip


def test_a_long_step_states_what_it_does_for_how_long_and_what_it_wrote_last(tmp_path: Path) -> None:
    output, _ = step(tmp_path, "sh", "-c", "echo unpacking; sleep 9").communicate(timeout=60)
    lines = output.splitlines()
    assert lines[0] == "doing something, about 9 s"
    assert len([line for line in lines[1:-1] if line.endswith(" s  unpacking")]) >= 2
    assert lines[-1].startswith("  done in ")


def test_a_step_that_fails_shows_the_end_of_what_it_wrote_and_its_status(tmp_path: Path) -> None:
    process = step(tmp_path, "sh", "-c", "seq 100; echo no network >&2; exit 7")
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 7
    assert "failed with status 7" in output and output.endswith("100\nno network\n") and "\n50\n" not in output


def test_ctrl_c_ends_a_step_and_its_program(tmp_path: Path) -> None:
    process = step(tmp_path, "sh", "-c", "echo $$ >pid; exec sleep 600")
    until(lambda: (tmp_path / "pid").is_file() and (tmp_path / "pid").read_text(), "the program runs")
    os.killpg(process.pid, signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode != 0
    assert not Path("/proc", (tmp_path / "pid").read_text().strip()).exists()


@pytest.mark.parametrize("script", ["bare_machine.sh", "bare_wheel.sh", "bare_image.sh"])
def test_the_try_of_a_bare_machine_states_why_it_is_left_out(script: str, tmp_path: Path) -> None:
    """Without its tools on the path, or without root."""
    (tmp_path / "bin").mkdir()
    for name in ("bash", "dirname", "id"):
        (tmp_path / "bin" / name).symlink_to(f"/usr/bin/{name}")
    done = subprocess.run(
        ["/usr/bin/bash", ROOT / ".ci" / script],
        env={"PATH": str(tmp_path / "bin")}, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0
    assert done.stdout.startswith(f"{script.removesuffix('.sh').replace('_', ' ')}: not tried: it needs ")
