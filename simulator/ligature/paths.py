"""Paths that users name."""

from __future__ import annotations

import errno
import os
import re
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

_READ = os.O_RDONLY | sum(getattr(os, name, 0) for name in ("O_NONBLOCK", "O_CLOEXEC", "O_BINARY"))
"""How files are opened; Blender runs on systems that have not all of it."""

_MOST_LETTERS = 50
"""Of the name of an object in that of a file: of up to four bytes each, file systems take 255."""


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
    number = os.open(path, _READ)
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


def printable(text: object) -> str:
    """``text`` with escapes for the surrogates of names that are not UTF-8, which nothing but a path may hold."""
    return str(text).encode("utf-8", "backslashreplace").decode("utf-8")


def check_folder(folder: Path) -> None:
    """Create a folder where it is missing, and write to it; raises OSError, before anything is computed for it."""
    folder.mkdir(parents=True, exist_ok=True)
    with naming(folder):
        tempfile.TemporaryFile(dir=folder).close()


def check_list(what: str, given: object) -> None:
    """Raise TypeError where no list is ``given``, or one text or path for it: each letter would be one, as ``/``."""
    if isinstance(given, str | bytes | os.PathLike):
        raise TypeError(f"{what} is {given!r}; it must be a list, such as [{given!r}]")
    if not isinstance(given, Iterable):
        raise TypeError(f"{what} is {given!r}; it must be a list")


def part_of(path: Path) -> Path:
    """What the recording ``path`` is called until it is whole; to be opened with the mode ``x``.

    Raises FileExistsError where one of the two exists: nothing is written over what somebody else records, or left.
    """
    part = path.with_name(f"{path.name}.active")
    if path.exists():
        raise FileExistsError(f"'{path}' exists already; choose another name")
    if part.exists():
        raise FileExistsError(
            f"'{part}' belongs to a recording that is still running or was killed; delete it or choose another name"
        )
    return part


def give_name(part: Path, path: Path) -> None:
    """Rename the file ``part`` to ``path``; raises FileExistsError where that exists by now, and OSError."""
    taken = FileExistsError(f"'{path}' exists by now; the recording is in '{part}'")
    try:
        os.link(part, path)
    except FileExistsError:
        raise taken from None
    except OSError:  # a file system without hard links
        if path.exists():
            raise taken from None
        part.replace(path)
    else:
        part.unlink()


def as_file_name(name: str) -> str:
    """The name of an object as that of a file: without folders, not hidden, and short enough to get an ending."""
    plain = re.sub(r"[/\\\x00-\x1f]", "_", name)[:_MOST_LETTERS]
    return f"_{plain}" if plain.startswith(".") or not plain else plain


def _check_regular(mode: int, path: Path) -> None:
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder", str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "is not a regular file", str(path))
