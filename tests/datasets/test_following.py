"""A dataset goes on in another simulation of its scene, such as one that a reset of an environment has made."""

from __future__ import annotations

import json
import runpy
import sys
from pathlib import Path

import h5py
import ligature
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.datasets import DatasetWriter
from ligature.environments import SuturingEnv
from ligature.environments.goals import GOALS

from tests.conftest import ROOT

EXAMPLE = ROOT / "examples" / "record_experts.py"
WORLDS = {"mass": [0.5, 2.0], "friction": [0.9, 1.1], "needle_size": [0.95, 1.05], "light": [0.2, 2.0]}


@settings(max_examples=4, deadline=None)
@given(task=st.sampled_from(sorted(set(GOALS) - {"first_throw", "knot_tie", "puncture"})), seed=st.integers(0, 1000))
def test_each_episode_has_what_its_own_simulation_did(
    tmp_path_factory: pytest.TempPathFactory, task: str, seed: int
) -> None:
    """Before, the first reset ended the dataset: its simulation was closed."""
    path, truth = tmp_path_factory.mktemp("worlds") / "data.h5", []
    env = SuturingEnv(task, randomise=WORLDS)
    with DatasetWriter(path, env.simulation, (), rate=50.0) as writer:
        for number in range(2):
            env.reset(seed=seed + number)
            writer.follow(env.simulation)
            seen = []
            for _ in range(3):
                env.step(np.full(env.action_space.shape, 0.3))
                assert writer.sample()
                seen.append((env.simulation.time, *env.readings[0].joints))
            writer.end_episode(False)
            truth.append(seen)
    env.close()
    with h5py.File(path) as file:
        for number, seen in enumerate(truth):
            episode = file[f"episode_{number:04d}"]
            joints = episode[f"arms/{GOALS[task].arms[0]}/measured_js"][:, 0]
            assert np.column_stack([episode["time"][:], joints]) == pytest.approx(np.array(seen), abs=1e-6)


def test_what_cannot_follow_is_refused_and_the_episode_stays(tmp_path: Path) -> None:
    scene = ligature.load("suturing_small")
    first, second, other = (ligature.Simulation(each) for each in (scene, scene, ligature.load("peg_transfer")))
    with DatasetWriter(tmp_path / "data.h5", first, ()) as writer:
        writer.sample()
        with pytest.raises(ValueError, match=r"an episode goes on .*: end or drop it before follow\(\)"):
            writer.follow(second)
        first.close()
        with pytest.raises(RuntimeError, match=r"the simulation of this dataset is closed; call follow\(\)"):
            writer.sample()
        writer.end_episode(True)
        with pytest.raises(ValueError, match="the simulation has other bodies than the dataset; write another dataset"):
            writer.follow(other)
        writer.follow(second)
        writer.sample()
        writer.end_episode(True)
        assert writer.count == 2
    for simulation in (second, other):
        simulation.close()


def test_experts_are_recorded_in_worlds_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What was drawn is an attribute of each episode; pictures show the lights of it."""

    def recorded(*options: str) -> int | str | None:
        given = f"{EXAMPLE} {tmp_path}/a.h5 --episodes 2 --randomise {tmp_path}/r.yaml".split()
        monkeypatch.setattr(sys, "argv", [*given, *options])
        with pytest.raises(SystemExit) as left:
            runpy.run_path(str(EXAMPLE), run_name="__main__")
        return left.value.code

    (tmp_path / "r.yaml").write_text(json.dumps(WORLDS | {"exposure": [0, 1]}))
    assert recorded("--camera", "cameraL") == 2
    assert "pictures of a dataset do not show 'exposure'" in capsys.readouterr().err
    (tmp_path / "r.yaml").write_text("mass: [1, 2]\nmass: [1, 2]")
    assert recorded() == 2 and "'mass' is already in line 1" in capsys.readouterr().err
    (tmp_path / "r.yaml").write_text(json.dumps(WORLDS))
    assert recorded("--camera", "cameraL") == 0
    with h5py.File(tmp_path / "a.h5") as file:
        episodes = [file["episode_0000"], file["episode_0001"]]
        drawn = [json.loads(episode.attrs["randomisation"]) for episode in episodes]
        (dark, dim), (bright, lit) = sorted(
            (*each["light"].values(), float(episode["cameras/cameraL/rgb"][0].mean()))
            for each, episode in zip(drawn, episodes, strict=True)
        )
    assert drawn[0]["friction"] != drawn[1]["friction"] and 0.2 <= dark < bright <= 2.0
    assert dim < lit
