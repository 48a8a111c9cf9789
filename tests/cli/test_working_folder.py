"""Nothing is imported from the folder that a command is started in: a scene of others may lie there beside a `yaml.py`."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from ligature.process import program

from tests.conftest import ROOT

PACKAGE = ROOT / "simulator" / "ligature"
TRAP = "import os\nopen(os.environ['TRAPPED'], 'a').write(__name__ + ' ')\n"
ABSENT = {"antigravity", "this", "idlelib", "turtledemo"}
STARTS = {
    "process.py": "`program`",
    "cli/demo.py": "a program of its own, which gives up the folder first",
    "cli/ros_packages.py": "a message",
}
"""Modules that name the interpreter, and what for."""


@pytest.fixture
def trapped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The names of modules that were imported from the working folder, which has one of every name."""
    folder = tmp_path / "folder"
    folder.mkdir()
    ours = {"ligature", "rospy", "rosgraph", "genpy", "std_msgs", "ambf_msgs", "crtk_msgs"}
    for name in {*sys.stdlib_module_names, *packages_distributions(), *ours} - ABSENT:
        if name.isidentifier() and not name.startswith("__"):
            (folder / f"{name}.py").write_text(TRAP)
    monkeypatch.chdir(folder)
    monkeypatch.setenv("TRAPPED", str(tmp_path / "trapped"))
    return tmp_path / "trapped"


def output(words: list[str], status: int) -> str:
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, stdin=subprocess.DEVNULL)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


def test_the_trap_takes_who_imports_from_the_working_folder(trapped: Path) -> None:
    output([sys.executable, "-m", "ligature.mesh.coacd_process"], 1)
    assert trapped.read_text()


def test_a_process_that_decomposes_imports_what_is_installed(trapped: Path) -> None:
    output(program("ligature.mesh.coacd_process", "{}", str(os.getpid()), "1"), 1)
    assert not trapped.exists()


def test_a_run_imports_what_is_installed(trapped: Path) -> None:
    """All modules of its processes are imported when the scene is looked for."""
    printed = output([str(Path(sys.executable).parent / "ligature"), "cockpit", "none.yaml", "--at", "127.0.0.1:0"], 2)
    assert "none.yaml' does not exist" in printed
    assert not trapped.exists()


def test_a_demonstration_imports_what_is_installed_or_lies_beside_it(trapped: Path, tmp_path: Path) -> None:
    (tmp_path / "beside.py").write_text("text = 'from beside'")
    (tmp_path / "shown.py").write_text("import beside, yaml, signal; print(beside.text)")
    code = f"import sys; del sys.path[0]; from ligature.cli.demo import _wait; _wait([{str(tmp_path / 'shown.py')!r}])"
    assert output([sys.executable, "-c", code], 0) == "from beside\n"
    assert not trapped.exists()


def test_every_process_of_ours_is_started_in_that_way() -> None:
    texts = {path.relative_to(PACKAGE).as_posix(): path.read_text("utf-8") for path in PACKAGE.rglob("*.py")}
    found = {name for name, text in texts.items() if "sys.executable" in text}
    assert found == STARTS.keys()
