"""Compiles kernels and keeps their machine code: the decorators that all rooms share.

The code lies below `ligature.cache.cache_folder`, in a folder named by the digest of all sources that kernels
are made of: Numba itself looks at one source file each, and would keep a kernel whose callee has changed. So only the
first start after an installation compiles, which is logged every few seconds while it lasts.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import logging
import os
import re
import shutil
import threading
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import llvmlite.binding
import numba
import numba.np.linalg
from numba.core import event

from ligature.cache import CacheError, cache_folder

Function = TypeVar("Function", bound=Callable[..., Any])

FIRST_REPORT, REPORT_EVERY = 1.0, 4.0
"""Seconds of compilation before the first line about it, and between lines."""

KEPT = 30 * 24 * 3600.0
"""Seconds for which the machine code of a version is kept after the last start with it."""

_PACKAGE = Path(__file__).parent
_KERNEL_SOURCE = re.compile(rb"^\s*@(?:compiled|kernel|inlined|intrinsic|unrolled)\b", re.MULTILINE)
_DIGEST = re.compile(r"[0-9a-f]{16}")
_CONSTANTS = (
    "kernels.py", "unrolled.py", "grasping/fingers.py", "model/state.py", "physics/loop_arrays.py", "suture/layout.py",
    "suture/passages.py", "tissue/layout.py", "tissue/contact_arrays.py",
)  # fmt: skip
"""Sources without kernels whose contents are compiled into kernels."""

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


def sources() -> list[Path]:
    """The files that kernels are made of, sorted."""
    found = {path for path in _PACKAGE.rglob("*.py") if _KERNEL_SOURCE.search(path.read_bytes())}
    return sorted(found | {_PACKAGE / name for name in _CONSTANTS})


@cache
def kernel_folder() -> Path | None:
    """Where the machine code of this version of the sources lies; None where nothing can be written."""
    try:
        root = cache_folder()
    except CacheError as error:
        _log.warning("%s; kernels are compiled again at every start", error)
        return None
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources())).hexdigest()[:16]
    folder = root / "kernels" / digest
    _forget_others(folder)
    return folder


def _forget_others(folder: Path) -> None:
    """Delete the machine code of other versions that nothing has started with for `KEPT`: 40 MB for each version."""
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        for other in folder.parent.iterdir():
            if _DIGEST.fullmatch(other.name) and time.time() - other.stat().st_mtime > KEPT:
                shutil.rmtree(other, ignore_errors=True)


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


def compile_with(function: Function, **options: Any) -> Function:
    """Like `compiled`, with options of `numba.njit`."""
    folder = kernel_folder()
    if folder is None:
        return numba.njit(**options)(function)
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        dispatcher = numba.njit(cache=True, **options)(function)
    finally:
        numba.config.CACHE_DIR = before
    _survive_failed_writes(dispatcher)
    _keep_bitcode(dispatcher)
    return dispatcher


def _keep_bitcode(dispatcher: Any) -> None:
    """Keep the library of a loaded kernel, which others link with, as bitcode: parsed, it is eight times as large.

    Where all kernels are loaded nothing links, and a physics process saves 20 MB.
    """
    rebuild = dispatcher._cache._impl.rebuild

    def rebuild_small(target: Any, payload: Any) -> Any:
        result = rebuild(target, payload)
        library, (_, kind, parts) = result.library, payload[0]
        if kind == "object":
            library._shared_module.close()
            library._shared_module = None
            library._get_module_for_linking = lambda: llvmlite.binding.parse_bitcode(parts[1])
        return result

    dispatcher._cache._impl.rebuild = rebuild_small


def _survive_failed_writes(dispatcher: Any) -> None:
    """Log instead of raising when machine code cannot be kept, for instance on a disk that has become full."""
    save = dispatcher._cache.save_overload

    def save_if_possible(signature: Any, data: Any) -> None:
        try:
            save(signature, data)
        except OSError as error:
            _warn_of_writes(str(error))

    dispatcher._cache.save_overload = save_if_possible


@cache
def _warn_of_writes(reason: str) -> None:
    _log.warning("kernels cannot be kept and will be compiled again at the next start: %s", reason)


class _Progress(event.Listener):
    """Logs a line every few seconds while Numba compiles."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._depth = self._kernels = 0
        self._seconds = self._since = 0.0
        self._watched = False

    def on_start(self, event: Any) -> None:
        with self._lock:
            if not self._depth:
                self._since = time.monotonic()
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


event.register("numba:compile", _Progress())
