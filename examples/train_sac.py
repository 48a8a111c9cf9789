"""Soft actor-critic of stable-baselines3 in an environment of Ligature, in as many processes as asked for.

``python examples/train_sac.py reach POLICY.onnx --steps 30000``; ``ligature evaluate POLICY.onnx --env reach`` measures
what it learnt. It needs ``pip install 'ligature-sim[train]'``. Every so many steps it prints how episodes go, and keeps
``POLICY.zip`` and ``POLICY.pkl`` (the network with its optimiser, and the scales of observations), which ``--resume``
takes up. The same seed and number of processes give the same network.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from functools import partial
from pathlib import Path

try:
    import gymnasium
    import networks
    import numpy as np
    import torch
    from ligature.environments import MAX_STEPS, SuturingEnv, registered
    from ligature.environments.goals import GOALS
    from ligature.environments.layout import STATE
    from networks import ToolView
    from stable_baselines3 import SAC
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.running_mean_std import RunningMeanStd
    from stable_baselines3.common.vec_env import SubprocVecEnv, VecNormalize
    from torch import nn
except ModuleNotFoundError as missing:
    sys.exit(f"{missing}; run: pip install 'ligature-sim[learn,train]'")

WINDOW = 50
"""Episodes over which the printed success is counted."""


class Seen(gymnasium.ObservationWrapper[np.ndarray, np.ndarray, np.ndarray]):
    """An environment seen from its tool: observations are features of `ToolView`."""

    def __init__(self, env: gymnasium.Env[np.ndarray, np.ndarray]) -> None:
        super().__init__(env)
        torch.set_num_threads(1)
        self.view = view_of(env)
        shape = self.observation(np.ones(STATE)).shape
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, shape, np.float32)

    def observation(self, observation: np.ndarray) -> np.ndarray:
        """Features (k,)."""
        found: np.ndarray = self.view(torch.from_numpy(observation.astype(np.float32)[None]))[0][0].numpy()
        return found


def view_of(env: gymnasium.Env[np.ndarray, np.ndarray]) -> ToolView:
    """How an environment of ours is seen from its tool."""
    plain = env.unwrapped
    assert isinstance(plain, SuturingEnv)
    return ToolView(*(torch.tensor(part, dtype=torch.float32) for part in (plain.base_rotation, plain.base_position)))


class Actor(nn.Module):
    """The deterministic policy alone, from observations (n, 52), scaled as `VecNormalize` did in training."""

    mean: torch.Tensor
    deviation: torch.Tensor
    limit: float
    body: nn.Module
    mu: nn.Module

    def __init__(self, model: SAC, scales: VecNormalize, view: ToolView) -> None:
        super().__init__()
        self.view = view
        seen = scales.obs_rms
        assert isinstance(seen, RunningMeanStd)
        mean, variance = seen.mean, seen.var
        self.register_buffer("mean", torch.tensor(mean, dtype=torch.float32))
        self.register_buffer("deviation", torch.tensor(variance + scales.epsilon, dtype=torch.float32).sqrt())
        self.limit = float(scales.clip_obs)
        self.body, self.mu = model.actor.latent_pi, model.actor.mu

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        """Actions for observations."""
        seen = ((self.view(observation)[0] - self.mean) / self.deviation).clip(-self.limit, self.limit)
        return torch.tanh(self.mu(self.body(seen)))


class Progress(BaseCallback):
    """Prints and writes how episodes go, and keeps a checkpoint with each line."""

    def __init__(self, out: Path, every: int) -> None:
        super().__init__()
        self._out, self._every, self._next = out, every, every
        self._begin, self._ended = time.perf_counter(), list[tuple[bool, float]]()

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "episode" in info:
                self._ended.append((bool(info["is_success"]), float(info["episode"]["r"])))
        if self.num_timesteps >= self._next:
            self._next += self._every
            self._report()
        return True

    def _report(self) -> None:
        last = self._ended[-WINDOW:]
        success = sum(done for done, _ in last) / max(1, len(last))
        reward = sum(total for _, total in last) / max(1, len(last))
        seconds = time.perf_counter() - self._begin
        share = f"{success:.0%} of {len(last)} succeeded"
        print(f"{self.num_timesteps} actions, {share}, reward {reward:.2f}, {seconds:.0f} s")
        with self._out.with_suffix(".csv").open("a", newline="") as file:
            csv.writer(file).writerow([self.num_timesteps, success, reward, round(seconds, 1)])
        save(self.model, self._out)  # type: ignore[arg-type]


def environments(task: str, jobs: int, seed: int) -> VecNormalize:
    """Environments in processes of their own, with scaled observations."""

    def one(max_steps: int) -> gymnasium.Env[object, object]:
        env: gymnasium.Env[np.ndarray, np.ndarray] = gymnasium.wrappers.TimeLimit(Seen(registered(task)), max_steps)
        return Monitor(env, info_keywords=("is_success",))

    vector = SubprocVecEnv([partial(one, MAX_STEPS)] * jobs, start_method="spawn")
    vector.seed(seed)
    return VecNormalize(vector, norm_reward=False)


def save(model: SAC, out: Path) -> None:
    """Keep everything that training goes on with."""
    model.save(out.with_suffix(".zip"))
    scales = model.get_vec_normalize_env()
    assert scales is not None
    scales.save(str(out.with_suffix(".pkl")))


def export(model: SAC, task: str, out: Path) -> None:
    """Write the policy as ONNX."""
    scales, env = model.get_vec_normalize_env(), registered(task)
    assert scales is not None
    networks.save(Actor(model, scales, view_of(env)), out, STATE)
    env.close()


def main() -> int:
    """Train, and write the policy."""
    arguments = argparse.ArgumentParser(description="Train soft actor-critic in an environment.")
    arguments.add_argument("task", choices=sorted(GOALS))
    arguments.add_argument("policy", type=Path, help="ONNX file to write")
    arguments.add_argument("--steps", type=int, default=30_000, help="actions in all")
    arguments.add_argument("--jobs", type=int, default=2, help="environments, each in a process")
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--resume", action="store_true", help="go on from the checkpoint beside POLICY")
    given = arguments.parse_args()
    if given.steps < 1 or given.jobs < 1 or given.seed < 0:
        arguments.error("--steps and --jobs are at least 1, and --seed at least 0")
    torch.set_num_threads(1)
    vector = environments(given.task, given.jobs, given.seed)
    try:
        if given.resume:
            vector = VecNormalize.load(str(given.policy.with_suffix(".pkl")), vector.venv)
            model = SAC.load(given.policy.with_suffix(".zip"), vector)
        else:
            given.policy.with_suffix(".csv").unlink(missing_ok=True)
            model = SAC(
                "MlpPolicy", vector, seed=given.seed, learning_starts=1000, batch_size=256, gamma=0.98, tau=0.01,
                train_freq=1, gradient_steps=1, device="cpu",
            )  # fmt: skip
        model.learn(given.steps, Progress(given.policy, 2000), reset_num_timesteps=not given.resume)
        save(model, given.policy)
        export(model, given.task, given.policy)
    except FileNotFoundError as error:
        print(f"nothing to resume: {error}")
        return 2
    finally:
        vector.close()
    print(f"{given.policy}: measure it with 'ligature evaluate {given.policy} --env {given.task}'")
    return 0


if __name__ == "__main__":
    sys.exit(main())
