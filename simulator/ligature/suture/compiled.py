"""Compiles the room's kernels once: the one decorator they share, and where their machine code is kept.

The code lies below ``LIGATURE_CACHE``, else ``XDG_CACHE_HOME``, in a folder named by the digest of all
sources that kernels are made of: Numba itself looks at one source file each, and would keep a kernel
whose callee has changed. So only the first start after an installation compiles.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

from ligature.mesh import distance

SOURCES = (
    "bonds", "chain", "contacts", "coupling", "holding", "layout", "pads", "passages", "placing", "reactions",
    "rotations", "step", "substeps", "tables", "ties", "tracking",
)  # fmt: skip
"""Modules of this room that hold kernels."""

Function = TypeVar("Function", bound=Callable[..., Any])


def cache_folder() -> Path:
    """Where the machine code of this version of the sources lies."""
    room = Path(__file__).parent
    sources = [*(room / f"{name}.py" for name in SOURCES), Path(__file__), Path(distance.__file__)]
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    root = os.environ.get("LIGATURE_CACHE")
    if root is None:
        root = str(Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "ligature")
    return Path(root) / "kernels" / digest


_FOLDER = str(cache_folder())


def _compile(function: Function, **options: Any) -> Function:
    # Kernels allocate nothing, so they need no reference counts: counting took half of a tick.
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = _FOLDER
    try:
        return numba.njit(cache=True, error_model="numpy", _nrt=False, **options)(function)
    finally:
        numba.config.CACHE_DIR = before


def kernel(function: Function) -> Function:
    """Compile ``function`` on its first call and keep the code on disk.

    No fast-math and no threads: the same input gives the same bits.
    """
    return _compile(function)


def inlined(function: Function) -> Function:
    """Like `kernel`, for the small functions of inner loops: LLVM folds them into their callers."""
    return _compile(function, forceinline=True)
