"""Datasets: what is sampled is what was there, with units, labels and what the scene is."""

from __future__ import annotations

import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import ligature
import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from ligature.datasets import DatasetError, DatasetWriter, rows
from ligature.datasets.store import episode_names, join, opened
from ligature.datasets.writer import _IMPATIENCE, DEPTH_UNIT, IMPATIENT, _count
from ligature.render.cameras import CameraHandle
from ligature.render.target import Exposure

ROOT = Path(__file__).resolve().parents[2]
SMALL = ROOT / "scenes" / "suturing_small" / "launch.yaml"


@pytest.fixture(scope="module")
def written(simulation: ligature.Simulation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes, and beside them what was really there at each sample."""
    folder = tmp_path_factory.mktemp("dataset")
    path, truth = folder / "data.h5", []
    with DatasetWriter(
        path, simulation, size=(64, 48), rate=50.0, phases=("wait", "work"), task="wait and work", gestures={"work": "G3"},
        remarks={"source": "test"},
    ) as writer:  # fmt: skip
        for success in (True, False):
            for k in range(12):
                simulation.step(10)
                if writer.sample("work" if k > 5 else "wait", ["PSM2"]):
                    truth.append(
                        (simulation.time, simulation.bodies["Needle"].pose, simulation.arms["PSM1"].measured_js())
                    )
                    picture = simulation.cameras["cameraR"].capture((64, 48))
            writer.end_episode(success, seed=3)
    np.savez(folder / "truth.npz", time=[t for t, *_ in truth], needle=[n for _, n, _ in truth],
             joints=[j.position for *_, j in truth], rgb=picture.rgb, depth=picture.depth, ids=picture.ids)  # fmt: skip
    return path


def test_pictures_are_packed_in_another_thread_while_those_of_the_next_sample_are_drawn(
    simulation: ligature.Simulation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    packing: list[threading.Thread] = []

    def noting(owner: type, method: str, name: str) -> None:
        real = getattr(owner, method)

        def noted(*given: Any, **options: Any) -> Any:
            if threading.current_thread() is threading.main_thread():
                done.append(name)
            return real(*given, **options)

        monkeypatch.setattr(owner, method, noted)

    def packed(picture: Any) -> rows.Packed:
        packing.append(threading.current_thread())
        return real(picture)

    real = rows.Packed.of
    monkeypatch.setattr(rows.Packed, "of", packed)
    noting(CameraHandle, "expose", "begin")
    noting(Exposure, "fetch", "fetch")
    with DatasetWriter(tmp_path / "data.h5", simulation, ("cameraL",), (64, 48), rate=1000.0) as writer:
        for _ in range(3):
            simulation.step()
            done.append("sample")
            writer.sample()
        done.append("end")
    first, *samples, end = "".join({"sample": " ", "end": " "}.get(name, name[0]) for name in done).split()
    steps = [list(dict.fromkeys(steps)) for steps in samples]
    assert first == "b" and steps == [list("fb")] * 2 and set(end) == {"f"}
    assert len(packing) == 9 and threading.main_thread() not in packing


def test_samples_come_at_the_rate_and_state_what_was_there(written: Path) -> None:
    truth = np.load(written.parent / "truth.npz")
    with h5py.File(written) as file:
        episodes = [file[name] for name in ("episode_0000", "episode_0001")]
        assert [e.attrs["samples"] for e in episodes] == [6, 6]
        assert [bool(e.attrs["success"]) for e in episodes] == [True, False]
        assert episodes[0].attrs["seed"] == 3
        times = np.concatenate([e["time"][:] for e in episodes])
        assert times == pytest.approx(truth["time"])
        assert np.diff(episodes[0]["time"][:]) == pytest.approx(0.02)
        needle = np.concatenate([e["needle/pose"][:] for e in episodes])
        assert needle == pytest.approx(truth["needle"], abs=1e-6)
        joints = np.concatenate([e["arms/PSM1/measured_js"][:, 0] for e in episodes])
        assert joints == pytest.approx(truth["joints"], abs=1e-6)
        phases = [file.attrs["phases"][k] for k in episodes[0]["phase"][:]]
        assert phases == ["wait"] * 3 + ["work"] * 3
        assert episodes[0]["thread/points"].shape == (6, 40, 3)
        assert "jaw/measured_js" in episodes[0]["arms/PSM2"]


def test_pictures_are_those_of_the_camera(written: Path) -> None:
    truth = np.load(written.parent / "truth.npz")
    with h5py.File(written) as file:
        camera = file["episode_0001/cameras/cameraR"]
        assert (camera["rgb"][-1] == truth["rgb"]).all()
        assert (camera["ids"][-1] == truth["ids"]).all()
        seen = np.isfinite(truth["depth"])
        assert seen.any()
        assert camera["depth"][-1][seen] * file.attrs["depth_unit"] == pytest.approx(truth["depth"][seen], abs=6e-5)
        assert (camera["depth"][-1][~seen] == 0).all()
        names = file["id_names"].asstr()[:]
        assert any("phantom" in names[i].lower() for i in np.unique(truth["ids"]))
        assert camera["intrinsics"].shape == (6, 3, 3)


def test_a_dataset_says_what_it_is_of(written: Path, simulation: ligature.Simulation) -> None:
    with h5py.File(written) as file:
        attributes = file.attrs
        assert attributes["scene"] == "suturing_small"
        assert (attributes["task"], attributes["source"]) == ("wait and work", "test")
        assert list(attributes["gestures"]) == ["", "", "G3"]
        for name, arm in file["arms"].items():
            robot, description = simulation.arms[name], next(a for a in simulation.scene.arms if a.name == name)
            assert arm.attrs["tool"] == robot.tool_type
            assert list(arm.attrs["joint_names"]) == list(robot.joints.names)
            assert list(arm.attrs["joint_units"]) == ["rad", "rad", "m", "rad", "rad", "rad"]
            assert arm.attrs["base_pose"] == pytest.approx(simulation.state["body_pose"][0, description.base])
        for name in ("episode_0000", "episode_0001"):
            assert file[name].attrs["task"] == "wait and work"
            assert file[name]["arms/PSM1/measured_js"].attrs["units"] == "rad, rad, m, rad, rad, rad"
        assert set(file["arms"]) == {"PSM1", "PSM2"}


def test_all_numbers_have_units(written: Path) -> None:
    bare = {"phase", "activity", "rgb", "ids"}
    with h5py.File(written) as file:
        missing = []
        file["episode_0000"].visititems(
            lambda name, item: missing.append(name)
            if isinstance(item, h5py.Dataset) and name.split("/")[-1] not in bare and "units" not in item.attrs
            else None
        )
    assert not missing


def test_the_action_of_a_sample_is_the_next_set_point(written: Path) -> None:
    with h5py.File(written) as file:
        for arm in file["episode_0001/arms"].values():
            for setpoint, action in (
                (arm["setpoint_js"][:, 0], arm["action_js"][:]),
                (arm["local_setpoint_cp"][:], arm["local_action_cp"][:]),
                (arm["jaw/setpoint_js"][:, 0], arm["jaw/action_js"][:]),
            ):
                assert (action[:-1] == setpoint[1:]).all() and (action[-1] == setpoint[-1]).all()


def test_labels_name_the_arm_that_works(written: Path) -> None:
    with h5py.File(written) as file:
        arms, phases = file["episode_0000/arms"], list(file.attrs["phases"])
        assert [phases[k] for k in arms["PSM2/phase"][:]] == ["wait"] * 3 + ["work"] * 3
        assert set(arms["PSM1/phase"][:]) == {0}
        activities = list(file.attrs["activities"])
        assert {activities[k] for k in arms["PSM1/activity"][:]} <= {"idle", "moves"}


def test_the_reader_of_the_examples_reads_it(written: Path) -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "examples" / "read_dataset.py", written], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert "episode_0000: 6 samples, success True; wait 3, work 3" in done.stdout
    assert "picture (48, 64, 3)" in done.stdout


def test_an_error_leaves_nothing_behind(simulation: ligature.Simulation, tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), DatasetWriter(tmp_path / "a.h5", simulation, cameras=()) as writer:
        writer.sample()
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", [[], ["missing.h5"], [__file__]])
def test_the_reader_of_the_examples_says_what_it_wants(words: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "examples" / "read_dataset.py", *words], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2 and "usage: read_dataset.py" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"rate": 0.0}, "rate must be above 0 and at most 1000 samples per simulated second"),
        *(({"rate": rate}, "rate is .+; it must be a number of samples") for rate in ("10", None, True, [10.0], 1j)),
        ({"rate": float("nan")}, "rate must be above 0"),
        ({"size": (0, 48)}, "size is a width and a height"),
        ({"size": (20_000, 48)}, "from 1 to 8192 each, not 20000 and 48"),
        *(
            ({"size": size}, "size is .+; it must be a width and a height in pixels, as")
            for size in ("320x240", (320,), (320.5, 240), None, 320, (1, 2, 3), ("320", "240"))
        ),
        *(
            ({"cameras": given}, "cameras is .+; it must be a list of names, .. for none")
            for given in ("cameraL", None, 3)
        ),
        ({"cameras": ("cameraL", "cameraL")}, "cameras: 'cameraL' is there twice; give each name once"),
        *(({"phases": given}, "phases is .+; it must be a list of names, .. for none") for given in ("reach", None, 3)),
        *(({"phases": (given,)}, "phases: .+ is not a name; each must be a text") for given in (1, "", None)),
        ({"phases": ("a", "b", "a")}, "phases: 'a' is there twice; give each name once"),
        ({"phases": tuple(map(str, range(256)))}, "at most 255 phases, not 256"),
        ({"gestures": ["G3"]}, "gestures is .+; it must be values by their names, as a dict"),
        ({"remarks": "mine"}, "remarks is 'mine'; it must be values by their names"),
        ({"remarks": {1: 2}}, "remarks: 1 cannot be the name of a remark"),
        ({"remarks": {"recorded": True}}, "'recorded' is set by the writer"),
        ({"gestures": {"work": "G3"}}, "gestures: 'work' is not a phase; the phases are .+"),
        ({"phases": ("work",), "gestures": {"work": "G99"}}, "'G99' is not one of the gestures G1, G2"),
    ],
)
def test_what_no_dataset_can_have_is_refused(
    simulation: ligature.Simulation, tmp_path: Path, wrong: dict, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        DatasetWriter(tmp_path / "a.h5", simulation, **wrong)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", [str, Path])
def test_what_exists_is_not_replaced(simulation: ligature.Simulation, tmp_path: Path, kind: type) -> None:
    path = tmp_path / "a.h5"
    path.write_text("mine")
    with pytest.raises(DatasetError, match="exists already; choose another name"):
        DatasetWriter(kind(path), simulation)
    assert path.read_text() == "mine"


def test_a_phase_that_was_not_announced_is_refused(simulation: ligature.Simulation, tmp_path: Path) -> None:
    with (
        pytest.raises(ValueError, match="unknown phase 'knit'; choose one of work"),
        DatasetWriter(tmp_path / "a.h5", simulation, cameras=(), phases=("work",)) as writer,
    ):
        writer.sample("knit")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"phase": "work", "arms": ["PSM9"]}, "arms: unknown arm 'PSM9'; choose from PSM1, PSM2"),
        ({"arms": "PSM1"}, "arms is 'PSM1'; it must be a list of names"),
        ({"extra": [1.0]}, "extra is .+; it must be values by their names, as a dict"),
        *(
            ({"extra": {"x": value}}, "extra: 'x' is .+; it must be floats, whole numbers of at most 64 bits, or True")
            for value in (None, "1.5", 2**64, np.datetime64("2026"), np.timedelta64(1), 1j, object(), [1, None], b"x")
        ),
        *(
            ({"extra": {"x": [1.0, value]}}, rf"extra: 'x' has {value} at \[1\]; numbers must be finite")
            for value in (np.nan, np.inf, -np.inf)
        ),
    ],
)
def test_a_sample_that_no_dataset_can_have_is_refused_and_the_episode_goes_on(
    simulation: ligature.Simulation, tmp_path: Path, wrong: dict, message: str
) -> None:
    with DatasetWriter(tmp_path / "a.h5", simulation, cameras=(), phases=("work",), rate=1000.0) as writer:
        for asked in ({}, wrong, {}):
            simulation.step(1)
            if asked:
                with pytest.raises(ValueError, match=message):
                    writer.sample(**asked)
            else:
                assert writer.sample(extra=None if "extra" not in wrong else {"x": [1.0, 2.0]})
    with opened(tmp_path / "a.h5") as file:
        assert file["episode_0000"].attrs["samples"] == 2


TRUE_OR_FALSE = [True, False, np.bool_(True), np.bool_(False), np.array(True), np.array([False]), 0, 1, np.int8(1)]
NEITHER = [None, "yes", 0.5, 1.0, 2, -1, [True], np.array([True, False]), np.array(["yes"]), float("nan"), {}, b"1"]


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(outcomes=st.lists(st.tuples(st.sampled_from([*TRUE_OR_FALSE, *NEITHER]), st.booleans()), max_size=4))
def test_an_outcome_that_is_no_truth_value_is_refused_and_the_episode_goes_on(
    simulation: ligature.Simulation, tmp_path_factory: pytest.TempPathFactory, outcomes: list[tuple[Any, bool]]
) -> None:
    """So that it never makes a dataset that nobody can read, be it the success or whether it was judged."""
    path, kept = tmp_path_factory.mktemp("outcomes") / "a.h5", []
    with DatasetWriter(path, simulation, cameras=(), rate=1000.0) as writer:
        for outcome, of_judging in outcomes:
            given = {"success": True, "judged": outcome} if of_judging else {"success": outcome, "judged": True}
            simulation.step(1)
            writer.sample()
            if any(outcome is each for each in NEITHER):
                with pytest.raises(ValueError, match="must be True or False"):
                    writer.end_episode(**given)
                given = {"success": False, "judged": False}
            writer.end_episode(**given)
            kept.append({name: bool(value) for name, value in given.items()})
    with opened(path) as file:
        found = [{name: file[each].attrs[name] for name in ("success", "judged")} for each in episode_names(file)]
    assert found == kept and all(value.shape == () for each in found for value in each.values())


NUMBERS = st.one_of(
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from([np.int8(3), np.uint64(2**64 - 1), np.float32(0.1), np.float16(0.5), 2**62 + 1, 1764340000.123456]),
)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(values=st.lists(NUMBERS, min_size=1, max_size=5))
@example(values=[2**62 + 1, True])
@example(values=[0, 0.5])
@example(values=[2**62 + 1, 0.5])
@example(values=[np.int8(1), 2**40])
def test_what_a_caller_adds_comes_back_to_the_digit(
    simulation: ligature.Simulation, tmp_path_factory: pytest.TempPathFactory, values: list[Any]
) -> None:
    """Numbers keep their type; where types follow each other, the array has one that holds them all, or one is refused."""
    path, kept = tmp_path_factory.mktemp("digits") / "a.h5", []
    with DatasetWriter(path, simulation, cameras=(), rate=1000.0) as writer:
        for value in values:
            with suppress(ValueError):
                writer.sample(extra={"x": value})
                simulation.step(1)
                kept.append(value)
    with opened(path) as file:
        found = file["episode_0000/extra/x"]
        assert found[:].tolist() == [np.asarray(value).item() for value in kept]
        if len({np.asarray(value).dtype for value in values}) == 1:
            assert found.dtype == np.asarray(values[0]).dtype and len(kept) == len(values)


def test_a_type_that_widens_keeps_rows_that_are_written_already(
    simulation: ligature.Simulation, tmp_path: Path
) -> None:
    values = [*range(rows.GATHERED + 3), 0.5, 2]
    with DatasetWriter(tmp_path / "a.h5", simulation, cameras=(), rate=1000.0) as writer:
        for value in values:
            simulation.step(1)
            assert writer.sample(extra={"x": [value, 1]})
    with opened(tmp_path / "a.h5") as file:
        found = file["episode_0000/extra/x"]
        assert found[:, 0].tolist() == values and found.dtype == float and found.attrs["units"] == "the caller's"


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rate=st.integers(5, 1000) | st.floats(5.0, 1000.0), ticks=st.integers(1, 60))
@example(rate=1000, ticks=5)
@example(rate=100, ticks=30)
@example(rate=60, ticks=16)
def test_samples_are_at_their_rate_or_refused(
    simulation: ligature.Simulation, tmp_path_factory: pytest.TempPathFactory, rate: float, ticks: int
) -> None:
    """A loop whose steps are no longer than a period is never refused, and late by less than a step."""
    path, step = tmp_path_factory.mktemp("rates") / "a.h5", ticks * simulation.dt
    refused = ""
    with DatasetWriter(path, simulation, cameras=(), rate=rate) as writer:
        for _ in range(40 + int(1.5 / rate / step)):
            try:
                writer.sample()
            except ValueError as error:
                refused = str(error)
                break
            simulation.step(ticks)
    with opened(path) as file:
        time = file["episode_0000/time"][:]
    late = time - time[0] - np.arange(len(time)) / rate
    assert late.min() >= -1e-6 and late.max() <= min(step, 1.0 / rate) + 2e-6
    if step <= 1.0 / rate:
        assert not refused
    elif step > 2.0 / rate + 1e-5:
        assert "call sample() at least every" in refused and f"would not be {float(rate):g} a second" in refused


@pytest.mark.parametrize("end", ["end_episode", "drop_episode"])
def test_time_that_goes_back_within_an_episode_is_refused(
    simulation: ligature.Simulation, tmp_path: Path, end: str
) -> None:
    before = simulation.snapshot()
    with DatasetWriter(tmp_path / "a.h5", simulation, cameras=(), rate=100.0) as writer:
        for _ in range(3):
            simulation.step(10)
            assert writer.sample()
        simulation.step(5)
        assert not writer.sample()
        simulation.restore(before)
        for _ in range(2):
            with pytest.raises(ValueError, match=r"time went back .+; call end_episode\(\) or drop_episode\(\) before"):
                writer.sample()
        writer.end_episode(True) if end == "end_episode" else writer.drop_episode()
        for _ in range(2):
            simulation.step(10)
            assert writer.sample()
    with opened(tmp_path / "a.h5") as file:
        counts = [file[name].attrs["samples"] for name in episode_names(file)]
    assert counts == ([3, 2] if end == "end_episode" else [2])


def test_a_closed_simulation_and_a_closed_dataset_are_reported(tmp_path: Path) -> None:
    simulation = ligature.Simulation(ligature.load(SMALL))
    with DatasetWriter(tmp_path / "a.h5", simulation, cameras=(), rate=100.0) as writer:
        assert writer.sample()
        simulation.close()
        with pytest.raises(RuntimeError, match=r"closed; call follow\(\)"):
            writer.sample()
    with pytest.raises(DatasetError, match="a.h5' is closed; make another writer"):
        writer.sample()
    with opened(tmp_path / "a.h5") as file:
        assert file["episode_0000"].attrs["samples"] == 1
    with pytest.raises(RuntimeError, match="the simulation is closed; make a new one"):
        DatasetWriter(tmp_path / "b.h5", simulation, cameras=())
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]


ARRAYS = st.sampled_from([(), (1,), (3,), (4,), (2, 2), (0,), (2, 0)]).map(np.zeros)
EXTRAS = st.dictionaries(
    st.sampled_from(["state", "reward", "näh", "a b", "a/b", "", ".", "..", "a\0b", "\ud800"]) | st.text(max_size=8),
    ARRAYS | st.sampled_from([0.5, "left", None, [[1.0], [1.0, 2.0]], 1j]),
    max_size=2,
)
REMARKS = st.dictionaries(
    st.sampled_from(["seed", "why", "task", "operator", "samples", "phases", "rate"]),
    st.integers() | st.floats() | st.text(max_size=8) | st.sampled_from([None, "a\0b", "\ud800", {}, [1], b"x", 1j]),
    max_size=2,
)


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(episodes=st.lists(st.tuples(st.lists(EXTRAS, max_size=4), REMARKS), max_size=3), remarks=REMARKS)
def test_what_a_caller_adds_is_kept_or_refused_and_the_dataset_is_sound(
    simulation: ligature.Simulation, tmp_path_factory: pytest.TempPathFactory, episodes: list, remarks: dict
) -> None:
    """Whatever is refused leaves the episode as it was, so that a caller who goes on has a dataset."""
    path, counts = tmp_path_factory.mktemp("kept") / "a.h5", []
    try:
        writer = DatasetWriter(path, simulation, cameras=(), rate=1000.0, remarks=remarks)
    except ValueError:
        assert not path.exists()
        return
    with writer:
        for extras, noted in episodes:
            count = 0
            for extra in extras:
                simulation.step(1)
                with suppress(ValueError):
                    count += writer.sample(extra=extra)
            try:
                writer.end_episode(True, **noted)
            except ValueError as error:
                assert any(name in str(error) for name in noted)
                writer.end_episode(True)
            counts += [count] if count else []
    with opened(path) as file:
        assert [file[name].attrs["samples"] for name in episode_names(file)] == counts
        for name in episode_names(file):
            assert all(len(array) == file[name].attrs["samples"] for array in file[name].get("extra", {}).values())


@given(st.sets(st.integers(0, 200_000), min_size=2))
def test_episodes_stay_in_order_however_many(numbers: set[int]) -> None:
    names = [f"episode_{number:04d}" for number in sorted(numbers)]
    assert episode_names(dict.fromkeys(names[::-1])) == names  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["cameraL", "/ambf/env/cameras/cameraL", "cameras/cameraL"])
def test_a_camera_is_kept_by_its_own_name_however_it_is_asked_for(
    simulation: ligature.Simulation, tmp_path: Path, name: str
) -> None:
    """Messages list cameras with their namespaces."""
    with pytest.raises(ValueError, match="is asked for twice; name each camera once" if name != "cameraL" else "twice"):
        DatasetWriter(tmp_path / "a.h5", simulation, cameras=(name, "cameraL"))
    with DatasetWriter(tmp_path / "a.h5", simulation, cameras=(name,), size=(16, 16), rate=100.0) as writer:
        for _ in range(2):
            simulation.step(10)
            writer.sample()
    with opened(tmp_path / "a.h5") as file:
        assert list(file["episode_0000/cameras"]) == ["cameraL"]
        assert file["episode_0000/cameras/cameraL/rgb"].shape == (2, 16, 16, 3)


@pytest.mark.parametrize("name", ["", ".", "..", "/", "{0}", "{0}/."])
def test_a_folder_is_no_dataset(simulation: ligature.Simulation, tmp_path: Path, name: str) -> None:
    path = Path(name.format(tmp_path))
    for ask in (lambda: DatasetWriter(path, simulation, cameras=()), lambda: opened(path), lambda: join(path)):
        with pytest.raises(DatasetError, match="is a folder"):
            ask()
    assert list(tmp_path.iterdir()) == []


FULL = """
import resource, sys
import ligature
from pathlib import Path
from ligature.datasets import DatasetError, DatasetWriter
simulation = ligature.Simulation(ligature.load({scene!r}))
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
try:
    with DatasetWriter(Path({path!r}), simulation, cameras=(), rate=1000.0) as writer:
        for _ in range(2000):
            writer.sample()
            simulation.step()
except DatasetError as error:
    print(error)
    sys.exit(7)
"""


def test_a_file_that_cannot_grow_is_reported_and_leaves_nothing(tmp_path: Path) -> None:
    """A limit of file sizes stands for a full disk: both have writes refused in the middle."""
    path = tmp_path / "a.h5"
    done = subprocess.run(
        [sys.executable, "-c", FULL.format(scene=str(SMALL), path=str(path))],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 7, done.stderr[-2000:]
    assert f"cannot write the dataset '{path}'" in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_tissue_is_sampled_with_its_punctures_and_forces(tmp_path: Path) -> None:
    simulation = ligature.Simulation(ligature.load(ROOT / "scenes" / "needle_insertion" / "launch.yaml"))
    simulation.bodies["Needle"].set_pose([0.03, 0.23, 0.7185, 0.7071068, 0, 0, 0.7071068])
    truth = []
    with DatasetWriter(tmp_path / "a.h5", simulation, cameras=(), rate=100.0) as writer:
        for _ in range(10):
            simulation.step(10)
            writer.sample()
            state = simulation.state[0]
            truth.append({name: state[name].copy() for name in (
                "tissue_node", "tissue_wrench", "tissue_peak", "puncture_count", "puncture_point", "puncture_normal"
            )})  # fmt: skip
    simulation.close()
    with h5py.File(tmp_path / "a.h5") as file:
        block = file["episode_0000/tissue/Block"]
        for name, field in {
            "points": "tissue_node", "wrench": "tissue_wrench", "peak_force": "tissue_peak",
            "puncture_count": "puncture_count", "puncture_points": "puncture_point",
            "puncture_normals": "puncture_normal",
        }.items():  # fmt: skip
            expected = np.array([moment[field] if name == "points" else moment[field][0] for moment in truth])
            np.testing.assert_allclose(block[name][:], expected, rtol=1e-5, atol=1e-6, err_msg=name)
        assert np.abs(np.diff(block["points"][:], axis=0)).max() > 0.0
        assert all("units" in block[name].attrs for name in block)


def test_depth_is_kept_in_whole_units_of_two_bytes() -> None:
    rng = np.random.default_rng(4)
    metres = rng.choice([1.0, 10.0, 1e3, 1e30], (40, 30)) * rng.uniform(0.0, 1.0, (40, 30))
    metres[rng.random(metres.shape) < 0.2] = np.inf
    metres, numbers = metres.astype("f4"), rng.integers(0, 2**16, metres.shape, dtype=np.int32)
    depth, ids = np.zeros((2, *metres.shape), dtype=np.uint16)
    _count(metres, numbers, depth, ids)
    steps = np.where(np.isfinite(metres), metres / np.float32(DEPTH_UNIT), 0.0)
    assert (depth == np.minimum(steps.round(), 65535.0)).all() and (ids == numbers).all()
    assert (depth == 65535).any() and (depth == 0).any()


def test_threads_wait_as_ever_once_no_writer_develops_pictures() -> None:
    usual, seen = sys.getswitchinterval(), []
    sys.setswitchinterval(0.003)
    try:
        both = threading.Barrier(2)

        def develop(longer: bool) -> None:
            with _IMPATIENCE:
                both.wait(30.0)
                seen.append(sys.getswitchinterval())
                both.wait(30.0)
                if longer:
                    other.join(30.0)
                    seen.append(sys.getswitchinterval())

        first, other = (threading.Thread(target=develop, args=(longer,)) for longer in (True, False))
        for thread in (first, other):
            thread.start()
        first.join(30.0)
        assert seen == pytest.approx([IMPATIENT] * 3) and sys.getswitchinterval() == pytest.approx(0.003)
    finally:
        sys.setswitchinterval(usual)
