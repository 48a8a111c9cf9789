"""Fetching Blender as a Python module: what is unavailable is reported in one line, in bounded time, and is no failure."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent


def fetch(folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs the script for a release as it is without network: the index is a missing folder."""
    index = {
        "PIP_INDEX_URL": "file:///nowhere/simple",
        "PIP_EXTRA_INDEX_URL": "",
        "PIP_FIND_LINKS": "",
        "PIP_CONFIG_FILE": os.devnull,
    }
    command = ["sh", str(ROOT / ".ci" / "fetch_blender_module.sh"), "5.0.1", str(folder), "40"]
    return subprocess.run(
        command, env={**os.environ, **index, **environment}, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )  # fmt: skip


@pytest.mark.skipif(not Path("/usr/bin/python3").exists(), reason="the system has no Python of its own")
def test_without_an_index_the_reason_is_reported_and_the_tests_are_skipped_with_it(tmp_path: Path) -> None:
    done = fetch(tmp_path / "bpy-5.0.1")
    assert done.returncode == 0, done.stderr
    why = (tmp_path / "bpy-5.0.1.why").read_text().strip()
    assert why.startswith("bpy 5.0.1 ") and f"{why}: its tests are skipped" in done.stderr
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-rs",
        "-p",
        "no:cacheprovider",
        str(ROOT / "tests" / "blender" / "test_in_module.py"),
    ]
    skipped = subprocess.run(
        command, env={**os.environ, "BLENDER_MODULES": str(tmp_path / "bpy-5.0.1" / "bin" / "python")}, cwd=ROOT, capture_output=True,
        text=True, timeout=120, check=False,
    )  # fmt: skip
    assert skipped.returncode == 0 and why in skipped.stdout, skipped.stdout


def test_what_is_there_is_kept(tmp_path: Path) -> None:
    python = tmp_path / "bpy-5.0.1" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.symlink_to(shutil.which("true") or "/bin/true")  # as a Python that imports all that is asked of it
    done = fetch(tmp_path / "bpy-5.0.1")
    assert done.returncode == 0 and "fetching" not in done.stdout
    assert python.is_symlink()
