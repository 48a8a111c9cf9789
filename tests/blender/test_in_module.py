"""The tests of `inside` in Blender as a Python module, whose Pythons BLENDER_MODULES names.

``make test`` names the newest Blender, ``make test-blender`` all that are supported.
"""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from tests.blender.test_in_blender import LONG

ROOT = Path(__file__).resolve().parent.parent.parent
INSIDE = Path(__file__).resolve().parent / "inside"
PYTHONS = os.environ.get("BLENDER_MODULES", "").split()


pytestmark = pytest.mark.timeout(900)


def named(python: str) -> str:
    """The folder of the module's environment, such as bpy-5.0.1, in the names of tests."""
    return Path(python).parent.parent.name


@cache
def missing(path: Path) -> str:
    """Why a Python has no Blender; empty when it has one."""
    if path.is_file() and not subprocess.run([path, "-c", "import bpy"], capture_output=True, check=False).returncode:
        return ""
    why = path.parent.parent.with_name(f"{path.parent.parent.name}.why")
    return why.read_text().strip() if why.is_file() else f"{path} has no bpy"


@pytest.fixture(params=PYTHONS or [""], ids=named)
def python(request: pytest.FixtureRequest) -> str:
    """A Python that has Blender as a module."""
    if not request.param:
        pytest.skip("name Pythons that have bpy in BLENDER_MODULES, or run `make test-blender`")
    if reason := missing(ROOT / request.param):
        pytest.skip(reason)
    return str(ROOT / request.param)


HERE_TOO = ("test_operators.py", "test_from_empty.py")
"""What also runs in the binary of Debian, and uses most of Blender's interface, of which versions differ."""


def test_the_add_on_holds_in_the_blender_module(python: str, scripts: Path, corpus: Path) -> None:
    run_inside(python, scripts, corpus, *LONG, *HERE_TOO)


@pytest.mark.slow
def test_the_rest_holds_in_the_blender_module_too(python: str, scripts: Path, corpus: Path) -> None:
    run_inside(python, scripts, corpus, ".", *(f"--ignore={file}" for file in (*LONG, *HERE_TOO)))


def run_inside(python: str, scripts: Path, corpus: Path, *files: str) -> None:
    """Run tests of `inside`, files or options of pytest, in the Blender module of ``python``; they must pass."""
    environment = {
        **{name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
        "BLENDER_USER_SCRIPTS": str(scripts),
        "BLENDER_USER_DATAFILES": str(scripts / "datafiles"),
        "LIGATURE_CORPUS": str(corpus),
        "LIGATURE_ROOT": str(ROOT),
        "LIGATURE_PYTHON": sys.executable,
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    words = ["-q", "-ra", "-p", "no:cacheprovider", "-c", os.devnull, "--rootdir", str(INSIDE)]
    command = [python, "-m", "pytest", *words, "--confcutdir", str(INSIDE), *files]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=880, check=False, cwd=INSIDE
    )
    output = done.stdout + done.stderr
    assert done.returncode == 0 and " passed" in output, output[-8000:]
