"""Blender with a window under Xvfb: panels are drawn, operators are undone, pictures are taken; run by `make test-blender`."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
UNTOUCHING = {"copy_findings", "fetch_coacd"}
"""Operators that write the clipboard or a folder of the extension, and leave the scene alone."""

LIMIT = 800
"""Seconds for the session: half a minute on an idle machine, whose processor draws the windows."""

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.fixture
def display() -> Iterator[str]:
    """A screen that nobody sees."""
    binary = shutil.which("Xvfb")
    if binary is None:
        pytest.skip("Xvfb is not installed")
    read, write = os.pipe()
    server = subprocess.Popen(
        [binary, "-displayfd", str(write), "-screen", "0", "1280x800x24", "-nolisten", "tcp"], pass_fds=(write,),
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(write)
    with os.fdopen(read) as pipe:
        number = pipe.readline().strip()
    yield f":{number}"
    server.terminate()
    server.wait(timeout=10)


@pytest.fixture
def session(display: str, scripts: Path, tmp_path: Path) -> Callable[[str], tuple[dict, str]]:
    """Runs a script of `gui`: what it found, and its output; its pictures lie in ``tmp_path``."""
    return lambda script: run_session(script, display, scripts, tmp_path)


def run_session(script: str, display: str, scripts: Path, tmp_path: Path) -> tuple[dict, str]:
    binary = shutil.which("blender")
    if binary is None:
        pytest.skip("Blender is not installed")
    environment = {
        **os.environ, "DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1", "BLENDER_USER_SCRIPTS": str(scripts),
        "BLENDER_USER_CONFIG": str(tmp_path / "config"), "PYTHONDONTWRITEBYTECODE": "1",
        "BLENDER_USER_DATAFILES": str(tmp_path / "datafiles"),  # no decomposition of an earlier run is taken
        "LIGATURE_TEST_PACKAGES": sysconfig.get_paths()["purelib"],
        "LIGATURE_COMMAND": str(Path(sys.executable).parent / "ligature"),
        "PYTHONPATH": str(ROOT / "simulator"), "LIGATURE_ROOT": str(ROOT),
    }  # fmt: skip
    environment.pop("WAYLAND_DISPLAY", None)
    blank = tmp_path / "blank.blend"  # with a file to open, Blender shows no splash
    save = f"import bpy; bpy.ops.wm.save_as_mainfile(filepath={str(blank)!r})"
    subprocess.run(
        [binary, "-b", "--factory-startup", "--python-expr", save], capture_output=True, timeout=100, check=True
    )
    folders = [sysconfig.get_paths()["purelib"], str(HERE / "gui")]
    startup = f"import sys; sys.path += {folders!r}"
    command = [
        binary,
        "--factory-startup",
        "--enable-event-simulate",
        "--window-geometry",
        "0",
        "0",
        "1280",
        "800",
        str(blank),
        "--python-expr",
        startup,
    ]
    command += ["--python", str(HERE / "gui" / script), "--", str(tmp_path)]
    start = time.monotonic()
    log = tmp_path / "log"
    with log.open("w") as stream:
        process = subprocess.Popen(command, env=environment, stdout=stream, stderr=subprocess.STDOUT, cwd=tmp_path)
        try:
            process.wait(timeout=LIMIT)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
    output = f"{log.read_text(errors='replace')}\nafter {time.monotonic() - start:.0f} s, status {process.returncode}"
    report = [line for line in output.splitlines() if line.startswith("RESULT ")]
    assert report, output[-5000:]
    found = json.loads(report[-1].removeprefix("RESULT "))
    assert found["errors"] == [], "\n".join(found["errors"])
    assert "Traceback" not in output and "Error: Python" not in output, output[-5000:]
    for name in found["pictures"]:
        assert (tmp_path / f"{name}.png").stat().st_size > 20_000
        if target := os.environ.get("LIGATURE_PICTURES"):
            shutil.copy(tmp_path / f"{name}.png", Path(target) / f"{name}.png")
    return found, output


def test_panels_draw_operators_are_undone_and_nothing_is_left(session: Callable[[str], tuple[dict, str]]) -> None:
    found, _ = session("session.py")
    assert set(found["drawn"]) >= {
        "BODY",
        "JOINT",
        "SHAPE",
        "HULL",
        "INERTIAL",
        "GHOST_OBJECT",
        "CAMERA",
        "LIGHT",
        "SUTURE",
    }
    tried = {label.split()[0]: how for label, how in found["undone"].items()}
    assert {f"adf.{name}" for name in tried} == set(found["operators"])  # a new operator needs a recipe in session.py
    expected = {name: "same" if name in UNTOUCHING else "undone" for name in tried}
    wrong = {label: how for label, how in found["undone"].items() if how != expected[label.split()[0]]}
    assert wrong == {}
    assert found["left"] == []
    background, ended = found["background"], found["ended"]
    assert (background["begun"], background["most"]) == (["RUNNING_MODAL"], 1) and background["pieces"] >= 2
    assert ended == {"before": 1, "after": 0, "pieces": background["pieces"], "left": background["pieces"]}
    sliced = found["import"]
    assert sliced["begun"] == ["RUNNING_MODAL"] and sliced["as before"] and sliced["undone"]
    assert sliced["ended"] < sliced["done"]
    assert len(found["dragged"]) == 3
    for label, report in found["dragged"].items():
        assert abs(report["after"] - report["before"]) > 1e-3, label
        assert report["undone"] == pytest.approx(report["before"], abs=1e-7), label


def test_the_tutorial_drives_to_a_scene_that_moves(session: Callable[[str], tuple[dict, str]], tmp_path: Path) -> None:
    found, output = session("tutorial.py")
    assert len(found["pictures"]) == 5
    assert re.search(r"\d+ bodies and 1 thread over \d+ frames", output), output  # Simulate Here played the motion back
    scene = tmp_path / "scenes" / "blender_suturing"
    assert (scene / "pad.yaml").read_bytes() == (ROOT / "scenes" / "blender_suturing" / "pad.yaml").read_bytes()
