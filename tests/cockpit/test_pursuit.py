"""Goals go where the operator points at a hand's speed, and stop at once."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.cockpit.pursuit import ANGULAR, JAW, LINEAR, ArmPursuits
from ligature.model.frames import axis_rotation, frame, pose7_matrix
from ligature.robots.poses import rotation_vector

SPEED = np.array([1.0, 1.0, 0.1])


def run(pursuits: ArmPursuits, dt: float = 0.01, most: int = 10000) -> list[tuple[str, np.ndarray]]:
    """What is commanded until everything is reached."""
    found = []
    while pursuits.active and len(found) < most:
        found += [
            (
                command.verb,
                np.array(next(getattr(command, name) for name in ("position", "pose") if hasattr(command, name))),
            )
            for command in pursuits.advance(dt)
        ]
    return found


def test_a_joint_goes_to_its_target_at_its_speed_and_others_stay() -> None:
    pursuits = ArmPursuits(3)
    pursuits.joint([0.0, 0.5, 0.1], 0, 0.3, SPEED)
    goals = np.array([values for _, values in run(pursuits)])
    assert np.abs(np.diff(goals, axis=0)).max() <= 0.01 * SPEED.max() + 1e-12
    assert goals[-1] == pytest.approx([0.3, 0.5, 0.1], abs=0.0)
    assert (goals[:, 1:] == [0.5, 0.1]).all()
    assert len(goals) == 30


def test_a_second_joint_does_not_stop_the_first() -> None:
    pursuits = ArmPursuits(0)
    pursuits.joint([0.0, 0.0, 0.1], 0, 0.3, SPEED)
    pursuits.advance(0.01)
    pursuits.joint([9.0, 9.0, 9.0], 2, 0.2, SPEED)  # set-points lag behind goals: where those are counts
    assert run(pursuits)[-1][1] == pytest.approx([0.3, 0.0, 0.2])


def test_a_tip_goes_straight_and_turns_together() -> None:
    start, target = np.eye(4), frame(axis_rotation((0, 0, 1), 1.2), (0.02, 0.0, 0.01))
    pursuits = ArmPursuits(0)
    pursuits.pose(start, target)
    poses = [pose7_matrix(values) for verb, values in run(pursuits) if verb == "servo_cp"]
    assert poses[-1] == pytest.approx(target, abs=1e-12)
    before = start
    for pose in poses:
        assert np.linalg.norm(pose[:3, 3] - before[:3, 3]) <= LINEAR * 0.01 + 1e-12
        assert np.linalg.norm(rotation_vector(pose[:3, :3] @ before[:3, :3].T)) <= ANGULAR * 0.01 + 1e-9
        assert np.linalg.norm(np.cross(pose[:3, 3], target[:3, 3])) < 1e-12
        before = pose


def test_jaw_and_tip_are_pursued_side_by_side() -> None:
    pursuits = ArmPursuits(0)
    pursuits.pose(np.eye(4), frame(np.eye(3), (0.01, 0.0, 0.0)))
    pursuits.jaw(0.0, 0.5, "jaw/servo_jp")
    commands = run(pursuits)
    jaw = [values[0] for verb, values in commands if verb == "jaw/servo_jp"]
    assert jaw[-1] == 0.5
    assert np.diff([0.0, *jaw]).max() <= JAW * 0.01 + 1e-12
    assert commands[-1][0] == "jaw/servo_jp"


def test_what_stops_commands_nothing_more() -> None:
    pursuits = ArmPursuits(0)
    pursuits.joint([0.0, 0.0, 0.0], 0, 1.0, SPEED)
    assert pursuits.stop()
    assert not pursuits.active
    assert pursuits.advance(0.01) == []
    assert not pursuits.stop()


def test_a_gizmo_takes_over_from_a_slider() -> None:
    pursuits = ArmPursuits(0)
    pursuits.joint([0.0, 0.0, 0.0], 0, 1.0, SPEED)
    pursuits.pose(np.eye(4), frame(np.eye(3), (0.01, 0.0, 0.0)))
    assert {verb for verb, _ in run(pursuits)} == {"servo_cp"}
