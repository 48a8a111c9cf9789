"""``ligature demo``: runs the bundled examples that suture by themselves."""

from __future__ import annotations

import runpy
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import FrameType

from rich.console import Console

from ligature.bundle import EXAMPLES
from ligature.cli.command import end_by, take_interrupts
from ligature.cli.sampling import Sampling
from ligature.process import end_with_parent

EXAMPLE = EXAMPLES / "suture.py"
_ENDING = (signal.SIGINT, signal.SIGTERM)

_NAP = 0.05
"""Seconds between two looks at whether the example has ended."""

_LAUNCH = """
import sys
sys.path[:1] = filter(None, sys.path[:1])
import signal
signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT, signal.SIGTERM))
from ligature.cli.demo import play
play()
"""
"""Until an example runs, a signal ends its process without a word. Nothing comes from the folder that one is in."""


def demo(
    throws: int, seed: int, out: Path, dataset: Path | None, console: Console, episodes: int = 1,
    sampling: Sampling | None = None, tissue: bool = False, knot: bool = False,
) -> int:  # fmt: skip
    """Run the example, or the one that writes ``dataset`` meanwhile; returns its exit status.

    With ``tissue`` it is the one that sutures soft tissue, with ``knot`` the one that also makes a knot over it.
    """
    soft = "--knot" if knot else "--tissue" if tissue else ""
    example = EXAMPLE.with_name("close_wound.py" if knot else "suture_tissue.py") if soft else EXAMPLE
    if soft and dataset is not None:
        console.print(f"--dataset writes sutures through holes; leave out {soft}, or --dataset", markup=False)
        return 2
    if not example.is_file():
        console.print(f"the demonstration '{example}' is missing; install Ligature again", markup=False)
        return 2
    if dataset is None:
        count = [] if soft else ["--throws", str(throws)]
        command = [str(example), *count, "--seed", str(seed), "--out", str(out)]
    else:
        words = [str(dataset), "--throws", str(throws), "--seed", str(seed), "--episodes", str(episodes)]
        words += (sampling or Sampling()).words()
        command = [str(EXAMPLE.with_name("record_dataset.py")), *words]
    return _wait(command)


def _wait(command: list[str]) -> int:
    """Run a Python program to its end; signals go to it, so that it ends in order. Returns a shell's exit status."""
    process: subprocess.Popen[bytes] | None = None
    early: list[int] = []

    def forward(number: int, frame: FrameType | None) -> None:
        if process is None:
            early.append(number)
        else:
            process.send_signal(number)

    before = {number: signal.signal(number, forward) for number in _ENDING}
    try:
        signal.pthread_sigmask(signal.SIG_BLOCK, _ENDING)  # in the new process, until it can take them
        process = subprocess.Popen([sys.executable, "-c", _LAUNCH, *command], preexec_fn=end_with_parent)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDING)
        for number in early:
            process.send_signal(number)
        while (status := process.poll()) is None:
            time.sleep(_NAP)  # a signal that another thread takes does not end a wait of the main thread
        return status if status >= 0 else 128 - status
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def play() -> None:
    """Run the program that the arguments name as Python does; an interrupt ends it without a traceback."""
    del sys.argv[0]
    sys.path.insert(0, str(Path(sys.argv[0]).parent))
    signal.signal(signal.SIGINT, signal.default_int_handler)
    take_interrupts()
    try:
        runpy.run_path(sys.argv[0], run_name="__main__")
    except KeyboardInterrupt as interrupt:
        end_by(interrupt.args[0] if interrupt.args else signal.SIGINT)
