"""Looks at a dataset of a stranger in a process of its own, before this one reads it.

The library of HDF5 reads some damaged files beyond their ends, and crashes. A child that is a copy of this process
meets the same bytes in the same memory first.
"""

from __future__ import annotations

import math
import os
import resource
import signal
from pathlib import Path
from typing import NoReturn

import h5py

from ligature.datasets.store import DatasetError, damaged, episode_folder, opened

SECONDS, SECONDS_A_BYTE = 4.0, 1e-6
"""Of processor time that a look may take; a dataset of 1000 episodes takes 5."""

WHOLE = 1 << 24
"""Bytes of an array that is read as a whole; of larger ones, and of pictures, the first and the last row are read."""


def probe(path: Path) -> None:
    """Raise `DatasetError` for a file that is no sound dataset, or on which HDF5 crashes."""
    files = [path, *episode_folder(path).glob("*")]
    seconds = math.ceil(SECONDS + SECONDS_A_BYTE * sum(file.stat().st_size for file in files if file.exists()))
    reads, writes = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reads)
        _look(path, writes, seconds)
    os.close(writes)
    with os.fdopen(reads, "rb") as answer:
        why = answer.read().decode("utf-8", "replace")
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        end = f"takes more than {seconds} s" if number == signal.SIGXCPU else "crashes"
        raise DatasetError(f"'{path}' is damaged: reading it {end} ({signal.Signals(number).name})")
    if why:
        raise DatasetError(why)


def _look(path: Path, writes: int, seconds: int) -> NoReturn:
    """Main of the child process: read all that a reader reads, report errors, and exit."""
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        with damaged(path), opened(path) as file:
            file.visititems(_read)
            for name in file:  # episodes of a dataset that grows are files of their own, which a visit leaves out
                file[name].visititems(_read)
    except DatasetError as error:
        os.write(writes, str(error).encode("utf-8", "backslashreplace")[:4096])
    finally:
        os._exit(0)


def _read(name: str, item: h5py.Group | h5py.Dataset) -> None:
    dict(item.attrs)
    if isinstance(item, h5py.Dataset):
        if item.nbytes <= WHOLE:
            item[()]
        else:
            item[0], item[-1]
