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
from tests.bench.reference import chain_step_us
from tests.bench.resets import median_ms

SECONDS, SPANS = 10.0, 5
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
    """What one process does: medians over spans, each measured right after the reference."""

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
    """Wall time of a reset over that of a step of the reference."""


def alone(name: str, seconds: float) -> Spans:
    """Steps with random actions, resets included, in this process, over ``seconds`` in all."""
    env, rng = made(name), np.random.default_rng(0)
    env.reset(seed=0)
    found = []
    for _ in range(SPANS):
        references = chain_step_us(), chain_step_us(clock="process_time")
        steps, begin, spent = 0, time.perf_counter(), time.process_time()
        while time.perf_counter() - begin < seconds / SPANS:
            *_, done, cut, _ = env.step(rng.uniform(-1, 1, env.action_space.shape).astype(np.float32))
            steps += 1
            if done or cut:
                env.reset()
        wall, spent = time.perf_counter() - begin, time.process_time() - spent
        ratios = 1e6 * wall / steps / references[0], 1e6 * spent / steps / references[1]
        found.append((steps / wall, steps / spent, *ratios))
    reset = median_ms(
        env.reset, lambda: [env.step(rng.uniform(-1, 1, env.action_space.shape).astype(np.float32)) for _ in range(10)]
    )
    env.close()
    of_wall, of_processor, ratio, ratio_of_processor = (float(median) for median in np.median(found, axis=0))
    return Spans(of_wall, of_processor, ratio, ratio_of_processor, reset, 1e3 * reset / references[0])


def main() -> int:
    """Entry point."""
    found = {}
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    load = os.getloadavg()[0]
    for name in sorted(name for name in gymnasium.registry if name.startswith("ligature/")):
        one, two = alone(name, seconds), rate(name, 2, seconds)
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
