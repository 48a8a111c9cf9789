"""Sutures as `suture` does, and writes a dataset to learn from: stereo pictures, depth, ids, motion, phases.

``python examples/record_dataset.py OUT.h5 --seed 1 --episodes 3``; read it with ``read_dataset.py``. Ctrl-C and SIGTERM
keep the episodes that have ended.
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
from ligature.datasets.interrupts import interrupted_once
from ligature.tasks import judge_suture

sys.path.insert(0, str(Path(__file__).resolve().parent))
from suture import SCENE, Failure, Surgeon, scatter  # noqa: E402

PHASES = ("prepare", "pick_up", "hand_over", "drive", "pull_out")
"""What a suture is made of: methods of the surgeon."""

GESTURES = {"pick_up": "G12", "hand_over": "G4", "drive": "G3", "pull_out": "G6"}
"""What JIGSAWS calls them: PSM1, on the left, picks up and pulls, PSM2 drives."""

TASK = {
    1: "suture the wound with one throw through the first pair of holes",
    2: "suture the wound with two throws through the first two pairs of holes",
    3: "suture the wound with three throws through the first three pairs of holes",
    4: "suture the wound with four throws through all pairs of holes",
}
"""The instruction by the number of throws."""


def record(writer: DatasetWriter, simulation: ligature.Simulation, throws: int, seed: int) -> bool:
    """Suture from where the simulation is, as one episode; returns whether it succeeded."""
    phase, doers = "", set[str]()

    def labelled(name: str, work: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(work)
        def run(*arguments: Any, **options: Any) -> Any:
            nonlocal phase, doers
            phase, doers = name, {word for word in arguments if isinstance(word, str)} or set(surgeon.arms)
            return work(*arguments, **options)

        return run

    surgeon = Surgeon(simulation, lambda: writer.sample(phase, doers) and None)
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
    measures = monitor.measures().report()
    writer.end_episode(success, judged=True, why=stopped or score.why, throws=throws, seed=seed, **measures)
    return success


def picture_size(text: str) -> tuple[int, int]:
    """Width and height of a text such as ``640x480``."""
    width, _, height = text.partition("x")
    return int(width), int(height)


def main() -> int:
    """Write the dataset and print how many episodes succeeded."""
    arguments = argparse.ArgumentParser(description="Write sutures as a dataset.")
    arguments.add_argument("out", type=Path, help="HDF5 file")
    arguments.add_argument("--throws", type=int, choices=(1, 2, 3, 4), default=1, help="in each episode")
    arguments.add_argument("--episodes", type=int, default=1)
    arguments.add_argument("--seed", type=int, default=0, help="of the first episode; 0 is the needle's own place")
    arguments.add_argument("--rate", type=float, default=10.0, help="samples per second")
    arguments.add_argument("--size", type=picture_size, default=(320, 240), help="of the pictures, such as 640x480")
    arguments.add_argument("--camera", action="append", help="repeatable; by default cameraL and cameraR")
    arguments.add_argument("--no-cameras", action="store_true", help="motion alone")
    given = arguments.parse_args()
    if given.episodes < 1 or given.seed < 0:
        arguments.error("--episodes is at least 1, and --seed at least 0")
    cameras = () if given.no_cameras else tuple(given.camera or ("cameraL", "cameraR"))
    simulation = ligature.Simulation(ligature.load(SCENE))
    start, done, ended, stopped = simulation.snapshot(), 0, 0, 0
    try:
        with interrupted_once():
            try:
                with DatasetWriter(
                    given.out, simulation, cameras, given.size, given.rate, PHASES, TASK[given.throws], GESTURES,
                    {"source": "scripted expert"},
                ) as writer:  # fmt: skip
                    for seed in range(given.seed, given.seed + given.episodes):
                        simulation.restore(start)
                        scatter(simulation, seed)
                        done += record(writer, simulation, given.throws, seed)
                        ended += 1
            except KeyboardInterrupt as interrupt:
                (stopped,) = interrupt.args  # the signal
    except (DatasetError, KeyError, ValueError) as error:
        print(error)
        return 2
    if stopped:
        print(f"interrupted; the {ended} episodes that ended are in {given.out}" if ended else "interrupted")
        return 128 + stopped
    print(f"{given.out}: {done} of {given.episodes} sutures succeeded, {given.out.stat().st_size / 1e6:.1f} MB")
    return 0 if done == given.episodes else 1


if __name__ == "__main__":
    sys.exit(main())
