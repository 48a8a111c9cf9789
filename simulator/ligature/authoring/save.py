"""Saves scene files so that a failure leaves what was there: checked first, written beside, then put in place."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from ligature.adf.diagnostics import AdfError
from ligature.adf.nodes import parse

WRITERS = 16
"""Files that are written at a time."""


class SaveError(OSError):
    """Files that could not be saved; nothing was changed. The message states which and why."""


def save_all(files: Mapping[Path, bytes]) -> list[Path]:
    """Write ``files``; those that hold their content already are left alone.

    All are on the disk before the first takes its place, and what took its place goes back when a
    later one cannot: a full disk or a folder that cannot be written leaves everything as it was, new
    folders too. Returns the paths that were written. Raises `SaveError`.
    """
    files = {path.parent.resolve() / path.name: data for path, data in files.items()}  # 'new/../old' is there already
    before = {path: _content(path) for path in files}
    changed = {path: data for path, data in files.items() if before[path] != data}
    folders = [folder for path in changed for folder in (path.parent, *path.parent.parents) if not folder.exists()]
    with ThreadPoolExecutor(WRITERS) as pool:  # most of the time goes to waiting for the disk
        writing = [(pool.submit(_staged, path, data), path) for path, data in changed.items()]
    staged = [(job.result(), path) for job, path in writing if job.exception() is None]
    placed: list[Path] = []
    try:
        for job, _ in writing:
            job.result()
        for name, path in staged:
            os.replace(name, path)
            placed.append(path)
    except OSError as error:
        _take_back({path: before[path] for path in placed}, [name for name, _ in staged], folders)
        path = Path(error.filename2 or error.filename or next(iter(changed)))
        raise SaveError(f"'{path}' cannot be written: {error.strerror or error}") from error
    return list(changed)


def _take_back(replaced: Mapping[Path, bytes | None], staged: list[str], folders: list[Path]) -> None:
    """Put back what was there before, and remove what was added."""
    for name in staged:
        Path(name).unlink(missing_ok=True)
    for path, data in replaced.items():
        if data is None:
            path.unlink(missing_ok=True)
        else:
            os.replace(_staged(path, data), path)
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
        return path.read_bytes()
    except OSError:
        return None


def _staged(path: Path, data: bytes) -> str:
    """A temporary file beside ``path`` with its content on the disk."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, 0o644)
    except OSError:
        os.unlink(name)
        raise
    return name
