"""Writers of datasets that are killed: ``python -m tests.datasets.killed_writers FOLDER COUNT SIGNAL SEED``.

Loads a simulation once; each writer is a fork of this process that records short episodes until a signal ends it at a
random time. Prints a line of JSON for each: its dataset, and how many episodes it had reported as ended.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from pathlib import Path

import ligature
import numpy as np
from ligature.datasets import DatasetWriter
from ligature.datasets.interrupts import interrupted_once
from ligature.process import end_with_parent

from tests.waiting import until

SAMPLES = 6


def write(simulation: ligature.Simulation, path: Path, ended: int) -> None:
    """Record episodes without end; a byte through the pipe ``ended`` for each that has ended."""
    try:
        with interrupted_once(), DatasetWriter(path, simulation, cameras=(), rate=500.0) as writer:
            for number in range(10**6):
                for _ in range(SAMPLES):
                    writer.sample()
                    simulation.step(2)
                writer.end_episode(number % 3 == 0, number=number)
                os.write(ended, b".")
    except KeyboardInterrupt:
        os._exit(0)


def kill_one(simulation: ligature.Simulation, path: Path, number: signal.Signals, episodes: int, delay: float) -> int:
    """Fork a writer, send it a signal a while after some episodes; returns how many had ended."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        end_with_parent()
        os.close(reading)
        write(simulation, path, writing)
    os.close(writing)
    dots = b""
    while len(dots) < episodes:
        dots += os.read(reading, 1)
    time.sleep(delay)
    os.kill(child, number)
    _wait(child)
    while piece := os.read(reading, 65536):
        dots += piece
    os.close(reading)
    return len(dots)


def _wait(child: int) -> None:
    """Wait until a writer has ended; one that does not is killed, and reported."""
    try:
        until(lambda: os.waitpid(child, os.WNOHANG)[0], "the writer ends", 30.0)
    except AssertionError as error:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        raise TimeoutError("a writer went on for half a minute after its signal") from error


def main() -> int:
    folder, count, name, seed = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3], int(sys.argv[4])
    scene = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"
    simulation = ligature.Simulation(ligature.load(scene, (3, 4)))
    simulation.step(10)
    rng = np.random.default_rng(seed)
    for k in range(count):
        path = folder / f"killed_{k}.h5"
        episodes, delay = int(rng.integers(0, 6)), float(rng.uniform(0.0, 0.1))
        ended = kill_one(simulation, path, signal.Signals[name], episodes, delay)
        sys.stdout.write(json.dumps({"path": str(path), "ended": ended}) + "\n")
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
