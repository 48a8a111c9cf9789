"""A bag of a session becomes a dataset that has what was reported, at the times at which it was."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import h5py
import ligature
import numpy as np
import pytest
from ligature.cli.replay import replay
from ligature.cli.sampling import Sampled, Sampling
from ligature.datasets import DatasetWriter
from ligature.datasets.bags import record_bag
from rich.console import Console

from tests.datasets.doctor import sound

pytestmark = pytest.mark.ros
rosbag, rospy = pytest.importorskip("rosbag"), pytest.importorskip("rospy")

ROOT = Path(__file__).resolve().parents[2]
SMALL = ROOT / "scenes" / "suturing_small" / "launch.yaml"
STAMP, RATE, SIZE, SAMPLES = 1_700_000_000.0, 50.0, (48, 32), 108
SETTLED = 500
"""Ticks that both arms move before."""

CAMERA = "/ambf/env/cameras/cameraL"

OF_A_NEEDLE_AT_REST = (
    r"WARN: ground_truth\.needle_pose\[2\]: zero variance .*",
    r"WARN: ground_truth\.needle_pose: 1 constant dimension\(s\) across ALL episodes: dim 2 .*",
)
"""What the doctor has to report of a needle that lies on the pad: it has one height."""


def write_bag(path: Path, reference: Path, slower: float = 1.0) -> None:
    """Drive both arms; a bag gets what they report, and the dataset ``reference`` the same from the simulation."""
    from ligature.ros import pictures
    from ligature.ros.arms.readings import readings
    from ligature.ros.conversion import fill_pose

    simulation = ligature.Simulation(ligature.load(SMALL), 1e-3)
    simulation.step(2)
    scene, needle = simulation.scene, simulation.scene.needles[0].body
    psms = [(k, arm) for k, arm in enumerate(scene.arms) if arm.kind.value == "psm"]
    for k, arm in psms:
        simulation.arms[arm.name].place_jp((0.1 * k, 0.1, 0.12, 0, 0, 0))
        simulation.arms[arm.name].adopt()
    from ambf_msgs.msg import RigidBodyState, WorldState
    from std_msgs.msg import Header

    def drive(tick: int) -> None:
        wave = 0.1 * np.sin(0.004 * tick + np.arange(7)) * [1, 1, 0.1, 1, 1, 1, 3]
        for k, arm in psms:
            robot = simulation.arms[arm.name]
            robot.servo_jp(wave[:6] + [0.1 * k, 0.1, 0.12, 0, 0, 0])
            robot.jaw.servo_jp(0.4 + wave[6:])
        simulation.step()

    for tick in range(-SETTLED, 0):  # nothing leaps when the bag begins
        drive(tick)
    first = simulation.time
    with rosbag.Bag(str(path), "w") as bag, DatasetWriter(reference, simulation, ("cameraL",), SIZE, RATE) as writer:
        for tick in range(int(SAMPLES / RATE / simulation.dt)):
            state = simulation.state[0]
            stamp = rospy.Time.from_sec(STAMP + slower * (simulation.time - first))
            if tick % 10 == 0:
                for k, arm in psms:
                    names = tuple(simulation.arms[arm.name].joints.names)
                    for reading in readings(arm.kind, names, f"{arm.name}_base"):
                        bag.write(f"/{arm.name}/{reading.topic}", reading.filled(state["arm"][k], stamp), stamp)
                body = RigidBodyState(header=Header(stamp=stamp))
                fill_pose(body.pose, state["body_pose"][needle].tolist())
                bag.write("/ambf/env/phantom/Needle/State", body, stamp)
                world = WorldState(header=Header(stamp=stamp), sim_time=simulation.time)
                bag.write("/ambf/env/World/State", world, stamp)
            if writer.sample():
                camera = simulation.cameras["cameraL"]
                header = Header(stamp=stamp)
                rgb = camera.capture(SIZE, passes=("rgb",)).rgb
                bag.write(f"{CAMERA}/ImageData", pictures.image(rgb, "rgb8", header), stamp)
                bag.write(f"{CAMERA}/CameraInfo", pictures.camera_info(camera.calibration(SIZE), header), stamp)
            drive(tick)
        writer.end_episode(True)
    simulation.close()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Path]]:
    """A bag, and the dataset that the simulation itself writes."""
    folder = tmp_path_factory.mktemp("bag")
    write_bag(folder / "run.bag", folder / "reference.h5")
    yield folder / "run.bag", folder / "reference.h5"


def test_a_bags_dataset_has_what_the_simulations_own_has(made: tuple[Path, Path], tmp_path: Path) -> None:
    bag, reference = made
    assert record_bag(bag, tmp_path / "bag.h5", RATE, size=SIZE) >= SAMPLES - 1
    with h5py.File(tmp_path / "bag.h5") as found, h5py.File(reference) as wanted:
        one, other = found["episode_0000"], wanted["episode_0000"]
        n = int(one.attrs["samples"])
        names: list[str] = []
        one.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
        assert {"needle/pose", "cameras/cameraL/rgb", "arms/PSM1/jaw/action_js"} <= set(names)
        for name in set(names) - {"time", "phase"}:
            if name.endswith(("/phase", "/activity")):
                continue
            last = n - 1 if "action" in name else n  # the action of the last sample is its own
            mine, own = one[name][:last], other[name][:last]
            if name.endswith("jaw/setpoint_js"):  # its topic has no velocity
                mine, own = mine[:, 0], own[:, 0]
            assert np.abs(mine.astype(float) - own).max() < 1e-6, name
        assert np.abs(np.diff(one["time"][:]) - 1.0 / RATE).max() < 1e-9
        assert set(one["arms/PSM1/activity"][:]) == {1}


def test_times_are_simulated_ones_where_the_run_was_slower_than_real_time(tmp_path: Path) -> None:
    write_bag(tmp_path / "slow.bag", tmp_path / "reference.h5", slower=3.0)
    record_bag(tmp_path / "slow.bag", tmp_path / "bag.h5", RATE, cameras=())
    with h5py.File(tmp_path / "bag.h5") as found, h5py.File(tmp_path / "reference.h5") as wanted:
        mine, own = (file["episode_0000/arms/PSM1/measured_js"][:, 0] for file in (found, wanted))
        assert abs(len(mine) - SAMPLES) <= 1
        moved = np.abs(np.diff(own, axis=0)).max()
        assert np.abs(mine - own[: len(mine)]).max() < 0.6 * moved


def test_a_bag_becomes_a_sound_dataset(made: tuple[Path, Path], tmp_path: Path) -> None:
    console = Console(file=io.StringIO(), soft_wrap=True)
    dataset = Sampled(tmp_path / "bag.h5", Sampling(RATE, SIZE), success=True, text="wave both arms")
    assert replay(made[0], None, "", 1.0, console, dataset) == 0, console.file.getvalue()  # type: ignore[attr-defined]
    sound(dataset.path, tmp_path, OF_A_NEEDLE_AT_REST)
    assert "recorded on ROS" in (tmp_path / "lerobot-3.0" / "README.md").read_text()


def without(bag: Path, path: Path, *topics: str) -> Path:
    """The bag without some topics."""
    with rosbag.Bag(str(bag)) as source, rosbag.Bag(str(path), "w") as target:
        for topic, message, stamp in source.read_messages():
            if topic not in topics:
                target.write(topic, message, stamp)
    return path


def marked(bag: Path, path: Path, marks: Sequence[tuple[float, str]]) -> Path:
    """The bag with phases marked some seconds after its beginning."""
    from std_msgs.msg import String

    with rosbag.Bag(str(without(bag, path))) as source:
        first = source.get_start_time()
    with rosbag.Bag(str(path), "a") as target:
        for after, phase in marks:
            target.write("/ligature/phase", String(phase), rospy.Time.from_sec(first + after))
    return path


def test_phases_that_the_operator_marked_label_a_bags_samples(made: tuple[Path, Path], tmp_path: Path) -> None:
    bag = marked(made[0], tmp_path / "marked.bag", [(0.5, "G2 position"), (1.01, "wait"), (1.5, "G2 position")])
    record_bag(bag, tmp_path / "bag.h5", RATE, size=SIZE, text="wave both arms", success=True)
    with h5py.File(tmp_path / "bag.h5") as file:
        assert (list(file.attrs["phases"]), list(file.attrs["gestures"])) == (
            ["", "G2 position", "wait"],
            ["", "G2", ""],
        )
        times, phases = file["episode_0000/time"][:], file["episode_0000/phase"][:]
        changes = times[1:][np.diff(phases.astype(int)) != 0]
        assert changes == pytest.approx([0.5, 1.01, 1.5], abs=1.01 / RATE)
        assert [phases[0], *phases[1:][np.diff(phases.astype(int)) != 0]] == [0, 1, 2, 1]
        assert (file["episode_0000/arms/PSM1/phase"][:] == phases).all()
    sound(tmp_path / "bag.h5", tmp_path, OF_A_NEEDLE_AT_REST)


@pytest.mark.parametrize(
    ("marks", "message"),
    [
        (
            [(0.1 + 0.001 * k, f"phase {k}") for k in range(256)],
            "256 different phases were marked; a dataset has at most",
        ),
        ([(0.5, "two\nlines")], "a phase is printable text"),
        ([(0.5, "x" * 300)], "a text has at most 200 bytes"),
    ],
)
def test_phases_that_no_dataset_can_have_are_an_error(
    made: tuple[Path, Path], tmp_path: Path, marks: list[tuple[float, str]], message: str
) -> None:
    assert message in reported(marked(made[0], tmp_path / "marked.bag", marks), tmp_path / "out.h5")


def reported(bag: Path, out: Path, **options: Any) -> str:
    """What ``replay`` prints of a bag that cannot become a dataset."""
    console = Console(file=io.StringIO(), soft_wrap=True)
    assert replay(bag, None, "", 1.0, console, Sampled(out, **options)) == 1
    assert not out.exists()
    assert not out.with_name(f"{out.name}.episodes").exists()
    return str(console.file.getvalue())  # type: ignore[attr-defined]


def test_what_is_missing_is_named(made: tuple[Path, Path], tmp_path: Path) -> None:
    bag, out = made[0], tmp_path / "out.h5"
    assert "no pictures of 'cameraX', only of cameraL" in reported(
        bag, out, sampling=Sampling(RATE, SIZE, ("cameraX",))
    )
    assert "'--scene'" in reported(bag, out, task="suture")
    no_jaws = [f"/{arm}/jaw/measured_js" for arm in ("PSM1", "PSM2")]
    poor = without(bag, tmp_path / "poor.bag", *no_jaws)
    assert "PSM1 lacks jaw/measured_js" in reported(poor, out)
    one = without(bag, tmp_path / "one.bag", no_jaws[0])
    record_bag(one, out, RATE, cameras=())
    with h5py.File(out) as found:
        assert list(found["arms"]) == ["PSM2"]


def test_a_topic_of_another_type_is_an_error(made: tuple[Path, Path], tmp_path: Path) -> None:
    from std_msgs.msg import String

    odd = without(made[0], tmp_path / "odd.bag", "/PSM1/measured_js")
    with rosbag.Bag(str(odd), "a") as bag:
        bag.write("/PSM1/measured_js", String("here"), rospy.Time.from_sec(STAMP))
    assert "/PSM1/measured_js has messages of the type std_msgs/String" in reported(odd, tmp_path / "out.h5")


def test_readings_that_are_no_numbers_are_an_error(made: tuple[Path, Path], tmp_path: Path) -> None:
    broken = tmp_path / "broken.bag"
    with rosbag.Bag(str(made[0])) as source, rosbag.Bag(str(broken), "w") as target:
        for k, (topic, message, stamp) in enumerate(source.read_messages(["/PSM1/measured_js", "/PSM1/setpoint_js"])):
            if k == 40:
                message.position = [float("nan")] * 6
            target.write(topic, message, stamp)
        for topic, message, stamp in source.read_messages():
            if topic.startswith("/PSM1/") and not topic.endswith(("/measured_js", "/setpoint_js")) or "/jaw/" in topic:
                target.write(topic, message, stamp)
    assert "not finite" in reported(broken, tmp_path / "out.h5", sampling=Sampling(RATE, SIZE, ()))
