"""Learning on many processes or machines: a search for a policy whose episodes run on Ray workers.

``python examples/scale_out.py --workers 2`` starts a local cluster; ``--address`` joins one that runs, on which
Ligature is installed. The policy is linear: the step of the tool is a matrix (3, 3) times the way to the target. The
search (cross-entropy method; Rubinstein, Methodology and Computing in Applied Probability 1, 1999) knows nothing of
how the arm's base stands in the world: it finds that matrix from rewards alone.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np
import ray
from ligature.environments import SuturingEnv

TIP, TARGET = slice(27, 30), slice(30, 33)
"""Where an observation has these (`ligature.environments.SuturingEnv`)."""


@ray.remote(num_cpus=1)
class Worker:
    """One process with one environment."""

    def __init__(self, task: str, max_steps: int) -> None:
        self._env = SuturingEnv(task, max_steps=max_steps)

    def evaluate(self, policy: np.ndarray, seed: int) -> tuple[float, bool, int]:
        """Total reward of one episode, whether it succeeded, and how many steps it took."""
        observation, _ = self._env.reset(seed=seed)
        total, steps, over, done = 0.0, 0, False, False
        while not over:
            action = np.zeros(7, dtype=np.float32)
            action[:3] = np.clip(policy @ (observation[TARGET] - observation[TIP]), -1.0, 1.0)
            observation, reward, done, cut, _ = self._env.step(action)
            total, steps, over = total + float(reward), steps + 1, done or cut
        return total, done, steps


def search(workers: list[ray.actor.ActorHandle], generations: int, population: int, seed: int) -> np.ndarray:
    """The middle (3, 3) of the best policies of the last generation; prints how each generation did."""
    rng = np.random.default_rng(seed)
    mean, spread = np.zeros((3, 3)), np.full((3, 3), 300.0)
    for generation in range(generations):
        begin = time.perf_counter()
        policies = mean + spread * rng.standard_normal((population, 3, 3))
        pool = ray.util.ActorPool(workers)
        rolls = list(pool.map(lambda worker, job: worker.evaluate.remote(*job), [(p, generation) for p in policies]))
        rewards = np.array([total for total, _, _ in rolls])
        best = policies[np.argsort(rewards)[-max(2, population // 4) :]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 10.0
        steps, took = sum(steps for *_, steps in rolls), time.perf_counter() - begin
        print(
            f"generation {generation}: best reward {rewards.max():.2f}, mean {rewards.mean():.2f}, "
            f"{sum(done for _, done, _ in rolls)} of {population} succeeded, {steps / took:.0f} steps/s"
        )
    return mean


def main() -> int:
    """Search for a policy, and try it on another episode."""
    arguments = argparse.ArgumentParser(description="Search for a policy on Ray workers.")
    arguments.add_argument("--workers", type=int, default=2)
    arguments.add_argument("--address", help="of a Ray cluster that runs; a local one is started otherwise")
    arguments.add_argument("--generations", type=int, default=8)
    arguments.add_argument("--population", type=int, default=24)
    arguments.add_argument("--steps", type=int, default=60, help="most in an episode")
    given = arguments.parse_args()
    if given.address:
        ray.init(address=given.address)
    else:
        ray.init(num_cpus=given.workers, include_dashboard=False, object_store_memory=100_000_000)
    workers = [Worker.remote("reach", given.steps) for _ in range(given.workers)]  # type: ignore[attr-defined]
    policy = search(workers, given.generations, given.population, seed=0)
    reward, done, steps = ray.get(workers[0].evaluate.remote(policy, 1000))
    print(f"the policy found: reward {reward:.2f} in {steps} steps, {'reached' if done else 'not reached'}")
    ray.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
