"""Where the episodes of a dataset lie on the disk while it grows, so that nothing takes a finished one away.

Each episode is a file of its own in the folder ``NAME.episodes`` until the dataset is closed. When it ends, its file
gets its name and ``NAME`` is replaced by one that links to all finished episodes: whoever opens ``NAME`` at any moment,
also after the writer was killed, reads all of them. Closing joins them into one file, `join` does so later.
"""

from __future__ import annotations

import io
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import h5py

from ligature.adf.contents import mistaken
from ligature.datasets.soundness import UNREADABLE, Unsound, check, episode_names, why
from ligature.paths import printable, reason, regular_file

MOST_NAMED = 3
"""Episodes that an error names."""

Describe = Callable[[h5py.File], None]
"""Writes into a file what holds for all episodes."""


class DatasetError(RuntimeError):
    """A dataset that cannot be written or read; the message gives the reason."""


def unwritable(path: Path, error: OSError | RuntimeError, kept: str = "") -> DatasetError:
    """The error of a dataset that could not be written because of ``error``; ``kept`` says what is whole of it."""
    why = reason(error) if isinstance(error, OSError) else str(error)
    return DatasetError(f"cannot write the dataset '{path}': {why}{kept}")


class _Disk(io.FileIO):
    """A file that keeps the first ``error`` of writing to itself: HDF5 crashes when its disk is full."""

    error: OSError | None = None

    def write(self, data: Any) -> int:
        """Write all of ``data``."""
        view = memoryview(data).cast("B")
        try:
            at = 0
            while at < len(view) and self.error is None:
                at += super().write(view[at:])
        except OSError as error:
            self.error = error
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """Make the file as long as HDF5 wants it."""
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0


class PartFile:
    """An HDF5 file that is called ``PATH.part`` until it is whole; raises OSError where it cannot be written."""

    def __init__(self, path: Path) -> None:
        self._path, self._part = path, path.parent / f"{path.name}.part"
        self._disk = _Disk(self._part, "w+")
        self.file = h5py.File(self._disk, "w")

    def check(self) -> None:
        """Raise what went wrong with the disk so far."""
        if self._disk.error is not None:
            raise self._disk.error

    def finish(self) -> None:
        """Hand it to the disk; then it gets its name."""
        self.file.close()
        self.check()
        os.fsync(self._disk.fileno())
        self._disk.close()
        self._part.replace(self._path)
        _sync_folder(self._path.parent)

    def drop(self) -> None:
        """Remove it."""
        with suppress(OSError, RuntimeError):
            self.file.close()
        with suppress(OSError):
            self._disk.close()
        self._part.unlink(missing_ok=True)


class EpisodeStore:
    """The episodes of the dataset ``path``, which must not exist; ``describe`` writes what holds for all of them.

    Raises `DatasetError` for a dataset that exists, and OSError where the disk fails.
    """

    def __init__(self, path: Path, describe: Describe) -> None:
        self._path, self._describe, self._folder = path, describe, episode_folder(path)
        if path.is_dir():
            raise DatasetError(f"'{path}' is a folder; give the name of a file that does not exist")
        if path.exists():
            raise DatasetError(f"'{path}' exists already; choose another name")
        if self._folder.exists():
            raise DatasetError(
                f"'{self._folder}' belongs to a recording that is still running or was killed; "
                "delete it or choose another name"
            )
        self._folder.mkdir()
        self._open: PartFile | None = None
        self._joined = False
        self.count = 0

    def begin(self) -> h5py.File:
        """The file of a new episode."""
        self._open = PartFile(self._folder / f"{_name(self.count)}.h5")
        return self._open.file

    def check(self) -> None:
        """Raise what went wrong with the disk so far."""
        if self._open is not None:
            self._open.check()

    def finish(self) -> None:
        """The episode is whole: from now on it is part of the dataset."""
        assert self._open is not None
        self._open.finish()
        self._open, self.count = None, self.count + 1
        self._link()

    def drop(self) -> None:
        """Remove the episode that is not whole."""
        if self._open is not None:
            self._open.drop()
            self._open = None

    def _link(self) -> None:
        """Replace the dataset by one that links to all finished episodes."""
        index = PartFile(self._path)
        try:
            self._describe(index.file)
            index.file.attrs["closed"] = False
            for number in range(self.count):
                name = _name(number)
                index.file[name] = h5py.ExternalLink(f"{self._folder.name}/{name}.h5", "/")
            index.finish()
        except BaseException:
            index.drop()
            raise

    def close(self, empty: bool) -> None:
        """Join the episodes into one file; without any, there is a file only if ``empty``. Once is enough.

        Raises `DatasetError` for episodes that cannot be read any more: their files stay, and the others are joined.
        """
        if self._joined:
            return
        self.drop()
        self.count = len(list(self._folder.glob("episode_*.h5")))  # an interrupt may have come between name and count
        if self.count or empty:
            self._link()
            bad: dict[str, str] = {}
            self.count = join(self._path, bad)
            self._joined = True
            if bad:
                raise DatasetError(f"{invalid(self._path, bad)}; the files of these episodes stay in '{self._folder}'")
        shutil.rmtree(self._folder, ignore_errors=True)


