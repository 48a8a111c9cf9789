"""Kernels: all their sources decide which machine code is taken, and it is kept where the user can write."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from ligature import kernel_cache

PACKAGE = Path(kernel_cache.__file__).parent
PROGRAM = """
import logging, sys
from pathlib import Path
from ligature import kernel_cache, kernels
@kernels.compiled
def twice(x):
    return 2 * x
print(twice(21), kernel_cache.kernel_folder(Path(__file__), __name__), sum(twice.stats.cache_hits.values()))
"""
DECORATORS = ("compiled", "kernel", "inlined", "intrinsic", "unrolled")


def read_by_kernels(source: Path) -> set[Path]:
    """The modules of the package from which the kernels of ``source`` take functions and constants."""
    tree = ast.parse(source.read_text())
    read = {
        name.id
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef)
        and any(isinstance(d, ast.Name) and d.id in DECORATORS for d in function.decorator_list)
        for part in function.body
        for name in ast.walk(part)
        if isinstance(name, ast.Name)
    }
    return {
        PACKAGE.joinpath(*node.module.split(".")[1:]).with_suffix(".py")
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("ligature.")
        if read & {alias.asname or alias.name for alias in node.names}
    }


def test_no_kernel_is_compiled_but_by_the_decorators_of_all_rooms() -> None:
    """Numba's own would keep code below the sources, and take no notice of a callee that changed."""
    for path in PACKAGE.rglob("*.py"):
        if path.name != "kernels.py":
            assert "njit" not in path.read_text(), path


