"""Keeps the machine code of kernels on disk, for every checkout and every installation of the same sources.

The code of a module lies below `ligature.cache.cache_folder`, in a folder named by a digest of the sources that it is
made of: its own, and those of kernels and their constants in all modules that it imports. Numba's own cache looks at
one file each, by path and time, and would keep a kernel whose callee has changed.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import inspect
import logging
import os
import re
import shutil
import time
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding
from numba.core import caching
from numba.core.runtime import rtsys

from ligature.cache import CacheError, cache_folder

KEPT = 30 * 24 * 3600.0
"""Seconds for which the machine code of a version is kept after the last start with it."""

LONGEST_TURN, POLL = 120.0, 0.02
"""Seconds to wait for another process that compiles the same kernel, and between looks."""

_PACKAGE = Path(__file__).parent
_KERNEL_SOURCE = re.compile(rb"^[ \t]*@(?:compiled|kernel|inlined|intrinsic|unrolled)\b", re.MULTILINE)
_IMPORT = re.compile(rb"^from (ligature[\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)
_DIGESTED = re.compile(r"[0-9a-f]{16}")
_CONSTANTS = (
    "kernels.py", "kernel_cache.py", "kernel_parts.py", "unrolled.py", "grasping/fingers.py", "model/state.py",
    "physics/loop_arrays.py", "suture/colliders.py", "suture/layout.py", "suture/passages.py", "tissue/layout.py",
    "tissue/contact_arrays.py",
)  # fmt: skip
"""Sources without kernels whose contents are compiled into kernels."""

_WITH_CONSTANTS = frozenset(f"{_PACKAGE}/{name}" for name in _CONSTANTS)

_log = logging.getLogger(__name__)


class _Source(NamedTuple):
    """What a start has to know of a source."""

    digest: bytes
    has_kernels: bool
    """Or constants that are compiled into kernels."""
    imported: frozenset[str]
    """The files of the package that it imports, as far as imports stand at the start of a line."""


@cache
def _source(path: str) -> _Source:
    """One source, which is read once; a start reads a hundred."""
    with open(path, "rb") as file:
        content = file.read()
    has_kernels = path in _WITH_CONSTANTS or _KERNEL_SOURCE.search(content) is not None
    imported = set[str]()
    for package, names in _IMPORT.findall(content):
        folder = "/".join((str(_PACKAGE), *package.decode().split(".")[1:]))
        words = (word.split() for word in names.decode().strip("()").split(","))
        imported |= {f"{module}.py" for module in (folder, *(f"{folder}/{word[0]}" for word in words if word))}
    there = frozenset(file for file in imported if _exists(file))
    return _Source(hashlib.sha256(content).digest(), has_kernels, there)


def _exists(path: str) -> bool:
    folder, _, name = path.rpartition("/")
    return name in _names_in(folder)


@cache
def _names_in(folder: str) -> frozenset[str]:
    """The names of the files in a folder; none where that is a module, of which something is imported."""
    with contextlib.suppress(OSError):
        return frozenset(os.listdir(folder))
    return frozenset()


@cache
def sources() -> frozenset[Path]:
    """The files of the package that kernels are made of."""
    return frozenset(path for path in _PACKAGE.rglob("*.py") if _source(str(path)).has_kernels)


def sources_of(module: Path) -> set[Path]:
    """The files that the kernels of ``module`` are made of: itself, and those of `sources` that it imports."""
    return set(map(Path, _sources_of(str(module))))


def _sources_of(module: str) -> list[str]:
    """The paths of `sources_of` in their order."""
    found, waiting = set[str](), [module]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting.extend(_source(path).imported)
    return sorted(path for path in found if path == module or _source(path).has_kernels)


@cache
def kernel_folder(module: Path, name: str) -> Path | None:
    """Where the machine code of the kernels of the module ``name`` lies; None where nothing can be written."""
    if (root := _root()) is None:
        return None
    made_of = b"".join(_source(path).digest for path in _sources_of(str(module)))
    folder = root / hashlib.sha256(name.encode() + made_of).hexdigest()[:16]
    with contextlib.suppress(OSError):
        folder.mkdir(exist_ok=True)
        os.utime(folder)
    return folder


@cache
def _root() -> Path | None:
    try:
        root = cache_folder() / "kernels"
        root.mkdir(exist_ok=True)
    except CacheError as error:
        _log.warning("%s; kernels are compiled again at every start", error)
        return None
    except OSError as error:
        _warn_of_writes(str(error))
        return None
    return root


@cache
def _forget_others(root: Path) -> None:
    """Delete the code of other versions that nothing has started with for `KEPT`: up to 40 MB for each."""
    for path in sources():
        kernel_folder(path, ".".join(("ligature", *path.relative_to(_PACKAGE).with_suffix("").parts)))
    with contextlib.suppress(OSError):
        for other in root.iterdir():
            if _DIGESTED.fullmatch(other.name) and time.time() - other.stat().st_mtime > KEPT:
                shutil.rmtree(other, ignore_errors=True)


class _Place(caching._CacheLocator):
    """The folder of a kernel; what it is made of is in the name of the folder."""

    def __init__(self, folder: Path, line: int) -> None:
        self._folder, self._line = folder, line

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> int:
        return 0

    def get_disambiguator(self) -> str:
        return str(self._line)

    @classmethod
    def from_function(cls, function: Any, file: str) -> _Place | None:
        folder = kernel_folder(Path(file).resolve(), function.__module__)
        return None if folder is None else cls(folder, function.__code__.co_firstlineno)


class Code(caching.CompileResultCacheImpl):
    """How the machine code of a kernel is kept."""

    _locator_classes = (_Place,)

    def reduce(self, data: Any) -> Any:
        """What is kept: machine code, and of the LLVM code that Numba reads beside it the names of functions.

        What contains a kernel links with another form of it; see `ligature.kernel_parts`. To read all of it took
        an eighth of a start.
        """
        (name, kind, (machine_code, _)), *others = super().reduce(data)
        names = (function.name for function in data.library.get_defined_functions())
        code = "\n".join(f'define void @"{name}"() {{ ret void }}' for name in names)
        return (name, kind, (machine_code, llvmlite.binding.parse_assembly(code).as_bitcode())), *others


class KernelCache(caching.FunctionCache):
    """The kept code of one kernel. Of processes that need the same kernel, one compiles and the others wait for it.

    A kernel's callees are compiled while it is: the order in which processes take their turns is that of calls, so
    that they cannot wait for each other.
    """

    _impl_class = Code
    _turn: int | None = None

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The machine code for a signature; None where it is this process's turn to compile it."""
        found = self._loaded(sig, target_context)
        if found is None and self._turn is None and self._take_turn():
            found = self._loaded(sig, target_context)
            if found is not None:
                self._end_turn()
        return found

    def _loaded(self, sig: Any, target_context: Any) -> Any:
        """The machine code for a signature, if it is kept; files that cannot be read are forgotten.

        A power failure leaves files without content, another user's start files that are his. Numba's own method first
        registers all that can be compiled, which compilation does again, and which takes longer than to load the code.
        """
        try:
            rtsys.initialize(target_context)  # what machine code calls to allocate memory
            return self._load_overload(sig, target_context)
        except Exception as error:  # whatever pickle and LLVM raise
            index = Path(self._cache_file._index_path)
            _log.warning("%s cannot be read and is compiled again: %s", index, str(error) or type(error).__name__)
            try:
                index.unlink()
            except OSError:
                self.disable()  # nothing can be kept there either
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled; what cannot be kept, for instance on a full disk, is logged."""
        try:
            super().save_overload(sig, data)
            _forget_others(Path(self._cache_path).parent)
        except OSError as error:
            _warn_of_writes(str(error))
        finally:
            self._end_turn()

    @property
    def _lock(self) -> Path:
        return Path(self._cache_path, f"{self._impl.filename_base}.lock")

    def _take_turn(self) -> bool:
        """Wait until no other process compiles this kernel; False where that cannot be known."""
        try:
            file = os.open(self._lock, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o600)
        except OSError:
            return False
        end = time.monotonic() + LONGEST_TURN
        while time.monotonic() < end:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                time.sleep(POLL)
                continue
            except OSError:
                break
            self._turn = file
            return True
        os.close(file)
        return False

    def _end_turn(self) -> None:
        if self._turn is not None:
            with contextlib.suppress(OSError):
                self._lock.unlink()
            os.close(self._turn)
            self._turn = None


@cache
def _warn_of_writes(reason: str) -> None:
    _log.warning("kernels cannot be kept and will be compiled again at the next start: %s", reason)


def cache_of(function: Any, kind: type[KernelCache]) -> Any:
    """What keeps the code of a kernel: nothing does where its source is no file or nothing can be written."""
    file = Path(inspect.getfile(function))
    if file.exists() and kernel_folder(file.resolve(), function.__module__) is not None:
        return kind(function)
    return caching.NullCache()
