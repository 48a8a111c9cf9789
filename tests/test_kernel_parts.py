"""Kernels contain each other as LLVM code: the same results, compiled or loaded, and nothing made that nobody calls."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from ligature import kernels

PACKAGE = Path(kernels.__file__).parent
INNER = """
from ligature import kernels
@kernels.inlined
def half(x):
    return 0.5 * x
@kernels.kernel
def root(x):
    y = x
    for _ in range(30):
        y = half(y + x / y)
    return y
@kernels.compiled
def checked(x):
    if x < 0.0:
        raise ValueError("negative", x)
    print("root of", x)
    return root(x)
"""
OUTER = """
from inner import checked, half, root
from ligature import kernels
@kernels.compiled
def both(x, y):
    return checked(x) + checked(y)
def made(*kernels):
    return [len(kernel.overloads) for kernel in kernels]
def loaded(*kernels):
    return [sum(kernel.stats.cache_hits.values()) for kernel in kernels]
"""


def run(folder: Path, text: str) -> list[str]:
    """The lines that a program prints, whose kernels are in ``folder``."""
    for name, source in (("inner", INNER), ("outer", OUTER)):
        path = folder / f"{name}.py"
        if not path.exists():
            path.write_text(source)
    path = os.pathsep.join([str(folder), str(PACKAGE.parent)])
    environment = {**os.environ, "PYTHONPATH": path, "LIGATURE_CACHE": str(folder / "cache")}
    words = [sys.executable, "-c", f"from outer import *\n{text}"]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.splitlines()


def test_what_kernels_alone_call_is_made_for_kernels_alone(tmp_path: Path) -> None:
    text = "print(both(4.0, 9.0)); print(made(both, checked, root, half), made(checked.part, root.part, half.part))"
    assert run(tmp_path, text) == ["root of 4.0", "root of 9.0", "5.0", "[1, 0, 0, 0] [1, 1, 1]"]


def test_what_is_loaded_needs_no_parts(tmp_path: Path) -> None:
    text = "both(4.0, 9.0); print(loaded(both), made(checked.part, root.part, half.part))"
    assert run(tmp_path, text)[-1] == "[0] [1, 1, 1]"
    assert run(tmp_path, text)[-1] == "[1] [0, 0, 0]"


def test_a_new_kernel_contains_parts_that_were_kept(tmp_path: Path) -> None:
    text = "print(both(4.0, 9.0)); print(loaded(both, checked.part, root.part, half.part))"
    run(tmp_path, text)
    (tmp_path / "outer.py").write_text(OUTER.replace("checked(y)", "root(y)"))
    # a part that is loaded contains what it calls
    assert run(tmp_path, text) == ["root of 4.0", "5.0", "[0, 1, 1, 0]"]


def test_python_can_call_what_kernels_contain(tmp_path: Path) -> None:
    text = "both(4.0, 9.0); print(half(3.0), root(16.0), checked(25.0)); print(made(both, checked, root, half))"
    assert run(tmp_path, text)[-2:] == ["1.5 4.0 5.0", "[1, 1, 1, 1]"]


def test_a_part_raises_what_python_catches(tmp_path: Path) -> None:
    text = "try: both(4.0, -9.0)\nexcept ValueError as error: print(error)"
    for _ in ("compiled", "loaded"):
        assert run(tmp_path, text) == ["root of 4.0", "('negative', -9.0)"]


def test_a_part_that_cannot_be_read_is_compiled_again(tmp_path: Path) -> None:
    text = "print(both(4.0, 9.0))"
    run(tmp_path, text)
    (tmp_path / "outer.py").write_text(OUTER.replace("checked(y)", "root(y)"))
    kept = list((tmp_path / "cache").rglob("*.part.*"))
    assert len(kept) == 6, kept
    for path in kept:
        path.write_bytes(path.read_bytes()[:20])
    assert run(tmp_path, text) == ["root of 4.0", "5.0"]
