"""Ends every process of a run on a signal such as SIGTERM.

A signal can arrive while the handler of another one runs, and between any two instructions of the interrupted thread: a
handler that takes a lock would wait forever for the thread that it interrupted. The handler here only sets a flag and
arms a kernel timer, which is safe at any moment and any number of times.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Iterable
from types import FrameType

END_TIMEOUT = 1.0
"""Seconds from the first signal after which the kernel ends a process that has not ended by itself."""

_NAP = 0.02
"""Seconds between two looks of `Stop.wait`: there is nothing that a handler could safely wake a thread with."""


class Stop:
    """Set once a signal has asked this process to end; made by `stop_on_signal`.

    Parameters
    ----------
    timeout
        Seconds from the first signal until SIGALRM ends the process, whatever it waits for; None leaves it alone.
    """

    def __init__(self, timeout: float | None) -> None:
        self._timeout = timeout
        self._set = False

    def is_set(self) -> bool:
        """Whether a signal has asked for the end."""
        return self._set

    def wait(self, seconds: float = float("inf")) -> bool:
        """Sleep until a signal asks for the end, for ``seconds`` at most; whether one did."""
        deadline = time.monotonic() + seconds
        while not self._set and time.monotonic() < deadline:
            time.sleep(min(_NAP, max(deadline - time.monotonic(), 0.0)))
        return self._set

    def _handle(self, number: int, frame: FrameType | None) -> None:
        """The handler: takes no lock, allocates nothing that others wait for, and may interrupt itself."""
        if not self._set:
            self._set = True
            if self._timeout is not None:
                signal.setitimer(signal.ITIMER_REAL, self._timeout)


def stop_on_signal(numbers: Iterable[signal.Signals] = (signal.SIGTERM,), timeout: float | None = END_TIMEOUT) -> Stop:
    """What the signals ``numbers`` set; to be called on the main thread.

    SIGINT is ignored unless it is among them: the terminal sends it to the whole group, and the parent passes it on.
    """
    stop, wanted = Stop(timeout), set(numbers)
    for number in {signal.SIGINT, *wanted}:
        signal.signal(number, stop._handle if number in wanted else signal.SIG_IGN)
    return stop
