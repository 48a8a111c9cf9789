"""Commands whose input, output or errors are closed, as a service starts them, or lead to a disk that is full."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from pathlib import Path

import pytest

BODY = "bodies: [B]\nB: {name: b, mass: 1, collision shape: SPHERE, collision geometry: {radius: 0.02}}\n"
COMMANDS = {
    "help": ["--help"],
    "check": ["check", "scene.yaml"],
    "bench": ["bench", "scene.yaml", "--seconds", "0.1"],
    "inertia": ["inertia", "scene.yaml"],
    "poses": ["poses", "scene.yaml", "--seconds", "0.01", "--out", "poses.npz"],
}
CLOSED = [numbers for count in (1, 2, 3) for numbers in itertools.combinations(range(3), count)]
START = "from ligature.cli import command; command.{}()"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "scene.yaml").write_text(BODY)
    return tmp_path


def started(
    words: list[str], folder: Path, redirections: str, command: str = "ligature", pass_fds: tuple[int, ...] = ()
) -> subprocess.CompletedProcess[str]:
    """The command as a shell starts it with ``redirections``."""
    return subprocess.run(
        ["bash", "-c", f'set -o pipefail; "$@" {redirections}', "bash", sys.executable, "-c", START.format(command), *words],
        cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300, pass_fds=pass_fds,
    )  # fmt: skip


@pytest.mark.parametrize("closed", [(2,), (0, 1, 2)])
def test_a_check_with_closed_streams_does_its_work(closed: tuple[int, ...], folder: Path) -> None:
    done = started(COMMANDS["check"], folder, " ".join(f"{number}>&-" for number in closed))
    assert done.returncode == 0 and "Traceback" not in done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("closed", CLOSED)
@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_every_command_with_closed_streams_does_its_work(
    words: list[str], closed: tuple[int, ...], folder: Path
) -> None:
    done = started(words, folder, " ".join(f"{number}>&-" for number in closed))
    assert done.returncode == 0 and "Traceback" not in done.stdout + done.stderr


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("words", [COMMANDS[name] for name in ("help", "check")], ids=("help", "check"))
def test_a_full_disk_is_reported_in_words(
    words: list[str], unbuffered: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)  # else what is printed is written at the end only
    assert_full(started(words, folder, "> /dev/full"))


def test_a_full_disk_is_reported_by_ambf_simulator(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONUNBUFFERED", "")
    assert_full(started(COMMANDS["help"], folder, "> /dev/full", "ambf_simulator"))


def assert_full(done: subprocess.CompletedProcess[str]) -> None:
    """Fail unless the command says that what it prints cannot be written."""
    assert done.returncode == 2
    assert done.stderr == "error: the output cannot be written: No space left on device\n"


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("command", ["ligature", "ambf_simulator"])
def test_a_reader_that_leaves_is_no_error(
    command: str, unbuffered: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    reader, pipe = os.pipe()
    os.close(reader)
    done = started(COMMANDS["help"], folder, f">&{pipe}", command, (pipe,))
    os.close(pipe)
    assert done.returncode in (0, 1) and done.stderr == ""


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252"])
@pytest.mark.parametrize(
    "words", [COMMANDS[name] for name in ("help", "check", "inertia")], ids=("help", "check", "inertia")
)
def test_a_terminal_without_unicode_gets_every_line(
    words: list[str], encoding: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "scene.yaml").write_text(BODY.replace("B", "手術é"), encoding="utf-8")
    monkeypatch.setenv("PYTHONIOENCODING", encoding)
    done = started(words, folder, "| LC_ALL=C cat -v")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr and "Error" not in done.stderr
    assert done.stdout.strip()


@pytest.mark.parametrize("words", [["check", "x.yaml"], ["fmt", "x.yaml"], ["inertia", "x.obj"], ["decompose", "x.obj"],
                                   ["convert", "x.urdf", "-o", "y.yaml"], ["diff", "x.yaml", "y.yaml"]], ids=" ".join)  # fmt: skip
def test_a_deleted_working_folder_is_reported_in_words(words: list[str], folder: Path) -> None:
    gone = folder / "gone"
    gone.mkdir()
    done = subprocess.run(
        ["bash", "-c", 'cd gone && rmdir ../gone && exec "$@"', "bash", sys.executable, "-c", START, *words],
        cwd=folder, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode in (1, 2), done.stdout + done.stderr
    assert (done.stdout + done.stderr).strip() and "Traceback" not in done.stdout + done.stderr


@pytest.mark.skipif(os.getuid() != 0, reason="only root can become a user that the system does not know")
def test_a_user_without_a_home_gets_no_folder_that_is_called_so(folder: Path) -> None:
    """ROS logs below ``~``, which is then taken as it stands; every program of a command has the variable instead."""
    folder.chmod(0o777)
    code = "import os; from ligature.cli import command; command._have_logs_of_ros(); print(os.environ['ROS_LOG_DIR'])"
    known = {name: os.environ[name] for name in ("PATH", "PYTHONPATH") if name in os.environ}
    words = ["setpriv", "--reuid=54321", "--clear-groups", sys.executable, "-c", code]
    done = subprocess.run(
        words, cwd="/", env={**known, "TMPDIR": str(folder)}, capture_output=True, text=True, timeout=60
    )
    if "ModuleNotFoundError" in done.stderr or "PermissionError" in done.stderr:
        pytest.skip("a stranger cannot read this checkout or the folder of the tests")
    assert done.returncode == 0 and Path(done.stdout.strip()).is_absolute(), done.stderr
