"""Records demonstrations of a learning environment's scripted expert as a dataset.

``python examples/record_experts.py OUT.h5 --task reach --episodes 50``; ``ligature dataset export OUT.h5 FOLDER`` makes
a dataset of LeRobot of it. Ctrl-C and SIGTERM keep the episodes that have ended.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from ligature.datasets import DatasetError, DatasetWriter
from ligature.datasets.interrupts import interrupted_once
from ligature.environments import SuturingEnv
from ligature.environments.experts import EXPERTS, Hand
from ligature.environments.suturing import CONTROL

MOST = 400
"""Actions of an episode."""


def demonstrate(env: SuturingEnv, writer: DatasetWriter, task: str, seed: int, noise: float) -> bool:
    """One episode; ``noise`` (of an action) disturbs the expert, which corrects itself. Whether it succeeded.

    A sample is what the environment observes and what the expert does then, without the disturbance.
    """
    observation, info = env.reset(seed=seed)
    rng, hand, why = np.random.default_rng(seed), Hand(env), ""
    disturbance = np.zeros(6)
    try:
        for action in EXPERTS[task](hand, observation):
            writer.sample(task, extra={"environment_state": observation, "expert_action": action})
            disturbance = 0.9 * disturbance + noise * rng.standard_normal(6)
            disturbed = np.append(action[:6] + disturbance, action[6]).astype(np.float32)
            observation, _, ended, cut, info = env.step(disturbed)
            if ended or cut:
                break
    except ValueError as error:
        why = str(error)
    writer.end_episode(info["is_success"], judged=True, seed=seed, why=why or info["lost"])
    return bool(info["is_success"])


def main() -> int:
    """Record, and print how many demonstrations succeeded."""
    arguments = argparse.ArgumentParser(description="Record demonstrations of an environment's scripted expert.")
    arguments.add_argument("out", type=Path, help="HDF5 file")
    arguments.add_argument("--task", choices=sorted(EXPERTS), default="reach")
    arguments.add_argument("--episodes", type=int, default=50)
    arguments.add_argument("--seed", type=int, default=1000, help="of the first episode")
    arguments.add_argument("--noise", type=float, default=0.3, help="that disturbs the expert, as a share of an action")
    arguments.add_argument("--camera", action="append", default=[], help="repeatable; none by default")
    given = arguments.parse_args()
    env = SuturingEnv(given.task, max_steps=MOST)
    begin, done, ended = time.perf_counter(), 0, 0
    try:
        with interrupted_once():
            try:
                with DatasetWriter(
                    given.out, env.simulation, given.camera, (640, 480), 1.0 / CONTROL, (given.task,), env.goal.text,
                    remarks={"source": "scripted expert", "environment": f"ligature/{given.task.capitalize()}-v0"},
                ) as writer:  # fmt: skip
                    for seed in range(given.seed, given.seed + given.episodes):
                        done += demonstrate(env, writer, given.task, seed, given.noise)
                        ended += 1
            except KeyboardInterrupt:
                print("interrupted")
    except (DatasetError, KeyError) as error:
        print(error)
        return 2
    print(f"{given.out}: {done} of {ended} demonstrations succeeded, in {time.perf_counter() - begin:.0f} s")
    return 0 if ended == given.episodes else 130


if __name__ == "__main__":
    sys.exit(main())
