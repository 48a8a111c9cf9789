"""What hands feel: the tip's contacts in the device's axes, and nothing when nobody drives."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.frames import frame
from ligature.teleop.calibration import Calibration, axes_of_words
from ligature.teleop.devices.device import Device
from ligature.teleop.feedback import Feedback, FeedbackSettings
from ligature.teleop.haptics import Haptics
from ligature.teleop.pairing import Hand


class Motors(Device):
    def __init__(self) -> None:
        super().__init__(lambda reading: None)
        self.forces: list[np.ndarray] = []

    def feel(self, force: np.ndarray) -> None:
        self.forces.append(force)


def test_a_push_to_the_right_of_the_picture_is_felt_to_the_right_by_the_device() -> None:
    motors = Motors()
    haptics = Haptics(FeedbackSettings(gain=0.5, damping=0.0), motors, Calibration(axes_of_words("left", "up", "away")))
    for k in range(3):
        hand = Hand(0.01 * k, frame(np.eye(3), (0, 0, 0)))
        haptics.press(hand, np.array([2.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.1]))
    assert motors.forces[-1] == pytest.approx([-1.0, 0.0, 0.1])
    haptics.rest()
    assert motors.forces[-1] == pytest.approx(np.zeros(3))
    count = len(motors.forces)
    haptics.rest()
    assert len(motors.forces) == count


def test_forces_go_out_five_hundred_times_a_second_at_most() -> None:
    motors = Motors()
    haptics = Haptics(FeedbackSettings(), motors, Calibration())
    for k in range(1000):
        haptics.press(Hand(1e-4 * k, np.eye(4)), np.zeros(3), np.zeros(3))
    assert 40 <= len(motors.forces) <= 50


def test_contacts_below_the_deadband_are_not_felt() -> None:
    feedback = Feedback(FeedbackSettings(deadband=0.5, damping=0.0))
    assert feedback.force(np.array([0.4, 0, 0]), np.zeros(3), 0.0) == pytest.approx(np.zeros(3))
    assert feedback.force(np.array([0.6, 0, 0]), np.zeros(3), 0.002) == pytest.approx([0.6, 0, 0])
