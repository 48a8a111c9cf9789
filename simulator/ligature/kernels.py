"""Compiles kernels and keeps their machine code: the decorators that all packages share.

Only the first start after an installation compiles, and later ones what has changed since (`ligature.kernel_cache`).
That is logged every few seconds while it lasts.
"""

from __future__ import annotations

import gc
import importlib
import logging
import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

import numba
import numba.np.linalg
from numba.core import event

from ligature.kernel_parts import Kernel

Function = TypeVar("Function", bound=Callable[..., Any])

FIRST_REPORT, REPORT_EVERY = 1.0, 4.0
"""Seconds of compilation before the first line about it, and between lines."""

RARELY = 20_000
"""New objects after which Python looks for unreachable ones while Numba compiles; it does so after 700 as a rule."""

_log = logging.getLogger(__name__)


def _import_without_scipy() -> None:
    """Import Numba's functions of arrays without SciPy's linear algebra, of which they only ask whether it is there.

    It takes 15 MB. Code that uses it imports it when it is compiled, and when it is called.
    """
    ensure, numba.np.linalg.ensure_blas = numba.np.linalg.ensure_blas, lambda: None
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        numba.np.linalg.ensure_blas = ensure


_import_without_scipy()


def compiled(function: Function) -> Function:
    """Compile ``function`` on its first call and keep the code on disk.

    No fast-math and no threads: the same input gives the same bits.
    """
    return compile_with(function)


def kernel(function: Function) -> Function:
    """Like `compiled`, for what allocates nothing.

    It needs no reference counts then: counting took half of a tick.
    """
    return compile_with(function, error_model="numpy", _nrt=False)


def inlined(function: Function) -> Function:
    """Like `kernel`, for the small functions of inner loops: LLVM folds them into their callers."""
    return compile_with(function, error_model="numpy", _nrt=False, forceinline=True)


def released(function: Function) -> Function:
    """Like `compiled`, for what takes milliseconds: other threads of Python run meanwhile."""
    return compile_with(function, nogil=True)


def compile_with(function: Function, **options: Any) -> Function:
    """Like `compiled`, with options of `numba.njit`."""
    if numba.config.DISABLE_JIT:
        return function
    options = {"nopython": True, "boundscheck": None, "no_cfunc_wrapper": True, **options}
    return Kernel(function, {}, options)  # type: ignore[return-value]


class _Compilation(event.Listener):
    """Logs a line every few seconds while Numba compiles, and has Python look for unreachable objects less often then.

    Numba makes millions of objects that live long; to look through them took a tenth of its time.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._usual = gc.get_threshold()
        self._depth = self._kernels = 0
        self._seconds = self._since = 0.0
        self._watched = False

    def on_start(self, event: Any) -> None:
        with self._lock:
            if not self._depth:
                self._since = time.monotonic()
                self._usual = gc.get_threshold()
                if 0 < self._usual[0] < RARELY:
                    gc.set_threshold(RARELY, *self._usual[1:])
            self._depth += 1
            if not self._watched:
                self._watched = True
                threading.Thread(target=self._watch, name="compilation", daemon=True).start()

    def on_end(self, event: Any) -> None:
        with self._lock:
            self._kernels += 1
            self._depth -= 1
            if not self._depth:
                self._seconds += time.monotonic() - self._since
                gc.set_threshold(*self._usual)

    def _watch(self) -> None:
        """Report until a whole period passes without compilation."""
        pause, before = FIRST_REPORT, -1
        while True:
            time.sleep(pause)
            pause = REPORT_EVERY
            with self._lock:
                if not self._depth and self._kernels == before:
                    self._watched = False
                    return
                before = self._kernels
                seconds = self._seconds + (time.monotonic() - self._since if self._depth else 0.0)
            _log.warning("compiling for this machine, once: %d kernels after %.0f s", before, seconds)


event.register("numba:compile", _Compilation())
