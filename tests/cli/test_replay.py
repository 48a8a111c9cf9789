"""Records are simulated again: with their own commands to the same bits, with others not."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import h5py
import ligature
import numpy as np
import pytest
from ligature.bus.record import Header, Record, RecordWriter
from ligature.cli.options import RunOptions
from ligature.cli.replay import replay
from ligature.cli.sampling import Sampled, Sampling
from ligature.model.commands import MarkPhase
from ligature.robots.commands import VERBS, PlaceJp, ServoJp
from rich.console import Console

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"
MODELS = (3, 4)
"""The second arm and its jaw alone."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fifth of a second in which an arm begins to move."""
    path = tmp_path_factory.mktemp("record") / "run.record"
    options = RunOptions(str(SCENE), MODELS, rate=500.0)
    simulation = ligature.Simulation(options.load(), 1e-3, 2e-3)
    simulation.step(2)
    writer = RecordWriter(path, Header(options.to_text(), simulation.state_hash()))
    commands = {1: ("place_jp", (0.1, 0.1, 0.12, 0.0, 0.0, 0.0)), 20: ("servo_jp", (0.12, 0.1, 0.12, 0.0, 0.0, 0.1))}
    for update in range(1, 100):
        if update in commands:
            verb, position = commands[update]
            command = VERBS[verb](0, position)
            writer.write(update, command)
            simulation.apply(command)
        simulation.step(2)
    writer.finish(100, simulation.state_hash())
    return path


def output(file: Path) -> tuple[int, str]:
    console = Console(file=io.StringIO(), soft_wrap=True)
    return replay(file, None, "", 1.0, console), console.file.getvalue()  # type: ignore[attr-defined]


def test_a_record_ends_in_the_same_bits(recorded: Path) -> None:
    status, text = output(recorded)
    assert status == 0, text
    assert f"the same bits: {Record.read(recorded).end}" in text


def test_a_record_becomes_a_dataset_of_the_run(recorded: Path, tmp_path: Path) -> None:
    console = Console(file=io.StringIO(), soft_wrap=True)
    assert replay(recorded, None, "", 1.0, console, Sampled(tmp_path / "run.h5")) == 0, console.file.getvalue()  # type: ignore[attr-defined]
    assert "the episode has no result: name its task with '--task'" in console.file.getvalue()  # type: ignore[attr-defined]
    with h5py.File(tmp_path / "run.h5") as file:
        episode = file["episode_0000"]
        assert not episode.attrs["judged"] and file.attrs["source"] == "recorded run"
        assert episode["time"][:] == pytest.approx([0.002, 0.102])
        placed = [[0.0] * 6, [0.1, 0.1, 0.12, 0.0, 0.0, 0.0]]
        assert episode["arms/PSM2/measured_js"][:, 0] == pytest.approx(np.array(placed), abs=1e-4)
        assert episode["cameras/cameraL/rgb"][:].std() > 1.0


@pytest.mark.parametrize("success", [True, False])
def test_the_operator_says_how_a_run_went(recorded: Path, tmp_path: Path, success: bool) -> None:
    console = Console(file=io.StringIO(), soft_wrap=True)
    dataset = Sampled(
        tmp_path / "run.h5", Sampling(500.0, (64, 48), ("cameraR",)), success=success, text="move the arm"
    )
    assert replay(recorded, None, "", 1.0, console, dataset) == 0
    with h5py.File(tmp_path / "run.h5") as file:
        episode = file["episode_0000"]
        assert episode.attrs["judged"] and episode.attrs["success"] == success
        assert episode.attrs["task"] == "move the arm"
        assert list(episode["cameras"]) == ["cameraR"]
        assert episode["cameras/cameraR/rgb"].shape == (episode.attrs["samples"], 48, 64, 3)
        phases = [file.attrs["phases"][k] for k in episode["phase"][:]]
        assert set(phases) == {"idle"}, "an arm that was put somewhere, and is not homed, does not move"


@pytest.mark.parametrize("seed", range(4))
def test_phases_that_the_operator_marked_label_the_samples(recorded: Path, tmp_path: Path, seed: int) -> None:
    """Marks at random updates, some twice in one, with repetitions and ends: each sample has the newest before it."""
    rng = np.random.default_rng(seed)
    names = ["G1 reach", "g3 push", "rest", "", "G99 not a gesture"]
    marks = sorted(
        (int(update), names[k]) for update, k in zip(rng.integers(1, 99, 12), rng.integers(0, 5, 12), strict=True)
    )
    record, path = Record.read(recorded), tmp_path / "marked.record"
    writer = RecordWriter(path, record.header)
    entries = [*((u, i, c) for i, (u, c) in enumerate(record.commands)), *((u, 100, MarkPhase(p)) for u, p in marks)]
    for update, _, command in sorted(entries, key=lambda entry: entry[:2]):
        writer.write(update, command)
    writer.finish(record.updates, record.end)
    console = Console(file=io.StringIO(), soft_wrap=True)
    dataset = Sampled(tmp_path / "run.h5", Sampling(500.0, (64, 48), ()))
    assert replay(path, None, "", 1.0, console, dataset) == 0, "marks change no bit"
    with h5py.File(dataset.path) as file:
        episode, phases = file["episode_0000"], list(file.attrs["phases"])
        found = [phases[k] for k in episode["phase"][:]]
        for time, phase in zip(episode["time"][:], found, strict=True):
            before = [p for u, p in marks if u <= round(time / 2e-3)]
            assert phase == (before[-1] if before else "")
        assert set(episode["arms/PSM2/phase"][:]) == set(episode["phase"][:])
        wanted = {"G1 reach": "G1", "g3 push": "G3", "rest": "", "": "", "G99 not a gesture": ""}
        assert list(file.attrs["gestures"]) == [wanted[phase] for phase in phases]


def test_a_changed_command_ends_in_other_bits(recorded: Path, tmp_path: Path) -> None:
    record, path = Record.read(recorded), tmp_path / "changed.record"
    writer = RecordWriter(path, record.header)
    for update, command in record.commands:
        assert isinstance(command, PlaceJp | ServoJp)
        writer.write(update, replace(command, position=(command.position[0] + 1e-9, *command.position[1:])))
    writer.finish(record.updates, record.end)
    status, text = output(path)
    assert status == 1
    assert "the run ended in another state" in text


def test_a_file_that_is_missing_or_cut_off_is_reported(recorded: Path, tmp_path: Path) -> None:
    assert output(tmp_path / "none.record") == (1, f"{tmp_path / 'none.record'}: No such file or directory\n")
    cut = tmp_path / "cut.record"
    cut.write_bytes(recorded.read_bytes()[:-10])
    status, text = output(cut)
    assert status == 1
    assert "cut off after 2 commands" in text
