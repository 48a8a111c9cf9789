"""Teleoperation over a network of 100 ms and 2 % loss: the console here, the simulator in another network namespace."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

from tests.network import bad_network
from tests.ros.conftest import ROOT

pytestmark = [pytest.mark.ros, pytest.mark.slow, pytest.mark.timeout(600)]

TESTS = ("tip_follows_the_pen", "ten_clutches", "device_that_fails")


def test_a_console_drives_arms_over_a_bad_network_as_over_a_good_one() -> None:
    """The tests of teleoperation, in which every message between console and simulator takes that network."""
    with bad_network(0.05, 0.02) as far:
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "tests/ros/test_teleop.py", "-q", "-k", " or ".join(TESTS)],
            env=dict(os.environ, LIGATURE_TEST_FAR=str(far.pid)), capture_output=True, text=True, cwd=ROOT, timeout=500,
        )  # fmt: skip
    assert done.returncode == 0, done.stdout[-4000:]
    assert re.search(r"\b6 passed", done.stdout), done.stdout[-500:]
