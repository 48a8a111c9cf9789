"""The folder of everything that is computed once: collision files, decompositions, machine code of kernels."""

from __future__ import annotations

import atexit
import contextlib
import errno
import logging
import os
import shutil
import stat
import tempfile
from functools import lru_cache
from pathlib import Path

VARIABLE = "LIGATURE_CACHE"

_log = logging.getLogger(__name__)


class CacheError(OSError):
    """Nothing can be kept, neither in the cache nor in the system's temporary folder."""


def cache_folder() -> Path:
    """Where everything is kept that is computed once: ``LIGATURE_CACHE``, else ``ligature`` in the user's cache folder.

    Where that cannot be written, a temporary folder that belongs to the user alone takes its place; a warning is
    logged once, and ``LIGATURE_CACHE`` hands the folder on to the processes of a run. Raises `CacheError` where
    there is none either.
    """
    if os.environ.get(VARIABLE):
        return _writable(Path(os.environ[VARIABLE]))
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return _writable(Path(base) / "ligature")


@lru_cache
def _writable(wanted: Path) -> Path:
    try:
        if not wanted.is_absolute() and str(wanted).startswith("~"):
            raise FileNotFoundError(errno.ENOENT, "the user has no home folder")
        wanted.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=wanted).close()
        return wanted
    except OSError as error:
        try:
            folder = _private_folder()
        except OSError as second:
            raise CacheError(f"neither {wanted} nor a temporary folder can be written: {second}") from second
        _log.warning(
            "%s cannot be written (%s): %s is used; set %s to choose another", wanted, error.strerror, folder, VARIABLE
        )
        os.environ[VARIABLE] = str(folder)
        return folder


def _private_folder() -> Path:
    """The user's own folder among the temporary ones, kept for the next start.

    Its files are executed as code. If another user created the folder, this process uses a private one.
    """
    if hasattr(os, "getuid"):
        folder = Path(tempfile.gettempdir()) / f"ligature-{os.getuid()}"
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        status = folder.lstat()
        if stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o077:
            return folder
    return temporary_folder()


def write_atomically(path: Path, data: bytes) -> None:
    """Make ``path`` hold ``data``; other processes see the old file or the whole new one. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise


@lru_cache(maxsize=1)
def temporary_folder() -> Path:
    """A folder of this process alone, removed when it ends."""
    folder, owner = tempfile.mkdtemp(prefix="ligature-"), os.getpid()

    def remove() -> None:
        if os.getpid() == owner:
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return Path(folder)
