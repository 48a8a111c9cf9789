"""Attempts at tasks: from the first state to the score that a program reads."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest
from ligature.model.frames import frame, matrix_pose7, pose7_matrix
from ligature.model.scene import Scene
from ligature.model.state import new_state
from ligature.tasks import TASKS, Attempt, MissingBodies

from tests.tasks.conftest import drive, hole_poses

SCENES = Path(__file__).resolve().parents[2] / "scenes"


@pytest.fixture(scope="module")
def scene() -> Scene:
    return ligature.load(SCENES / "suturing" / "launch.yaml")


def driven_through(attempt: Attempt, scene: Scene, pair: int) -> Any:
    """Drives the needle of ``scene`` along its arc through holes that are laid out for it; returns the last state."""
    scenery, state = attempt.monitor.scenery, new_state(scene)[0]
    base, middle, tip = scenery.points
    circle = np.linalg.lstsq(
        2.0 * np.array([middle - tip, base - tip]), [middle @ middle - tip @ tip, base @ base - tip @ tip], rcond=None
    )[0]
    x, across = tip - circle, np.cross(tip - circle, middle - tip)
    radius = float(np.linalg.norm(x))
    R = np.column_stack(
        [-x / radius, across / np.linalg.norm(across), np.cross(-x, across / np.linalg.norm(across)) / radius]
    )
    T_needle_arc = frame(R, circle)
    for k, (poses, plain) in enumerate(zip(drive(pair), [hole_poses()] * 60, strict=True)):
        state["sim_time"] = 2.0 + 0.01 * k
        for side, bodies in enumerate((scenery.entries, scenery.exits)):
            for number, body in enumerate(bodies):
                state["body_pose"][body] = plain[1 + 4 * side + number]
        state["body_pose"][scenery.needle] = matrix_pose7(pose7_matrix(poses[0]) @ np.linalg.inv(T_needle_arc))
        attempt.observe(state)
    return state


def test_tasks_have_the_challenges_numbers() -> None:
    assert TASKS == {"pose_estimation": 1, "insertion": 2, "suture": 3}


def test_an_insertion_is_reported_with_the_challenges_fields(scene: Scene) -> None:
    attempt = Attempt(scene, "insertion")
    driven_through(attempt, scene, 2)
    score = attempt.judge()
    assert [(p.pair, p.exit) for p in attempt.monitor.passages] == [(2, False), (2, True)]
    report = score.report()
    assert report["success"] is True
    assert report["hole"] == 2
    assert report["completion_time"] == pytest.approx(0.59)
    for side in ("entry", "exit"):
        x, y = report[f"{side}_lateral_x"], report[f"{side}_lateral_y"]
        assert report[f"{side}_lateral"] == pytest.approx(np.hypot(x, y))
        assert report[f"{side}_lateral_max"] == max(abs(x), abs(y))


def test_a_reset_of_the_scene_begins_anew(scene: Scene) -> None:
    attempt = Attempt(scene, "insertion")
    state = driven_through(attempt, scene, 1)
    assert attempt.judge().success
    state["resets"] += 1
    state["sim_time"] = 9.0
    attempt.observe(state)
    assert attempt.time == 0.0
    assert attempt.judge().report() == {
        "success": False, "completion_time": 0.0, "why": "the tip went through 0 holes; two are needed",
    }  # fmt: skip


def test_a_reported_pose_is_judged_in_the_frame_of_the_camera_body(scene: Scene) -> None:
    attempt, state = Attempt(scene, "pose_estimation"), new_state(scene)[0]
    camera = next(b.index for b in scene.bodies if b.identity.name == "CameraFrame")
    state["body_pose"][camera, :3] = 0.0, 0.0, 1.0
    attempt.observe(state)
    report = attempt.judge(frame(np.eye(3), (0.0, 0.004, -1.0))).report()
    assert [report[name] for name in ("E_base", "E_mid", "E_tip")] == pytest.approx([0.004] * 3)
    assert report["total"] == pytest.approx(0.012)
    with pytest.raises(ValueError, match="needs the reported pose"):
        attempt.judge()


def test_a_suture_names_the_misses_of_all_holes(scene: Scene) -> None:
    attempt = Attempt(scene, "suture", pairs=1)
    driven_through(attempt, scene, 1)
    report = attempt.judge().report()
    assert {"success", "completion_time", "axial", "entry1_lateral", "exit1_lateral"} == set(report)


def test_progress_is_the_share_of_holes_passed_in_their_order(scene: Scene) -> None:
    for pair, task, pairs, share in ((1, "suture", 4, 0.25), (2, "suture", 4, 0.0), (1, "suture", 1, 1.0),
                                     (2, "insertion", 4, 1.0)):  # fmt: skip
        attempt = Attempt(scene, task, pairs)
        assert attempt.progress == 0.0
        driven_through(attempt, scene, pair)
        assert attempt.progress == share, (pair, task, pairs)


def test_nothing_is_judged_before_the_first_state(scene: Scene) -> None:
    with pytest.raises(ValueError, match="before its first state"):
        Attempt(scene, "suture").judge()


def test_what_a_scene_lacks_is_named(scene: Scene) -> None:
    small = ligature.load(SCENES / "suturing_small" / "launch.yaml")
    with pytest.raises(MissingBodies, match="has 0 pairs of holes Entry1, Exit1, …; the task needs 4"):
        Attempt(small, "suture")
    bodies = [
        replace(b, identity=replace(b.identity, name=b.identity.name.replace("Camera", ""))) for b in scene.bodies
    ]
    with pytest.raises(MissingBodies, match="has no body 'CameraFrame'"):
        Attempt(replace(scene, bodies=tuple(bodies)), "pose_estimation")
    with pytest.raises(ValueError, match="unknown task 'knit'; choose one of pose_estimation, insertion, suture"):
        Attempt(scene, "knit")
