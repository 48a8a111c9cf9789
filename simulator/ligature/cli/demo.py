"""``ligature demo``: runs the bundled example that sutures by itself."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from rich.console import Console

from ligature.bundle import EXAMPLES
from ligature.process import end_with_parent

EXAMPLE = EXAMPLES / "suture.py"


def demo(throws: int, seed: int, out: Path, dataset: Path | None, console: Console) -> int:
    """Run the example, or the one that writes ``dataset`` meanwhile; returns its exit status."""
    if not EXAMPLE.is_file():
        console.print(f"the demonstration '{EXAMPLE}' is missing; install Ligature again")
        return 2
    if dataset is None:
        command = [sys.executable, str(EXAMPLE), "--throws", str(throws), "--seed", str(seed), "--out", str(out)]
    else:
        words = [str(dataset), "--throws", str(throws), "--seed", str(seed)]
        command = [sys.executable, str(EXAMPLE.with_name("record_dataset.py")), *words]
    return subprocess.run(command, check=False, preexec_fn=end_with_parent).returncode
