"""Files that vanish or become something else between two looks at them, and folders that cannot be written."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ligature.cli import command

from tests.cli.test_odd_paths import BOX, TRI, URDF, WRITERS

READERS = {
    "check": (["check", "FILE"], "scene.yaml"),
    "check, a mesh": (["check", "scene.yaml"], "tri.obj"),
    "bench": (["bench", "--seconds", "0.01", "FILE"], "scene.yaml"),
    "bench, a mesh": (["bench", "--seconds", "0.01", "scene.yaml"], "tri.obj"),
    "fmt": (["fmt", "--lossy", "FILE"], "scene.yaml"),
    "diff": (["diff", "box.yaml", "FILE"], "scene.yaml"),
    "inertia": (["inertia", "FILE"], "tri.obj"),
    "decompose": (["decompose", "FILE"], "tri.obj"),
    "convert": (["convert", "FILE", "-o", "out.yaml"], "box.urdf"),
    "poses": (["poses", "FILE", "--seconds", "0.001", "--out", "out.npz"], "scene.yaml"),
    "replay": (["replay", "FILE"], "run.record"),
    "score": (["score", "suture", "FILE"], "run.record"),
    "teleop": (["teleop", "FILE"], "teleop.yaml"),
    "dataset info": (["dataset", "info", "FILE"], "data.h5"),
    "dataset export": (["dataset", "export", "FILE", "exported"], "data.h5"),
}
FILES = {
    "scene.yaml": "bodies: [A]\nA: {name: a, mass: 1, mesh: tri.obj, collision mesh type: CONVEX_HULL}\n",
    "box.yaml": BOX,
    "box.urdf": URDF,
    "tri.obj": TRI,
    "run.record": '{"format": "ligature record 1", "options": "", "begin": ""}\n',
    "teleop.yaml": "camera: ECM\n",
    "data.h5": "\x89HDF\r\n\x1a\n",
}


def _folder(file: Path) -> None:
    file.unlink()
    file.mkdir()


def _pipe(file: Path) -> None:
    file.unlink()
    os.mkfifo(file)


def _link(file: Path) -> None:
    file.unlink()
    file.symlink_to(file.name)


class Hangs(BaseException):
    """A command waits for ever; no command may catch it."""


CHANGES: dict[str, Callable[[Path], Any]] = {
    "gone": Path.unlink,
    "a folder": _folder,
    "a pipe": _pipe,
    "a circle of links": _link,
    "empty": lambda file: file.write_bytes(b""),
    "cut": lambda file: file.write_bytes(file.read_bytes()[:20]),
    "bytes": lambda file: file.write_bytes(random.Random(1).randbytes(500)),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
@pytest.mark.parametrize(("words", "name"), READERS.values(), ids=READERS)
def test_a_file_that_changes_after_a_look_at_it_is_reported_or_read(
    words: list[str], name: str, change: Callable[[Path], Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    for one, text in FILES.items():
        (tmp_path / one).write_text(text, encoding="latin-1")
    monkeypatch.chdir(tmp_path)
    file, look, looks = tmp_path / name, os.stat, [0]
    last = random.Random(f"{words}{change}").randint(1, 3)

    def stat(path: Any, *arguments: Any, **options: Any) -> os.stat_result:
        found = look(path, *arguments, **options)
        if isinstance(path, str | os.PathLike) and os.path.join(tmp_path, os.fspath(path)) == str(file):
            looks[0] += 1
            if looks[0] == last:
                change(file)
        return found

    def hangs(*_: object) -> None:
        raise Hangs

    monkeypatch.setattr(sys, "argv", ["ligature", *(name if word == "FILE" else word for word in words)])
    handler = signal.signal(signal.SIGALRM, hangs)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr(os, "stat", stat)
    signal.alarm(20)
    try:
        with pytest.raises(SystemExit) as ended:
            command.ligature()
    finally:
        signal.alarm(0)
        monkeypatch.undo()
        signal.signal(signal.SIGALRM, handler)
    printed = "".join(capfd.readouterr())
    assert "Traceback" not in printed and "[Errno" not in printed
    assert ended.value.code in (0, 1, 2, None) and (not ended.value.code or printed.strip()), printed


@pytest.mark.parametrize("words", WRITERS.values(), ids=WRITERS)
def test_a_disk_that_is_full_amid_a_file_is_reported_with_its_name(words: list[str], tmp_path: Path) -> None:
    for one, text in FILES.items():
        (tmp_path / one).write_text(text, encoding="latin-1")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    run = (
        "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (10, 10)); "
        "from ligature.cli import command; command.ligature()"
    )
    done = subprocess.run(
        [sys.executable, "-c", run, *("written.obj" if word == "OUT" else word for word in words)],
        cwd=tmp_path, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    printed = done.stdout + done.stderr
    assert done.returncode in (1, 2) and "File too large" in printed, printed
    assert "written." in printed.replace("\n", "") and "Traceback" not in printed and "[Errno" not in printed
    left = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert {path: left.pop(path) for path in before} == before
    assert not left, left


def test_a_film_that_has_no_folder_ends_before_it_is_made(tmp_path: Path) -> None:
    from examples.suture import Film

    (tmp_path / "file").touch()
    with pytest.raises(SystemExit, match="Not a directory"):
        Film(None, tmp_path / "file" / "film")  # type: ignore[arg-type]
