"""What an export leaves out, what it refuses and why, and its card; over datasets that are generated."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import h5py
import ligature
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st
from ligature.cli.main import app
from ligature.datasets import DatasetError, DatasetWriter
from ligature.datasets.lerobot import FORMATS, export
from ligature.datasets.lerobot.tables import json_of
from ligature.datasets.quality import pace
from typer.testing import CliRunner

from tests.datasets.lerobot_rules import COUNTERS, broken


def recorded(path: Path, simulation: ligature.Simulation, lengths: tuple[int, ...], extras: Any = None) -> Path:
    """Episodes of motion at 1000 samples a second; ``extras`` are those of sample and episode."""
    with DatasetWriter(path, simulation, cameras=(), rate=1000.0, phases=("go",)) as writer:
        for number, samples in enumerate(lengths):
            for k in range(samples):
                simulation.step(1)
                assert writer.sample("go", extra=extras(k, number) if extras else None)
            writer.end_episode(True)
    return path


def rows(root: Path, name: str) -> list[Any]:
    """A column of an export."""
    tables = [pq.read_table(path, columns=[name]) for path in sorted((root / "data").glob("*/*.parquet"))]
    return pa.concat_tables(tables)[name].to_pylist()


def info_of(path: Path) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["dataset", "info", str(path)])
    return done.exit_code, " ".join(done.output.split())


def strict(path: Path) -> list[Any]:
    """What a file has that is JSON, or lines of it; NaN and Infinity are none."""

    def refuse(constant: str) -> None:
        raise AssertionError(f"{path.name} has {constant}")

    text = path.read_text()
    lines = text.splitlines() if path.suffix == ".jsonl" else [text]
    return [json.loads(line, parse_constant=refuse) for line in lines]


TEXTS = st.text(st.sampled_from("aZ9 ü→|#:'\"[]&*!%@`-\\\n\t<>_"), max_size=12)
LINES = TEXTS.filter(str.isprintable)
KINDS: dict[str, st.SearchStrategy[Any]] = {
    "bool": st.booleans(),
    "int8": st.integers(-128, 127).map(np.int8),
    "int64": st.integers(-(2**63), 2**63 - 1),
    "float32": st.floats(-(2.0**99), 2.0**99, width=32).map(np.float32),
    "float64": st.floats(-1e99, 1e99),
}


@settings(
    max_examples=8, phases=(Phase.explicit, Phase.generate), suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    data=st.data(), format=st.sampled_from(FORMATS), license=LINES, task=TEXTS, phase=TEXTS.filter(bool), source=TEXTS
)
@example(data=None, format="lerobot-3.0", license="nonsense: [x", task="a|b\nc", phase="a|b", source="x\n| y |")
def test_any_dataset_has_a_card_that_describes_it_and_keeps_every_number(
    simulation: ligature.Simulation, tmp_path_factory: pytest.TempPathFactory, data: Any, format: str, license: str,
    task: str, phase: str, source: str,
) -> None:  # fmt: skip
    folder = tmp_path_factory.mktemp("any")
    kinds, lengths = {"x": "int64", "y": "float64"}, [2, 1, 3]
    if data is not None:
        kinds = data.draw(st.dictionaries(st.sampled_from(["x", "reward", "näh", "a b"]), st.sampled_from([*KINDS])))
        lengths = [2, *data.draw(st.lists(st.integers(1, 4), max_size=2))]
    given_values: dict[str, list[Any]] = {name: [] for name in kinds}
    with DatasetWriter(
        folder / "a.h5", simulation, cameras=(), rate=1000.0, phases=(phase,), task=task, remarks={"source": source}
    ) as writer:  # fmt: skip
        for samples in lengths:
            for k in range(samples):
                simulation.step(1)
                extra = {name: data.draw(KINDS[kind]) if data else k + 2**62 for name, kind in kinds.items()}
                writer.sample(phase, extra=extra)
                for name in kinds if samples > 1 else ():
                    given_values[name].append(np.asarray(extra[name]).item())
            writer.end_episode(True)
    log: list[str] = []
    root = folder / "out"
    export(folder / "a.h5", root, format, license=license, log=log.append)
    assert broken(root) == []
    for path in [*root.glob("meta/**/*.json"), *root.glob("meta/**/*.jsonl")]:
        assert strict(path) or path.name == "events.jsonl"
    features = strict(root / "meta/info.json")[0]["features"]
    for name in kinds:
        if f"extra.{name}" in features:  # what never changes is left out
            assert rows(root, f"extra.{name}") == given_values[name]
    short = [f"episode_{k:04d}" for k, samples in enumerate(lengths) if samples < 2]
    assert [line.split()[0] for line in log if "is left out: it has 1; an episode" in line] == short
    check_card((root / "README.md").read_text(), features, license)


def check_card(text: str, features: dict[str, Any], license: str) -> None:
    """The card has no place that was not filled in, YAML for the hub, and a meaning of each feature."""
    assert not re.search(r"[{}]", text)
    front, rest = text.removeprefix("---\n").split("\n---\n", 1)
    assert yaml.safe_load(front)["license"] == (license or "unknown")
    lines = rest.splitlines()
    table = lines.index("| name | shape | meaning |")
    described = lines[table + 2 : table + 2 + len(features)]
    for name, line in zip(features, described, strict=True):
        assert line.startswith(f"| `{name}` |")
        assert ("counter of LeRobot" in line) == (name in COUNTERS)
        assert ("array of the caller" in line) == (name.startswith("extra."))
    for line in lines:
        if line.startswith("|"):
            assert line.endswith("|"), "a text of a caller ends no row"


def test_the_card_states_where_the_data_are_from(simulation: ligature.Simulation, tmp_path: Path) -> None:
    export(recorded(tmp_path / "a.h5", simulation, (3,)), tmp_path / "out", "lerobot-3.0", log=lambda _: None)
    assert "| data type | simulated |" in (tmp_path / "out/README.md").read_text()


def test_a_license_that_is_no_line_is_refused(simulation: ligature.Simulation, tmp_path: Path) -> None:
    path = recorded(tmp_path / "a.h5", simulation, (2,))
    done = CliRunner().invoke(app, ["dataset", "export", str(path), str(tmp_path / "o"), "--license", "nonsense: [x\n"])
    assert done.exit_code == 1 and "it must be a line of printable text" in " ".join(done.output.split())
    assert list(tmp_path.iterdir()) == [path]


# --- types of a caller's arrays -------------------------------------------------------------------


def test_types_that_differ_between_episodes_become_one(simulation: ligature.Simulation, tmp_path: Path) -> None:
    path = recorded(
        tmp_path / "a.h5", simulation, (2, 2), lambda k, number: {"reward": k + 0.5 * number if number else k}
    )
    export(path, tmp_path / "out", "lerobot-3.0", log=lambda _: None)
    assert rows(tmp_path / "out", "extra.reward") == [0.0, 1.0, 0.5, 1.5]


def test_what_policies_observe_is_of_single_precision(simulation: ligature.Simulation, tmp_path: Path) -> None:
    path = recorded(tmp_path / "a.h5", simulation, (2,), lambda k, _: {"environment_state": [k, 0.1]})
    export(path, tmp_path / "out", "lerobot-3.0", log=lambda _: None)
    features = strict(tmp_path / "out/meta/info.json")[0]["features"]
    assert features["observation.environment_state"]["dtype"] == "float32"


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        ({"x": 1e101}, r"episode_0000: 'extra/x' has 1e\+101; numbers of an export must be at most 1e\+100"),
        ({"x": np.uint64(2**64 - 1)}, "'extra/x' has 18446744073709551615; numbers of an export must be at most 9.2"),
        (
            {"environment_state": 1e39},
            r"'extra/environment_state' has 1e\+39; numbers of an export must be at most 3.4",
        ),
    ],
)
def test_numbers_that_no_export_holds_are_named(
    simulation: ligature.Simulation, tmp_path: Path, extra: dict[str, Any], message: str
) -> None:
    path = recorded(tmp_path / "a.h5", simulation, (2,), lambda *_: extra)
    with pytest.raises(DatasetError, match=message):
        export(path, tmp_path / "out", "lerobot-3.0", log=lambda _: None)
    assert list(tmp_path.iterdir()) == [path]


# --- numbers that are none ------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_a_number_that_is_none_is_refused_with_its_place(
    simulation: ligature.Simulation, tmp_path: Path, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    path = recorded(tmp_path / "a.h5", simulation, (4, 4), lambda k, _: {"x": float(k)})
    names: list[str] = []
    with h5py.File(path, "r+") as file:
        file["episode_0001"].visititems(
            lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) and item.dtype.kind == "f" else None
        )
        poses = ("local_measured_cp", "local_setpoint_cp", "local_action_cp", "pose", "time")
        name = "extra/x" if seed == 0 else rng.choice([name for name in names if not name.endswith(poses)])
        array, sample, value = file[f"episode_0001/{name}"], int(rng.integers(4)), rng.choice([np.nan, np.inf, -np.inf])
        values = array[:]
        values[(sample, *rng.integers(values.shape[1:]))] = value
        array[:] = values
    place = f"'{name}' of sample {sample} is {value}"
    with pytest.raises(DatasetError, match=re.escape(f"episode_0001: {place}; numbers must be finite")):
        export(path, tmp_path / "out", "lerobot-3.0", log=lambda _: None)
    assert list(tmp_path.iterdir()) == [path]
    status, output = info_of(path)
    assert status == 0 and place in output


def test_json_has_no_number_that_is_none() -> None:
    for value in (float("nan"), float("inf")):
        with pytest.raises(ValueError, match="not JSON compliant"):
            json_of({"a": [value]})


# --- samples that are not at their rate -----------------------------------------------------------


@settings(max_examples=200)
@given(rate=st.integers(1, 1000), share=st.floats(0.01, 1.0), n=st.integers(1, 300))
@example(rate=60, share=0.96, n=5)
@example(rate=1000, share=1.0, n=300)
def test_a_loop_whose_steps_are_no_longer_than_a_period_keeps_the_rate(rate: int, share: float, n: int) -> None:
    step = share / rate
    times = np.ceil(np.arange(n) / rate / step - 1e-9) * step
    found = pace(times, rate)
    assert found.holds and found.off <= step + 1e-9


@settings(max_examples=200)
@given(rate=st.integers(1, 1000), speed=st.floats(0.01, 0.5) | st.floats(2.0, 100.0), n=st.integers(5, 300))
def test_times_of_another_speed_do_not_keep_the_rate(rate: int, speed: float, n: int) -> None:
    found = pace(5.0 + np.arange(n) / rate / speed, rate)
    assert not found.holds and found.measured == pytest.approx(rate * speed)


@pytest.mark.parametrize(("step", "rate"), [(5, 1000), (30, 100)])
def test_an_export_whose_time_would_be_wrong_is_refused(
    simulation: ligature.Simulation, tmp_path: Path, step: int, rate: int
) -> None:
    """As earlier releases wrote them, where a loop had steps longer than a period."""
    path = recorded(tmp_path / "a.h5", simulation, (6, 6))
    with h5py.File(path, "r+") as file:
        file.attrs["rate"] = float(rate)
        file["episode_0001/time"][:] = np.arange(6) * step * 1e-3
        file["episode_0000/time"][:] = np.arange(6) / rate
    measured = f"{1000 / step:.4g} samples a second"
    with pytest.raises(
        DatasetError, match=f"episode_0001 has {measured} by its times, and {rate} by its rate: .* Record"
    ):
        export(path, tmp_path / "out", "lerobot-3.0", log=lambda _: None)
    status, output = info_of(path)
    assert status == 0 and f"its times are {measured}, not {rate}" in output


def test_small_delays_are_reported(simulation: ligature.Simulation, tmp_path: Path) -> None:
    path, log = tmp_path / "a.h5", []
    with DatasetWriter(path, simulation, cameras=(), rate=60.0) as writer:
        for _ in range(60):
            simulation.step(5)
            writer.sample()
        writer.end_episode(True)
    export(path, tmp_path / "out", "lerobot-3.0", log=log.append)
    assert re.fullmatch(r"episode_0000: \d+ samples, up to [34]\.\d+ ms off the rate", log[0])
    assert re.search(r"up to [34]\.\d+ ms off the rate", info_of(path)[1])


# --- episodes that are left out -------------------------------------------------------------------


def test_episodes_of_one_sample_are_left_out_by_name(simulation: ligature.Simulation, tmp_path: Path) -> None:
    path, log = recorded(tmp_path / "a.h5", simulation, (1, 3, 1, 2)), []
    export(path, tmp_path / "out", "lerobot-3.0", log=log.append)
    assert broken(tmp_path / "out") == []
    left = "is left out: it has 1; an episode of LeRobot needs 2 samples: record longer, or more samples a second"
    assert log == [f"episode_0000 {left}", f"episode_0002 {left}", "episode_0001: 3 samples", "episode_0003: 2 samples"]


def test_nothing_but_episodes_of_one_sample_is_refused(simulation: ligature.Simulation, tmp_path: Path) -> None:
    path = recorded(tmp_path / "a.h5", simulation, (1, 1))
    with pytest.raises(
        DatasetError, match=r"no episode to export; episode_0000: it has 1; .+ needs 2 .+ \(and 1 more\)"
    ):
        export(path, tmp_path / "out", "lerobot-3.0", log=lambda _: None)
    assert list(tmp_path.iterdir()) == [path]


def test_an_episode_that_cannot_be_read_is_left_out_by_name(simulation: ligature.Simulation, tmp_path: Path) -> None:
    path = recorded(tmp_path / "a.h5", simulation, (2, 2, 3))
    with h5py.File(path, "r+") as file:
        file["episode_0001"].attrs["success"] = "yes"
        file["episode_0002/time"][1] = 0.0
    done = CliRunner().invoke(app, ["dataset", "export", str(path), str(tmp_path / "out")])
    output = " ".join(done.output.split())
    assert done.exit_code == 0, output
    assert "episode_0001 is left out: attribute 'success' of 'episode_0001' must be true or false" in output
    assert "episode_0002 is left out: 'episode_0002/time' does not ascend at sample 1" in output
    assert broken(tmp_path / "out") == []
