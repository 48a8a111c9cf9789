"""The tests of `inside` in Blender as a Python module; ``make test-blender`` sets BLENDER_MODULE to its Python."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
INSIDE = Path(__file__).resolve().parent / "inside"


@pytest.mark.parametrize("file", sorted(p.name for p in INSIDE.glob("test_*.py")))
def test_the_add_on_holds_in_the_blender_module(scripts: Path, corpus: Path, file: str) -> None:
    python = os.environ.get("BLENDER_MODULE")
    if not python:
        pytest.skip("set BLENDER_MODULE to a Python that has bpy, or run `make test-blender`")
    environment = {
        **{name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
        "BLENDER_USER_SCRIPTS": str(scripts),
        "LIGATURE_CORPUS": str(corpus),
        "LIGATURE_ROOT": str(ROOT),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [
        str(ROOT / python),
        "-m",
        "pytest",
        "-q",
        "-ra",
        "-p",
        "no:cacheprovider",
        "--rootdir",
        str(INSIDE),
        file,
    ]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=280, check=False, cwd=INSIDE
    )
    output = done.stdout + done.stderr
    assert done.returncode == 0 and " passed" in output, output[-8000:]
