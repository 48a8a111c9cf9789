"""Leader to follower: no jumps, the right scale, and a stop when the leader is not to be trusted."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.frames import axis_rotation, frame, rpy_matrix
from ligature.teleop.pairing import Hand, Pairing, Settings, Status, Tip

DT = 0.01
START = frame(rpy_matrix(0.3, -0.2, 1.0), (0.01, -0.02, 0.1))


def hand(time: float, position: tuple[float, ...] = (0, 0, 0), R: np.ndarray | None = None, grip: float = 0.5) -> Hand:
    return Hand(time, frame(np.eye(3) if R is None else R, position), grip)


def engaged(**settings: object) -> Pairing:
    pairing = Pairing(Settings(**settings))  # type: ignore[arg-type]
    pairing.engage(hand(0.0), Tip(START, 0.35))
    return pairing


def slowly(pairing: Pairing, end: np.ndarray, R: np.ndarray | None = None, steps: int = 100) -> Tip:
    """Move the hand along a line, and wait until the follower is there."""
    goal = pairing.goal
    for k in range(1, 3 * steps):
        goal = pairing.update(hand(k * DT, tuple(end * min(k / steps, 1.0)), R))
    return goal


def test_engaging_does_not_move_the_follower() -> None:
    pairing = engaged()
    goal = pairing.update(hand(DT))
    assert goal.T_camera_tip == pytest.approx(START, abs=1e-12)


def test_positions_move_by_scaled_increments_in_the_view() -> None:
    pairing = engaged(scale=0.25)
    goal = slowly(pairing, np.array([0.08, -0.04, 0.02]))
    assert goal.T_camera_tip[:3, 3] - START[:3, 3] == pytest.approx([0.02, -0.01, 0.005], abs=1e-9)
    assert goal.T_camera_tip[:3, :3] == pytest.approx(START[:3, :3], abs=1e-9)


def test_the_tip_turns_as_the_hand_does() -> None:
    pairing = engaged()
    turn = axis_rotation((0, 0, 1), 0.7)
    goal = slowly(pairing, np.zeros(3), turn)
    assert goal.T_camera_tip[:3, :3] == pytest.approx(turn @ START[:3, :3], abs=1e-9)


def test_locks_keep_position_or_orientation() -> None:
    turn = axis_rotation((1, 0, 0), 0.5)
    goal = slowly(engaged(lock_rotation=True), np.array([0.1, 0, 0]), turn)
    assert goal.T_camera_tip[:3, :3] == pytest.approx(START[:3, :3])
    goal = slowly(engaged(lock_translation=True), np.array([0.1, 0, 0]), turn)
    assert goal.T_camera_tip[:3, 3] == pytest.approx(START[:3, 3])


def test_the_clutch_does_not_jump() -> None:
    pairing = engaged()
    before = slowly(pairing, np.array([0.05, 0, 0]))
    for k in range(10):
        pairing.clutch()
        away = hand(3.0 + k, (0.3 * k, -0.2, 0.1), axis_rotation((0, 1, 0), 0.1 * k))
        assert pairing.update(hand(3.0 + k - DT, (0.05 if k == 0 else 0.3 * (k - 1), 0, 0))) is not None
        pairing.engage(away, before)
        after = pairing.update(Hand(away.time + DT, away.T_view_hand, away.grip))
        assert np.linalg.norm(after.T_camera_tip[:3, 3] - before.T_camera_tip[:3, 3]) < 1e-12
        assert after.T_camera_tip[:3, :3] == pytest.approx(before.T_camera_tip[:3, :3], abs=1e-12)
        before = after


def test_while_clutched_the_follower_stays() -> None:
    pairing = engaged()
    pairing.clutch()
    goal = pairing.update(hand(DT, (0.04, 0, 0)))
    assert goal.T_camera_tip == pytest.approx(START)
    assert pairing.status is Status.CLUTCHED


def test_the_jaw_follows_the_grip_slowly_at_first_and_then_at_once() -> None:
    pairing = engaged(jaw=(0.0, 1.0), jaw_speed=10.0, jaw_speed_at_first=0.5)
    first = pairing.update(hand(0.1, grip=1.0)).jaw
    assert first == pytest.approx(0.35 + 0.05)
    for k in range(2, 40):
        pairing.update(hand(0.1 * k, grip=1.0))
    assert pairing.goal.jaw == pytest.approx(1.0)
    assert pairing.update(hand(4.1, grip=0.0)).jaw == pytest.approx(0.0)


def test_a_device_without_a_grip_leaves_the_jaw_alone() -> None:
    pairing = engaged()
    goal = pairing.update(Hand(DT, np.eye(4), None))
    assert goal.jaw == 0.35


def test_speed_and_workspace_are_bounded() -> None:
    corners = ((-0.02, -0.05, 0.05), (0.02, 0.05, 0.15))
    pairing = engaged(scale=1.0, max_velocity=0.1, max_angular_velocity=1.0, workspace=corners)
    goal = pairing.update(hand(DT, (0.04, 0, 0), axis_rotation((0, 0, 1), 0.5)))
    assert np.linalg.norm(goal.T_camera_tip[:3, 3] - START[:3, 3]) <= 0.1 * DT + 1e-12
    cosine = (np.trace(goal.T_camera_tip[:3, :3].T @ START[:3, :3]) - 1) / 2
    assert np.arccos(cosine) <= 1.0 * DT + 1e-9
    goal = slowly(engaged(scale=1.0, workspace=corners), np.array([0.5, 0, 0]))
    assert goal.T_camera_tip[0, 3] == pytest.approx(0.02)


def test_a_silent_leader_stops_driving() -> None:
    pairing = engaged()
    pairing.update(hand(DT))
    assert pairing.watch(DT + 0.09)
    assert not pairing.watch(DT + 0.11)
    assert pairing.status is Status.SILENT
    assert pairing.update(hand(1.0, (0.04, 0, 0))).T_camera_tip == pytest.approx(START)


def test_a_leader_that_leaps_or_sends_no_pose_stops_driving() -> None:
    pairing = engaged()
    assert pairing.update(hand(DT, (0.5, 0, 0))).T_camera_tip == pytest.approx(START)
    assert pairing.status is Status.LEAPT
    for broken in (np.full((4, 4), np.nan), np.zeros((4, 4)), np.diag([1.0, 1.0, -1.0, 1.0])):
        pairing = engaged()
        assert pairing.update(Hand(DT, broken, 0.5)).T_camera_tip == pytest.approx(START)
        assert pairing.status is Status.BROKEN


def test_an_operator_must_move_fingers_or_wrist_before_driving() -> None:
    pairing = engaged(presence_grip=0.5, presence_roll=0.1)
    goal = pairing.update(hand(DT, (0.04, 0, 0)))
    assert pairing.status is Status.WAITING
    assert goal.T_camera_tip == pytest.approx(START)
    pairing.update(hand(2 * DT, (0.04, 0, 0), grip=1.0))
    assert pairing.status is Status.FOLLOWING
    goal = pairing.update(hand(3 * DT, (0.04, 0, 0), grip=1.0))
    assert goal.T_camera_tip[:3, 3] == pytest.approx(START[:3, 3], abs=1e-12)
    pairing = engaged(presence_grip=0.5, presence_roll=0.1)
    pairing.update(hand(DT, R=axis_rotation((0, 0, 1), 0.2)))
    assert pairing.status is Status.FOLLOWING
