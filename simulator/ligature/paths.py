"""Paths that users name."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


def reason(error: OSError) -> str:
    """What the system reports, without the number and the path that Python adds."""
    return error.strerror or str(error)


def real_path(path: Path) -> Path:
    """``path`` absolute, with links followed as far as they lead: opening says what is wrong with a circle of links.

    Raises FileNotFoundError for a relative path where the working directory was deleted.
    """
    try:
        return Path(os.path.realpath(path))
    except FileNotFoundError:
        raise FileNotFoundError(errno.ENOENT, "the folder that you are in was deleted", str(path)) from None


def regular_file(path: Path) -> Path:
    """``path``, where it is a file to read; raises OSError, for a folder `IsADirectoryError`.

    Reading a pipe waits for who writes to it, and a device such as ``/dev/zero`` has no end.
    """
    _check_regular(path.stat().st_mode, path)
    return path


def open_file(path: Path) -> BinaryIO:
    """``path``, opened to be read, where it is a file; raises OSError as `regular_file` does.

    What was opened is looked at, so that a file may become a pipe at any moment: opening that does not wait either.
    """
    number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        _check_regular(os.fstat(number).st_mode, path)
        return os.fdopen(number, "rb")
    except BaseException:
        os.close(number)
        raise


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """An OSError within names ``path``: that of a full disk names no file, that of a temporary one a file of ours."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, reason(error), str(path)) from error


def _check_regular(mode: int, path: Path) -> None:
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder", str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "is not a regular file", str(path))
