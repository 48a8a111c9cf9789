"""Learning on many processes or machines: workers of Ray roll episodes, from which a policy is trained, in rounds.

``python examples/scale_out.py pick POLICY.onnx --workers 2`` starts a local cluster; ``--address`` joins one that runs,
on which Ligature is installed. In the first round the scripted expert shows the task, disturbed; in each later one the
policy of the round before acts, and the expert says at each step what it would do (DAgger; Ross, Gordon and Bagnell,
International Conference on Artificial Intelligence and Statistics 2011). ``ligature evaluate`` measures the policy.

A worker that is lost is replaced, and its episode rolled again. After each round ``POLICY.npz`` has all samples, and
``--resume`` goes on from there. An episode follows from seed and policy: neither changes what is learnt.
It needs ``pip install 'ligature-sim[train]' ray==2.44.1``.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

try:
    import numpy as np
    import ray
    from ligature.environments import MAX_STEPS, SuturingEnv
    from ligature.environments.experts import CORRECTING, demonstrate
    from ligature.environments.layout import ACTION, STATE
    from ligature.environments.policies import Policy, load_policy
except ModuleNotFoundError as missing:
    sys.exit(f"{missing}; run: pip install 'ligature-sim[learn,train]' ray==2.44.1")

SEEDS = 10_000
"""Seeds that a seed of the training has; those of evaluations begin at 1 000 000."""


class Episode(NamedTuple):
    """Observations (n, k), what the expert does there (n, 7), success, and the process that rolled it."""

    observations: np.ndarray
    actions: np.ndarray
    success: bool
    process: int


class Samples(NamedTuple):
    """What training goes on with: all samples, their rounds and episodes, and the bytes of the network learnt."""

    observations: np.ndarray
    actions: np.ndarray
    rounds: int
    episodes: int
    network: np.ndarray

    @classmethod
    def load(cls, path: Path) -> Samples:
        """What `save` wrote."""
        with np.load(path) as found:
            data = {name: found[name] for name in cls._fields}
        return cls(**data | {"rounds": int(data["rounds"]), "episodes": int(data["episodes"])})

    def save(self, path: Path) -> None:
        """Write all, or, where this is killed, nothing."""
        part = path.with_name(path.name + ".part")
        with part.open("wb") as file:
            np.savez(file, **self._asdict())
        part.replace(path)


NOTHING = Samples(np.empty((0, STATE), "f4"), np.empty((0, ACTION), "f4"), 0, 0, np.empty(0, "u1"))


def roll(env: SuturingEnv, policy: Policy | None, seed: int, noise: float) -> Episode:
    """One episode of the expert, or of a policy that it corrects."""
    seen: list[tuple[np.ndarray, np.ndarray]] = []

    def look(observation: np.ndarray, action: np.ndarray) -> None:
        seen.append((np.asarray(observation, np.float32), np.clip(action, -1.0, 1.0).astype(np.float32)))

    _, info = demonstrate(env, seed, noise, look, None if policy is None else policy(env, seed), slips=True)
    observations, actions = map(np.stack, zip(*seen, strict=True))
    return Episode(observations, actions, bool(info["is_success"]), os.getpid())


@ray.remote(num_cpus=1, max_restarts=-1, max_task_retries=-1)
class Worker:
    """One process with one environment, which Ray starts anew wherever it ends."""

    def __init__(self, task: str, noise: float) -> None:
        self._env, self._noise = SuturingEnv(task, max_steps=MAX_STEPS), noise
        self._policy: tuple[int, Policy | None] = 0, None

    def process(self) -> int:
        """Its number, once it can roll."""
        return os.getpid()

    def roll(self, rounds: int, network: np.ndarray, seed: int) -> Episode:
        """One episode with what was learnt in so many ``rounds``."""
        if self._policy[0] != rounds:
            self._policy = rounds, _loaded(network)
        return roll(self._env, self._policy[1], seed, self._noise)


def _loaded(network: np.ndarray) -> Policy:
    with tempfile.NamedTemporaryFile(suffix=".onnx") as file:
        file.write(network.tobytes())
        file.flush()
        return load_policy(file.name)


def collect(workers: list[Any], rounds: int, network: np.ndarray, seeds: range) -> list[Episode]:
    """Episodes in the order of their seeds."""
    everywhere = ray.put(network)
    return list(ray.util.ActorPool(workers).map(lambda w, seed: w.roll.remote(rounds, everywhere, seed), list(seeds)))


def learn(given: argparse.Namespace, workers: list[Any], samples: Samples) -> None:
    """All rounds that are not yet done."""
    from train_bc import save, train  # after the command is read: torch takes seconds

    known, begin = set(ray.get([worker.process.remote() for worker in workers])), time.perf_counter()
    while samples.rounds < given.rounds:
        first = given.seed * SEEDS + samples.episodes
        count = given.episodes if samples.rounds else given.first or given.episodes
        rolled = collect(workers, samples.rounds, samples.network, range(first, first + count))
        lost = {e.process for e in rolled} - known
        known |= lost
        observations = np.concatenate([samples.observations, *(e.observations for e in rolled)])
        actions = np.concatenate([samples.actions, *(e.actions for e in rolled)])
        save(train(observations, actions, given.epochs, given.seed), given.policy, observations.shape[1])
        shown, share = samples.episodes, sum(e.success for e in rolled) / len(rolled)
        network = np.frombuffer(given.policy.read_bytes(), np.uint8)
        samples = Samples(observations, actions, samples.rounds + 1, shown + len(rolled), network)
        samples.save(given.policy.with_suffix(".npz"))
        print(
            f"round {samples.rounds}: {f'a policy of {shown} episodes' if shown else 'the expert, disturbed,'} "
            f"succeeded in {share:.0%} of {len(rolled)}, {len(observations)} samples, "
            f"{time.perf_counter() - begin:.0f} s{f'; {len(lost)} workers replaced' if lost else ''}",
            flush=True,
        )
        if shown:
            with given.policy.with_suffix(".csv").open("a", newline="") as table:
                csv.writer(table).writerow([shown, share, len(rolled)])


def main() -> int:
    """Train a policy in rounds."""
    arguments = argparse.ArgumentParser(description="Train a policy from episodes of Ray workers.")
    arguments.add_argument("task", choices=CORRECTING)
    arguments.add_argument("policy", type=Path, help="ONNX file to write")
    arguments.add_argument("--workers", type=int, default=2)
    arguments.add_argument("--address", help="of a Ray cluster that runs; a local one is started otherwise")
    arguments.add_argument("--rounds", type=int, default=6)
    arguments.add_argument("--episodes", type=int, default=40, help="of a round")
    arguments.add_argument("--first", type=int, help="episodes of the first round, in which the expert shows the task")
    arguments.add_argument("--epochs", type=int, default=60, help="of training after each round")
    arguments.add_argument("--noise", type=float, default=0.2, help="that disturbs the expert, as a share of an action")
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--resume", action="store_true", help="go on after the last round that POLICY.npz has")
    given = arguments.parse_args()
    counts = (given.workers, given.rounds, given.episodes, given.epochs, 1 if given.first is None else given.first)
    if min(counts) < 1 or given.seed < 0 or not 0.0 <= given.noise <= 1.0:
        arguments.error(
            "--workers, --rounds, --episodes, --epochs and --first are at least 1, --seed is at least 0, and --noise "
            "from 0 to 1"
        )
    kept = given.policy.with_suffix(".npz")
    if given.resume and not kept.is_file():
        print(f"nothing to resume: no file {kept}")
        return 2
    if given.address:
        ray.init(address=given.address)
    else:
        ray.init(num_cpus=given.workers, include_dashboard=False, object_store_memory=200_000_000)
    try:
        workers = [Worker.remote(given.task, given.noise) for _ in range(given.workers)]  # type: ignore[attr-defined]
        if not given.resume:
            given.policy.with_suffix(".csv").unlink(missing_ok=True)
        learn(given, workers, Samples.load(kept) if given.resume else NOTHING)
    finally:
        ray.shutdown()
    print(f"{given.policy}: measure it with 'ligature evaluate {given.policy} --env {given.task}'")
    return 0


if __name__ == "__main__":
    sys.exit(main())
