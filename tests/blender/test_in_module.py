"""The tests of `inside` in Blender as a Python module; ``make test-blender`` names its Pythons in BLENDER_MODULES."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
INSIDE = Path(__file__).resolve().parent / "inside"
PYTHONS = os.environ.get("BLENDER_MODULES", "").split()


pytestmark = pytest.mark.timeout(900)


def named(python: str) -> str:
    """The folder of the module's environment, such as bpy-5.0.1, in the names of tests."""
    return Path(python).parent.parent.name


@pytest.fixture(params=PYTHONS or [""], ids=named)
def python(request: pytest.FixtureRequest) -> str:
    """A Python that has Blender as a module."""
    if not request.param:
        pytest.skip("name Pythons that have bpy in BLENDER_MODULES, or run `make test-blender`")
    path = ROOT / request.param
    if not path.is_file() or subprocess.run([path, "-c", "import bpy"], capture_output=True, check=False).returncode:
        pytest.skip(f"{request.param} has no bpy: its wheel could not be had when `make test-blender` fetched it")
    return str(path)


@pytest.mark.parametrize("file", sorted(p.name for p in INSIDE.glob("test_*.py")))
def test_the_add_on_holds_in_the_blender_module(python: str, scripts: Path, corpus: Path, file: str) -> None:
    environment = {
        **{name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
        "BLENDER_USER_SCRIPTS": str(scripts),
        "LIGATURE_CORPUS": str(corpus),
        "LIGATURE_ROOT": str(ROOT),
        "LIGATURE_PYTHON": sys.executable,
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    words = ["-q", "-ra", "-p", "no:cacheprovider", "-c", os.devnull, "--rootdir", str(INSIDE)]
    command = [python, "-m", "pytest", *words, "--confcutdir", str(INSIDE), file]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=880, check=False, cwd=INSIDE
    )
    output = done.stdout + done.stderr
    assert done.returncode == 0 and " passed" in output, output[-8000:]
