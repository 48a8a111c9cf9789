"""Records demonstrations of a learning environment's scripted expert as a dataset.

``python examples/record_experts.py OUT.h5 --task reach --episodes 50``; ``ligature dataset export OUT.h5 FOLDER`` makes
a dataset of LeRobot of it. With ``--randomise FILE`` each episode draws another world, and has it as the attribute
``randomisation``. Ctrl-C and SIGTERM keep the episodes that have ended.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
from ligature.datasets import DatasetError, DatasetWriter
from ligature.datasets.interrupts import interrupted_once
from ligature.environments import Randomisation, SuturingEnv, env_id
from ligature.environments.experts import EXPERTS, demonstrate
from ligature.environments.goals import GOALS, FirstThrow, KnotTie, Suture
from ligature.environments.suturing import CONTROL

MOST = 400
"""Actions of an episode, where the task's own do not need more."""

PHASES = {"insert": "drive", "puncture": "drive", "pick": "pick_up", "pull_through": "pull_out"}
"""What a task of one phase is, where it is not called as the task."""

GESTURES = {
    "pick_up": "G12",
    "hand_over": "G4",
    "drive": "G3",
    "pull_out": "G6",
    "reach_for_it": "G14",
    "tighten": "G7",
}
"""What JIGSAWS calls phases: PSM1, on the left, picks up and pulls, PSM2 drives, and takes and draws the thread."""

SEVERAL = {
    "suture": ("drive", "take", "pull_out"), "first_throw": ("wrap", "reach_for_it", "tighten"),
    "knot_tie": ("first_throw", "second_throw", "tighten"),
}  # fmt: skip
"""The phases of tasks that have several."""

NEAR = 0.035
"""Metres from where the throw is to be within which the second arm reaches for the thread."""


def phases(task: str) -> tuple[str, ...]:
    """What a demonstration of a task is made of."""
    return SEVERAL.get(task, (PHASES.get(task, task),))


def phase(env: SuturingEnv) -> tuple[str, list[str]]:
    """What is done now, and the arms that do it."""
    arms = [arm.name for arm in env.arms]
    if isinstance(env.goal, FirstThrow):
        return _throwing(env, env.goal, arms)
    if isinstance(env.goal, KnotTie):
        return phases(env.task)[env.goal.made], arms
    if not isinstance(env.goal, Suture):
        return phases(env.task)[0], arms
    driver, puller = arms
    if not env.goal.driven:
        return "drive", [driver]
    return ("pull_out", [puller]) if env.goal.taken else ("take", arms)


def _throwing(env: SuturingEnv, goal: FirstThrow, arms: list[str]) -> tuple[str, list[str]]:
    """What is done now while a throw is made, and the arms that do it."""
    if goal.holds(1) and not goal.holds(0):
        return "tighten", arms[1:]
    if goal.holds(1) or np.linalg.norm(env.tool_positions[1] - goal.target()) < NEAR:
        return "reach_for_it", arms
    return "wrap", arms[:1]


def record(env: SuturingEnv, writer: DatasetWriter, seed: int, noise: float, pictures: bool = False) -> bool:
    """One episode, with what the environment observes and what the expert does then; whether it succeeded."""

    def look(observation: np.ndarray, action: np.ndarray) -> None:
        writer.follow(env.simulation)  # with some ranges each reset makes another one
        if pictures:
            env.dress()
        name, arms = phase(env)
        writer.sample(name, arms, extra={"environment_state": observation, "expert_action": action})

    try:
        _, info = demonstrate(env, seed, noise, look)
    except ValueError as error:
        writer.end_episode(False, judged=True, seed=seed, why=str(error), **drawn(env))
        return False
    writer.end_episode(info["is_success"], judged=True, seed=seed, why=info["lost"], **drawn(env))
    return bool(info["is_success"])


def drawn(env: SuturingEnv) -> dict[str, str]:
    """What was drawn for an episode, as a remark of a dataset."""
    return {"randomisation": json.dumps(env.randomisation)} if env.randomisation else {}


def unseen(ranges: Randomisation | None) -> str:
    """A range of the sensor, which pictures of a dataset do not show; empty without."""
    names = ("exposure", "picture_noise")
    return next((name for name in names if ranges is not None and getattr(ranges, name) is not None), "")


def main() -> int:
    """Record, and print how many demonstrations succeeded."""
    arguments = argparse.ArgumentParser(description="Record demonstrations of an environment's scripted expert.")
    arguments.add_argument("out", type=Path, help="HDF5 file")
    arguments.add_argument("--task", choices=sorted(EXPERTS), default="reach")
    arguments.add_argument("--episodes", type=int, default=50)
    arguments.add_argument("--seed", type=int, default=1000, help="of the first episode")
    arguments.add_argument(
        "--noise", type=float, default=0.2, help="the most that disturbs the expert, as a share of an action"
    )
    arguments.add_argument("--camera", action="append", default=[], help="repeatable; none by default")
    arguments.add_argument("--randomise", type=Path, help="YAML file of ranges from which every episode draws")
    given = arguments.parse_args()
    if given.episodes < 1 or given.seed < 0 or not 0.0 <= given.noise <= 1.0:
        arguments.error("--episodes is at least 1, --seed at least 0, and --noise from 0 to 1")
    try:
        ranges = Randomisation.of(given.randomise)
    except ValueError as error:
        arguments.error(str(error))
    if given.camera and unseen(ranges):
        arguments.error(f"pictures of a dataset do not show '{unseen(ranges)}'; leave it out of {given.randomise}")
    most, steps = max(MOST, GOALS[given.task].steps), phases(given.task)
    env = SuturingEnv(given.task, max_steps=most, randomise=ranges)
    begin, done, ended, stopped = time.perf_counter(), 0, 0, 0
    try:
        with interrupted_once():
            try:
                with DatasetWriter(
                    given.out, env.simulation, given.camera, (640, 480), 1.0 / CONTROL, steps, env.goal.text,
                    {name: GESTURES[name] for name in steps if name in GESTURES},
                    remarks={"source": "scripted expert", "environment": env_id(given.task)},
                ) as writer:  # fmt: skip
                    for seed in range(given.seed, given.seed + given.episodes):
                        done += record(env, writer, seed, given.noise, bool(given.camera))
                        ended += 1
            except KeyboardInterrupt as interrupt:
                (stopped,) = interrupt.args  # the signal
                print("interrupted")
    except (DatasetError, KeyError, ValueError) as error:
        print(error)
        return 2
    print(f"{given.out}: {done} of {ended} demonstrations succeeded, in {time.perf_counter() - begin:.0f} s")
    return 128 + stopped if stopped else 0


if __name__ == "__main__":
    sys.exit(main())
