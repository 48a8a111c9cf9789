"""Nothing is imported from the folder that a command is started in: a scene of others may lie there beside a `yaml.py`."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
import typer
from ligature.cli.main import app
from ligature.process import program

from tests.conftest import ROOT

PACKAGE = ROOT / "simulator" / "ligature"
TRAP = "import os\nopen(os.environ['TRAPPED'], 'a').write(__name__ + ' ')\n"
ABSENT = {"antigravity", "this", "idlelib", "turtledemo"}
BOX = "bodies: [A]\nA: {name: a, mass: 1, shape: BOX, geometry: {x: 1, y: 1, z: 1}}\n"
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
COMMANDS: dict[str, tuple[str, int]] = {
    "run": ("run none.yaml", 2),
    "cockpit": ("cockpit none.yaml --at 127.0.0.1:0", 2),
    "check": ("check box.yaml", 0),
    "bench": ("bench box.yaml --seconds 0.1", 0),
    "compile": ("compile none.yaml", 1),
    "render": ("render box.yaml --camera none", 1),
    "decompose": ("decompose tri.obj -o out.obj", 0),
    "fmt": ("fmt box.yaml", 0),
    "diff": ("diff box.yaml box.yaml", 0),
    "inertia": ("inertia box.yaml", 0),
    "convert": ("convert box.yaml -o out.urdf", 0),
    "poses": ("poses box.yaml --seconds 0.01 --out out.npz", 0),
    "demo": ("demo --seed 0 --dataset none/none.h5", 2),
    "evaluate": ("evaluate expert --env reach --episodes 6 --max-steps 1 -j 2", 0),
    "record": ("record --seconds 0.1 --out none/none.bag", 2),
    "replay": ("replay none.h5", 1),
    "score": ("score none none", 2),
    "teleop": ("teleop none.yaml", 2),
    "dataset": ("dataset info none.h5", 1),
}
"""Of each command some words, and the exit status."""
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
    output([sys.executable, "-m", "json.tool", "none"], 1)
    assert trapped.read_text()


def test_a_process_that_decomposes_imports_what_is_installed(trapped: Path) -> None:
    output(program("ligature.mesh.coacd_process", "{}", str(os.getpid()), "1"), 1)
    assert not trapped.exists()


def test_every_command_is_tried() -> None:
    assert COMMANDS.keys() == typer.main.get_command(app).commands.keys()  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_imports_what_is_installed(name: str, trapped: Path) -> None:
    Path("box.yaml").write_text(BOX)
    Path("tri.obj").write_text(TETRAHEDRON)
    words, status = COMMANDS[name]
    printed = output([str(Path(sys.executable).parent / "ligature"), *words.split()], status)
    assert "Traceback" not in printed
    assert not trapped.exists(), trapped.read_text()


_FINDS = "import runpy, sys; print(*{name.partition('.')[0] for name in sys.modules})"
_OF_PYTHON_FOR_A_MODULE = subprocess.check_output([sys.executable, "-I", "-S", "-c", _FINDS], text=True).split()
"""What Python itself imports, from the working folder too, before the module of ``-m`` has a say."""


@pytest.mark.parametrize("words", [["-m", "ligature"], ["-mligature"], ["-B", "-X", "utf8", "-m", "ligature.__main__"]])
def test_the_package_as_a_command_imports_what_is_installed(words: list[str], trapped: Path) -> None:
    Path("ligature.py").unlink()  # which is what these words ask for
    for name in _OF_PYTHON_FOR_A_MODULE:
        Path(f"{name}.py").unlink(missing_ok=True)
    assert "none.yaml' does not exist" in output([sys.executable, *words, "check", "none.yaml"], 1)
    assert not trapped.exists(), trapped.read_text()


def test_a_package_of_a_user_that_is_run_keeps_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python puts it first for ``python -m mine``, and it may import Ligature before anything else."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "__init__.py").write_text("import ligature, beside")
    (tmp_path / "mine" / "__main__.py").write_text("import beside; print(beside.text)")
    (tmp_path / "beside.py").write_text("text = 'from beside'")
    monkeypatch.chdir(tmp_path)
    assert output([sys.executable, "-m", "mine", "ligature"], 0) == "from beside\n"


def test_roslaunch_starts_a_command_that_imports_what_is_installed(
    trapped: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LIGATURE_PYTHON", sys.executable)
    words = ["check", "none.yaml", "__name:=a", "__log:=b"]
    assert "none.yaml' does not exist" in output([str(ROOT / "launch" / "ligature_command"), *words], 1)
    assert not trapped.exists(), trapped.read_text()


def test_the_names_for_other_programs_are_set_by_what_is_installed(trapped: Path) -> None:
    Path("ambf_client.py").write_text(TRAP)
    printed = output(["sh", "-c", f". {ROOT}/env.sh; echo $PYTHONPATH"], 0)
    assert "client/names/ambf" in printed
    assert not trapped.exists(), trapped.read_text()


def test_environments_that_are_spawned_import_what_is_installed(trapped: Path) -> None:
    """Where this process has drawn, it cannot fork them."""
    code = (
        "import sys; del sys.path[0]; from ligature.environments import make_vec, vector\n"
        "vector._start_method = lambda options: 'spawn'\n"
        "if __name__ == '__main__':\n    envs = make_vec('reach', 2); envs.reset(seed=1); envs.close(); print('done')"
    )
    if sys.version_info < (3, 11):
        pytest.skip("Python 3.10 has no PYTHONSAFEPATH")
    assert output([sys.executable, "-c", code], 0) == "done\n"
    assert not trapped.exists(), trapped.read_text()


def test_a_demonstration_imports_what_is_installed_or_lies_beside_it(trapped: Path, tmp_path: Path) -> None:
    (tmp_path / "beside.py").write_text("text = 'from beside'")
    (tmp_path / "shown.py").write_text("import beside, yaml, signal; print(beside.text)")
    code = f"import sys; del sys.path[0]; from ligature.cli.demo import _wait; _wait([{str(tmp_path / 'shown.py')!r}])"
    assert output([sys.executable, "-c", code], 0) == "from beside\n"
    assert not trapped.exists()


def test_every_process_of_ours_is_started_in_that_way() -> None:
    """Elsewhere there are neither other commands of Python nor pools, which look into the working folder."""
    texts = {path.relative_to(PACKAGE).as_posix(): path.read_text("utf-8") for path in PACKAGE.rglob("*.py")}
    found = {name for name, text in texts.items() if "sys.executable" in text}
    assert found == STARTS.keys()
    pools = re.compile(
        r"ProcessPoolExecutor|multiprocessing\.(Pool|Process|Manager|shared_memory)\b|[\"'](spawn|forkserver)[\"']"
    )
    assert {name for name, text in texts.items() if pools.search(text)} == {
        "environments/vector.py",
        "render/context.py",
    }
