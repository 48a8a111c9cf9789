"""How fast the learning environments are: ``python -m tests.bench.environments [SECONDS]``.

Steps a second for state observations and random actions, resets included, in one process and in two, and how many
times real time that is; a step is 20 ms of simulated time. Steps for each second of processor time measure the same of a
machine that has other work; so does the time of a reset.
"""

from __future__ import annotations

import os
import sys
import time

import gymnasium
import ligature.environments
import numpy as np
from ligature.environments.suturing import CONTROL

from tests.bench import ledger
from tests.bench.reference import chain_step_us
from tests.bench.resets import median_ms

SECONDS = 10.0
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


def rate_alone(name: str, seconds: float) -> tuple[float, float, float]:
    """Steps for each second of the wall, and of the processor, and milliseconds of it for a reset, in this process."""
    env, rng = made(name), np.random.default_rng(0)
    env.reset(seed=0)
    steps, begin, spent = 0, time.perf_counter(), time.process_time()
    while time.perf_counter() - begin < seconds:
        *_, done, cut, _ = env.step(rng.uniform(-1, 1, env.action_space.shape).astype(np.float32))
        steps += 1
        if done or cut:
            env.reset()
    wall, spent = time.perf_counter() - begin, time.process_time() - spent
    reset = median_ms(
        env.reset, lambda: [env.step(rng.uniform(-1, 1, env.action_space.shape).astype(np.float32)) for _ in range(10)]
    )
    env.close()
    return steps / wall, steps / spent, reset


def main() -> int:
    """Entry point."""
    found = {}
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    load = os.getloadavg()[0]
    for name in sorted(name for name in gymnasium.registry if name.startswith("ligature/")):
        reference = chain_step_us()
        (one, spent, reset), two = rate_alone(name, seconds), rate(name, 2, seconds)
        found[name] = {
            "steps_per_second": one, "real_time_factor": one * CONTROL, "real_time_factor_of_processor": spent * CONTROL,
            "two_processes": two * CONTROL, "ratio": 1e6 / one / reference, "ratio_of_processor": 1e6 / spent / reference,
            "reset": {"ms": reset, "ratio": 1e3 * reset / reference},
        }  # fmt: skip
        sys.stdout.write(
            f"{name}: {one:.0f} steps/s in one process, {one * CONTROL:.2f} times real time, "
            f"{spent * CONTROL:.2f} by processor time; {two:.0f} in two, {two * CONTROL:.2f} times; "
            f"reset {reset:.1f} ms; a step is {1e6 / spent / reference:.1f} references\n"
        )
        sys.stdout.flush()
    ledger.note("environments", found)
    sys.stdout.write(f"load of the machine at the start: {load:.1f}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
