"""Datasets from wherever they come, exported, break no rule of a format; others' reader has no fault to find.

`lerobot-doctor` also warns of what was recorded, such as short episodes and joints that never move: here all move.
`test_bags` has the dataset of a bag.
"""

from __future__ import annotations

import io
from pathlib import Path

import h5py
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

START = np.array([0.1, 0.1, 0.12, 0.0, 0.0, 0.0])
OF_A_PICK = (
    r"WARN: action\[6\]: \d+\.\d% of values at maximum \(0\.8000\)",  # the jaws are open all the way to the needle
    r"WARN: action\[6\]: stuck/static in 2/2 episodes .*",
    r"WARN: observation\.environment_state\[48\]: stuck/static in 2/2 episodes .*",  # and so is their set-point
    r"WARN: observation\.environment_state\[49\]: stuck/static in 2/2 episodes .*",  # marks: held, share, stage
    r"WARN: observation\.environment_state\[50\]: stuck/static in 2/2 episodes .*",
    r"WARN: observation\.environment_state\[51\]: stuck/static in 2/2 episodes .*",
    r"WARN: observation\.environment_state\[32\]: zero variance .*",  # the pad is level: the target has one height
    r"WARN: observation\.environment_state: 1 constant dimension\(s\) across ALL episodes: dim 32 .*",
    r"WARN: ground_truth\.thread_tension\[33\]: 1 extreme outlier.*",  # the thread's end, lifted, swings against something
)
"""What the doctor says of picking a needle up, and why that is so."""


def test_an_environments_expert_records_a_sound_dataset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(EXAMPLES)
    from record_experts import phases, record

    env, path = SuturingEnv("pick", max_steps=200), tmp_path / "pick.h5"
    with DatasetWriter(path, env.simulation, ("cameraL",), (64, 48), 50.0, phases("pick"), env.goal.text) as writer:
        assert all(record(env, writer, seed, 0.2) for seed in (1, 2))
    env.close()
    sound(path, tmp_path, OF_A_PICK)


def test_a_demonstrated_suture_has_its_phases_and_gestures_by_arm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which arm a phase names holds the needle in it, by the ground truth that the dataset has beside."""
    monkeypatch.syspath_prepend(EXAMPLES)
    from record_experts import GESTURES, phases, record

    env, path, steps = SuturingEnv("suture", max_steps=400), tmp_path / "suture.h5", phases("suture")
    gestures = {name: GESTURES[name] for name in steps if name in GESTURES}
    with DatasetWriter(path, env.simulation, (), (64, 48), 50.0, steps, env.goal.text, gestures) as writer:
        assert record(env, writer, 1, 0.0)
    env.close()
    with h5py.File(path) as file:
        assert file.attrs["gestures"].tolist() == ["", "G3", "", "G6"]
        episode, activities = file["episode_0000"], file.attrs["activities"].tolist()
        changes = np.flatnonzero(np.diff(episode["phase"][:])) + 1
        assert episode["phase"][:][[0, *changes]].tolist() == [1, 2, 3]
        driver, puller = episode["arms/PSM2"], episode["arms/PSM1"]
        for arm, own in ((driver, (1, 2)), (puller, (2, 3))):
            assert ((arm["phase"][:] > 0) == np.isin(episode["phase"][:], own)).all()
        drives = [activities.index("holds needle"), activities.index("drives needle")]
        assert np.isin(driver["activity"][:][driver["phase"][:] == 1], drives).all()
        assert np.isin(puller["activity"][:][puller["phase"][:] == 3], drives).all()


def test_the_record_of_a_run_becomes_a_sound_dataset(tmp_path: Path) -> None:
    """What an operator does arrives as commands, and the record of a run holds those."""
    options, record, n = RunOptions(str(SMALL), (1, 3), rate=500.0), tmp_path / "run.record", 1100
    simulation = ligature.Simulation(options.load(), 1e-3, 2e-3)
    simulation.step(2)
    writer = RecordWriter(record, Header(options.to_text(), simulation.state_hash()))

    def send(update: int, arm: int, verb: str, *values: object) -> None:
        command = VERBS[verb](arm, *values)
        writer.write(update, command)
        simulation.apply(command)

    begin = [np.array(simulation.arms[name].measured_js().position) for name in ("PSM1", "PSM2")]
    for update in range(1, n):
        for arm, q in enumerate(begin):
            if update == 1:
                send(update, arm, "adopt")
            elif update > 40 and update % 10 == 0:
                wave = 0.05 * np.sin(0.01 * update + arm + np.arange(7)) * [1, 1, 0.1, 1, 1, 1, 4]
                gently = min((update - 40) / 200, 1.0)  # nothing leaps
                send(update, arm, "servo_jp", tuple(map(float, q + gently * (START + wave[:6] - q))))
                send(update, arm, "jaw/servo_jp", (gently * (0.3 + float(wave[6])),))
        simulation.step(2)
    writer.finish(n, simulation.state_hash())
    simulation.close()
    dataset = Sampled(tmp_path / "run.h5", Sampling(50.0, (64, 48), ("cameraL",)), success=True, text="move both arms")
    console = Console(file=io.StringIO(), soft_wrap=True)
    assert replay(record, None, "", 1.0, console, dataset) == 0, console.file.getvalue()  # type: ignore[attr-defined]
    sound(dataset.path, tmp_path)
    faster = Sampled(tmp_path / "faster.h5", Sampling(600.0, (64, 48), ()))
    assert replay(record, None, "", 1.0, console, faster) == 1
    printed = console.file.getvalue()  # type: ignore[attr-defined]
    assert "--rate is 600, and the run has 500 updates a second; give at most that" in printed
    assert not faster.path.exists()
