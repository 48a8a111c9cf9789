"""The example that scales out runs on a local Ray cluster of two workers, and what it finds gets better."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "scale_out.py"


@pytest.mark.slow
def test_a_search_on_two_workers_gets_better() -> None:
    pytest.importorskip("ray")
    command = [sys.executable, EXAMPLE, "--workers", "2", "--generations", "4", "--population", "16", "--steps", "40"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stderr[-3000:]
    means = [float(value) for value in re.findall(r"mean (-?[\d.]+)", done.stdout)]
    assert len(means) == 4
    assert means[-1] > means[0]
    assert "the policy found: " in done.stdout
