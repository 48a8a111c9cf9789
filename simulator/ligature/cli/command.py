"""Where the commands begin: an interrupt while modules are imported ends them.

Python turns SIGINT into an exception, which is lost where it arrives while the import system releases a lock, or in a
module that passes over errors: one start of 150 that were interrupted went on as if nothing had been said. Commands
import what they need when they need it, so this holds as long as they run.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
from types import FrameType

_IMPORT_SYSTEM = "<frozen importlib._bootstrap>"


def ligature() -> None:
    """The command ``ligature``."""
    _run("ligature.cli.main")


def ambf_simulator() -> None:
    """The command ``ambf_simulator``."""
    _run("ligature.cli.ambf_simulator")


def _run(module: str) -> None:
    _open_streams()
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # ignored, as under nohup, it stays ignored
        signal.signal(signal.SIGINT, _interrupt)
    importlib.import_module(module).main()


def _open_streams() -> None:
    """Lead input, output and errors that are closed, as a service may start a command, to nowhere.

    The first files opened would take their places, and get what is printed.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            open_null(number)
            setattr(sys, name, open(number, "w" if number else "r", encoding="utf-8", closefd=False))  # noqa: SIM115


def open_null(number: int) -> None:
    """Open the null device as the file descriptor ``number``."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    if nowhere != number:
        os.dup2(nowhere, number)
        os.close(nowhere)


def _interrupt(number: int, frame: FrameType | None) -> None:
    """End the process amid an import, as if SIGINT had no handler; elsewhere raise `KeyboardInterrupt`."""
    while frame is not None:
        if frame.f_code.co_filename == _IMPORT_SYSTEM:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        frame = frame.f_back
    raise KeyboardInterrupt
