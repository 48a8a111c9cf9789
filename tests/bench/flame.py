"""Where the time of a tick goes, as a flame graph: ``python -m tests.bench.flame [SCENE] [SECONDS]``.

Writes ``docs/pictures/bench_flame.svg``: samples of Python, of compiled kernels and of Bullet, by py-spy, while the scene
(by default `suturing`) runs at 200 updates a second after it has settled. A kernel that Numba has compiled has no
name there: it belongs to the Python function that calls it.
"""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
import sys
from pathlib import Path

import ligature

from tests.bench import ledger

SETTLED, UPDATE = 1000, 5
"""Ticks before the first sample, and ticks of an update."""

SECONDS, RATE = 10, 500
"""Time on the clock of all samples, and samples a second."""

PR_SET_PTRACER, ANY = 0x59616D61, -1
"""Linux: allows other processes of this user to look at this one (prctl(2))."""


def record(scene: str, seconds: int, path: Path) -> None:
    """Step ``scene`` while py-spy samples this process, and write the flame graph to ``path``."""
    simulation = ligature.Simulation(ligature.load(scene))
    simulation.step(SETTLED)
    ctypes.CDLL(None).prctl(PR_SET_PTRACER, ctypes.c_long(ANY), 0, 0, 0)
    spy = Path(sys.executable).with_name("py-spy")
    words = [spy, "record", "--native", "--function", "--rate", str(RATE), "--duration", str(seconds)]
    sampler = subprocess.Popen([*words, "--pid", str(os.getpid()), "--output", path], stdout=subprocess.DEVNULL)
    while sampler.poll() is None:
        simulation.step(UPDATE)
    simulation.close()
    if sampler.returncode:
        raise SystemExit(f"py-spy ended with status {sampler.returncode}")
    # py-spy takes its own command line, with the paths of this machine, for the title
    title = f"{scene}, {seconds} s at {1000 // UPDATE} updates a second"
    drawn = path.read_text(encoding="utf-8")
    path.write_text(re.sub(r"[^<>]*py-spy record [^<]*", title, drawn, count=1), encoding="utf-8")


def main() -> int:
    """Entry point."""
    scene = sys.argv[1] if len(sys.argv) > 1 else "suturing"
    path = ledger.ROOT / "docs" / "pictures" / "bench_flame.svg"
    record(scene, int(sys.argv[2]) if len(sys.argv) > 2 else SECONDS, path)
    sys.stdout.write(f"{scene}: {path.relative_to(ledger.ROOT)}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
