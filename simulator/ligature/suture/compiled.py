"""The decorators of this room's kernels, which allocate nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from ligature.kernels import compile_with

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile ``function`` on its first call and keep the code on disk.

    Kernels allocate nothing, so they need no reference counts: counting took half of a tick.
    """
    return compile_with(function, error_model="numpy", _nrt=False)


def inlined(function: Function) -> Function:
    """Like `kernel`, for the small functions of inner loops: LLVM folds them into their callers."""
    return compile_with(function, error_model="numpy", _nrt=False, forceinline=True)
