"""The add-on, packed as users install it, and Blender to run tests in."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from pathlib import Path

import pytest

collect_ignore = ["inside", "gui"]
ROOT = Path(__file__).resolve().parent.parent.parent
HERE = Path(__file__).resolve().parent


@pytest.fixture(scope="session")
def scripts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Blender's folder of user scripts with the packed add-on in it."""
    folder = tmp_path_factory.mktemp("scripts")
    subprocess.run([sys.executable, ROOT / "blender_addon" / "pack.py", "--stage", folder / "addons"], check=True)
    return folder


@pytest.fixture(scope="session")
def blender(scripts: Path, corpus: Path) -> Callable[..., str]:
    """Runs pytest arguments inside the Blender binary and returns the output; fails the test when they fail."""
    binary = shutil.which("blender")
    if binary is None:
        pytest.skip("Blender is not installed")

    def run(*arguments: str, limit: float = 880.0) -> str:
        environment = {
            **os.environ,
            "BLENDER_USER_SCRIPTS": str(scripts),
            "BLENDER_USER_DATAFILES": str(scripts / "datafiles"),
            "LIGATURE_TEST_PACKAGES": sysconfig.get_paths()["purelib"],
            "LIGATURE_CORPUS": str(corpus),
            "LIGATURE_ROOT": str(ROOT),
            "LIGATURE_PYTHON": sys.executable,
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        command = [
            binary,
            "-b",
            "--factory-startup",
            "--python",
            str(HERE / "run_inside.py"),
            "--",
            "-q",
            "-ra",
            *arguments,
        ]
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=limit, check=False, cwd=HERE / "inside"
        )
        output = done.stdout + done.stderr
        assert done.returncode == 0, output[-8000:]
        return output

    return run
