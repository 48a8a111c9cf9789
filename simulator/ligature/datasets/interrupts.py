"""An orderly end for programs that record: the first signal interrupts, later ones wait until all is on the disk."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from ligature.process import amid_import

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_LATER = 0.02
"""Seconds after which an interrupt tries again that was lost, or that came amid an import."""


@contextmanager
def interrupted_once() -> Iterator[None]:
    """The first SIGINT, SIGTERM or SIGHUP within raises KeyboardInterrupt; others are ignored until the block ends.

    The exception has the number of the signal as its argument. Where it is lost, as in an object's clean-up or a
    callback from C, it is raised again. For the main thread of a program.
    """
    first: list[int] = []

    def interrupt(number: int, frame: FrameType | None) -> None:
        if not first:
            first.append(number)
            again(number, frame)

    def again(number: int, frame: FrameType | None) -> None:
        if isinstance(sys.exc_info()[1], KeyboardInterrupt):
            return  # it is on its way out
        signal.setitimer(signal.ITIMER_REAL, _LATER)
        if not amid_import(frame):
            raise KeyboardInterrupt(first[0])

    alarm = signal.signal(signal.SIGALRM, again)
    heard = [number for number in _ENDING if signal.getsignal(number) is not signal.SIG_IGN]  # as under nohup
    before: dict[int, Any] = {number: signal.signal(number, interrupt) for number in heard}
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, alarm)
        for number, handler in before.items():
            signal.signal(number, handler)
