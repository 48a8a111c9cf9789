"""Compiles the room's kernels once: the one decorator they share, and where their machine code is kept.

Numba keeps the code beside the sources; where those cannot be written (a system-wide installation)
it goes below ``LIGATURE_CACHE``, else ``XDG_CACHE_HOME``, so that only the first start ever compiles.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def _cache_folder() -> Path:
    root = os.environ.get("LIGATURE_CACHE")
    if root:
        return Path(root) / "numba"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "ligature" / "numba"


if not os.access(Path(__file__).parent, os.W_OK) and not numba.config.CACHE_DIR:
    numba.config.CACHE_DIR = str(_cache_folder())


def kernel(function: Function) -> Function:
    """Compile ``function`` on its first call and keep the code on disk.

    No fast-math and no threads: the same input gives the same bits.
    """
    return numba.njit(cache=True, error_model="numpy")(function)


def inlined(function: Function) -> Function:
    """Like `kernel`, for the small functions of inner loops: LLVM folds them into their callers."""
    return numba.njit(cache=True, error_model="numpy", inline="never", forceinline=True)(function)
