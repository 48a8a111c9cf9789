"""What every process of a run does: end with its parent, end on a signal, tell its parent how it is.

A process tells by lines on standard output: ``@event text``; everything else is a log line.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading

_PR_SET_PDEATHSIG = 1
_prctl = ctypes.CDLL(None).prctl


def end_with_parent() -> None:
    """Ask Linux to terminate this process when its parent dies, also by ``kill -9``.

    Runs between fork and exec too, where nothing may be loaded any more: other threads may have held locks.
    """
    parent = os.getppid()
    _prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        sys.exit(0)


def stop_on_signal() -> threading.Event:
    """An event that SIGTERM sets; SIGINT is left to the parent, which the terminal also tells."""
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return stop


def tell(event: str, text: str = "") -> None:
    """Tell the parent about ``event``."""
    sys.stdout.write(f"@{event} {text}\n")
    sys.stdout.flush()
