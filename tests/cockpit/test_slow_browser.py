"""A browser that answers late, or not for seconds: what its operator has begun by a button is done all the same."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import numpy as np
import pytest
from ligature.cockpit.deadman import ALONE, GONE
from ligature.process import end_with_parent

from tests.cockpit.conftest import ROOT, Served, tip, until
from tests.waiting import steady

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

ARM = "PSM2"
SILENT, AWAKE = 0.8, 0.2
"""Seconds for which the browser is stopped, and for which it goes on between."""


@pytest.fixture
def tissue() -> Iterator[Served]:
    running = Served(scene=ROOT / "scenes" / "needle_insertion" / "launch.yaml")
    yield running
    running.end()


@pytest.fixture
def newcomer(tissue: Served) -> Iterator[subprocess.Popen[str]]:
    """Somebody who presses what is offered, in a process that can be stopped."""
    found = subprocess.Popen(
        [sys.executable, "-m", "tests.cockpit.wired", tissue.url], stdout=subprocess.PIPE, text=True, cwd=ROOT,
        preexec_fn=end_with_parent,
    )  # fmt: skip
    yield found
    found.send_signal(signal.SIGCONT)
    found.kill()
    found.wait()


def moves(served: Served) -> None:
    begin = tip(served, ARM)
    until(lambda: np.linalg.norm((tip(served, ARM) - begin)[:3, 3]) > 0.005, "the arm moves")


def test_a_browser_that_is_always_late_drives_a_needle_through_tissue(
    tissue: Served, newcomer: subprocess.Popen[str]
) -> None:
    assert SILENT > GONE, "what a hand steers would be given up"
    deadline = time.monotonic() + 600.0
    while newcomer.poll() is None and time.monotonic() < deadline:
        newcomer.send_signal(signal.SIGSTOP)
        time.sleep(SILENT)
        newcomer.send_signal(signal.SIGCONT)
        time.sleep(AWAKE)
    assert newcomer.wait(1.0) == 0
    assert int(tissue.state["puncture_count"][0]) == 2


def test_an_arm_stands_while_its_browser_is_frozen_and_goes_on_after(
    tissue: Served, newcomer: subprocess.Popen[str]
) -> None:
    until(lambda: tissue.arm(ARM)["homed"] and not tissue.arm(ARM)["busy"], "instruments are ready")
    moves(tissue)
    begin = time.monotonic()
    os.kill(newcomer.pid, signal.SIGSTOP)
    stood = steady(lambda: tip(tissue, ARM).copy(), 2.0, 1e-6, "the arm stands")
    assert time.monotonic() - begin < ALONE + 2.0 + 3.0
    time.sleep(1.0)
    assert np.abs(tip(tissue, ARM) - stood).max() < 1e-6
    os.kill(newcomer.pid, signal.SIGCONT)
    assert newcomer.wait(600.0) == 0
    assert int(tissue.state["puncture_count"][0]) == 2