@pytest.mark.parametrize("source", sorted(kernel_cache.sources()), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_all_files_that_kernels_read_decide_which_code_is_taken(source: Path) -> None:
    missing = read_by_kernels(source) - kernel_cache.sources_of(source)
    assert not missing, missing


COLLECTED = """
import gc, sys
from pathlib import Path
from numba.core import event
from ligature import kernels
seen = []
class Watch(event.Listener):
    def on_start(self, event):
        seen.append(gc.get_threshold())
    def on_end(self, event):
        seen.append(gc.get_threshold())
event.register("numba:compile", Watch())
@kernels.compiled
def twice(x):
    return 2 * x
@kernels.compiled
def bad(x):
    return x.nothing
gc.set_threshold({first}, 7, 9)
twice(21)
try:
    bad(1)
except Exception:
    pass
print(seen[0] == ({during}, 7, 9), gc.get_threshold() == ({first}, 7, 9))
"""


@pytest.mark.parametrize(("usual", "during"), [(500, 20_000), (50_000, 50_000), (0, 0)])
def test_unreachable_objects_are_looked_for_less_often_while_numba_compiles(
    tmp_path: Path, usual: int, during: int
) -> None:
    """And as often as before afterwards, whether the compilation succeeded or not."""
    program = tmp_path / "collected.py"
    program.write_text(COLLECTED.format(first=usual, during=during))
    done = run(f"import runpy; runpy.run_path({str(program)!r})", LIGATURE_CACHE=str(tmp_path / "cache"))
    assert done.stdout == "True True\n", done.stdout + done.stderr


LINKED = """
from ligature import kernels
@kernels.kernel
def twice(x):
    return 2 * x
@kernels.kernel
def thrice(x):
    return twice(x) + x
def hits(kernel):
    return sum(kernel.stats.cache_hits.values())
"""


def run(program: str, **environment: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, **environment}
    return subprocess.run([sys.executable, "-c", program], env=env, capture_output=True, text=True, timeout=120)


def test_an_edit_compiles_what_depends_on_it_and_nothing_else(tmp_path: Path) -> None:
    """In a copy of the package: its place and its times decide nothing."""
    copy = tmp_path / "copy" / "ligature"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    edited = copy / "suture" / "layout.py"

    def folders() -> dict[Path, str]:
        text = (
            "from pathlib import Path; from ligature.kernel_cache import *; [print(path.relative_to(Path(sys.argv[1]))"
        )
        text = f"import sys; sys.argv[1:] = [{str(copy)!r}]; {text}, kernel_folder(path, path.stem)) for path in sources()]"
        done = run(text, PYTHONPATH=str(copy.parent), LIGATURE_CACHE=str(tmp_path / "cache"))
        return {PACKAGE / name: folder for name, folder in (line.split() for line in done.stdout.splitlines())}

    before = folders()
    assert set(before) == kernel_cache.sources()
    os.utime(copy / "suture" / "chain.py", (0, 0))
    assert folders() == before
    edited.write_text(edited.read_text() + "LIMIT = 1\n")
    changed = {path for path, folder in folders().items() if folder != before[path]}
    layout = PACKAGE / "suture" / "layout.py"
    assert changed == {path for path in before if layout in kernel_cache.sources_of(path)}
    assert PACKAGE / "suture" / "step.py" in changed and PACKAGE / "tissue" / "dense.py" not in changed


def test_code_is_shared_by_copies_of_a_file(tmp_path: Path) -> None:
    environment = {"LIGATURE_CACHE": str(tmp_path / "cache")}
    for copy, hits in (("one", "0"), ("two", "1")):
        (tmp_path / copy).mkdir()
        (tmp_path / copy / "doubling.py").write_text(PROGRAM)
        path = os.pathsep.join([str(tmp_path / copy), str(PACKAGE.parent)])
        done = run("import doubling", PYTHONPATH=path, **environment)
        assert done.stdout.split()[0::2] == ["42", hits], done.stderr


TOGETHER = """
from ligature import kernels
@kernels.kernel
def inner(x):
    for _ in range(3):
        x = x * x + 1.0
    return x
@kernels.kernel
def outer(x):
    return inner(x) + inner(2.0 * x)
"""


def test_processes_that_need_a_kernel_at_once_compile_it_once(tmp_path: Path) -> None:
    (tmp_path / "together.py").write_text(TOGETHER)
    text = (
        "from together import *; outer(1.0); print(*(sum(k.stats.cache_misses.values()) for k in (inner.part, outer)))"
    )
    path = os.pathsep.join([str(tmp_path), str(PACKAGE.parent)])
    environment = {**os.environ, "PYTHONPATH": path, "LIGATURE_CACHE": str(tmp_path / "cache")}
    running = [
        subprocess.Popen([sys.executable, "-c", text], env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(4)
    ]
    counts = [[int(word) for word in process.communicate(timeout=240)[0].split()] for process in running]
    assert [process.returncode for process in running] == [0] * 4
    assert sum(outer for _, outer in counts) == sum(inner for inner, _ in counts) == 1, counts
    assert not list((tmp_path / "cache").rglob("*.lock"))


@pytest.fixture
def program(tmp_path: Path) -> str:
    """Defines a kernel in a file: Numba keeps no code of what has no source."""
    (tmp_path / "doubling.py").write_text(PROGRAM)
    return f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import doubling"


def test_a_kernel_that_is_new_links_with_one_that_was_kept(tmp_path: Path) -> None:
    """Of a kernel that Python called before, there is no code to link with."""
    (tmp_path / "linked.py").write_text(LINKED)
    environment = {"PYTHONPATH": str(tmp_path), "LIGATURE_CACHE": str(tmp_path / "cache")}
    first = run("from linked import *; print(twice(2.0))", **environment)
    second = run("from linked import *; print(twice(2.0), hits(twice), thrice(2.0), hits(thrice))", **environment)
    third = run("from linked import *; print(thrice(2.0), hits(thrice))", **environment)
    assert [done.stdout.strip() for done in (first, second, third)] == ["4.0", "4.0 1 6.0 0", "6.0 1"], second.stderr


MULTIPLYING = """
import sys
import numpy as np
from ligature import kernels
@kernels.compiled
def total(a):
    return a.sum()
@kernels.compiled
def square(a):
    return a @ a
@kernels.compiled
def solved(a, b):
    return np.linalg.solve(a, b)
def loaded():
    return "scipy.linalg" in sys.modules
"""


@pytest.mark.parametrize("call", ["square(a)[0, 1]", "solved(a, a)[1, 1]"])
def test_linear_algebra_is_imported_by_kernels_that_use_it_alone(call: str, tmp_path: Path) -> None:
    (tmp_path / "multiplying.py").write_text(MULTIPLYING)
    path = os.pathsep.join([str(tmp_path), str(PACKAGE.parent)])
    environment = {"PYTHONPATH": path, "LIGATURE_CACHE": str(tmp_path / "cache")}
    text = f"from multiplying import *; a = np.eye(3) + 1.0; print(total(a), loaded(), round({call}, 9), loaded())"
    compiled, kept = run(text, **environment), run(text, **environment)
    value = "5.0" if call.startswith("square") else "1.0"
    assert compiled.stdout.strip() == kept.stdout.strip() == f"12.0 False {value} True", compiled.stderr + kept.stderr


@pytest.mark.parametrize("variable", ["LIGATURE_CACHE", "XDG_CACHE_HOME", "HOME"])
def test_who_can_write_nowhere_gets_a_private_folder_and_one_line(program: str, tmp_path: Path, variable: str) -> None:
    (tmp_path / "file").write_text("")
    wishes = {"LIGATURE_CACHE": "", "XDG_CACHE_HOME": "", variable: str(tmp_path / "file" / "below")}
    (tmp_path / "temporary").mkdir()
    done = run(program, **wishes, TMPDIR=str(tmp_path / "temporary"))
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "temporary" / f"ligature-{os.getuid()}"
    assert done.stdout.startswith(f"42 {folder}/kernels/")
    warnings = [line for line in done.stderr.splitlines() if not line.startswith("compiling for this machine")]
    assert len(warnings) == 1  # a busy machine compiles for a second, and reports it
    assert f"cannot be written (Not a directory): {folder} is used; set LIGATURE_CACHE" in done.stderr
    assert folder.stat().st_mode & 0o777 == 0o700 and list(folder.rglob("*.nbc"))
    again = run(program, **wishes, TMPDIR=str(tmp_path / "temporary"))
    assert done.stdout.split()[2] == "0" and again.stdout.split() == [*done.stdout.split()[:2], "1"]


def test_a_temporary_folder_that_others_can_write_is_not_taken(program: str, tmp_path: Path) -> None:
    """What lies in a cache runs as code."""
    (tmp_path / "file").write_text("")
    (tmp_path / f"ligature-{os.getuid()}").mkdir()
    (tmp_path / f"ligature-{os.getuid()}").chmod(0o777)
    done = run(program, LIGATURE_CACHE=str(tmp_path / "file" / "below"), TMPDIR=str(tmp_path))
    assert done.returncode == 0 and f"{tmp_path}/ligature-{os.getuid()} is used" not in done.stderr
    assert list((tmp_path / f"ligature-{os.getuid()}").iterdir()) == []
    assert [path.name for path in tmp_path.glob("ligature-*")] == [f"ligature-{os.getuid()}"]


def test_code_of_versions_that_nobody_starts_any_more_goes(program: str, tmp_path: Path) -> None:
    folder = tmp_path / "cache" / "kernels"
    for name, days in (("0123456789abcdef", 31), ("fedcba9876543210", 29), ("my notes", 400)):
        (folder / name).mkdir(parents=True)
        (folder / name / "code.nbc").write_text("")
        os.utime(folder / name, (time.time() - days * 86400,) * 2)
    done = run(program, LIGATURE_CACHE=str(tmp_path / "cache"))
    mine = Path(done.stdout.split()[1])
    left = {path.name for path in folder.iterdir()}
    assert left >= {mine.name, "fedcba9876543210", "my notes"} and "0123456789abcdef" not in left
    for name in left:
        os.utime(folder / name, (0, 0))
    assert run(program, LIGATURE_CACHE=str(tmp_path / "cache")).stdout.split()[2] == "1"
    assert time.time() - mine.stat().st_mtime < 600
    (tmp_path / "tripling.py").write_text(PROGRAM.replace("2 * x", "x + x"))
    run(program.replace("doubling", "tripling"), LIGATURE_CACHE=str(tmp_path / "cache"))
    assert {path.name for path in folder.iterdir()} > left - {"fedcba9876543210"}
    assert "fedcba9876543210" not in {path.name for path in folder.iterdir()}


DAMAGED = """
import importlib, os, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import doubling
from ligature import kernel_cache
folder = kernel_cache.kernel_folder(Path(doubling.__file__), "doubling")
for ending in ("nbi", "nbc"):
    for damage in (lambda data: b"", lambda data: data[: len(data) // 2], lambda data: bytes(len(data)), None):
        for path in folder.glob("*." + ending):
            data = path.read_bytes()
            path.unlink()
            path.mkdir() if damage is None else path.write_bytes(damage(data))
        importlib.reload(doubling)
    importlib.reload(doubling)
"""


def test_files_that_a_power_failure_left_are_compiled_again(tmp_path: Path) -> None:
    """Empty, cut, of zeros, or nothing that can be read or removed: another user's."""
    (tmp_path / "doubling.py").write_text(PROGRAM)
    environment = {**os.environ, "LIGATURE_CACHE": str(tmp_path / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", DAMAGED, str(tmp_path)], env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert [line.split()[0] for line in done.stdout.splitlines()] == ["42"] * 11
    assert "cannot be read and is compiled again" in done.stderr


def test_a_disk_that_becomes_full_costs_the_cache_and_not_the_run(program: str, tmp_path: Path) -> None:
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)); "
    done = run("import ligature.kernels; " + limit + program, LIGATURE_CACHE=str(tmp_path / "cache"))
    assert done.returncode == 0 and done.stdout.startswith("42 "), done.stderr
    assert "kernels cannot be kept and will be compiled again at the next start" in done.stderr


@pytest.mark.slow  # `.ci/bare_machine.sh` does the same
@pytest.mark.timeout(900)
@pytest.mark.skipif(os.getuid() != 0, reason="only root can become somebody else")
def test_somebody_who_owns_nothing_can_simulate() -> None:
    words = ["setpriv", "--reuid=65534", "--clear-groups", sys.executable]
    if subprocess.run([*words, "-c", "import ligature"], capture_output=True, check=False).returncode:
        pytest.skip("nobody cannot read this checkout")
    with TemporaryDirectory() as place:
        scene, temporary, home = (Path(place, name) for name in ("ball.yaml", "temporary", "home"))
        home.mkdir(mode=0o700)
        scene.write_text(
            "bodies: [BODY a]\nBODY a: {name: a, mass: 1, collision shape: SPHERE, collision geometry: {radius: 0.1}}\n"
        )
        temporary.mkdir()
        temporary.chmod(0o777)
        Path(place).chmod(0o755)
        env = {**os.environ, "LIGATURE_CACHE": "", "XDG_CACHE_HOME": "", "HOME": str(home), "TMPDIR": str(temporary)}
        done = subprocess.run(
            [*words, "-m", "ligature", "bench", str(scene), "--seconds", "0.1"],
            env=env, capture_output=True, text=True, timeout=800, cwd="/",
        )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{home}/.cache/ligature cannot be written (Permission denied)" in done.stderr
