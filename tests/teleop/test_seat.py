"""Leaders, followers and pedals together."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.frames import axis_rotation, frame
from ligature.teleop.camera import CameraDrive
from ligature.teleop.pairing import Hand, Settings, Status, Tip
from ligature.teleop.seat import Conflict, Seat

TIPS = {name: Tip(frame(np.eye(3), (0.01 * k, 0, 0.1))) for k, name in enumerate(("PSM1", "PSM2", "PSM3"))}
CAMERA = frame(axis_rotation((1, 0, 0), 2.0), (0, 0, 0.2))


@pytest.fixture
def seat() -> Seat:
    made = Seat({"MTML": ("PSM2", "PSM3"), "MTMR": ("PSM1", "PSM3")}, Settings(scale=1.0, max_velocity=10.0))
    made.enable(True)
    return made


def feed(seat: Seat, now: float, x: float = 0.0, leader: str = "MTMR") -> dict[str, Tip]:
    seat.sample(leader, Hand(now, frame(np.eye(3), (x, 0, 0)), 0.5))
    return dict(seat.update(now, TIPS, CAMERA).tips)


def test_nothing_moves_before_it_is_enabled() -> None:
    seat = Seat({"MTMR": ("PSM1",)})
    assert feed(seat, 0.0) == {}
    assert seat.status("MTMR") is Status.IDLE


def test_a_leader_drives_its_first_follower(seat: Seat) -> None:
    feed(seat, 0.0)
    goals = feed(seat, 0.01, 0.02)
    assert list(goals) == ["PSM1"]
    assert goals["PSM1"].T_camera_tip[0, 3] == pytest.approx(0.02)


def test_a_leader_that_waits_drives_nobody_until_it_is_asked_to() -> None:
    seat = Seat({"MTMR": ("PSM1",), "pad": ("PSM1", "PSM2")}, Settings(scale=1.0, max_velocity=10.0), waiting=["pad"])
    seat.enable(True)
    assert feed(seat, 0.0, leader="pad") == {}
    assert seat.leaders["pad"].selected is None
    assert seat.next_follower("pad") == "PSM2", "PSM1 is driven"
    feed(seat, 0.01, leader="pad")
    assert list(feed(seat, 0.02, 0.02, leader="pad")) == ["PSM2"]


def test_a_leader_takes_over_another_follower_without_a_jump(seat: Seat) -> None:
    feed(seat, 0.0)
    feed(seat, 0.01, 0.03)
    assert seat.next_follower("MTMR") == "PSM3"
    feed(seat, 0.02, 0.03)
    goals = feed(seat, 0.03, 0.03)
    assert goals["PSM3"].T_camera_tip == pytest.approx(TIPS["PSM3"].T_camera_tip)


def test_a_follower_obeys_one_leader(seat: Seat) -> None:
    seat.select("MTMR", "PSM3")
    with pytest.raises(Conflict, match="PSM3 follows MTMR; unselect it there first"):
        seat.select("MTML", "PSM3")
    assert seat.next_follower("MTML") == "PSM2"
    with pytest.raises(Conflict, match="MTML may drive PSM2, PSM3, not PSM1"):
        seat.select("MTML", "PSM1")
    with pytest.raises(Conflict, match="PSM1 follows A"):
        Seat({"A": ("PSM1",), "B": ("PSM1",)})


def test_ten_clutches_move_the_hand_far_and_the_follower_nowhere(seat: Seat) -> None:
    time, x = 0.0, 0.0
    feed(seat, time, x)
    for _ in range(10):
        seat.clutch(True)
        for _ in range(10):
            time, x = time + 0.01, x + 0.01
            assert feed(seat, time, x) == {}
        seat.clutch(False)
        feed(seat, time + 0.001, x)
        time += 0.01
        goals = feed(seat, time, x)
        assert goals["PSM1"].T_camera_tip == pytest.approx(TIPS["PSM1"].T_camera_tip, abs=1e-12)


def test_a_leader_that_falls_silent_lets_its_follower_hold_until_it_is_rearmed(seat: Seat) -> None:
    feed(seat, 0.0)
    assert seat.update(0.2, TIPS, CAMERA).tips == {}
    assert seat.status("MTMR") is Status.SILENT
    assert feed(seat, 0.3) == {}
    seat.rearm("MTMR")
    feed(seat, 0.31)
    assert "PSM1" in feed(seat, 0.32)


def test_the_camera_pedal_takes_the_hands_off_the_followers(seat: Seat) -> None:
    feed(seat, 0.0)
    seat.camera(True, ["MTMR"])
    seat.sample("MTMR", Hand(0.01, np.eye(4), 0.5))
    assert seat.update(0.01, TIPS, CAMERA).camera == pytest.approx(CAMERA)
    seat.sample("MTMR", Hand(0.02, frame(np.eye(3), (0.05, 0, 0)), 0.5))
    orders = seat.update(0.02, TIPS, CAMERA)
    assert orders.tips == {}
    assert orders.camera is not None
    assert orders.camera[:3, 3] == pytest.approx(CAMERA[:3, 3] - 0.05 * CAMERA[:3, 0])
    seat.camera(False)
    feed(seat, 0.03, 0.05)
    assert feed(seat, 0.04, 0.05)["PSM1"].T_camera_tip == pytest.approx(TIPS["PSM1"].T_camera_tip, abs=1e-12)


def test_two_hands_roll_the_camera_by_the_line_between_them() -> None:
    drive = CameraDrive(scale=0.5)
    left, right = frame(np.eye(3), (-0.1, 0, 0)), frame(np.eye(3), (0.1, 0, 0))
    drive.engage([left, right], np.eye(4))
    turned = [frame(np.eye(3), 0.1 * side * np.array([np.cos(0.3), np.sin(0.3), 0])) for side in (-1, 1)]
    T = drive.update(turned)
    assert T[:3, 3] == pytest.approx(np.zeros(3), abs=1e-12)
    assert T[:3, :3] == pytest.approx(axis_rotation((0, 0, 1), -0.3), abs=1e-12)
    with pytest.raises(ValueError, match="began with 2 hands, not 1"):
        drive.update(turned[:1])
    with pytest.raises(ValueError, match="one or two hands"):
        CameraDrive().engage([], np.eye(4))


def test_unknown_names_are_reported_with_the_known_ones(seat: Seat) -> None:
    with pytest.raises(Conflict, match="unknown leader 'omni'; choose one of MTML, MTMR"):
        seat.sample("omni", Hand(0.0, np.eye(4)))


def test_the_clutch_of_one_leader_leaves_the_others_driving(seat: Seat) -> None:
    for leader in ("MTMR", "MTML"):
        feed(seat, 0.0, leader=leader)
    feed(seat, 0.001)
    seat.clutch(True, "MTMR")
    feed(seat, 0.01, 0.02)
    goals = feed(seat, 0.02, 0.02, leader="MTML")
    assert list(goals) == ["PSM2"]
    seat.clutch(False, "MTMR")
    assert seat.status("MTMR") is Status.IDLE


def test_a_clutch_tap_makes_a_silent_leader_trusted_again(seat: Seat) -> None:
    feed(seat, 0.0)
    seat.update(0.2, TIPS, CAMERA)
    seat.clutch(True)
    assert seat.status("MTMR") is Status.SILENT
    seat.clutch(False)
    feed(seat, 0.31)
    assert "PSM1" in feed(seat, 0.32)


def test_a_leader_drives_only_while_it_is_allowed_to(seat: Seat) -> None:
    seat.allow("MTMR", False)
    feed(seat, 0.0)
    assert feed(seat, 0.01, 0.01) == {}
    seat.allow("MTMR", True)
    feed(seat, 0.02, 0.01)
    assert feed(seat, 0.03, 0.02)["PSM1"].T_camera_tip[0, 3] == pytest.approx(0.01)


def test_another_scale_while_driving_moves_nothing(seat: Seat) -> None:
    feed(seat, 0.0)
    before = feed(seat, 0.01, 0.02)["PSM1"].T_camera_tip[0, 3]
    seat.change("MTMR", scale=0.1)
    assert feed(seat, 0.02, 0.02)["PSM1"].T_camera_tip[0, 3] == pytest.approx(before)
    assert feed(seat, 0.03, 0.03)["PSM1"].T_camera_tip[0, 3] == pytest.approx(before + 0.001)


def test_a_hand_that_leaps_lets_the_camera_go(seat: Seat) -> None:
    seat.camera(True, ["MTMR"])
    for k in range(2):
        seat.sample("MTMR", Hand(0.01 * k, np.eye(4)))
        assert seat.update(0.01 * k, TIPS, CAMERA).camera is not None
    seat.sample("MTMR", Hand(0.02, frame(np.eye(3), (0.2, 0, 0))))
    assert seat.update(0.02, TIPS, CAMERA).camera is None
    assert seat.status("MTMR") is Status.LEAPT
    assert seat.drives_camera == ()


def test_a_silent_hand_lets_the_camera_rest_and_begins_anew(seat: Seat) -> None:
    seat.camera(True, ["MTMR"])
    seat.sample("MTMR", Hand(0.0, np.eye(4)))
    seat.update(0.0, TIPS, CAMERA)
    assert seat.update(0.2, TIPS, CAMERA).camera is None
    seat.sample("MTMR", Hand(0.3, frame(np.eye(3), (0.2, 0, 0))))
    assert seat.update(0.3, TIPS, CAMERA).camera == pytest.approx(CAMERA)
