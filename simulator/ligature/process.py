"""What every process of a run does: end with its parent, report to its parent.

A process reports by lines on standard output: ``@event text``; everything else is a log line.
"""

from __future__ import annotations

import ctypes
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

REPEAT = 2.0
"""Seconds between two reports of the same: a client may repeat what fails a thousand times a second."""

_GROUP_TRIES, _GROUP_PAUSE = 4, 0.11

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
_IMPORT_SYSTEM = "<frozen importlib._bootstrap>"
_PR_SET_PDEATHSIG = 1
_prctl = ctypes.CDLL(None).prctl

_CALL = (
    "import gc, sys; gc.disable(); sys.path[:1] = filter(None, sys.path[:1]); del sys.argv[0]; "
    "module = __import__(sys.argv[0], fromlist=['main']); gc.freeze(); gc.enable(); module.main()"
)
"""Nothing that an import makes is garbage: to look for it takes a tenth of the time."""


def program(module: str, *words: str) -> list[str]:
    """The command by which a new process of this Python calls ``main`` of ``module``, with ``words`` as arguments.

    ``python -m`` would import from the working folder first: there may be a scene of others, with a ``yaml.py``.
    """
    return [sys.executable, "-c", _CALL, module, *words]


def end_with_parent(parent: int | None = None) -> None:
    """Ask Linux to terminate this process when its parent dies, also by ``kill -9``.

    ``parent`` is its process id, as the parent itself passed it on: one that died before this call is noticed, too.
    Runs between fork and exec too, where nothing may be loaded any more: other threads may have held locks.
    """
    parent = os.getppid() if parent is None else parent
    _prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        sys.exit(0)


def amid_import(frame: FrameType | None) -> bool:
    """Whether ``frame`` was called by the import system, which loses what a handler raises while it releases a lock."""
    while frame is not None:
        if frame.f_code.co_filename == _IMPORT_SYSTEM:
            return True
        frame = frame.f_back
    return False


@contextmanager
def signals_held() -> Iterator[None]:
    """Signals that end this process wait until the block has ended, and with it the files that it writes.

    For blocks of milliseconds; they may be nested. On other threads than the main one, which alone sets handlers, it
    has no effect.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []

    def hold(number: int, frame: FrameType | None) -> None:
        arrived.append(number)

    before = {number: signal.getsignal(number) for number in _ENDING}
    heard = {number: handler for number, handler in before.items() if handler not in (signal.SIG_IGN, None)}
    if callable(timer := signal.getsignal(signal.SIGALRM)):  # an interrupt tries again; else it ends what hangs
        heard[signal.SIGALRM] = timer
    try:
        for number in heard:
            signal.signal(number, hold)
        yield
    finally:
        for number, handler in heard.items():
            signal.signal(number, handler)
        if arrived:
            signal.raise_signal(arrived[0])


def lower_priority(nice: int) -> None:
    """Take the processor only where others leave it; runs between fork and exec too.

    Linux shares the processor among sessions first where its automatic groups are on, as on most desktops: within a
    session of its own a process is alone, and nice to nobody, unless the group's priority is lowered too.
    """
    os.nice(nice)
    for _ in range(_GROUP_TRIES):
        try:
            group = os.open("/proc/self/autogroup", os.O_WRONLY)
            try:
                os.write(group, str(nice).encode())
            finally:
                os.close(group)
            return
        except BlockingIOError:  # one who is not root may do so ten times a second
            time.sleep(_GROUP_PAUSE)
        except OSError:  # a kernel without such groups
            return


def run_in_real_time() -> bool:
    """Have this thread, and none that it starts, run before all ordinary ones; whether that was allowed.

    Linux allows it to root, and to users with ``rtprio`` in /etc/security/limits.conf, as machines of the dVRK have
    it. A thread that never sleeps would stop the machine; Linux leaves a twentieth of the time to all others.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1))
    except OSError:
        return False
    return True


@contextmanager
def scheduled_as_before() -> Iterator[None]:
    """After the block, Linux schedules all threads as it did before, and new ones as it does most.

    For libraries that meddle with it: SVT-AV1 gives root's threads, the caller's too, the highest real-time priority.
    """
    before = _schedules()
    try:
        yield
    finally:
        ordinary = os.SCHED_OTHER, os.sched_param(0)
        for thread, (policy, param) in _schedules().items():
            was = before.get(thread, ordinary)
            if (policy, param.sched_priority) != (was[0], was[1].sched_priority):
                with suppress(OSError):  # it has ended
                    os.sched_setscheduler(thread, *was)


def _schedules() -> dict[int, tuple[int, os.sched_param]]:
    """Scheduling policy and parameters of each thread of this process by its number."""
    found = {}
    for thread in map(int, os.listdir("/proc/self/task")):
        with suppress(OSError):  # it has ended
            found[thread] = os.sched_getscheduler(thread), os.sched_getparam(thread)
    return found


class Reported:
    """What was reported within the last ``REPEAT`` seconds."""

    def __init__(self) -> None:
        self._times: dict[str, float] = {}

    def is_new(self, text: str, now: float) -> bool:
        """Whether ``text`` is to be reported at ``now`` (s, monotonic), which counts as done then."""
        if now - self._times.get(text, -math.inf) < REPEAT:
            return False
        self._times = {other: at for other, at in self._times.items() if now - at < REPEAT} | {text: now}
        return True


def ending(status: int) -> str:
    """How a process ended, by its ``status`` as Python has it: below zero the number of a signal."""
    return f"was ended by {signal.Signals(-status).name}" if status < 0 else f"ended with status {status}"


def report(event: str, text: str = "") -> None:
    """Report ``event`` to the parent; names of files may hold what is not UTF-8."""
    sys.stdout.write(f"@{event} {text}\n".encode("utf-8", "backslashreplace").decode())
    sys.stdout.flush()
