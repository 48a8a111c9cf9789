"""What the hand feels: bounded, finite, and passive against a wall in spite of delay."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest
from ligature.model.frames import axis_rotation, frame
from ligature.teleop.calibration import Calibration
from ligature.teleop.devices.device import Device
from ligature.teleop.feedback import Feedback, FeedbackSettings
from ligature.teleop.haptics import Haptics
from ligature.teleop.pairing import Hand

DT = 0.002
"""Seconds between two readings of a device at 500 Hz."""

RATES = (500.0, 1000.0)
"""Readings a second."""

DELAY = 0.005
FINE = 20
"""Steps of the hand's motion while a force stays."""

MASS, STIFFNESS = 0.3, 3000.0


class Motors(Device):
    """A device that exerts the newest force that it received."""

    def __init__(self, axis: int) -> None:
        super().__init__(lambda reading: None)
        self.force, self.count, self._axis = 0.0, 0, axis

    def feel(self, wrench: np.ndarray) -> None:
        self.force = float(wrench[self._axis])
        self.count += 1


def contacts(
    settings: FeedbackSettings | None, push: float, rate: float = 500.0, axis: int = 0, count: int = 100
) -> float:
    """Energy (J) that forces gave a hand of 0.3 kg which is thrown into a wall of 3 kN/m again and again at 0.1 m/s.

    The hand moves on between two readings under the force that stays, and the energy is that of its real way.
    ``push`` newtons lean on the wall. Without settings the wall itself is felt, as late as ever. The device reads
    ``rate`` times a second. An ``axis`` of 3 is a turn: kg·m², N·m, rad and rad/s in place of kg, N, m and m/s.
    """
    motors, x, v, gained, hits, inside = Motors(axis), 0.005, -0.1, 0.0, 0, 0
    haptics = Haptics(settings, motors, Calibration()) if settings else None
    DT = 1.0 / rate
    late = deque([0.0] * (FINE * round(DELAY / DT * 2) // 2))  # of each fine step
    for n in range(800_000):
        wall = late[0]
        if haptics is None:
            motors.force = wall
        else:
            pose = frame(np.eye(3), (x, 0, 0)) if axis == 0 else frame(axis_rotation(np.eye(3)[0], x), (0, 0, 0))
            haptics.press(Hand(n * DT, pose), wall * np.eye(6)[axis], np.zeros(6))
        for _ in range(FINE):
            late.append(STIFFNESS * max(-x, 0.0))
            late.popleft()
            h, a = DT / FINE, (motors.force - push) / MASS
            way = v * h + 0.5 * a * h * h
            x, v, gained = x + way, v + a * h, gained + motors.force * way
        inside = inside + 1 if x < 0.0 or (inside and x <= 0.004) else -inside
        if inside < 0 or inside > 6 * rate:  # out again, or come to rest in the wall: the next throw
            inside, hits, v = 0, hits + 1, -0.1
            if hits == count:
                assert haptics is None or motors.count > n - 2, "every reading was answered"
                return gained
    raise AssertionError(f"{hits} contacts only")


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("push", [0.0, 1.0])
def test_a_delayed_wall_by_itself_gives_energy(push: float, rate: float) -> None:
    assert contacts(None, push, rate) > 0.1


@pytest.mark.parametrize("push", [0.0, 1.0])
@pytest.mark.parametrize(
    "settings",
    [FeedbackSettings(), FeedbackSettings(limit=10.0, damping=0.0), FeedbackSettings(limit=100.0, gain=2.0)],
    ids=["defaults", "without damping", "strong"],
)
@pytest.mark.parametrize("rate", RATES)
def test_over_a_hundred_contacts_the_hand_gains_no_energy(settings: FeedbackSettings, push: float, rate: float) -> None:
    assert contacts(settings, push, rate) <= 1e-9


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("push", [0.0, 1.0])
def test_over_a_hundred_turns_into_a_wall_the_hand_gains_no_energy(push: float, rate: float) -> None:
    """The same wall about an axis: its torque has an account of its own."""
    settings = FeedbackSettings(
        gain=0.0, torque_gain=1.0, torque_limit=10.0, torque_damping=0.1, most_torque_damping=30.0
    )
    assert contacts(settings, push, rate, axis=3) <= 1e-9


def test_forces_are_scaled_and_bounded() -> None:
    feedback = Feedback(FeedbackSettings(gain=2.0, limit=3.0, damping=0.0))
    assert feedback.force(np.array([0.5, 0, 0]), np.zeros(3), 0.0) == pytest.approx([1.0, 0, 0])
    assert np.linalg.norm(feedback.force(np.array([30.0, 40.0, 0]), np.zeros(3), DT)) == pytest.approx(3.0)


def test_a_hand_that_spent_nothing_is_not_pushed_along_and_one_that_was_is_braked() -> None:
    feedback = Feedback(FeedbackSettings(damping=0.0))
    push = np.array([1.0, 0.0, 0.0])
    assert feedback.force(push, np.zeros(3), 0.0) == pytest.approx(push)
    braked = feedback.force(push, np.array([1e-4, 0.0, 0.0]), DT)
    assert feedback.energy == pytest.approx(1e-4)
    assert braked[0] < 0.0
    assert np.linalg.norm(braked) <= 30.0 * 0.05 + 1e-12


def test_what_the_hand_spent_comes_back() -> None:
    feedback = Feedback(FeedbackSettings(damping=0.0))
    push = np.array([1.0, 0.0, 0.0])
    for k in range(11):
        feedback.force(push, np.array([-1e-4 * k, 0.0, 0.0]), DT * k)
    assert feedback.energy == pytest.approx(-1e-3)
    assert feedback.force(push, np.array([-9e-4, 0.0, 0.0]), DT * 11) == pytest.approx(push)


def test_numbers_that_are_not_finite_are_not_felt() -> None:
    feedback = Feedback()
    assert (feedback.force(np.array([np.nan, 0, 0]), np.zeros(3), 0.0) == 0.0).all()
    assert (feedback.force(np.zeros(3), np.array([0.0, np.inf, 0.0]), DT) == 0.0).all()
    assert np.isfinite(feedback.energy)
