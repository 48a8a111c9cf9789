"""What hands feel: the tip's contacts in the device's axes, and nothing when nobody drives."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.frames import frame
from ligature.teleop.calibration import Calibration, axes_of_words
from ligature.teleop.devices.device import Device
from ligature.teleop.feedback import Feedback, FeedbackSettings
from ligature.teleop.haptics import Haptics, step_of
from ligature.teleop.pairing import Hand


class Motors(Device):
    def __init__(self) -> None:
        super().__init__(lambda reading: None)
        self.forces: list[np.ndarray] = []

    def feel(self, wrench: np.ndarray) -> None:
        self.forces.append(wrench)


def test_a_push_to_the_right_of_the_picture_is_felt_to_the_right_by_the_device() -> None:
    motors = Motors()
    haptics = Haptics(FeedbackSettings(gain=0.5, damping=0.0), motors, Calibration(axes_of_words("left", "up", "away")))
    for k in range(3):
        hand = Hand(0.01 * k, frame(np.eye(3), (0, 0, 0)))
        haptics.press(hand, np.array([2.0, 0, 0, 9, 0, 0]), np.array([0.0, 0, 0.1, 0, 0, 0]))
    assert motors.forces[-1] == pytest.approx([-1.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    haptics.rest()
    assert motors.forces[-1] == pytest.approx(np.zeros(6))
    count = len(motors.forces)
    haptics.rest()
    assert len(motors.forces) == count


def test_torques_are_felt_with_their_gain_about_the_device_s_axes_and_within_their_limit() -> None:
    motors = Motors()
    settings = FeedbackSettings(torque_gain=0.5, torque_limit=0.2, torque_damping=0.0)
    haptics = Haptics(settings, motors, Calibration(axes_of_words("left", "up", "away")))
    for k, torque in enumerate((0.0, 0.1, 0.9)):
        haptics.press(Hand(0.01 * k, np.eye(4)), np.array([0.0, 0, 0, torque, 0, 0]), np.zeros(6))
    assert motors.forces[1][3:] == pytest.approx([-0.05, 0.0, 0.0])
    assert motors.forces[2][3:] == pytest.approx([-0.2, 0.0, 0.0])


def test_forces_go_out_a_thousand_times_a_second_at_most() -> None:
    motors = Motors()
    haptics = Haptics(FeedbackSettings(), motors, Calibration())
    for k in range(1000):
        haptics.press(Hand(1e-4 * k, np.eye(4)), np.zeros(6), np.zeros(6))
    assert 90 <= len(motors.forces) <= 110


def test_contacts_below_the_deadband_are_not_felt() -> None:
    feedback = Feedback(FeedbackSettings(deadband=0.5, damping=0.0))
    assert feedback.force(np.array([0.4, 0, 0]), np.zeros(3), 0.0) == pytest.approx(np.zeros(3))
    assert feedback.force(np.array([0.6, 0, 0]), np.zeros(3), 0.002) == pytest.approx([0.6, 0, 0])


def felt(step: float, late: np.ndarray) -> np.ndarray:
    """Damping forces of a hand that moves by one millimetre a reading; the readings are ``late`` by seconds."""
    motors = Motors()
    haptics = Haptics(FeedbackSettings(gain=0.0, limit=100.0, damping=2.0), motors, Calibration(), step=step)
    for k, after in enumerate(late):
        pose = frame(np.eye(3), (1e-3 * k, 0.0, 0.0))
        haptics.press(Hand(2e-3 * k + after, pose), np.zeros(6), np.zeros(6))
    return np.array(motors.forces)[:, 0]


def test_with_a_fixed_step_forces_do_not_depend_on_when_readings_come() -> None:
    """AMBF's -f: the velocity that is damped is that of the nominal rate, here 500 Hz."""
    even, late = np.zeros(40), np.random.default_rng(3).uniform(0.0, 9e-4, 40)
    assert (felt(2e-3, late) == felt(2e-3, even)).all()
    assert felt(2e-3, even) == pytest.approx(felt(0.0, even), abs=1e-9), "on time both are the same"
    assert np.abs(felt(0.0, late) - felt(0.0, even)).max() > 0.05
    assert abs(felt(1e-3, even)[-1]) == pytest.approx(2.0 * abs(felt(2e-3, even)[-1]), rel=0.03), "twice as fast"


@pytest.mark.parametrize("asked", [None, "soon", 0.0, -1.0, float("nan"), float("inf")])
def test_a_step_that_is_none_is_the_one_that_has_gone_by(asked: object) -> None:
    assert step_of(asked) == 0.0
