"""Behaviour cloning: a small network learns from demonstrations what a scripted expert does.

``python examples/train_bc.py FOLDER POLICY.onnx``, where ``ligature dataset export`` wrote FOLDER from a dataset of
``examples/record_experts.py``; ``ligature evaluate POLICY.onnx --env …`` measures what it learnt. It needs
``pip install 'ligature-sim[train]'``. The same dataset and seed give the same network.
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import torch
from torch import nn

OBSERVATION, ACTION = "observation.environment_state", "extra.expert_action"
HIDDEN = 256
BATCH = 256
STILL = 1e-4
"""Deviation, in the units of an observation, below which a number is taken as constant: scaling would magnify noise."""


class Policy(nn.Module):
    """Observations (n, k) to actions (n, 7) within -1 and 1; it scales what it sees by itself."""

    mean: torch.Tensor
    scale: torch.Tensor

    def __init__(self, mean: torch.Tensor, scale: torch.Tensor) -> None:
        super().__init__()
        self.register_buffer("mean", mean)
        self.register_buffer("scale", scale)
        self.body = nn.Sequential(
            nn.Linear(len(mean), HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 7)
        )

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        """Actions for observations."""
        # what is constant has a scale of 0 and tells nothing; beyond five deviations nothing was seen
        seen = ((observation - self.mean) * self.scale).clip(-5.0, 5.0)
        return torch.tanh(self.body(seen))


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
    """Least squares of the actions by Adam, with a learning rate that falls to zero (half a cosine)."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    seen, wanted = torch.from_numpy(observations), torch.from_numpy(actions)
    deviation = seen.std(dim=0)
    scale = torch.where(deviation > STILL, 1.0 / deviation.clip(min=STILL), torch.zeros_like(deviation))
    policy = Policy(seen.mean(dim=0), scale)
    batches = -(-len(seen) // BATCH)
    optimiser = torch.optim.AdamW(policy.parameters(), lr=1e-3, weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, epochs * batches)
    begin = time.perf_counter()
    for epoch in range(epochs):
        total = 0.0
        for batch in torch.randperm(len(seen)).split(BATCH):
            loss = nn.functional.mse_loss(policy(seen[batch]), wanted[batch])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
            total += float(loss.detach()) * len(batch)
        if epoch == epochs - 1 or epoch % max(1, epochs // 10) == 0:
            print(f"epoch {epoch + 1} of {epochs}: loss {total / len(seen):.5f}, {time.perf_counter() - begin:.0f} s")
    return policy


def save(policy: Policy, path: Path, numbers: int) -> None:
    """Write the network as ONNX, whose input is one observation (1, k)."""
    policy.eval()
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it warns of packages that this does not use
    torch.onnx.export(
        policy, (torch.zeros(1, numbers),), path, input_names=["state"], output_names=["action"], dynamo=True,
        external_data=False, verbose=False,
    )  # fmt: skip


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
