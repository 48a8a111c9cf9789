"""The entry point of the commands: handles interrupts during imports, missing packages, bad paths and full disks.

Python turns SIGINT into an exception, which is lost where it arrives while the import system releases a lock, or in a
module that passes over errors: one start of 150 that were interrupted continued as if nothing had happened. Commands
import what they need when they need it, so this holds as long as they run.
"""

from __future__ import annotations

import errno
import functools
import gc
import importlib
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn

from ligature.limits import shortage, small_memory
from ligature.process import amid_import

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of writing to a full disk."""

GONE = (errno.EPIPE, errno.EIO)
"""Errors of writing to a reader that has seen enough, or to a terminal that was closed."""

LONG = 120
"""Characters of a path that a message quotes."""

LEAST_COLUMNS, MOST_COLUMNS = 40, 1000
"""Of lines that a command prints for a person."""

_NUMBA: dict[str, Callable[[str], bool]] = {
    "NUMBA_DISABLE_JIT": lambda value: value.strip() == "0",
    "NUMBA_NUM_THREADS": lambda value: value.isdecimal() and 0 < int(value) <= (os.cpu_count() or 1),
}
"""Which values of Numba's variables kernels can be compiled with."""

INTERRUPT_TIMEOUT = 1.0
"""Seconds in which the main thread takes an interrupt, wherever it is."""

_TIMEOUT_LOOK = 0.02

_taken = False


def ligature() -> None:
    """The command ``ligature``."""
    _run("ligature.cli.main")


def ambf_simulator() -> None:
    """The command ``ambf_simulator``."""
    _run("ligature.cli.ambf_simulator")


def _run(module: str) -> None:
    _open_streams()
    _correct_settings()
    try:
        _have_logs_of_ros()
        take_interrupts()
        try:
            gc.disable()  # as in `ligature.process`
            main = importlib.import_module(module).main
            gc.freeze()
            gc.enable()
            main()
        finally:
            sys.stdout.flush()  # what waits to be written is written here, where a failure can still be reported
    except ModuleNotFoundError as error:
        from ligature.cli.missing import remedy

        text = remedy(error.name or "")
        if not text:
            raise
        _fail(text)
    except OSError as error:
        _end(error)
    except (MemoryError, RuntimeError, ImportError) as error:
        if text := shortage(error):
            _give_up(text)
        raise
    except KeyboardInterrupt:  # before the command line is read
        end_by(signal.SIGINT)


def take_interrupts() -> None:
    """Have SIGINT end this process wherever it arrives; see above."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # ignored, as under nohup, it stays ignored
        signal.signal(signal.SIGINT, _interrupt)
        _deadline().watch()


class _Deadline(threading.Thread):
    """Ends this process when its main thread has not taken an interrupt in time.

    Python calls handlers between two of its own instructions: a kernel that LLVM compiles meanwhile takes many seconds.
    """

    def __init__(self) -> None:
        super().__init__(name="interrupts", daemon=True)
        self._reader, self._writer = os.pipe2(os.O_CLOEXEC)
        os.set_blocking(self._writer, False)
        self.start()

    def watch(self) -> None:
        """Have Python write the number of every signal that arrives from now on; called in the main thread."""
        signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)

    def run(self) -> None:
        """Read the numbers of signals as they arrive, whatever the main thread does."""
        while numbers := os.read(self._reader, 1):
            if numbers[0] != signal.SIGINT or signal.getsignal(signal.SIGINT) is not _interrupt:
                continue
            deadline = time.monotonic() + INTERRUPT_TIMEOUT
            while not _taken and time.monotonic() < deadline:
                time.sleep(_TIMEOUT_LOOK)
            if not _taken:
                os._exit(128 + signal.SIGINT)


@functools.cache
def _deadline() -> _Deadline:
    """The one of this process."""
    os.register_at_fork(after_in_child=_forget_wakeups)
    return _Deadline()


def _forget_wakeups() -> None:
    """Leave pipe and thread to the parent: what a forked process gets does not concern it."""
    signal.set_wakeup_fd(-1)
    _deadline.cache_clear()


@contextmanager
def ending_in_order() -> Iterator[None]:
    """The first SIGTERM within raises SystemExit, so that the block ends the processes that it has started."""

    def end(number: int, frame: FrameType | None) -> None:
        signal.signal(number, signal.SIG_DFL)
        raise SystemExit(128 + number)

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def end_by(number: int) -> NoReturn:
    """End this process by a signal, without a word."""
    signal.signal(number, signal.SIG_DFL)
    signal.raise_signal(number)
    raise SystemExit(128 + number)


def _end(error: OSError) -> NoReturn:
    """End the command for what a file system reports about a path of the user's, or of what is printed."""
    if text := shortage(error):
        _give_up(text)
    if error.filename is not None:  # too long a name, a full disk, no permission
        name = os.fsdecode(error.filename)
        _fail(f"error: '{name if len(name) < LONG else name[:LONG] + '…'}': {error.strerror}")
    if error.errno not in (*FULL, *GONE):
        raise error
    open_null(1)  # else Python tries at its end once more to write what is left, and fails in its own words
    if error.errno in GONE:
        raise SystemExit(1) from None
    _fail(f"error: the output cannot be written: {error.strerror}")


