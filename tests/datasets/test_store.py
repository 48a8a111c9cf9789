"""An episode that has ended is on the disk, whatever comes then: kills, signals, errors, a full disk."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import h5py
import ligature
import numpy as np
import pytest
from ligature.datasets import DatasetError, DatasetWriter
from ligature.datasets.store import episode_folder, episode_names, join, opened

from tests.datasets.killed_writers import SAMPLES

ROOT = Path(__file__).resolve().parents[2]
SMALL = ROOT / "scenes" / "suturing_small" / "launch.yaml"


@pytest.fixture(scope="module")
def simulation() -> Iterator[ligature.Simulation]:
    found = ligature.Simulation(ligature.load(SMALL, (3, 4)))
    yield found
    found.close()


def record(writer: DatasetWriter, simulation: ligature.Simulation, number: int, samples: int = SAMPLES) -> None:
    for _ in range(samples):
        simulation.step(2)
        writer.sample()
    writer.end_episode(True, number=number)


def written(path: Path, simulation: ligature.Simulation) -> DatasetWriter:
    return DatasetWriter(path, simulation, cameras=(), rate=500.0)


def check_whole(path: Path, at_least: int) -> None:
    """All episodes that are listed can be read in full, and there are those that ended."""
    with h5py.File(path) as file:
        names = episode_names(file)
        assert len(names) >= at_least
        for number, name in enumerate(names):
            episode = file[name]
            assert episode.attrs["number"] == number
            assert episode.attrs["samples"] == SAMPLES
            time = episode["time"][:]
            assert len(time) == SAMPLES and (np.diff(time) > 0.0).all()
            lengths = []
            episode.visititems(
                lambda _, item, found=lengths: found.append(len(item)) if hasattr(item, "shape") else None
            )
            assert set(lengths) == {SAMPLES} and len(lengths) > 10


def kill(folder: Path, count: int, signal: str, seed: int) -> list[dict]:
    command = [sys.executable, "-m", "tests.datasets.killed_writers", str(folder), str(count), signal, str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=280, cwd=ROOT)
    assert done.returncode == 0, done.stderr[-2000:]
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(found) == count
    return found


def check_killed(found: list[dict]) -> None:
    """What a killed writer leaves can be read as it is, and joined afterwards."""
    assert sum(each["ended"] for each in found) > len(found), "the writers came to nothing before they were killed"
    for each in found:
        path, ended = Path(each["path"]), each["ended"]
        if ended:
            check_whole(path, ended)
            assert join(path) >= ended
            check_whole(path, ended)
            assert not episode_folder(path).exists()


def test_killed_writers_leave_every_episode_that_ended(tmp_path: Path) -> None:
    check_killed(kill(tmp_path, 6, "SIGKILL", 1))


@pytest.mark.slow
def test_fifty_killed_writers_leave_every_episode_that_ended(tmp_path: Path) -> None:
    check_killed(kill(tmp_path, 50, "SIGKILL", 2))


@pytest.mark.parametrize("signal", ["SIGINT", "SIGTERM"])
def test_interrupted_writers_leave_one_file(tmp_path: Path, signal: str) -> None:
    for each in kill(tmp_path, 3, signal, 3):
        path = Path(each["path"])
        assert not episode_folder(path).exists()
        assert path.exists() == (each["ended"] > 0) or each["ended"] == 0
        if path.exists():
            check_whole(path, each["ended"])
            with h5py.File(path) as file:
                assert file.attrs["closed"]
    assert not list(tmp_path.glob("*.part"))


def test_a_dataset_can_be_read_while_it_grows(simulation: ligature.Simulation, tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with written(path, simulation) as writer:
        assert not path.exists()
        for number in range(3):
            record(writer, simulation, number)
            check_whole(path, number + 1)
            with h5py.File(path) as file:
                assert not file.attrs["closed"] and len(episode_names(file)) == number + 1
        writer.sample()
    with h5py.File(path) as file:
        assert file.attrs["closed"] and len(episode_names(file)) == 4
        assert not file["episode_0003"].attrs["success"]
    assert list(tmp_path.iterdir()) == [path]


def test_joining_loses_nothing(simulation: ligature.Simulation, tmp_path: Path) -> None:
    path, before = tmp_path / "a.h5", {}
    with written(path, simulation) as writer:
        for number in range(2):
            record(writer, simulation, number)
        with opened(path) as file:
            before = everything(file)
    with opened(path) as file:
        assert everything(file) == before


def everything(file: h5py.File) -> dict[str, object]:
    """All numbers and attributes of a dataset."""
    found: dict[str, object] = {}

    def take(place: str, item: h5py.Group | h5py.Dataset) -> None:
        found[f"{place}@"] = {name: np.asarray(value).tolist() for name, value in item.attrs.items()}
        if isinstance(item, h5py.Dataset):
            found[place] = item[()].tolist()
        else:
            for name in item:
                take(f"{place}/{name}", item[name])

    take("", file)
    found["@"].pop("closed")  # type: ignore[attr-defined]
    return found


def test_an_error_keeps_what_has_ended(simulation: ligature.Simulation, tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with pytest.raises(ZeroDivisionError), written(path, simulation) as writer:
        record(writer, simulation, 0)
        writer.sample()
        raise ZeroDivisionError
    check_whole(path, 1)
    assert list(tmp_path.iterdir()) == [path]


def test_a_dropped_episode_leaves_no_gap(simulation: ligature.Simulation, tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with written(path, simulation) as writer:
        record(writer, simulation, 0)
        writer.sample()
        writer.drop_episode()
        record(writer, simulation, 1)
    check_whole(path, 2)


def test_what_a_killed_writer_left_is_not_written_over(simulation: ligature.Simulation, tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    episode_folder(path).mkdir()
    with pytest.raises(DatasetError, match="belongs to a recording that is still running or was killed"):
        written(path, simulation)
    assert list(tmp_path.iterdir()) == [episode_folder(path)]


def test_other_files_are_no_datasets(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("no")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    with pytest.raises(DatasetError, match="cannot read the dataset"):
        join(tmp_path / "text")
    with pytest.raises(DatasetError, match="not a Ligature dataset"):
        join(tmp_path / "other.h5")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["other.h5", "text"]
