"""A run is recorded by one command, scored from what was recorded, played again, and simulated again bit for bit."""

from __future__ import annotations

import io
import json
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from tests.ros.conftest import BIN, ROOT, Program
from tests.waiting import stays, until

pytestmark = pytest.mark.ros
SCENE = ROOT / "scenes" / "suturing" / "launch.yaml"
RUN = ("run", SCENE, "-l", "0,1,2,3", "-p", "200", "--no-cameras", "--names", "src", "--task", "insertion")


@dataclass
class Session:
    """What a session on ROS left behind."""

    env: dict[str, str]
    bag: Path
    record: Path

    def ligature(self, *words: object) -> subprocess.CompletedProcess[str]:
        command = [BIN / "ligature", *map(str, words)]
        return subprocess.run(command, env=self.env, capture_output=True, text=True, timeout=120)


def scored(task: str, file: Path, scene: Path | None = None, json: bool = False) -> tuple[int, str]:
    """Status and output of ``ligature score`` in this process."""
    from ligature.cli.score import score

    console = Console(file=io.StringIO(), soft_wrap=True)
    return score(task, file, scene, 1.0, json, console), console.file.getvalue()  # type: ignore[attr-defined]


def replayed(file: Path, scene: Path | None = None) -> tuple[int, str]:
    """The same of ``ligature replay`` of a record."""
    from ligature.cli.replay import replay

    console = Console(file=io.StringIO(), soft_wrap=True)
    return replay(file, scene, "", 1.0, console), console.file.getvalue()  # type: ignore[attr-defined]


def moved(node: Any) -> None:
    """PSM1 gets ready and goes somewhere; a report ends the task."""
    from std_msgs.msg import Bool

    from tests.ros.crtk import Psm

    psm = Psm(node, "PSM1")
    psm.check_connections(10.0)
    assert psm.enable(10.0)
    assert psm.home(20.0)
    stays(lambda: psm.state.now.is_homed, "it stays homed", 0.5)  # as a person looks before the next move
    assert psm.move_jp(psm.setpoint_jp() + [0.2, -0.1, 0.02, 0.4, 0.2, -0.2]).wait()
    report = node.Publisher("/surgical_robotics_challenge/completion_report/testers/task2", Bool, queue_size=1)
    until(lambda: report.get_num_connections() == 2, "recorder and judge listen")
    report.publish(Bool(data=True))
    time.sleep(0.5)
    psm.close()
    report.unregister()


PHASES = ("G1 reach", "rest", "")


def marked(node: Any) -> Any:
    """Mark phases, and send between them what is none; returns the topic, which must stay until all has arrived."""
    from std_msgs.msg import String

    topic = node.Publisher("/ligature/phase", String, queue_size=10)
    until(lambda: topic.get_num_connections() >= 2, "the simulator and the recorder")
    for text in (PHASES[0], "two\nlines", f" {PHASES[1]} ", "x" * 300, PHASES[2]):
        topic.publish(text)
    return topic


def away(node: Any) -> None:
    """PSM1 goes somewhere else."""
    from tests.ros.crtk import Psm

    psm = Psm(node, "PSM1")
    psm.check_connections(10.0)
    assert psm.move_jp(psm.setpoint_jp() + [-0.2, 0.1, 0.0, 0.0, 0.0, 0.0]).wait()
    psm.close()


@pytest.fixture(scope="module")
def session(ros_env: dict[str, str], node: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Session]:
    folder = tmp_path_factory.mktemp("session")
    found = Session(ros_env, folder / "session.bag", folder / "session.record")
    program = Program([str(BIN / "ligature"), *map(str, RUN), "--record", str(found.record)], ros_env)
    try:
        program.wait_for("first state published")
        program.wait_for("judging 'insertion'")
        recorder = Program([str(BIN / "ligature"), "record", str(found.bag)], ros_env)
        recorder.wait_for("recording to")
        part = folder / "session.part.bag.active"
        until(part.exists, "the bag", 30.0)
        phases = marked(node)
        moved(node)
        phases.unregister()
        live = found.ligature("score", "insertion", "--json")
        assert live.returncode == 1, live.stdout + live.stderr
        assert json.loads(live.stdout)["measures"]["path_length_PSM1"] > 0.01
        assert not found.bag.exists(), "half a bag has the final name"
        assert not found.record.exists(), "half a record has the final name"
        assert recorder.end(60) == 0, recorder.output
    finally:
        program.end()
    yield found


def test_both_recordings_get_their_names_when_they_are_whole(session: Session) -> None:
    assert {path.name for path in session.bag.parent.iterdir()} >= {"session.bag", "session.record"}
    assert not list(session.bag.parent.glob("*.active"))


def test_the_bag_holds_everything(session: Session) -> None:
    import rosbag

    with rosbag.Bag(str(session.bag)) as bag:
        topics = bag.get_type_and_topic_info().topics
    wanted = {
        "/ambf/env/World/State", "/ambf/env/Needle/State", "/PSM1/measured_js", "/PSM1/move_jp", "/diagnostics",
        "/ligature/tasks/insertion/score", "/surgical_robotics_challenge/completion_report/testers/task2",
    }  # fmt: skip
    assert wanted <= set(topics)


