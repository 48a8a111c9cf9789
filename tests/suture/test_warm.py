"""Kernels compiled ahead serve the first start."""

from __future__ import annotations

import os
import subprocess
import sys

from ligature.kernels import cache_folder
from ligature.suture.warm import compile_kernels


def test_kernels_lie_in_the_folder_that_the_environment_names(monkeypatch, tmp_path):
    monkeypatch.setenv("LIGATURE_CACHE", str(tmp_path))
    assert cache_folder().parent == tmp_path / "kernels"


def test_a_second_process_starts_from_compiled_kernels():
    compile_kernels()
    code = (
        "from ligature.suture.warm import compile_kernels; compile_kernels();"
        "from ligature.suture.substeps import run_tick;"
        "assert sum(run_tick.stats.cache_hits.values()) == 1, run_tick.stats"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ), timeout=120)
