"""An episode that has ended is on the disk, whatever comes then: kills, signals, errors, a full disk."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import ligature
import numpy as np
import pytest
from ligature.cli.main import app
from ligature.datasets import DatasetError, DatasetWriter
from ligature.datasets.probe import probe
from ligature.datasets.store import episode_folder, episode_names, join, opened
from typer.testing import CliRunner

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


# --- episodes that cannot be read -----------------------------------------------------------------

DAMAGE: dict[str, tuple[Callable[[h5py.File], object], str]] = {
    "an outcome in words": (
        lambda file: file.attrs.create("success", "yes"),
        "attribute 'success' of 'episode_0001' must be true or false",
    ),
    "an outcome as a list": (lambda file: file.attrs.create("success", [True]), "'success' of 'episode_0001' must be"),
    "a judgement in words": (lambda file: file.attrs.create("judged", "no"), "'judged' of 'episode_0001' must be true"),
    "no number of samples": (
        lambda file: file.attrs.pop("samples"),
        "attribute 'samples' of 'episode_0001' is missing",
    ),
    "a missing array": (lambda file: file.pop("phase"), "'episode_0001/phase' is missing or not an array"),
    "times that jump back": (
        lambda file: file["time"].write_direct(np.zeros(1), dest_sel=np.s_[3:4]),
        "'episode_0001/time' does not ascend at sample 3, where it is 0",
    ),
    "times that stand": (
        lambda file: file["time"].write_direct(file["time"][:], np.s_[2:3], np.s_[3:4]),
        "'episode_0001/time' does not ascend at sample 3",
    ),
    "a time that is none": (
        lambda file: file["time"].write_direct(np.full(1, np.nan), dest_sel=np.s_[3:4]),
        "'episode_0001/time' does not ascend at sample 3, where it is nan",
    ),
    "a circle": (lambda file: file.create_group("circle").__setitem__("round", file["/"]), "'episode_0001/circle"),
}


def three(path: Path, simulation: ligature.Simulation, closed: bool) -> None:
    """A dataset of three episodes, as a writer leaves it that ended, or that was killed."""
    writer = written(path, simulation)
    for number in range(3):
        record(writer, simulation, number, 5)
    if closed:
        writer.close()


@pytest.mark.parametrize("closed", [True, False], ids=["closed", "growing"])
@pytest.mark.parametrize("damage", DAMAGE)
def test_an_episode_that_cannot_be_read_is_named_and_the_others_are_reached(
    simulation: ligature.Simulation, tmp_path: Path, damage: str, closed: bool
) -> None:
    path = tmp_path / "a.h5"
    three(path, simulation, closed)
    change, why = DAMAGE[damage]
    with h5py.File(path if closed else episode_folder(path) / "episode_0001.h5", "r+") as file:
        change(file["episode_0001"] if closed else file)
    with pytest.raises(DatasetError, match=r"a\.h5' is not a valid dataset: episode_0001: ") as strict:
        opened(path)
    assert why in str(strict.value) and "/'" not in str(strict.value)
    bad: dict[str, str] = {}
    with opened(path, bad) as file:
        assert list(bad) == ["episode_0001"] and why in bad["episode_0001"]
        assert episode_names(file, bad) == ["episode_0000", "episode_0002"]
        assert [file[name].attrs["number"] for name in episode_names(file, bad)] == [0, 2]
    printed = CliRunner().invoke(app, ["dataset", "info", str(path)])
    assert printed.exit_code == 1 and why in printed.output.replace("\n", " ")
    assert "episode_0000: 5 samples" in printed.output and "episode_0002: 5 samples" in printed.output


def test_joining_leaves_an_episode_that_cannot_be_read_where_it_is(
    simulation: ligature.Simulation, tmp_path: Path
) -> None:
    path = tmp_path / "a.h5"
    three(path, simulation, closed=False)
    lost = episode_folder(path) / "episode_0001.h5"
    with h5py.File(lost, "r+") as file:
        file.attrs["success"] = "yes"
    with pytest.raises(DatasetError, match="episode_0001: attribute 'success' of 'episode_0001' must be"):
        join(path)
    assert len(list(episode_folder(path).iterdir())) == 3, "an error leaves all as it was"
    printed = CliRunner().invoke(app, ["dataset", "join", str(path)])
    output = printed.output.replace("\n", " ")
    assert printed.exit_code == 1 and "2 episodes in one file" in output and "episode_0001: attribute" in output
    with opened(path) as file:
        assert file.attrs["closed"] and episode_names(file) == ["episode_0000", "episode_0002"]
    assert list(episode_folder(path).iterdir()) == [lost]


@pytest.mark.parametrize("gone", [(1,), (0, 1, 2)])
def test_an_episode_whose_file_is_gone_is_named(
    simulation: ligature.Simulation, tmp_path: Path, gone: tuple[int, ...]
) -> None:
    path = tmp_path / "a.h5"
    three(path, simulation, closed=False)
    for number in gone:
        (episode_folder(path) / f"episode_000{number}.h5").unlink()
    bad: dict[str, str] = {}
    with opened(path, bad):
        assert list(bad) == [f"episode_000{number}" for number in gone]
    if len(gone) < 3:
        assert join(path, {}) == 2
    else:
        with pytest.raises(DatasetError, match="episode_0000: "):
            join(path, {})


def test_a_writer_that_closes_keeps_what_can_be_read_and_names_the_rest_once(
    simulation: ligature.Simulation, tmp_path: Path
) -> None:
    path = tmp_path / "a.h5"
    with pytest.raises(DatasetError) as raised, written(path, simulation) as writer:
        for number in range(3):
            record(writer, simulation, number, 5)
        with h5py.File(episode_folder(path) / "episode_0001.h5", "r+") as file:
            file.attrs["success"] = "yes"
    assert str(raised.value).count("attribute 'success' of 'episode_0001'") == 1
    assert "stay in" in str(raised.value) and "2 episodes are whole" in str(raised.value)
    with opened(path) as file:
        assert episode_names(file) == ["episode_0000", "episode_0002"]
    assert [place.name for place in episode_folder(path).iterdir()] == ["episode_0001.h5"]


def test_bytes_of_an_episode_that_cannot_be_unpacked_are_found_before_they_are_read(
    simulation: ligature.Simulation, tmp_path: Path
) -> None:
    path = tmp_path / "a.h5"
    three(path, simulation, closed=True)
    with h5py.File(path, "r+") as file:
        del file["episode_0001/phase"]
        array = file.create_dataset("episode_0001/phase", (5,), "u1", chunks=(5,), compression="gzip")
        array.id.write_direct_chunk((0,), b"no deflate")
    assert list(probe(path)) == ["episode_0001"]
    printed = CliRunner().invoke(app, ["dataset", "info", str(path)])
    assert printed.exit_code == 1 and "episode_0002: 5 samples" in printed.output and "episode_0001: " in printed.output
