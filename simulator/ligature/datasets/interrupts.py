"""An orderly end for programs that record: the first signal interrupts, later ones wait until all is on the disk.

HDF5 calls back into Python to write, and swallows what is raised there: while a dataset is being written, a signal is
kept and interrupts afterwards.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_ENDING = (signal.SIGINT, signal.SIGTERM)
_writing = 0
_kept = False


@contextmanager
def interrupted_once() -> Iterator[None]:
    """The first SIGINT or SIGTERM within raises KeyboardInterrupt; others are ignored until the block has ended.

    For the main thread of a program.
    """
    global _kept

    def interrupt(number: int, frame: FrameType | None) -> None:
        global _kept
        for each in _ENDING:
            signal.signal(each, signal.SIG_IGN)
        if _writing:
            _kept = True
        else:
            raise KeyboardInterrupt

    _kept = False
    before: dict[int, Any] = {number: signal.signal(number, interrupt) for number in _ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Keep a signal that `interrupted_once` takes until the end of the block; it interrupts there."""
    global _writing, _kept
    _writing += 1
    try:
        yield
    finally:
        _writing -= 1
    if _kept and not _writing:
        _kept = False
        raise KeyboardInterrupt