def test_record_and_bag_hold_the_phases_that_were_marked(session: Session) -> None:
    import rosbag
    from ligature.bus.record import Record
    from ligature.model.commands import MarkPhase

    marks = [command.phase for _, command in Record.read(session.record).commands if isinstance(command, MarkPhase)]
    assert marks == list(PHASES), "what is no phase is not among them"
    with rosbag.Bag(str(session.bag)) as bag:
        assert [message.data for _, message, _ in bag.read_messages(["/ligature/phase"])][:1] == [PHASES[0]]


def test_the_record_simulated_again_ends_in_the_same_bits(session: Session) -> None:
    status, output = replayed(session.record)
    assert status == 0, output
    assert "the same bits: " in output


def test_a_record_is_not_replayed_on_another_scene(session: Session) -> None:
    other = ROOT / "scenes" / "suturing_small" / "launch.yaml"
    status, output = replayed(session.record, other)
    assert status == 1
    assert "starts in another state than the recorded run" in output


def test_the_task_is_scored_from_the_record_and_from_the_bag(session: Session) -> None:
    scores = []
    for status, output in (
        scored("insertion", session.record, json=True),
        scored("insertion", session.bag, SCENE, json=True),
    ):
        assert status == 1, output
        scores.append(json.loads(output))
    assert scores[0]["score"]["why"] == scores[1]["score"]["why"]
    assert {"tissue_force", "thread_tension", "drops", "path_length_PSM1"} <= set(scores[0]["measures"])
    assert scores[0]["measures"]["path_length_PSM1"] > 0.01


def test_what_cannot_be_scored_is_reported(session: Session, tmp_path: Path) -> None:
    cut = tmp_path / "cut.bag"
    cut.write_bytes(session.bag.read_bytes()[:200_000])
    small = ROOT / "scenes" / "suturing_small" / "launch.yaml"
    for words, message in (
        (("insertion", cut, SCENE), "the bag is truncated"),
        (("insertion", session.bag), "name the launch file"),
        (("insertion", session.bag, small), "has 0 pairs of holes"),
        (("pose_estimation", session.bag, SCENE), "no pose is reported on"),
        (("pose_estimation", session.record), "contains no reported pose"),
        (("insertion", tmp_path / "none.bag"), "No such file"),
    ):
        status, output = scored(*words)
        assert status == 2, output
        assert message in output


@pytest.mark.slow  # commands come at their own times: a simulator that lags behind is not homed when the move comes
def test_recorded_commands_and_recorded_joints_drive_the_arm_to_the_same_place(
    session: Session, node: Any, listen: Callable[..., Any]
) -> None:
    import rosbag
    from sensor_msgs.msg import JointState

    with rosbag.Bag(str(session.bag)) as bag:
        wanted = [message.position for _, message, _ in bag.read_messages("/PSM1/setpoint_js")][-1]
    program = Program([str(BIN / "ligature"), "run", str(SCENE), "-p", "500", "--no-cameras"], session.env)
    try:
        program.wait_for("first state published")
        joints = listen("/PSM1/measured_js", JointState)
        start = np.array(joints.wait().position)
        assert np.abs(start - wanted).max() > 0.1
        for words, topic in (((), "/PSM1/move_jp"), (("--joints", "setpoint", "-s", "2"), "/PSM1/setpoint_js")):
            done = session.ligature("replay", session.bag, *words)
            assert done.returncode == 0, done.stdout + done.stderr
            assert topic in done.stdout
            joints.wait(lambda message: np.abs(np.array(message.position) - wanted).max() < 2e-3)
            away(node)
    finally:
        program.end()


def test_recordings_that_cannot_be_made_are_reported_and_leave_nothing(session: Session, tmp_path: Path) -> None:
    from ligature.cli.record import record

    there = tmp_path / "there.bag"
    mine = [there, tmp_path / "running.part.bag", tmp_path / "cut.part.bag.active"]
    for path in mine:
        path.write_text("mine")
    for out, free, message in (
        (tmp_path / "a.bag", 1e9, "space free on disk"),
        (there, 1.0, "exists already"),
        (tmp_path / "a.txt", 1.0, "must end in .bag"),
        (tmp_path / "no" / "a.bag", 1.0, "does not exist; create it first"),
        (tmp_path / "running.bag", 1.0, "running.part.bag' belongs to a recording that is still running or was killed"),
        (tmp_path / "cut.bag", 1.0, "cut.part.bag.active' belongs to a recording that is still running or was cut off"),
    ):
        console = Console(file=io.StringIO(), soft_wrap=True)
        assert record(out, "", 2.0, free, console) == 1
        assert message in console.file.getvalue()  # type: ignore[attr-defined]
    assert sorted(tmp_path.iterdir()) == sorted(mine)
    assert all(path.read_text() == "mine" for path in mine)


def test_a_recorder_that_waits_for_a_clock_is_reported(session: Session, tmp_path: Path) -> None:
    import rosgraph
    from ligature.cli.record import record

    master = rosgraph.Master("/ligature_tests")
    master.setParam("/use_sim_time", True)
    console = Console(file=io.StringIO(), soft_wrap=True)
    try:
        assert record(tmp_path / "a.bag", "", 1.0, 0.001, console) == 1
    finally:
        master.deleteParam("/use_sim_time")
    assert "/use_sim_time is true, and nobody publishes /clock" in console.file.getvalue()  # type: ignore[attr-defined]
    assert not list(tmp_path.iterdir())


def test_a_run_whose_record_exists_ends_and_reports_it(session: Session) -> None:
    done = session.ligature(*RUN, "--record", session.record)
    assert done.returncode != 0
    assert "cannot record the run" in done.stdout
