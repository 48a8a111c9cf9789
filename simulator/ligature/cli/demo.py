"""``ligature demo``: runs the bundled examples that suture by themselves."""

from __future__ import annotations

import runpy
import signal
import subprocess
import sys
from pathlib import Path
from types import FrameType

from rich.console import Console

from ligature.bundle import EXAMPLES
from ligature.cli.command import end_by, take_interrupts
from ligature.cli.sampling import Sampling
from ligature.process import end_with_parent

EXAMPLE = EXAMPLES / "suture.py"


def demo(
    throws: int, seed: int, out: Path, dataset: Path | None, console: Console, episodes: int = 1,
    sampling: Sampling | None = None, tissue: bool = False,
) -> int:  # fmt: skip
    """Run the example, or the one that writes ``dataset`` meanwhile; returns its exit status.

    With ``tissue`` it is the one that sutures soft tissue.
    """
    example = EXAMPLE.with_name("suture_tissue.py") if tissue else EXAMPLE
    if tissue and dataset is not None:
        console.print("--dataset writes sutures through holes; leave out --tissue, or --dataset")
        return 2
    if not example.is_file():
        console.print(f"the demonstration '{example}' is missing; install Ligature again")
        return 2
    if dataset is None:
        count = [] if tissue else ["--throws", str(throws)]
        command = [str(example), *count, "--seed", str(seed), "--out", str(out)]
    else:
        words = [str(dataset), "--throws", str(throws), "--seed", str(seed), "--episodes", str(episodes)]
        words += (sampling or Sampling()).words()
        command = [str(EXAMPLE.with_name("record_dataset.py")), *words]
    return _wait(command)


def _wait(command: list[str]) -> int:
    """Run a Python program to its end; signals go to it, so that it ends in order. Returns a shell's exit status."""
    process: subprocess.Popen[bytes] | None = None

    def forward(number: int, frame: FrameType | None) -> None:
        if process is not None:
            process.send_signal(number)

    before = {number: signal.signal(number, forward) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        process = subprocess.Popen([sys.executable, "-m", "ligature.cli.demo", *command], preexec_fn=end_with_parent)
        status = process.wait()
        return status if status >= 0 else 128 - status
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _play(program: str) -> None:
    """Run a program as Python does; an interrupt ends it without a traceback."""
    take_interrupts()
    sys.path[0] = str(Path(program).parent)
    try:
        runpy.run_path(program, run_name="__main__")
    except KeyboardInterrupt:
        end_by(signal.SIGINT)


if __name__ == "__main__":
    del sys.argv[0]
    _play(sys.argv[0])
