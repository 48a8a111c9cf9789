"""How well a policy does in an environment: episodes of held-out seeds, each measured, and summed up with intervals.

Metres, radians, newtons, simulated seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import binomtest, bootstrap

from ligature.environments.layout import ACTION
from ligature.environments.policies import Policy, asked, checked, load_policy
from ligature.environments.suturing import CONTROL, SuturingEnv
from ligature.environments.workers import results

CONFIDENCE = 0.95

RESAMPLES = 2000
"""Of the bootstrap."""


@dataclass(frozen=True)
class Episode:
    """How one episode went.

    Attributes
    ----------
    seed
        Of the reset.
    success
        Whether the task was done.
    lost
        Why it could not be done any more, such as a dropped needle; empty otherwise.
    steps, time
        Actions, and simulated seconds.
    reward
        The sum over all actions.
    path_length
        Way of the control point of the tool in metres, of all tools together.
    peak_force
        Largest force on the tip of a tool at the end of an action in newtons: of needle and thread, and of all that
        a finger stands on.
    tissue_force
        Largest force of tissue on the needle at the end of an action in newtons.
    """

    seed: int
    success: bool
    lost: str
    steps: int
    time: float
    reward: float
    path_length: float
    peak_force: float
    tissue_force: float


MEASURES = ("time", "path_length", "peak_force", "tissue_force", "reward")
"""What has means and intervals, beside success and drops."""

UNITS = {"time": "s", "time_to_success": "s", "path_length": "m", "peak_force": "N", "tissue_force": "N", "reward": ""}
"""Of what a summary has means of."""


def run_episode(
    env: SuturingEnv, policy: Policy, seed: int, max_steps: int, look: Callable[[int], None] = lambda step: None
) -> Episode:
    """One episode, from a reset with ``seed``; cut after ``max_steps`` actions.

    ``look`` is called with the number of actions at the start and after each.
    """
    observation, info = env.reset(seed=seed)
    act = asked(policy, env, seed)
    reward = way = peak = tissue = 0.0
    at, ended, steps, width = env.tool_positions, False, 0, len(env.arms) * ACTION
    look(0)
    while not ended and steps < max_steps:
        observation, gained, ended, _, info = env.step(checked(act(observation), width))
        steps += 1
        look(steps)
        reward += gained
        way += sum(np.linalg.norm(env.tool_positions - at, axis=1).tolist())
        at = env.tool_positions
        peak = max(peak, *(float(np.linalg.norm(arm.spatial_measured_cf()[:3])) for arm in env.arms))
        tissue = max(tissue, float(np.linalg.norm(env.needle_force)))
    return Episode(seed, bool(info["is_success"]), str(info["lost"]), steps, steps * CONTROL, reward, way, peak, tissue)


def run_episodes(
    name: str, options: Mapping[str, Any], seeds: Sequence[int], max_steps: int, jobs: int = 1
) -> Iterator[Episode]:
    """Episodes of the policy ``name`` (`load_policy`) in the order of their seeds, in ``jobs`` processes.

    Every episode is a function of its seed alone: in how many processes they run changes none.
    """
    if jobs == 1:
        yield from _episodes(name, options, seeds, max_steps)
        return
    chunks = [list(seeds[k : k + 5]) for k in range(0, len(seeds), 5)]
    for found in results(_chunk, [(name, dict(options), chunk, max_steps) for chunk in chunks], jobs):
        yield from found


def _episodes(name: str, options: Mapping[str, Any], seeds: Sequence[int], max_steps: int) -> Iterator[Episode]:
    policy, env = load_policy(name), SuturingEnv(**options, max_steps=None)
    try:
        for seed in seeds:
            yield run_episode(env, policy, seed, max_steps)
    finally:
        env.close()


def _chunk(job: tuple[str, dict[str, Any], list[int], int]) -> list[Episode]:
    return list(_episodes(*job))


def summary(episodes: Sequence[Episode]) -> dict[str, Any]:
    """Means with intervals of 95 %.

    ``success`` and ``dropped`` are shares with the interval of Wilson (Journal of the American Statistical Association
    22, 1927); `MEASURES` are means with percentile intervals of a bootstrap of seed 0. Time and path of episodes that
    failed say little, so that ``time_to_success`` has those alone that succeeded.
    """
    n = len(episodes)
    found: dict[str, Any] = {"episodes": n}
    for name, count in (
        ("success", sum(e.success for e in episodes)), ("lost", sum(bool(e.lost) for e in episodes)),
    ):  # fmt: skip
        interval = binomtest(count, n).proportion_ci(CONFIDENCE, method="wilson")
        found[name] = {"mean": count / n, "low": float(interval.low), "high": float(interval.high)}
    for name in MEASURES:
        found[name] = _mean([getattr(e, name) for e in episodes])
    done = [e.time for e in episodes if e.success]
    found["time_to_success"] = _mean(done) if done else None
    return found


def _mean(values: Sequence[float]) -> dict[str, float]:
    data = np.asarray(values, dtype=float)
    mean = float(data.mean())
    if len(data) < 2 or np.ptp(data) == 0.0:
        return {"mean": mean, "low": mean, "high": mean}
    interval = bootstrap(
        (data,), np.mean, confidence_level=CONFIDENCE, n_resamples=RESAMPLES, method="percentile", random_state=0
    ).confidence_interval
    return {"mean": mean, "low": float(interval.low), "high": float(interval.high)}


def report(name: str, options: Mapping[str, Any], episodes: Sequence[Episode], version: str) -> dict[str, Any]:
    """Everything about an evaluation, for a file: what ran, the summary, each episode."""
    return {
        "format": "ligature evaluation 1", "ligature": version, "policy": name,
        "environment": dict(options), "confidence": CONFIDENCE,
        "summary": summary(episodes), "episodes": [asdict(e) for e in episodes],
    }  # fmt: skip
