"""The state after n ticks is the same to the bit on every x86-64 processor with AVX2, as far as one can emulate another.

Environment variables make OpenBLAS, NumPy and the C library take the processor for another one. Compiled kernels need
no such test: LLVM neither reorders sums nor fuses products, whatever it compiles for.
"""

from __future__ import annotations

import ast
import os
import platform
import subprocess
import sys
from functools import cache
from pathlib import Path

import gymnasium
import ligature
import ligature.environments  # noqa: F401 (registers environments)
import pytest
from ligature import blas

from tests.conftest import ROOT

FLAGS = Path("/proc/cpuinfo").read_text().split() if platform.machine() == "x86_64" else []
pytestmark = pytest.mark.skipif("avx2" not in FLAGS or "fma" not in FLAGS, reason="another kind of processor")

AVX512 = "AVX512F AVX512CD AVX512_KNL AVX512_KNM AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR"
PROCESSORS = {
    "the oldest one": {
        "OPENBLAS_CORETYPE": "Nehalem",
        "NPY_DISABLE_CPU_FEATURES": f"AVX2 FMA3 {AVX512}",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX512VL",
    },
    "one of AMD's": {"OPENBLAS_CORETYPE": "Zen", "NPY_DISABLE_CPU_FEATURES": AVX512},
    "one with AVX-512": {"OPENBLAS_CORETYPE": "SkylakeX"} if "avx512f" in FLAGS else {},
    "one that OpenBLAS does not know": {"OPENBLAS_CORETYPE": "Prescott"},
}
"""What makes OpenBLAS, NumPy and the C library take this processor for another one; for the C library with AVX2."""

SCENES = sorted(path.parent.name for path in ROOT.glob("scenes/*/launch.yaml"))
ENVIRONMENTS = sorted(name for name in gymnasium.registry if name.startswith("ligature/"))
QUICK = ("suturing_small", "soft_suturing", "ligature/Pick-v0")

ELEMENTARY = {
    "sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh", "arcsinh", "arccosh", "arctanh",
    "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "cbrt", "power", "float_power",
}  # fmt: skip
"""Functions that NumPy computes with vectors of the processor's size, to other last bits for each size."""

STEPPING = (
    "adf", "mesh", "model", "physics", "suture", "tissue", "sensing", "robots", "grasping", "arms", "soft", "plugins",
    "environments", "tasks", "datasets", "teleop", "bus",
)  # fmt: skip
"""Packages whose results become part of a state, a command or an observation."""


def run(processor: dict[str, str], ticks: int, names: tuple[str, ...]) -> dict[str, str]:
    environment = {name: value for name, value in os.environ.items() if name != blas.VARIABLE}
    command = [sys.executable, "-W", "ignore", "-m", "tests.emulated", str(ticks), *names]
    done = subprocess.run(
        command, cwd=ROOT, env={**environment, **processor}, capture_output=True, text=True, check=False, timeout=3000
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return dict(line.split() for line in done.stdout.splitlines())


@cache
def here(ticks: int, names: tuple[str, ...]) -> dict[str, str]:
    return run({}, ticks, names)


@pytest.mark.parametrize("processor", ["the oldest one", "one with AVX-512"])
def test_another_processor_computes_the_same_bits(processor: str) -> None:
    assert run(PROCESSORS[processor], 120, QUICK) == here(120, QUICK)


@pytest.mark.slow
@pytest.mark.timeout(3000)
@pytest.mark.parametrize("processor", PROCESSORS)
def test_another_processor_computes_the_same_bits_of_every_scene(processor: str) -> None:
    names = (*SCENES, *ENVIRONMENTS)
    assert run(PROCESSORS[processor], 2000, names) == here(2000, names)


def test_routines_are_pinned_whether_numpy_comes_first_or_last() -> None:
    for first, last in (("numpy, scipy.linalg", "ligature"), ("ligature", "numpy, scipy.linalg")):
        code = f"import {first}; import {last}; from ligature import blas; print(*map(blas.core, blas.loaded()))"
        environment = {name: value for name, value in os.environ.items() if name != blas.VARIABLE}
        out = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
        assert set(out.stdout.split()) <= {blas.CORE}, first


def test_a_user_who_chooses_routines_keeps_them() -> None:
    code = "import ligature, numpy; from ligature import blas; print(*map(blas.core, blas.loaded()))"
    environment = {**os.environ, blas.VARIABLE: "Nehalem"}
    out = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert set(out.stdout.split()) <= {"Nehalem"}


@pytest.mark.parametrize(
    "flags, has", [("fpu avx2 fma", True), ("fpu avx fma", False), ("fpu avx2", False), ("", False)]
)
def test_a_processor_without_avx2_keeps_its_routines(
    flags: str, has: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cpuinfo").write_text(f"processor : 0\nflags\t\t: {flags}\nbugs : avx2 fma\n")
    monkeypatch.setattr(blas, "CPUS", tmp_path / "cpuinfo")
    monkeypatch.delenv(blas.VARIABLE, raising=False)
    monkeypatch.setattr(blas, "loaded", list)
    blas.pin()
    assert (os.environ.get(blas.VARIABLE) == blas.CORE) is has


def interpreted(tree: ast.Module) -> list[ast.AST]:
    """What of a module is not in a kernel: machine code of kernels calls the C library."""
    kernels = {"compiled", "kernel", "inlined", "intrinsic", "unrolled"}
    left, waiting = [], list[ast.AST](tree.body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.FunctionDef) and any(
            isinstance(mark, ast.Name) and mark.id in kernels for mark in node.decorator_list
        ):
            continue
        left.append(node)
        waiting.extend(ast.iter_child_nodes(node))
    return left


def elementary(node: ast.AST) -> str | None:
    """The elementary function of NumPy that an expression calls, if it is one: ``np.sin``, or a power of arrays."""
    if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "np" and node.attr in ELEMENTARY:
        return ast.unparse(node)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) and ast.unparse(node.right) not in ("2", "0.5"):
        base = ast.unparse(node.left)
        return ast.unparse(node) if "np." in base and not base.startswith("float(") else None
    return None


@pytest.mark.parametrize("package", STEPPING)
def test_no_elementary_function_of_numpy_decides_a_state(package: str) -> None:
    folder = Path(ligature.__file__).parent / package
    found = [
        f"{path.relative_to(folder)}:{node.lineno}: {text}"  # type: ignore[attr-defined]
        for path in folder.rglob("*.py")
        for node in interpreted(ast.parse(path.read_text()))
        if (text := elementary(node))
    ]
    assert found == [], "their bits depend on the processor; use those of math, or a kernel"


@pytest.mark.parametrize(
    "text", ["np.sin(x)", "(1.0 - np.clip(d, 0.0, 1.0)) ** dt", "np.power(x, 3)", "np.abs(x) ** 3"]
)
def test_elementary_functions_are_found(text: str) -> None:
    assert [found for node in ast.walk(ast.parse(text)) if (found := elementary(node))]
