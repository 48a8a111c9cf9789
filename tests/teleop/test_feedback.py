"""What the hand feels: bounded, finite, and passive against a wall in spite of delay."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest
from ligature.teleop.feedback import Feedback, FeedbackSettings

DT = 0.002
DELAY = 0.005


def contacts(feedback: Feedback | None, count: int = 100) -> tuple[float, float]:
    """Energy (J) of a hand of 0.3 kg that hits a wall of 3 kN/m again and again at 0.1 m/s: before and after."""
    mass, stiffness, hits = 0.3, 3000.0, 0
    position, speed, gained = 0.005, -0.1, 0.0
    spent = 0.0
    late: deque[float] = deque([0.0] * round(DELAY / DT + 1))
    inside = False
    while hits < count:
        late.append(stiffness * max(-position, 0.0))
        wall = np.array([late.popleft(), 0.0, 0.0])
        velocity = np.array([speed, 0.0, 0.0])
        force = wall if feedback is None else feedback.force(wall, velocity, DT)
        gained += force[0] * speed * DT
        speed += force[0] / mass * DT
        position += speed * DT
        if position < 0.0:
            inside = True
        elif inside and position > 0.004:
            inside, hits = False, hits + 1
            spent += 0.5 * mass * 0.1**2
            position, speed = 0.005, -0.1
    return gained, spent


def test_a_delayed_wall_by_itself_gives_energy() -> None:
    gained, _ = contacts(None)
    assert gained > 0.0


def test_over_a_hundred_contacts_the_hand_gains_no_energy() -> None:
    feedback = Feedback(FeedbackSettings(limit=100.0, damping=0.0, most_damping=1e6))
    gained, _ = contacts(feedback)
    assert gained <= 1e-9
    assert feedback.energy <= 1e-9


def test_forces_are_scaled_and_bounded() -> None:
    feedback = Feedback(FeedbackSettings(gain=2.0, limit=3.0, damping=0.0))
    assert feedback.force(np.array([0.5, 0, 0]), np.zeros(3), DT) == pytest.approx([1.0, 0, 0])
    assert np.linalg.norm(feedback.force(np.array([30.0, 40.0, 0]), np.zeros(3), DT)) == pytest.approx(3.0)


def test_numbers_that_are_not_finite_are_not_felt() -> None:
    feedback = Feedback()
    assert (feedback.force(np.array([np.nan, 0, 0]), np.zeros(3), DT) == 0.0).all()
    assert np.isfinite(feedback.energy)
