"""Clones the behaviour of a dataset's demonstrations: a small network in numpy that turns observations into actions.

``python examples/train_bc.py FOLDER --task reach`` reads what ``ligature dataset export`` made of a dataset of
``record_experts.py``, trains on its split ``train``, and tries the policy in the environment with seeds that no
demonstration has. The network is a perceptron with two hidden layers, trained by Adam (Kingma and Ba, ICLR 2015) on the
mean squared error of actions.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from ligature.environments import SuturingEnv
from ligature.model.frames import pose7_matrix
from numpy.typing import NDArray

Array = NDArray[np.float64]
HELD_OUT = 500_000
"""The first seed of evaluation."""


def features(observation: Array) -> Array:
    """What the network sees of a state observation (52,) (`ligature.environments.SuturingEnv`).

    Ways from the tool to needle, target and set-point in centimetres, orientations as axes, jaw and marks.
    """
    o = np.asarray(observation, dtype=float)
    tip, ahead, needle = pose7_matrix(o[7:14]), pose7_matrix(o[41:48]), pose7_matrix(o[14:21])
    behind = ahead[:3, :3].T @ tip[:3, :3]
    return np.concatenate([
        100.0 * (o[30:33] - o[27:30]), 100.0 * (needle[:3, 3] - o[27:30]), 100.0 * (ahead - tip)[:3, 3],
        100.0 * tip[:3, 3], needle[:3, :2].ravel(), tip[:3, :2].ravel(), behind[[0, 0, 1], [1, 2, 2]],
        100.0 * needle[2:3, 3], o[[6, 48]], o[49:52],
    ])  # fmt: skip


class Network:
    """A perceptron with standardised input, two hidden layers of tanh, and Adam."""

    def __init__(self, seen: Array, wanted: Array, hidden: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self._mean, self._scale = seen.mean(axis=0), seen.std(axis=0) + 1e-3
        sizes = (seen.shape[1], hidden, hidden, wanted.shape[1])
        self._weights = [
            [rng.standard_normal((a, b)) / np.sqrt(a), np.zeros(b)] for a, b in zip(sizes, sizes[1:], strict=False)
        ]
        self._first = [[np.zeros_like(w) for w in layer] for layer in self._weights]
        self._second = [[np.zeros_like(w) for w in layer] for layer in self._weights]
        self._steps = 0

    def __call__(self, seen: Array) -> Array:
        """Actions (n, 7) for what is seen (n, features)."""
        return self._layers(seen)[-1]

    def _layers(self, seen: Array) -> list[Array]:
        found = [(seen - self._mean) / self._scale]
        for number, (W, b) in enumerate(self._weights):
            sums = found[-1] @ W + b
            found.append(np.tanh(sums) if number < len(self._weights) - 1 else sums)
        return found

    def learn(self, seen: Array, wanted: Array, rate: float) -> float:
        """One step of Adam on a batch; returns the mean squared error before it."""
        layers = self._layers(seen)
        error = layers[-1] - wanted
        slope = 2.0 * error / error.size
        self._steps += 1
        for number in reversed(range(len(self._weights))):
            below = layers[number]
            gradients = [below.T @ slope, slope.sum(axis=0)]
            slope = (slope @ self._weights[number][0].T) * (1.0 - below**2)
            for k, gradient in enumerate(gradients):
                first, second = self._first[number][k], self._second[number][k]
                first += 0.1 * (gradient - first)
                second += 0.001 * (gradient**2 - second)
                unbiased = first / (1.0 - 0.9**self._steps)
                spread = np.sqrt(second / (1.0 - 0.999**self._steps)) + 1e-8
                self._weights[number][k] -= rate * unbiased / spread
        return float(np.mean(error**2))


def demonstrations(folder: Path, split: str) -> tuple[Array, Array]:
    """What is seen and what the expert does in all samples of a split."""
    info = json.loads((folder / "meta" / "info.json").read_text())
    begin, end = map(int, info["splits"][split].split(":"))
    tables = [pq.read_table(path) for path in sorted((folder / "data").glob("*/*.parquet"))]
    seen, wanted = [], []
    for table in tables:
        number = np.array(table["episode_index"])
        chosen = table.filter((number >= begin) & (number < end))
        seen += [features(np.array(row)) for row in chosen["observation.environment_state"].to_pylist()]
        wanted += chosen["extra.expert_action"].to_pylist()
    return np.array(seen), np.clip(np.array(wanted, dtype=float), -1.0, 1.0)


def train(seen: Array, wanted: Array, hidden: int, epochs: int, seed: int) -> Network:
    """A network that does what is wanted; prints the error now and then."""
    network, rng = Network(seen, wanted, hidden, seed), np.random.default_rng(seed)
    for epoch in range(epochs):
        order, rate = rng.permutation(len(seen)), 2e-3 * 0.5 * (1.0 + np.cos(np.pi * epoch / epochs))
        errors = [
            network.learn(seen[part], wanted[part], rate) for part in np.array_split(order, len(order) // 128 + 1)
        ]
        if epoch % max(1, epochs // 5) == 0 or epoch == epochs - 1:
            print(f"epoch {epoch}: error {np.mean(errors):.4f}")
    return network


def evaluate(network: Network, task: str, episodes: int) -> int:
    """How many episodes of held-out seeds the policy does."""
    env, done = SuturingEnv(task, max_steps=400), 0
    for seed in range(HELD_OUT, HELD_OUT + episodes):
        observation, info = env.reset(seed=seed)
        ended = cut = False
        while not (ended or cut):
            action = network(features(observation)[None])[0]
            observation, _, ended, cut, info = env.step(np.clip(action, -1.0, 1.0).astype(np.float32))
        done += info["is_success"]
    env.close()
    return done


def main() -> int:
    """Train and evaluate."""
    arguments = argparse.ArgumentParser(description="Clone the behaviour of demonstrations.")
    arguments.add_argument("folder", type=Path, help="dataset of LeRobot v3.0")
    arguments.add_argument("--task", default="reach")
    arguments.add_argument("--epochs", type=int, default=60)
    arguments.add_argument("--hidden", type=int, default=128)
    arguments.add_argument("--episodes", type=int, default=50, help="of the evaluation")
    arguments.add_argument("--seed", type=int, default=0)
    given = arguments.parse_args()
    try:
        seen, wanted = demonstrations(given.folder, "train")
    except (OSError, KeyError) as error:
        print(f"'{given.folder}' is no LeRobot v3.0 export of record_experts.py: {error!r}")
        return 2
    begin = time.perf_counter()
    network = train(seen, wanted, given.hidden, given.epochs, given.seed)
    took, begin = time.perf_counter() - begin, time.perf_counter()
    done = evaluate(network, given.task, given.episodes)
    # Wilson's interval of 95 %
    n, p, z = given.episodes, done / given.episodes, 1.96
    middle, half = p + z * z / (2 * n), z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    low, high = ((middle + sign * half) / (1 + z * z / n) for sign in (-1, 1))
    print(
        f"{done} of {n} episodes with held-out seeds succeeded ({100 * low:.0f} to {100 * high:.0f} % at 95 %); "
        f"{len(seen)} samples, trained in {took:.0f} s, evaluated in {time.perf_counter() - begin:.0f} s"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
