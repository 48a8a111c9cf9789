"""LeRobot's own reader finds in an export what the HDF5 file has; ``make lerobot-reader`` brings LeRobot."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from ligature.datasets import DatasetWriter
from ligature.datasets.lerobot import export
from ligature.environments import SuturingEnv
from ligature.environments.experts import EXPERTS
from ligature.environments.hand import Hand

ROOT = Path(__file__).resolve().parents[2]
PYTHON = ROOT / "build" / "lerobot" / "bin" / "python"
READER = Path(__file__).with_name("lerobot_reader.py")
RATE, SIZE, STEPS, SEEDS = 50, (64, 48), 40, (1, 2, 3)
CODED = 6.0
"""Mean error of a coded picture, of 255."""

pytestmark = pytest.mark.skipif(
    not PYTHON.with_name("lerobot-info").exists(), reason="no LeRobot: 'make lerobot-reader' installs it"
)


def recorded(path: Path) -> Path:
    """Three episodes of an environment's expert; the second one failed."""
    env = SuturingEnv("hand_over", max_steps=None)
    with DatasetWriter(path, env.simulation, ("cameraL",), SIZE, RATE, ("work",), env.goal.text) as writer:
        for seed in SEEDS:
            observation, _ = env.reset(seed=seed)
            for _, action in zip(range(STEPS), EXPERTS["hand_over"](Hand(env), observation), strict=False):
                writer.sample("work")
                env.step(np.asarray(action, dtype=np.float32))
            writer.end_episode(seed != 2, judged=True, seed=seed)
    env.close()
    return path


@pytest.mark.parametrize("codec", ["h264", "av1"])
def test_lerobot_reads_what_was_recorded(codec: str, tmp_path: Path) -> None:
    source, target, out = recorded(tmp_path / "data.h5"), tmp_path / "export", tmp_path / "read.npz"
    export(source, target, "lerobot-3.0", codec, log=lambda _: None)
    done = subprocess.run(
        [PYTHON, READER, target, out], capture_output=True, text=True, timeout=300,
        env={"PATH": os.environ["PATH"], "HOME": str(tmp_path), "HF_HUB_OFFLINE": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    found = np.load(out)
    assert (int(found["episodes"]), int(found["fps"])) == (len(SEEDS), RATE)
    order = ["episode_0000", "episode_0002", "episode_0001"]  # those that failed come last
    with h5py.File(source) as file:
        for number, name in enumerate(order):
            rows, episode = found["episode_index"] == number, file[name]
            arms = [episode["arms/PSM1"], episode["arms/PSM2"]]
            state = np.hstack([np.c_[arm["measured_js"][:, 0], arm["jaw/measured_js"][:, 0]] for arm in arms])
            action = np.hstack([np.c_[arm["action_js"][:], arm["jaw/action_js"][:]] for arm in arms])
            assert (found["observation.state"][rows] == state).all()
            assert (found["action"][rows][:, 0] == action).all()
            assert (found["action"][rows][:-1, 1] == action[1:]).all(), "the action a sample later"
            assert found["task"][rows].tolist() == [str(episode.attrs["task"])] * len(state)
            assert found["next.success"][rows].any() == bool(episode.attrs["success"])
            seen = 255.0 * np.moveaxis(found["observation.images.cameraL"][rows], 1, -1)
            errors = np.abs(seen - episode["cameras/cameraL/rgb"][:]).mean(axis=(1, 2, 3))
            assert errors.max() < CODED, "each picture is that of its sample"
