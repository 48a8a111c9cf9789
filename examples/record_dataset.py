"""Sutures as `suture` does, and writes a dataset to learn from: stereo pictures, depth, ids, motion, phases.

``python examples/record_dataset.py OUT.h5 --seed 1 --episodes 3``; read it with ``read_dataset.py``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import ligature
from ligature.datasets import DatasetError, DatasetWriter
from ligature.tasks import judge_suture

sys.path.insert(0, str(Path(__file__).resolve().parent))
from suture import SCENE, Failure, Surgeon, scatter  # noqa: E402

PHASES = ("prepare", "pick_up", "hand_over", "drive", "pull_out")
"""What a suture is made of: methods of the surgeon."""


def record(writer: DatasetWriter, simulation: ligature.Simulation, throws: int) -> bool:
    """Suture from where the simulation is, as one episode; returns whether it succeeded."""
    phase = ""

    def labelled(name: str, work: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(work)
        def run(*arguments: Any, **options: Any) -> Any:
            nonlocal phase
            phase = name
            return work(*arguments, **options)

        return run

    surgeon = Surgeon(simulation, lambda: writer.sample(phase) and None)
    for name in PHASES:
        setattr(surgeon, name, labelled(name, getattr(surgeon, name)))
    surgeon.wait(0.3)
    stopped = ""
    try:
        surgeon.suture(tuple(range(1, throws + 1)))
    except Failure as failure:
        stopped = str(failure)
    monitor, poses = surgeon.monitor, simulation.state["body_pose"][0]
    score = judge_suture(monitor.scenery, poses, monitor.passages, simulation.time, throws)
    success = score.success and not stopped
    writer.end_episode(success, why=stopped or score.why, throws=throws)
    return success


def main() -> int:
    """Write the dataset and print how many episodes succeeded."""
    arguments = argparse.ArgumentParser(description="Write sutures as a dataset.")
    arguments.add_argument("out", type=Path, help="HDF5 file")
    arguments.add_argument("--throws", type=int, default=1, help="in each episode")
    arguments.add_argument("--episodes", type=int, default=1)
    arguments.add_argument("--seed", type=int, default=0, help="of the first episode; 0 is the needle's own place")
    arguments.add_argument("--rate", type=float, default=10.0, help="samples per second")
    given = arguments.parse_args()
    simulation = ligature.Simulation(ligature.load(SCENE))
    start, done = simulation.snapshot(), 0
    try:
        with DatasetWriter(given.out, simulation, rate=given.rate, phases=PHASES) as writer:
            for seed in range(given.seed, given.seed + given.episodes):
                simulation.restore(start)
                scatter(simulation, seed)
                done += record(writer, simulation, given.throws)
    except DatasetError as error:
        print(error)
        return 2
    print(f"{given.out}: {done} of {given.episodes} sutures succeeded, {given.out.stat().st_size / 1e6:.1f} MB")
    return 0 if done == given.episodes else 1


if __name__ == "__main__":
    sys.exit(main())
