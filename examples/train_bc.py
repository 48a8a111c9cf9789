"""Behaviour cloning: a small network learns from demonstrations what a scripted expert does.

``python examples/train_bc.py FOLDER POLICY.onnx``, where ``ligature dataset export`` wrote FOLDER from a dataset of
``examples/record_experts.py``; ``ligature evaluate POLICY.onnx --env …`` measures what it learnt. It needs
``pip install 'ligature-sim[train]'``. The same dataset and seed give the same network.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import torch
from networks import Scale, ToolView, base_pose, save
from torch import Tensor, nn

OBSERVATION, ACTION = "observation.environment_state", "extra.expert_action"
HIDDEN = 256
BATCH = 256


class Policy(nn.Module):
    """Observations (n, 52) to actions (n, 7) within -1 and 1; steps are learnt along the axes of the tool."""

    def __init__(self, view: ToolView, scale: Scale) -> None:
        super().__init__()
        self.view, self.scale = view, scale
        self.body = nn.Sequential(
            nn.Linear(len(scale.mean), HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 7)
        )

    def forward(self, observation: Tensor) -> Tensor:
        """Actions for observations, within -1 and 1."""
        features, R = self.view(observation)
        return self.act(self.scale(features), R).clip(-1.0, 1.0)

    def act(self, features: Tensor, R: Tensor) -> Tensor:
        """Actions for scaled features, with the step turned from the tool (n, 3, 3) to the base."""
        found = self.body(features)
        step = (R @ found[:, :3, None])[:, :, 0]
        return torch.cat([step, found[:, 3:]], dim=1)


def demonstrations(folder: Path) -> tuple[np.ndarray, np.ndarray, int]:
    """Observations (n, k), actions (n, 7) and the number of episodes of the split ``train``."""
    splits = json.loads((folder / "meta" / "info.json").read_text("utf-8"))["splits"]
    first, last = map(int, splits["train"].split(":"))
    table = pq.read_table(folder / "data", columns=["episode_index", OBSERVATION, ACTION])
    episode = table["episode_index"].to_numpy()
    taken = (episode >= first) & (episode < last)
    columns = (np.stack(table[name].to_numpy()).astype(np.float32) for name in (OBSERVATION, ACTION))
    observations, actions = (column[taken] for column in columns)
    return observations, np.clip(actions, -1.0, 1.0), last - first


def train(observations: np.ndarray, actions: np.ndarray, epochs: int, seed: int) -> Policy:
    """A policy, by Adam, with a learning rate that falls to zero (half a cosine).

    Huber's loss: where the expert turns from one deed to the next, a network of finite slope is far off for one sample.
    """
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    view, wanted = ToolView(*base_pose(observations)), torch.from_numpy(actions)
    raw, R = view(torch.from_numpy(observations))
    policy = Policy(view, Scale(raw))
    features = policy.scale(raw)
    batches = -(-len(features) // BATCH)
    optimiser = torch.optim.AdamW(policy.parameters(), lr=1e-3, weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, epochs * batches)
    begin = time.perf_counter()
    for epoch in range(epochs):
        total = 0.0
        for batch in torch.randperm(len(features)).split(BATCH):
            loss = nn.functional.huber_loss(policy.act(features[batch], R[batch]), wanted[batch], delta=0.2)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
            total += float(loss.detach()) * len(batch)
        if epoch == epochs - 1 or epoch % max(1, epochs // 10) == 0:
            print(
                f"epoch {epoch + 1} of {epochs}: loss {total / len(features):.5f}, {time.perf_counter() - begin:.0f} s"
            )
    return policy


def main() -> int:
    """Train, and write the policy."""
    arguments = argparse.ArgumentParser(description="Clone the behaviour of a scripted expert.")
    arguments.add_argument("folder", type=Path, help="dataset in LeRobot's format with what an environment observed")
    arguments.add_argument("policy", type=Path, help="ONNX file to write")
    arguments.add_argument("--epochs", type=int, default=200)
    arguments.add_argument("--seed", type=int, default=0)
    given = arguments.parse_args()
    try:
        observations, actions, episodes = demonstrations(given.folder)
    except (OSError, KeyError, ValueError) as error:
        print(f"{given.folder} is no dataset of 'ligature dataset export' with '{OBSERVATION}': {error}")
        return 2
    print(f"{episodes} demonstrations, {len(observations)} samples")
    policy = train(observations, actions, given.epochs, given.seed)
    save(policy, given.policy, observations.shape[1])
    print(f"{given.policy}: measure it with 'ligature evaluate {given.policy} --env TASK'")
    return 0


if __name__ == "__main__":
    sys.exit(main())
