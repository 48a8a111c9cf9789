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

try:
    import numpy as np
    import pyarrow.parquet as pq
    import torch
    from ligature.environments.layout import ACTION, HELD
    from networks import Scale, ToolView, base_pose, save
    from torch import Tensor, nn
except ModuleNotFoundError as missing:
    sys.exit(f"{missing}; run: pip install 'ligature-sim[learn,lerobot,train]'")

OBSERVATION, SHOWN = "observation.environment_state", "extra.expert_action"
HIDDEN = 256
BATCH = 256


class Policy(nn.Module):
    """Observations (n, 52) to actions (n, 7) within -1 and 1; steps are learnt along the axes of the tool.

    What to do with something in hand is learnt apart from what to do without. One network for both lifts the jaws
    before they are shut: where they close, all that tells the two apart is whether they hold.
    """

    def __init__(self, view: ToolView, scale: Scale) -> None:
        super().__init__()
        self.view, self.scale = view, scale
        self.empty, self.holding = _layers(len(scale.mean)), _layers(len(scale.mean))

    def forward(self, observation: Tensor) -> Tensor:
        """Actions for observations, within -1 and 1."""
        features, R = self.view(observation)
        features, held = self.scale(features), observation[:, HELD : HELD + 1] > 0.5
        return turned(torch.where(held, self.holding(features), self.empty(features)), R).clip(-1.0, 1.0)


def turned(found: Tensor, R: Tensor) -> Tensor:
    """Actions (n, 7) with the step turned from the tool (n, 3, 3) to the base."""
    step = (R @ found[:, :3, None])[:, :, 0]
    return torch.cat([step, found[:, 3:]], dim=1)


def _layers(features: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(features, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, ACTION)
    )


def demonstrations(folder: Path) -> tuple[np.ndarray, np.ndarray, int]:
    """Observations (n, k), actions (n, 7) and the number of episodes of the split ``train``."""
    splits = json.loads((folder / "meta" / "info.json").read_text("utf-8"))["splits"]
    first, last = map(int, splits["train"].split(":"))
    table = pq.read_table(folder / "data", columns=["episode_index", OBSERVATION, SHOWN])
    episode = table["episode_index"].to_numpy()
    taken = (episode >= first) & (episode < last)
    columns = (np.stack(table[name].to_numpy()).astype(np.float32) for name in (OBSERVATION, SHOWN))
    observations, actions = (column[taken] for column in columns)
    return observations, np.clip(actions, -1.0, 1.0), last - first


def train(observations: np.ndarray, actions: np.ndarray, epochs: int, seed: int) -> Policy:
    """A policy, learnt from what was shown with empty jaws, and from what was shown with something in them."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    seen, wanted = torch.from_numpy(observations), torch.from_numpy(actions)
    view = ToolView(*base_pose(observations))
    raw, R = view(seen)
    policy = Policy(view, Scale(raw))
    features, held = policy.scale(raw), seen[:, HELD] > 0.5
    for name, network, own in (("empty", policy.empty, ~held), ("holding", policy.holding, held)):
        if own.any():
            fit(network, features[own], R[own], wanted[own], epochs, f"{name}, {int(own.sum())} samples")
    return policy


def fit(network: nn.Sequential, features: Tensor, R: Tensor, wanted: Tensor, epochs: int, title: str) -> None:
    """Adam, with a learning rate that falls to zero (half a cosine).

    Huber's loss: where the expert turns from one deed to the next, a network of finite slope is far off for one sample.
    """
    optimiser = torch.optim.AdamW(network.parameters(), lr=1e-3, weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, epochs * -(-len(features) // BATCH))
    begin, total = time.perf_counter(), 0.0
    for _ in range(epochs):
        total = 0.0
        for batch in torch.randperm(len(features)).split(BATCH):
            loss = nn.functional.huber_loss(turned(network(features[batch]), R[batch]), wanted[batch], delta=0.2)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
            total += float(loss.detach()) * len(batch)
    print(f"{title}: loss {total / len(features):.5f} after {epochs} epochs, {time.perf_counter() - begin:.0f} s")


def main() -> int:
    """Train, and write the policy."""
    arguments = argparse.ArgumentParser(description="Clone the behaviour of a scripted expert.")
    arguments.add_argument("folder", type=Path, help="dataset in LeRobot's format with what an environment observed")
    arguments.add_argument("policy", type=Path, help="ONNX file to write")
    arguments.add_argument("--epochs", type=int, default=200)
    arguments.add_argument("--seed", type=int, default=0)
    given = arguments.parse_args()
    if given.epochs < 1 or given.seed < 0:
        arguments.error("--epochs is at least 1, and --seed at least 0")
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
