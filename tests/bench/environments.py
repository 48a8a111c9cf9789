"""How fast the learning environments are: ``python -m tests.bench.environments [SECONDS]``.

Steps a second for state observations and random actions, resets included, in one process and in two, and how many
times real time that is; a step is 20 ms of simulated time. Steps for each second of processor time measure the same of a
machine that has other work; so does the time of a reset.
"""

from __future__ import annotations

import os
import sys
import time
from typing import NamedTuple

import gymnasium
import ligature.environments
import numpy as np
from ligature.environments.suturing import CONTROL

from tests.bench import ledger
from tests.bench.reference import Reference
from tests.bench.resets import median

SECONDS, SPAN = 10.0, 0.1
"""Seconds of a measurement, and of a span after which the reference is timed."""
MAX_STEPS = 100


def made(name: str) -> gymnasium.Env:
    assert ligature.environments is not None
    return gymnasium.make(name, max_episode_steps=MAX_STEPS)


def rate(name: str, processes: int, seconds: float) -> float:
    """Steps a second of all processes together."""
    assert ligature.environments is not None
    task = gymnasium.spec(name).kwargs["task"]
    envs = ligature.environments.make_vec(task, processes, max_steps=MAX_STEPS)
    rng = np.random.default_rng(0)
    envs.reset(seed=0)
    for _ in range(20):
        envs.step(rng.uniform(-1, 1, envs.action_space.shape).astype(np.float32))
    steps, begin = 0, time.perf_counter()
    while time.perf_counter() - begin < seconds:
        envs.step(rng.uniform(-1, 1, envs.action_space.shape).astype(np.float32))
        steps += processes
    found = steps / (time.perf_counter() - begin)
    envs.close()
    return found


class Spans(NamedTuple):
    """What one process does; ratios are medians over spans, in turn with which the reference is timed."""

    of_wall: float
    """Steps for each second of the wall."""
    of_processor: float
    """Steps for each second of the processor."""
    ratio: float
    """Wall time of a step over that of the reference."""
    ratio_of_processor: float
    reset_ms: float
    """Milliseconds of a reset."""
    reset_ratio: float
    """Processor time of a reset over that of a step of the reference."""


def alone(name: str, seconds: float, reference: Reference) -> Spans:
    """Steps with random actions, resets included, in this process, over ``seconds`` in all."""
    env, rng = made(name), np.random.default_rng(0)

    def act() -> bool:
        *_, done, cut, _ = env.step(rng.uniform(-1, 1, env.action_space.shape).astype(np.float32))
        return bool(done or cut)

    env.reset(seed=0)
    totals, ratios = np.zeros(3), []
    while totals[1] < seconds:
        steps, begin, spent = 0, time.perf_counter(), time.process_time()
        while time.perf_counter() - begin < SPAN:
            steps += 1
            if act():
                env.reset()
        span = np.array([steps, time.perf_counter() - begin, time.process_time() - spent])
        totals += span
        ratios.append(1e6 * span[1:] / steps / reference.time())
    reset = median(env.reset, lambda: [act() for _ in range(10)], reference)
    env.close()
    rates, medians = totals[0] / totals[1:], np.median(ratios, axis=0)
    return Spans(float(rates[0]), float(rates[1]), float(medians[0]), float(medians[1]), *reset)


def main() -> int:
    """Entry point."""
    found = {}
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    load = os.getloadavg()[0]
    with Reference() as reference:
        for name in sorted(name for name in gymnasium.registry if name.startswith("ligature/")):
            one, two = alone(name, seconds, reference), rate(name, 2, seconds)
            found[name] = {
                "steps_per_second": one.of_wall, "real_time_factor": one.of_wall * CONTROL,
                "real_time_factor_of_processor": one.of_processor * CONTROL, "two_processes": two * CONTROL,
                "ratio": one.ratio, "ratio_of_processor": one.ratio_of_processor, "reset": {"ms": one.reset_ms, "ratio": one.reset_ratio},
            }  # fmt: skip
            sys.stdout.write(
                f"{name}: {one.of_wall:.0f} steps/s in one process, {one.of_wall * CONTROL:.2f} times real time, "
                f"{one.of_processor * CONTROL:.2f} by processor time; {two:.0f} in two, {two * CONTROL:.2f} times; "
                f"reset {one.reset_ms:.1f} ms; a step is {one.ratio:.2f} references, {one.ratio_of_processor:.2f} by "
                "processor time\n"
            )
            sys.stdout.flush()
    ledger.note("environments", found)
    sys.stdout.write(f"load of the machine at the start: {load:.1f}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
