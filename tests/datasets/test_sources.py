"""Datasets from wherever they come, exported, break no rule of a format; others' reader has no fault to find.

`lerobot-doctor` also warns of what was recorded: short episodes, joints that never move, forces that leap. That is
what was done, and stays.
"""

from __future__ import annotations

import io
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.bus.record import Header, RecordWriter
from ligature.cli.options import RunOptions
from ligature.cli.replay import replay
from ligature.cli.sampling import Sampled, Sampling
from ligature.datasets import DatasetWriter
from ligature.environments import SuturingEnv
from ligature.robots.commands import VERBS
from rich.console import Console

from tests.datasets.doctor import sound

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = str(ROOT / "examples")
SMALL = ROOT / "scenes" / "suturing_small" / "launch.yaml"


def test_an_environments_expert_records_a_sound_dataset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(EXAMPLES)
    from record_experts import record

    env, path = SuturingEnv("reach", max_steps=200), tmp_path / "reach.h5"
    with DatasetWriter(path, env.simulation, ("cameraL",), (64, 48), 50.0, ("reach",), env.goal.text) as writer:
        assert all(record(env, writer, seed, 0.2) for seed in range(3))
    env.close()
    sound(path, tmp_path)


def test_the_record_of_a_run_becomes_a_sound_dataset(tmp_path: Path) -> None:
    """What an operator does arrives as commands, and the record of a run holds those."""
    options, record, n = RunOptions(str(SMALL), (3, 4), rate=500.0), tmp_path / "run.record", 300
    simulation = ligature.Simulation(options.load(), 1e-3, 2e-3)
    simulation.step(2)
    writer, start = RecordWriter(record, Header(options.to_text(), simulation.state_hash())), (0.1, 0.1, 0.12, 0, 0, 0)
    for update in range(1, n):
        if update == 1 or update % 10 == 0:
            wave = 0.05 * np.sin(0.01 * update + np.arange(6)) * [1, 1, 0.1, 1, 1, 1]
            position = start if update == 1 else tuple(map(float, start + wave))
            command = VERBS["place_jp" if update == 1 else "servo_jp"](0, position)
            writer.write(update, command)
            simulation.apply(command)
        simulation.step(2)
    writer.finish(n, simulation.state_hash())
    simulation.close()
    dataset = Sampled(tmp_path / "run.h5", Sampling(20.0, (64, 48), ("cameraL",)), success=True, text="move the arm")
    console = Console(file=io.StringIO(), soft_wrap=True)
    assert replay(record, None, "", 1.0, console, dataset) == 0, console.file.getvalue()  # type: ignore[attr-defined]
    sound(dataset.path, tmp_path)
