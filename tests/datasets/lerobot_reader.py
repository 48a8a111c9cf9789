"""Reads an export with LeRobot itself: ``python tests/datasets/lerobot_reader.py FOLDER OUT.npz``.

For the Python of an environment with LeRobot, which needs numpy 2: nothing of ours is imported.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np


def main() -> int:
    """Write every number of every sample, the next action as LeRobot finds it by time, tasks, and all pictures."""
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    root, out = Path(sys.argv[1]), Path(sys.argv[2])
    rate = LeRobotDataset("local/export", root=root).fps
    dataset = LeRobotDataset("local/export", root=root, delta_timestamps={"action": [0.0, 1.0 / rate]})
    rows = [dataset[k] for k in range(len(dataset))]
    found = {name: np.stack([np.asarray(row[name]) for row in rows]) for name in rows[0] if name != "task"}
    found["task"] = np.array([row["task"] for row in rows])
    np.savez(out, episodes=dataset.num_episodes, fps=rate, **found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
