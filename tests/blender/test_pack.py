"""The packed add-on: relative imports only, no Blender in the shared packages, equal bytes for equal content."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent


@pytest.fixture(scope="module")
def pack() -> ModuleType:
    spec = importlib.util.spec_from_file_location("pack", ROOT / "blender_addon" / "pack.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_packed_modules_import_each_other_relatively_and_the_rooms_know_no_blender(
    pack: ModuleType, tmp_path: Path
) -> None:
    addon = pack.stage(tmp_path, vendored=False)
    modules = list(addon.rglob("*.py"))
    assert len(modules) > 60 and not (addon / "pack.py").exists()
    for module in modules:
        text = module.read_text(encoding="utf-8")
        assert not re.search(r"^\s*(from|import) ligature\b", text, re.MULTILINE), module
        if "ligature" in module.relative_to(addon).parts:
            assert not re.search(r"^\s*(from|import) (bpy|mathutils|bmesh)\b", text, re.MULTILINE), module
            assert not re.search(r"^(from|import) (scipy|numba|trimesh)\b", text, re.MULTILINE), module


WITHOUT_POSIX = """
import importlib, os, pathlib, signal, sys, tempfile, types
import concurrent.futures.thread, numpy, subprocess, yaml
for name in ("O_NONBLOCK", "O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "getuid", "geteuid", "getgid", "fork", "mkfifo", "setsid",
             "killpg", "posix_fallocate", "pread", "pipe2", "register_at_fork", "sched_setscheduler", "nice", "WNOHANG"):
    delattr(os, name)
for name in ("SIGKILL", "SIGHUP", "SIGALRM", "SIGQUIT", "SIGXCPU", "setitimer", "pthread_sigmask"):
    delattr(signal, name)
for name in ("fcntl", "resource", "pwd", "grp", "termios", "pty"):
    sys.modules[name] = None
addon, folder = map(pathlib.Path, sys.argv[1:])
package = sys.modules[addon.name] = types.ModuleType(addon.name)
package.__path__ = [str(addon)]  # without its own module, which needs Blender
for path in sorted((addon / "ligature").rglob("*.py")):
    importlib.import_module(".".join(path.relative_to(addon.parent).with_suffix("").parts).removesuffix(".__init__"))
from adf_studio.ligature.adf import Resolver, read_any
from adf_studio.ligature.authoring.save import save_all
save_all({folder / "m.yaml": b"bodies: [A]\\nA: {name: a, mass: 0}\\n"})
print(read_any(folder / "m.yaml", Resolver.for_file(folder / "m.yaml")).kind)
"""


def test_the_packed_modules_work_without_what_windows_lacks(pack: ModuleType, tmp_path: Path) -> None:
    addon = pack.stage(tmp_path, vendored=False)
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_POSIX, addon, tmp_path], capture_output=True, text=True, cwd=tmp_path, timeout=60
    )
    assert (done.stdout, done.returncode) == ("model\n", 0), done.stderr


def test_version_branches_stand_in_one_file() -> None:
    for module in (ROOT / "blender_addon").glob("*.py"):
        if module.name != "compat.py":
            assert "bpy.app.version" not in module.read_text(encoding="utf-8"), module


def test_equal_content_gives_equal_bytes(pack: ModuleType, tmp_path: Path) -> None:
    addon = pack.stage(tmp_path, vendored=False)
    first = pack.write_zip(addon, tmp_path / "a.zip", "x/").read_bytes()
    assert pack.write_zip(addon, tmp_path / "b.zip", "x/").read_bytes() == first