def _fail(text: str) -> NoReturn:
    from rich.console import Console

    Console(stderr=True, highlight=False, soft_wrap=True).print(text, style="red", markup=False)
    raise SystemExit(2) from None


def _give_up(text: str) -> NoReturn:
    """End the process for want of what printing in colour and an end in order need as well."""
    with suppress(OSError):
        sys.stdout.flush()
    sys.stderr.write(f"{text}\n")
    sys.stderr.flush()
    os._exit(2)


def _correct_settings() -> None:
    """Replace variables of the environment with which a command prints nothing, or cannot compile; report the latter.

    Programs that start others without a terminal often give it 0 columns.
    """
    columns = os.environ.get("COLUMNS", "")
    if columns.isdecimal():
        wide = len(columns) > len(str(MOST_COLUMNS)) or int(columns) > MOST_COLUMNS
        if wide or int(columns) == 0:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = str(max(int(columns), LEAST_COLUMNS))
    for name, usable in _NUMBA.items():
        value = os.environ.get(name)
        if value is not None and not usable(value):
            del os.environ[name]
            sys.stderr.write(f"{name}={value} is passed over: kernels cannot be compiled with it\n")
    if text := small_memory():
        sys.stderr.write(f"{text}\n")


def _open_streams() -> None:
    """Open the null device for standard streams that are closed, as a service may start a command.

    The first files opened would take their places, and get what is printed.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            open_null(number)
            setattr(sys, name, open(number, "w" if number else "r", encoding="utf-8", closefd=False))  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # as errors: a terminal without UTF-8 lacks '³' and names


def _have_logs_of_ros() -> None:
    """Give the logs of ROS a place for a user without a home folder: ROS makes one called ``~`` where one is."""
    if os.path.isabs(os.path.expanduser("~")) or os.environ.get("ROS_HOME") or os.environ.get("ROS_LOG_DIR"):
        return
    from ligature.cache import CacheError, cache_folder

    with suppress(CacheError):
        os.environ["ROS_LOG_DIR"] = str(cache_folder() / "ros")


def open_null(number: int) -> None:
    """Open the null device as the file descriptor ``number``."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    if nowhere != number:
        os.dup2(nowhere, number)
        os.close(nowhere)


def _interrupt(number: int, frame: FrameType | None) -> None:
    """End the process amid an import, as if SIGINT had no handler; elsewhere raise `KeyboardInterrupt`."""
    global _taken
    _taken = True  # no lock: a second signal may interrupt this
    if amid_import(frame):
        end_by(number)
    raise KeyboardInterrupt
