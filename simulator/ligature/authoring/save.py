"""Saves scene files so that a failure leaves what was there: checked first, written beside, then put in place."""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Collection, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from ligature.adf.diagnostics import AdfError
from ligature.adf.nodes import parse
from ligature.paths import naming, open_file, real_path, reason

WRITERS = 16
"""Files that are written at a time."""

_MOST_LETTERS = 50
"""Of a name within that of a temporary file."""

_WRITE = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH


class SaveError(OSError):
    """Files that could not be saved; nothing was changed. The message states which and why."""


def save_all(files: Mapping[Path, bytes], roots: Collection[Path] | None = None) -> list[Path]:
    """Write ``files``; those that hold their content already are left alone.

    All are on the disk before the first takes its place, and the files that they replace stay beside them until the
    last has: a full disk, a folder that cannot be written or a process that is ended leaves what was there. New folders
    go again too. With ``roots``, links resolved, nothing is written outside these folders. Returns the paths that were
    written. Raises `SaveError`.
    """
    files = {_real(path): data for path, data in files.items()}  # 'new/../old' is there already
    _refuse_devices(files)
    changed = {path: data for path, data in files.items() if _content(path) != data}
    refuse_outside(changed, roots)
    _refuse_protected(changed)
    folders = [folder for path in changed for folder in (path.parent, *path.parent.parents) if not folder.exists()]
    with ThreadPoolExecutor(WRITERS) as pool:  # most of the time goes to waiting for the disk
        writing = [(pool.submit(_staged, path, data), path) for path, data in changed.items()]
    staged = [(job.result(), path) for job, path in writing if job.exception() is None]
    kept: dict[Path, str] = {}
    placed: list[Path] = []
    try:
        for job, _ in writing:
            job.result()
        for name, path in staged:
            if path.is_file():
                kept[path] = _kept(path)
            os.replace(name, path)
            placed.append(path)
    except OSError as error:
        _take_back(placed, kept, [name for name, _ in staged], folders)
        path = Path(error.filename2 or error.filename or next(iter(changed)))
        raise SaveError(f"'{path}' cannot be written: {reason(error)}") from error
    for old in kept.values():
        with suppress(OSError):
            os.unlink(old)
    return list(changed)


def refuse_input(out: Path, *read: Path) -> None:
    """Raise `SaveError` where ``out`` is one of the files that it is made of, which would be lost."""
    if any(_same(out, path) for path in read):
        raise SaveError(f"'{out}' is the file that is read; write to another name")


def _same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except OSError:  # one of them is missing
        return False


def refuse_outside(files: Iterable[Path], roots: Collection[Path] | None) -> None:
    """Raise `SaveError` when a file lies outside the folders ``roots``, links resolved; None allows all."""
    if roots is None:
        return
    allowed = [real_path(root) for root in roots]
    for path in files:
        real = _real(path)
        if not any(root in real.parents for root in allowed):
            listed = ", ".join(f"'{root}'" for root in allowed)
            raise SaveError(f"'{real}' lies outside {listed}, so nothing was written")


def _refuse_devices(files: Iterable[Path]) -> None:
    """Raise `SaveError` for a device or a pipe: a file in its place would end what others use it for."""
    for path in files:
        system = path.parts[1:2] in (("dev",), ("proc",)) and path.parts[2:3] != ("shm",)
        try:
            mode = path.stat().st_mode
        except OSError:
            continue
        if system or not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise SaveError(f"'{path}' is a device or a pipe, which no file may replace; give another name")


def _refuse_protected(files: Iterable[Path]) -> None:
    """Raise `SaveError` for a file that may not be written: that its folder may is no leave to replace it."""
    for path in files:
        try:
            mode = path.stat().st_mode
        except OSError:
            continue
        if stat.S_ISREG(mode) and not (mode & _WRITE and os.access(path, os.W_OK)):
            raise SaveError(f"'{path}' is write-protected; allow writing (chmod u+w), or give another name")


def foreign(files: Mapping[Path, bytes], own: Mapping[str, str]) -> list[Path]:
    """The existing files that ``files`` would change and that are not as ``own`` has them: `digest` by path."""
    found = []
    for path, data in files.items():
        before = _content(_real(path))
        if before is not None and before != data and own.get(str(_real(path))) != digest(before):
            found.append(_real(path))
    return found


def digest(data: bytes) -> str:
    """A text that tells contents of files apart."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def digests(files: Mapping[Path, bytes]) -> dict[str, str]:
    """The digest of each file by its real path."""
    return {str(_real(path)): digest(data) for path, data in files.items()}


def _real(path: Path) -> Path:
    """The path with the links of its folder resolved; a link in its own place is replaced, not followed."""
    return real_path(path.parent) / path.name


def _kept(path: Path) -> str:
    """A second name of a file, beside it, under which it stays until all files are in their places."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".old")
    os.close(handle)
    os.unlink(name)
    try:
        os.link(path, name)
    except OSError:  # a file system without hard links
        shutil.copy2(path, name)
    return name


def _take_back(placed: list[Path], kept: Mapping[Path, str], staged: list[str], folders: list[Path]) -> None:
    """Put back what was there before, and remove what was added."""
    for name in staged:
        Path(name).unlink(missing_ok=True)
    for path in placed:
        if path not in kept:
            path.unlink(missing_ok=True)
    for path, old in kept.items():
        os.replace(old, path)  # of two names of one file this leaves both
        Path(old).unlink(missing_ok=True)
    for folder in sorted(set(folders), key=lambda f: len(f.parts), reverse=True):
        with suppress(OSError):
            folder.rmdir()


def checked_text(text: str, path: Path) -> bytes:
    """The bytes of a scene file that can be read back; raises `SaveError`."""
    try:
        parse(text, path)
    except AdfError as error:
        raise SaveError(f"'{path.name}' would not be readable: {error}") from error
    return text.encode("utf-8")


def _content(path: Path) -> bytes | None:
    try:
        with open_file(path) as file:
            return file.read()
    except OSError:
        return None


def _staged(path: Path, data: bytes) -> str:
    """A temporary file beside ``path`` with its content on the disk."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with naming(path):
        part = path.parent / f".{path.name[:_MOST_LETTERS]}.{secrets.token_hex(4)}"
        try:
            with part.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            with suppress(FileNotFoundError):
                part.chmod(stat.S_IMODE(path.stat().st_mode))  # who may read and write it stays
        except OSError:
            part.unlink(missing_ok=True)
            raise
    return str(part)
