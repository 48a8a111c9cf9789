"""Tasks on ROS: reports in, scores and measures out, and what a scene without the bodies of a task is reported."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Callable
from typing import Any

import pytest

from tests.ros.conftest import BIN, ROOT, SMALL, Program, free_port
from tests.waiting import until

pytestmark = pytest.mark.ros
SUTURING = ROOT / "scenes" / "suturing" / "launch.yaml"


def test_an_insertion_that_was_not_made_is_reported_with_measures(
    start: Callable[..., Program], node: Any, listen: Callable[..., Any], publish: Callable[..., Any]
) -> None:
    from diagnostic_msgs.msg import DiagnosticStatus
    from std_msgs.msg import Bool, Empty

    program = start(BIN / "ligature", "run", SUTURING, "-p", "200", "--no-cameras", "--task", "insertion")
    program.wait_for("first state published")
    program.wait_for("judging 'insertion'")
    root = "/ligature/tasks/insertion"
    scores, measures = listen(f"{root}/score", DiagnosticStatus), listen(f"{root}/measures", DiagnosticStatus)
    report = publish("/surgical_robotics_challenge/completion_report/testers/task2", Bool)
    report.publish(Bool(data=False))
    report.publish(Bool(data=True))
    score = scores.wait()
    assert len(scores.messages) == 1, "a report of False is none"
    assert score.level == DiagnosticStatus.WARN
    assert score.message.startswith("not done: ")
    fields = {row.key: row.value for row in measures.wait().values}
    assert fields["drops"] == "0"
    assert {"time", "tissue_force", "thread_tension", "path_length_PSM1", "path_length_PSM2"} <= set(fields)

    def passed(message: Any) -> float:
        return float(next(row.value for row in message.values if row.key == "time"))

    restart = publish(f"{root}/restart", Empty)
    measures.wait(lambda m: passed(m) > 2.0)
    restart.publish(Empty())
    measures.wait(lambda m: passed(m) < 1.0)
    assert any("not done:" in line for line in program.lines)
    assert program.end() == 0


def test_a_killed_judge_is_back_and_physics_never_pauses(
    start: Callable[..., Program], listen: Callable[..., Any]
) -> None:
    from diagnostic_msgs.msg import DiagnosticStatus

    program = start(BIN / "ligature", "run", SUTURING, "-p", "200", "--no-cameras", "--task", "insertion")
    program.wait_for("judging 'insertion'")
    measures = listen("/ligature/tasks/insertion/measures", DiagnosticStatus)
    measures.wait()
    physics = program.children()["physics"]
    os.kill(program.children()["tasks_process"], signal.SIGKILL)
    program.wait_for("the tasks process ended with status -9; restarting it")
    until(lambda: program.output.count("judging 'insertion'") == 2, "it judges again", 60.0)
    before = len(measures.messages)
    until(lambda: len(measures.messages) > before, "measures come again", 30.0)
    assert program.children()["physics"] == physics
    assert program.end() == 0


def test_a_run_whose_scene_lacks_holes_ends_and_reports_it(ros_env: dict[str, str]) -> None:
    env = dict(ros_env, ROS_MASTER_URI=f"http://127.0.0.1:{free_port()}")
    done = subprocess.run(
        [BIN / "ligature", "run", SMALL, "--task", "insertion"], env=env, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 1
    assert "has 0 pairs of holes Entry1, Exit1, …; the task needs 1" in done.stdout


def test_a_task_that_there_is_not_is_refused_with_those_that_there_are(ros_env: dict[str, str]) -> None:
    done = subprocess.run(
        [BIN / "ligature", "run", SMALL, "--task", "knit"], env=ros_env, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2
    assert "unknown task 'knit'" in done.stderr
