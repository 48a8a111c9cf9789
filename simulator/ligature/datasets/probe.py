"""Looks at a dataset of a stranger in a process of its own, before this one reads it.

The library of HDF5 reads some damaged files beyond their ends, and crashes. A child that is a copy of this process
meets the same bytes in the same memory first.
"""

from __future__ import annotations

import json
import math
import os
import resource
import signal
from pathlib import Path
from typing import Any, NoReturn

import h5py

from ligature.datasets.soundness import held_against
from ligature.datasets.store import DatasetError, damaged, episode_folder, opened

SECONDS, SECONDS_A_BYTE = 4.0, 1e-6
"""Of processor time that a look may take; a dataset of 1000 episodes takes 5."""

MOST_WORDS = 4096
"""Letters of an error."""

WHOLE = 1 << 24
"""Bytes of an array that is read as a whole; of larger ones, and of pictures, the first and the last row are read."""


def probe(path: Path) -> dict[str, str]:
    """Episodes of a dataset that cannot be read, with the reasons.

    Raises `DatasetError` for a file that is no sound dataset, or on which HDF5 crashes.
    """
    files = [path, *episode_folder(path).glob("*")]
    seconds = math.ceil(SECONDS + SECONDS_A_BYTE * sum(file.stat().st_size for file in files if file.exists()))
    reads, writes = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reads)
        _look(path, writes, seconds)
    os.close(writes)
    with os.fdopen(reads, "rb") as answer:
        content = answer.read()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        end = f"takes more than {seconds} s" if number == signal.SIGXCPU else "crashes"
        raise DatasetError(f"'{path}' is damaged: reading it {end} ({signal.Signals(number).name})")
    found: dict[str, Any] = json.loads(content) if content else {"error": f"'{path}' is damaged: reading it ends early"}
    if found["error"]:
        raise DatasetError(found["error"])
    return dict(found["bad"])


def _look(path: Path, writes: int, seconds: int) -> NoReturn:
    """Main of the child process: read all that a reader reads, report errors, and exit."""
    bad: dict[str, str] = {}
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        with damaged(path), opened(path, bad) as file:
            for name in [name for name in file if name not in bad]:
                with held_against(name, bad):
                    _read_all(file[name])
        _answer(writes, "", bad)
    except DatasetError as error:
        _answer(writes, str(error), bad)
    finally:
        os._exit(0)


def _answer(writes: int, error: str, bad: dict[str, str]) -> None:
    """Hand what was found to the parent process."""
    with os.fdopen(writes, "w", encoding="utf-8") as out:
        json.dump({"error": error[:MOST_WORDS], "bad": {name: why[:MOST_WORDS] for name, why in bad.items()}}, out)


def _read_all(item: h5py.Group | h5py.Dataset) -> None:
    _read("", item)
    if isinstance(item, h5py.Group):
        item.visititems(_read)


def _read(name: str, item: h5py.Group | h5py.Dataset) -> None:
    dict(item.attrs)
    if isinstance(item, h5py.Dataset):
        if item.nbytes <= WHOLE:
            item[()]
        else:
            item[0], item[-1]