def join(path: Path, bad: dict[str, str] | None = None) -> int:
    """Make one file of a dataset whose episodes are files of their own; returns how many episodes it has.

    A dataset that is one file stays. Episodes that no reader could read are added to ``bad``, with the reasons, and
    their files stay where they are; without ``bad`` they are an error. Raises `DatasetError`, for which the dataset
    stays as it was.
    """
    found = {} if bad is None else bad
    folder = episode_folder(path)
    try:
        regular_file(path)
    except OSError as error:
        raise DatasetError(_unreadable(path, error)) from error
    whole, copying = PartFile(path), ""
    try:
        with opened(path, bad) as linked:
            names = episode_names(linked, found)
            if linked.attrs.get("closed", True):
                whole.drop()
                return len(names)
            if found and not names:
                raise DatasetError(invalid(path, found))
            whole.file.attrs.update(linked.attrs)
            whole.file.attrs["closed"] = True
            for name in [name for name in linked if name not in found]:
                copying = name
                linked.copy(linked[name], whole.file, name)
                whole.check()
        whole.finish()
    except BaseException as error:
        whole.drop()
        if isinstance(error, OSError | RuntimeError) and not isinstance(error, DatasetError):
            at = f" ({copying})" if copying else ""
            raise DatasetError(f"cannot join the episodes of '{path}'{at}: {error}; they stay in '{folder}'") from error
        raise
    if not found:
        shutil.rmtree(folder, ignore_errors=True)
    for name in names if found else ():
        with suppress(OSError):
            (folder / f"{name}.h5").unlink()
    return len(names)


def invalid(path: Path, bad: Mapping[str, str]) -> str:
    """What is reported of a dataset with ``bad`` episodes."""
    listed = [f"{printable(name)}: {reason}" for name, reason in list(bad.items())[:MOST_NAMED]]
    more = [f"and {len(bad) - MOST_NAMED} other episodes"] if len(bad) > MOST_NAMED else []
    return f"'{path}' is not a valid dataset: {'; '.join([*listed, *more])}"


def opened(path: Path, bad: dict[str, str] | None = None) -> h5py.File:
    """A dataset for reading; raises `DatasetError` for a file that is none, or that no reader could read.

    Episodes that are not sound are added to ``bad``, with the reasons, and are not to be read, nor are those that it
    has already. Without ``bad`` they are an error.
    """
    found = {} if bad is None else bad
    try:
        file = h5py.File(regular_file(path), "r")
    except OSError as error:
        raise DatasetError(_unreadable(path, error)) from error
    try:
        if not str(file.attrs.get("format", "")).startswith("ligature dataset"):
            raise DatasetError(f"'{path}' is an HDF5 file, but not a Ligature dataset")
        with damaged(path):
            check(file, path, found)
        if found and bad is None:
            raise DatasetError(invalid(path, found))
    except BaseException:
        file.close()
        raise
    return file


def _unreadable(path: Path, error: OSError) -> str:
    """Why HDF5 cannot read a file."""
    with suppress(OSError):
        if other := mistaken(path, "an HDF5 file"):
            return f"{other}, not a dataset; 'ligature replay FILE --dataset' makes one of a record or a bag"
    return f"cannot read the dataset '{path}': {reason(error)}"


@contextmanager
def damaged(path: Path) -> Iterator[None]:
    """Reports in one way what HDF5 finds wrong with bytes of the dataset ``path``, wherever they are read.

    Raises `DatasetError` then.
    """
    try:
        yield
    except (DatasetError, MemoryError):
        raise
    except Unsound as error:
        raise DatasetError(f"'{path}' is not a valid dataset: {printable(error)}") from error
    except UNREADABLE as error:
        if isinstance(error, OSError) and error.filename is not None:
            raise
        raise DatasetError(f"'{path}' is damaged: {why(error)}") from error


def episode_folder(path: Path) -> Path:
    """Where the episodes of a dataset lie while it grows."""
    return path.parent / f"{path.name}.episodes"


def _name(number: int) -> str:
    return f"episode_{number:04d}"


def _sync_folder(folder: Path) -> None:
    """Flush the entries of a folder to the disk."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
