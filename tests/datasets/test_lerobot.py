"""Exports in LeRobot's formats keep the formats' rules, and hold what the HDF5 file holds."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import av
import h5py
import ligature
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from ligature.cli.main import app
from ligature.datasets import DatasetError, DatasetWriter
from ligature.datasets.lerobot import FORMATS, export
from ligature.model.frames import axis_rotation, frame, matrix_pose7, pose7_matrix
from typer.testing import CliRunner

from tests.datasets.doctor import examined
from tests.datasets.lerobot_rules import broken, broken_for_open_h

ROOT = Path(__file__).resolve().parents[2]
SMALL = ROOT / "scenes" / "suturing_small" / "launch.yaml"
SETTLED = 1.0
"""Seconds after which the arms follow their waves."""

RATE, SAMPLES = 50, (106, 104, 108, 102)


@pytest.fixture(scope="module")
def simulation() -> Iterator[ligature.Simulation]:
    found = ligature.Simulation(ligature.load(SMALL))
    for arm in ("PSM1", "PSM2"):
        found.arms[arm].place_jp([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])
        found.arms[arm].adopt()
    yield found
    found.close()


def record(
    simulation: ligature.Simulation, path: Path, size: tuple[int, int], cameras: tuple[str, ...],
    lengths: tuple[int, ...] = SAMPLES,
) -> Path:  # fmt: skip
    """Four episodes in which all moves all the while: two tasks, a failure, and one that nothing judged."""
    needle = simulation.scene.bodies[simulation.scene.needles[0].body]

    def lift(time: float) -> np.ndarray:
        turn = axis_rotation((0.48, 0.36, 0.8), 0.1 * np.sin(3.0 * time))
        return frame(turn, np.array([0.0, 0.0, 0.03]) + 0.002 * np.sin(np.array([3.0, 3.4, 3.8]) * time))

    with DatasetWriter(path, simulation, cameras, size, RATE, ("reach", "back"), "wave", {"reach": "G1"}) as writer:
        for number, samples in enumerate(lengths):
            begin, taken = simulation.time, 0
            while taken < samples:
                time = simulation.time - begin
                for k, name in enumerate(("PSM1", "PSM2")):
                    wave = np.sin(2.0 * (1.0 + 0.2 * np.arange(7)) * time + number + k)
                    simulation.arms[name].servo_jp(np.array([0.0, 0.0, 0.12, 0, 0, 0]) + wave[:6] * 0.04)
                    simulation.arms[name].jaw.servo_jp([0.3 + 0.2 * wave[6]])
                simulation.set_pose(needle.index, matrix_pose7(lift(time + number) @ needle.T_world_body))
                if time > SETTLED:
                    taken += writer.sample("reach" if taken < samples / 2 else "back")
                simulation.step(10)
            remarks = {"task": "wave back"} if number == 2 else {}
            writer.end_episode(number != 1, judged=number != 3, seed=number, **remarks)
    return path


@pytest.fixture(scope="module")
def source(simulation: ligature.Simulation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lerobot")
    return record(simulation, folder / "waves.h5", (64, 48), ("cameraL", "cameraR"))


@pytest.fixture(scope="module", params=FORMATS)
def exported(request: pytest.FixtureRequest, source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    # workers that share tests out may come back to a format
    target = tmp_path_factory.mktemp("exports") / request.param
    export(source, target, request.param, log=lambda _: None)
    return target


def data(root: Path) -> dict[str, np.ndarray]:
    """All rows of an export, in order."""
    tables = [pq.read_table(path) for path in sorted((root / "data").glob("*/*.parquet"))]
    whole = pa.concat_tables(tables)
    return {name: np.array(whole[name].to_pylist()) for name in whole.column_names}


def test_an_export_breaks_no_rule(exported: Path) -> None:
    assert broken(exported) == []


def test_numbers_are_those_of_the_recording(exported: Path, source: Path) -> None:
    found = data(exported)
    order = ["episode_0000", "episode_0002", "episode_0001", "episode_0003"]
    with h5py.File(source) as file:
        for number, name in enumerate(order):
            rows, episode = found["episode_index"] == number, file[name]
            state, action = [], []
            for arm in (episode["arms/PSM1"], episode["arms/PSM2"]):
                state += [arm["measured_js"][:, 0], arm["jaw/measured_js"][:, 0][:, None]]
                setpoint = np.hstack([arm["setpoint_js"][:, 0], arm["jaw/setpoint_js"][:, 0][:, None]])
                action.append(np.vstack([setpoint[1:], setpoint[-1:]]))
            assert (found["observation.state"][rows] == np.hstack(state)).all()
            assert (found["action"][rows] == np.hstack(action)).all()
            before = found["observation.setpoint"][rows]
            assert found["delta_action"][rows] == pytest.approx(found["action"][rows] - before, abs=1e-6)
            assert (found["ground_truth.needle_pose"][rows] == episode["needle/pose"][:]).all()
            assert (found["label.phase"][rows] == episode["phase"][:]).all()
            assert np.mean(episode["arms/PSM2/activity"][:] == 1) > 0.9, "both arms move all the while"
            assert found["next.success"][rows].any() == bool(episode.attrs["success"])
            assert found["next.done"][rows].tolist() == [False] * (rows.sum() - 1) + [True]


def test_a_cartesian_step_leads_from_one_pose_to_the_next(exported: Path) -> None:
    found = data(exported)
    before, after, steps = (found[f"{name}"] for name in ("index", "cartesian_action", "cartesian_delta_action"))
    assert len(before) == sum(SAMPLES)
    rows = np.flatnonzero(found["episode_index"] == 0)[:-1]
    for k in rows[1:]:
        one, other = pose7_matrix(after[k - 1, :7]), pose7_matrix(after[k, :7])
        turn = steps[k, 3:6]
        angle = np.linalg.norm(turn)
        R = one[:3, :3] @ axis_rotation(turn / angle, angle) if angle > 1e-9 else one[:3, :3]
        assert one[:3, 3] + steps[k, :3] == pytest.approx(other[:3, 3], abs=1e-6)
        assert pytest.approx(other[:3, :3], abs=1e-5) == R


def test_pictures_are_those_of_the_recording(exported: Path, source: Path) -> None:
    with h5py.File(source) as file:
        wanted = file["episode_0000/cameras/cameraR/rgb"][:].astype(float)
    path = sorted(exported.glob("videos/**/*cameraR*/**/*.mp4"))[0]
    with av.open(str(path)) as container:
        frames = np.array([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)], dtype=float)
    assert frames.shape == wanted.shape
    # small pictures of fine detail with half the resolution of colour: what is left is above 25 dB
    error = np.mean((frames - wanted) ** 2)
    assert 10.0 * np.log10(255.0**2 / error) > 25.0
    shifted = np.mean((frames[1:] - wanted[:-1]) ** 2)
    assert error < shifted, "each picture is nearest to its own"


def test_splits_keep_failures_and_what_nothing_judged_apart(exported: Path) -> None:
    info = json.loads((exported / "meta/info.json").read_text())
    assert info["splits"] == {"train": "0:1", "val": "1:2", "test": "2:2", "failure": "2:3", "unjudged": "3:4"}
    assert info["total_tasks"] == 2


def test_the_card_names_what_is_in_it(exported: Path) -> None:
    text = (exported / "README.md").read_text()
    info = json.loads((exported / "meta/info.json").read_text())
    assert text.startswith("---\nlicense: unknown\n")
    for name in info["features"]:
        assert f"| `{name}` |" in text
    assert "| 1 | reach | G1 |" in text and "synchronised" in text
    assert "counter of LeRobot" not in "".join(
        line for line in text.splitlines() if "`" in line and "index" not in line and "timestamp" not in line
    )


def test_calibrations_are_those_of_the_scene(exported: Path, source: Path) -> None:
    found = json.loads((exported / "meta/calibration.json").read_text())
    with h5py.File(source) as file:
        camera = file["episode_0002/cameras/cameraL"]
        assert found["episodes"][1]["cameraL"]["pose"] == pytest.approx(camera["pose"][0])
        assert found["episodes"][1]["cameraL"]["intrinsics"] == pytest.approx(camera["intrinsics"][0])
        assert found["arms"]["PSM2"]["base_pose"] == pytest.approx(file["arms/PSM2"].attrs["base_pose"])


# --- the rules find what is broken ----------------------------------------------------------------


def edit(name: str, change: Callable[[dict], object]) -> Callable[[Path], None]:
    def run(root: Path) -> None:
        path = root / "meta" / name
        value = json.loads(path.read_text())
        change(value)
        path.write_text(json.dumps(value))

    return run


def first(root: Path, pattern: str) -> Path:
    return sorted(root.glob(pattern))[0]


def without_a_row(root: Path) -> None:
    path = first(root, "data/*/*.parquet")
    pq.write_table(pq.read_table(path).slice(1), path)


def with_late_timestamps(root: Path) -> None:
    path = first(root, "data/*/*.parquet")
    table = pq.read_table(path)
    times = pa.array(np.array(table["timestamp"]) * np.float32(1.01))
    pq.write_table(table.set_column(table.column_names.index("timestamp"), "timestamp", times), path)


def with_other_numbers(root: Path) -> None:
    path = first(root, "data/*/*.parquet")
    table = pq.read_table(path)
    values = np.array(table["observation.state"].to_pylist(), dtype=np.float32) + 1.0
    column = pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), values.shape[1])
    pq.write_table(table.set_column(table.column_names.index("observation.state"), "observation.state", column), path)


def with_a_short_video(root: Path) -> None:
    paths = sorted(root.glob("videos/**/*.mp4"), key=lambda path: path.stat().st_size)
    shutil.copy(paths[0], paths[-1]) if len(paths) > 1 else None
    path = paths[-1]
    path.write_bytes(path.read_bytes()[:-1000])


DAMAGE: dict[str, Callable[[Path], None]] = {
    "a missing video": lambda root: first(root, "videos/**/*.mp4").unlink(),
    "a cut video": with_a_short_video,
    "missing rows": lambda root: first(root, "data/*/*.parquet").unlink(),
    "a row less": without_a_row,
    "late timestamps": with_late_timestamps,
    "numbers without their statistics": with_other_numbers,
    "another rate": edit("info.json", lambda info: info.update(fps=25)),
    "too many episodes": edit("info.json", lambda info: info.update(total_episodes=5)),
    "overlapping splits": edit("info.json", lambda info: info["splits"].update(train="0:2")),
    "a missing name": edit("info.json", lambda info: info["features"]["action"]["names"].pop()),
    "a name with a slash": edit("info.json", lambda info: info["features"].update({"a/b": info["features"]["action"]})),
    "a missing feature": edit("info.json", lambda info: info["features"].pop("action")),
    "missing statistics": edit("stats.json", lambda stats: stats.pop("action")),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_the_rules_find_damage(exported: Path, tmp_path: Path, damage: str) -> None:
    copied = tmp_path / "copy"
    shutil.copytree(exported, copied)
    DAMAGE[damage](copied)
    try:
        found = broken(copied)
    except (KeyError, av.error.FFmpegError, FileNotFoundError, pa.ArrowInvalid) as error:
        found = [repr(error)]
    assert found, damage


# --- others ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def large(simulation: ligature.Simulation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("open_h")
    return record(simulation, folder / "waves.h5", (640, 480), ("cameraL",), (12, 8, 10, 6))


def test_open_h_has_nothing_to_say(large: Path, tmp_path: Path) -> None:
    export(large, tmp_path / "out", "lerobot-2.1", license="cc-by-4.0", log=lambda _: None)
    assert broken(tmp_path / "out") == []
    assert broken_for_open_h(tmp_path / "out") == []
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert {"observation.meta.tool", "instruction.text"} <= set(info["features"])


def test_open_h_finds_small_slow_pictures(exported: Path) -> None:
    assert any("480" in line or "missing" in line for line in broken_for_open_h(exported))


def test_av1_is_smaller_and_breaks_no_rule(source: Path, tmp_path: Path) -> None:
    export(source, tmp_path / "out", "lerobot-3.0", "av1", log=lambda _: None)
    assert broken(tmp_path / "out") == []


def test_the_command_exports_and_says_what_is_wrong(source: Path, tmp_path: Path) -> None:
    run = CliRunner().invoke
    done = run(app, ["dataset", "export", str(source), str(tmp_path / "out"), "--format", "lerobot-2.1"])
    assert done.exit_code == 0, done.output
    assert broken(tmp_path / "out") == []
    again = run(app, ["dataset", "export", str(source), str(tmp_path / "out")])
    assert again.exit_code == 1 and "exists already" in again.output
    for words, message in (
        (["--format", "lerobot-9"], "format must be one of lerobot-3.0, lerobot-2.1, not 'lerobot-9'"),
        (["--codec", "gif"], "codec must be one of h264, av1, not 'gif'"),
    ):
        done = run(app, ["dataset", "export", str(source), str(tmp_path / "other"), *words])
        assert done.exit_code == 1 and message in done.output
    assert not (tmp_path / "other").exists()
    (tmp_path / "other.part").mkdir()
    done = run(app, ["dataset", "export", str(source), str(tmp_path / "other")])
    assert done.exit_code == 1 and "other.part' belongs to an export that is still running or was killed" in done.output
    assert (tmp_path / "other.part").is_dir()
    done = run(app, ["dataset", "info", str(source)])
    assert done.exit_code == 0 and "episode_0001: 104 samples, failure; reach 52, back 52" in done.output
    assert "episode_0003: 102 samples, not judged" in done.output
    done = run(app, ["dataset", "join", str(source)])
    assert done.exit_code == 0 and "4 episodes in one file" in done.output


@pytest.mark.parametrize(
    ("size", "rate", "message"),
    [
        ((64, 48), 12.5, "12.5 samples a second; record it again with a whole number"),
        ((63, 48), 20.0, "63x48; videos need even sizes, such as 62x48"),
    ],
)
def test_what_the_formats_cannot_hold_is_refused(
    simulation: ligature.Simulation, tmp_path: Path, size: tuple[int, int], rate: float, message: str
) -> None:
    with DatasetWriter(tmp_path / "a.h5", simulation, ("cameraL",), size, rate) as writer:
        for _ in range(2):
            while not writer.sample():
                simulation.step(10)
        writer.end_episode(True)
    with pytest.raises(DatasetError, match=message):
        export(tmp_path / "a.h5", tmp_path / "out", "lerobot-3.0", log=lambda _: None)
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]


def test_a_dataset_of_an_interrupted_recording_is_exported_too(simulation: ligature.Simulation, tmp_path: Path) -> None:
    writer = DatasetWriter(tmp_path / "a.h5", simulation, ("cameraL",), (64, 48), 20.0)
    for _ in range(3):
        simulation.step(50)
        writer.sample()
    writer.end_episode(True)
    export(tmp_path / "a.h5", tmp_path / "out", "lerobot-3.0", log=lambda _: None)
    writer.close()
    assert broken(tmp_path / "out") == []


def test_what_never_changes_is_left_out_and_named(exported: Path, source: Path) -> None:
    text, found = (exported / "README.md").read_text(), data(exported)
    line = next(line for line in text.splitlines() if line.startswith("Left out, since they never change here"))
    assert "`observation.meta.jaw_force`" in line
    kept = {"observation.state", "action", "next.done", "next.success", "task_index"}
    for name, values in found.items():
        assert f"`{name}`" not in line
        assert values.dtype.kind in "UO" or name in kept or (values != values[0]).any(), name


def test_the_doctor_has_nothing_to_say(source: Path, tmp_path: Path) -> None:
    """`lerobot-doctor` reads the format with code of others."""
    target = tmp_path / "out"
    export(source, target, "lerobot-3.0", log=lambda _: None)
    report, findings = examined(target)
    assert findings == [] and report["overall_severity"] == "PASS"
    assert report["total_frames"] == sum(SAMPLES)
