"""Compiles the room's kernels once: the decorator that they share, and the folder of their machine code.

As in the suture room: the folder's name is the digest of the room's sources, since Numba looks at one source file
each and would keep a kernel whose callee has changed. No fast-math and no threads: the same input gives the same
bits.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def cache_folder() -> Path:
    """Folder of the machine code of this version of the sources."""
    sources = sorted(Path(__file__).parent.glob("*.py"))
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    root = os.environ.get("LIGATURE_CACHE")
    if root is None:
        root = str(Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "ligature")
    return Path(root) / "kernels" / digest


_FOLDER = str(cache_folder())


def _compile(function: Function, **options: Any) -> Function:
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = _FOLDER
    try:
        return numba.njit(cache=True, error_model="numpy", _nrt=False, **options)(function)
    finally:
        numba.config.CACHE_DIR = before


def kernel(function: Function) -> Function:
    """Compile ``function`` on its first call and keep the code on disk; it allocates nothing."""
    return _compile(function)


def inlined(function: Function) -> Function:
    """Like `kernel`, for the small functions of inner loops: LLVM folds them into their callers."""
    return _compile(function, forceinline=True)
