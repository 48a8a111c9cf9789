"""Hands suture through ROS only, and the figures of the mapping are within their bounds."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.ros.conftest import ROOT


@pytest.mark.slow
@pytest.mark.ros
@pytest.mark.timeout(1200)
def test_devices_drive_a_needle_through_tissue_and_fail_safely() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.bench.teleop_suture"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
