"""Where the commands begin: an interrupt while modules are imported ends them.

Python turns SIGINT into an exception, which is lost where it arrives while the import system releases a lock, or in a
module that passes over errors: one start of 150 that were interrupted went on as if nothing had been said.
"""

from __future__ import annotations

import importlib
import signal


def ligature() -> None:
    """The command ``ligature``."""
    _run("ligature.cli.main")


def ambf_simulator() -> None:
    """The command ``ambf_simulator``."""
    _run("ligature.cli.ambf_simulator")


def _run(module: str) -> None:
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:  # ignored, as under nohup, it stays ignored
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    main = importlib.import_module(module).main
    signal.signal(signal.SIGINT, before)
    main()
