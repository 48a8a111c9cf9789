"""Paths that a shell can hand over and no scene lies at: each command reports that in words."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from ligature.cli import command

COMMANDS = {
    "check": ["check", "PATH"],
    "bench": ["bench", "--seconds", "0.1", "PATH"],
    "render": ["render", "--camera", "c", "PATH"],
    "decompose": ["decompose", "PATH", "out.obj"],
    "fmt": ["fmt", "PATH"],
    "diff": ["diff", "PATH", "PATH"],
    "inertia": ["inertia", "PATH"],
    "convert": ["convert", "PATH"],
    "poses": ["poses", "PATH"],
    "replay": ["replay", "PATH"],
    "score": ["score", "reach", "PATH"],
    "teleop": ["teleop", "PATH"],
    "dataset info": ["dataset", "info", "PATH"],
    "dataset export": ["dataset", "export", "PATH", "exported"],
}


def _link(place: Path, to: str) -> str:
    place.symlink_to(to)
    return place.name


PATHS: dict[str, Callable[[Path], str]] = {
    "missing": lambda _: "none.yaml",
    "circle of links": lambda folder: _link(folder / "circle.yaml", "circle.yaml"),
    "link to nothing": lambda folder: _link(folder / "link.yaml", "none.yaml"),
    "pipe": lambda folder: os.mkfifo(folder / "pipe.yaml") or "pipe.yaml",
    "folder": lambda folder: (folder / "folder.yaml").mkdir() or "folder.yaml",
    "no UTF-8": lambda _: os.fsdecode(b"\xff\xfe.yaml"),
    "line break": lambda _: "new\nline.yaml",
    "long name": lambda _: "x" * 300 + ".yaml",
    "long path": lambda _: "y/" * 3000 + "z.yaml",
    "empty": lambda _: "",
    "device": lambda _: "/dev/null",
    "below a file": lambda folder: (folder / "file").write_text("") and "" or "file/scene.yaml",
}


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_commands_say_what_is_wrong_with_a_path(
    words: list[str], path: Callable[[Path], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    place = path(tmp_path)
    monkeypatch.setattr(sys, "argv", ["ligature", *(place if word == "PATH" else word for word in words)])
    monkeypatch.setattr(signal, "signal", lambda *_: None)  # interrupts stay the test runner's
    with pytest.raises(SystemExit) as ended:
        command.ligature()
    out, err = capfd.readouterr()
    assert ended.value.code in (1, 2), out + err
    assert (out + err).strip() and "Traceback" not in out + err and "[Errno" not in out + err


WRITERS = {
    "decompose": ["decompose", "tri.obj", "-o", "OUT"],
    "poses": ["poses", "box.yaml", "--seconds", "0.001", "--out", "OUT"],
    "convert": ["convert", "box.urdf", "-o", "OUT"],
}
OUTS: dict[str, Callable[[Path], str]] = {
    "no ending": lambda _: "written",
    "no folder": lambda _: "none/written.obj",
    "folder": lambda folder: (folder / "folder.obj").mkdir() or "folder.obj",
    "this folder": lambda _: ".",
    "below a file": lambda folder: (folder / "file").write_text("") and "" or "file/written.obj",
    "no name": lambda _: "",
    "system": lambda _: "/proc/written.obj",
    "long name": lambda _: "x" * 300 + ".obj",
    "pipe": lambda folder: os.mkfifo(folder / "pipe.obj") or "pipe.obj",
    "link to a device": lambda folder: (folder / "null.obj").symlink_to(os.devnull) or "null.obj",
}
BOX = "bodies: [A]\nA: {name: a, mass: 0, shape: BOX, geometry: {x: 1, y: 1, z: 1}}\n"
URDF = "<robot name='r'><link name='a'/></robot>"
TRI = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.mark.parametrize("out", OUTS.values(), ids=OUTS)
@pytest.mark.parametrize("words", WRITERS.values(), ids=WRITERS)
def test_commands_write_the_file_of_that_name_or_report_why_not(
    words: list[str], out: Callable[[Path], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    for name, text in {"box.yaml": BOX, "box.urdf": URDF, "tri.obj": TRI}.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    place = out(tmp_path)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.is_file()}
    monkeypatch.setattr(sys, "argv", ["ligature", *(place if word == "OUT" else word for word in words)])
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    with pytest.raises(SystemExit) as ended:
        command.ligature()
    printed = "".join(capfd.readouterr())
    assert "Traceback" not in printed and "[Errno" not in printed
    if not ended.value.code:
        assert (tmp_path / place).is_file(), printed
    else:
        assert ended.value.code in (1, 2) and printed.strip()
        assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.is_file()} == before, printed


@pytest.mark.parametrize("way", ["the same name", "another folder's name", "a link"])
@pytest.mark.parametrize("words", WRITERS.values(), ids=WRITERS)
def test_no_command_writes_over_what_it_reads(
    words: list[str], way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    folder, source = tmp_path / "folder", words[1]
    folder.mkdir()
    (folder / source).write_text({"box.yaml": BOX, "box.urdf": URDF, "tri.obj": TRI}[source])
    monkeypatch.chdir(folder)
    if way == "a link":
        (folder / "link").symlink_to(source)
    out = {"the same name": source, "another folder's name": f"../folder/{source}", "a link": "link"}[way]
    before = {path: path.read_bytes() for path in folder.iterdir()}
    monkeypatch.setattr(sys, "argv", ["ligature", *(out if word == "OUT" else word for word in words)])
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    with pytest.raises(SystemExit) as ended:
        command.ligature()
    printed = "".join(capfd.readouterr())
    assert ended.value.code == 1 and "is the file that is read; write to another name" in printed, printed
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize("scene", ["none.yaml", "x" * 300])
def test_compile_says_why_a_scene_cannot_run(scene: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "ligature", "compile", scene],
        cwd=tmp_path, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode in (1, 2) and "Traceback" not in done.stdout + done.stderr
    assert "does not exist" in done.stdout or "File name too long" in done.stderr
