"""Moves to rest: against the closed form of one joint, and what holds of every move."""

from __future__ import annotations

import copy
import pickle  # noqa: TID251 (what processes exchange)

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.robots.operating_state import Rejected
from ligature.robots.trajectory import JointTrajectory

POSITION, SPEED, LIMIT = st.floats(-3.0, 3.0), st.floats(-0.5, 0.5), st.floats(0.5, 10.0)


@st.composite
def moves(draw: st.DrawFn) -> tuple[np.ndarray, ...]:
    """Position, velocity, goal, maximum velocity and maximum acceleration of one to four joints."""
    n = draw(st.integers(1, 4))
    drawn = (draw(st.lists(values, min_size=n, max_size=n)) for values in (POSITION, SPEED, POSITION, LIMIT, LIMIT))
    return tuple(np.array(values) for values in drawn)


@given(POSITION, POSITION, LIMIT, LIMIT)
def test_a_joint_at_rest_takes_as_long_as_the_trapezoid_of_its_limits(
    q: float, goal: float, v: float, a: float
) -> None:
    """Accelerate, cruise, brake: d/v + v/a, or 2 √(d/a) where the maximum velocity is not reached."""
    distance = abs(goal - q)
    expected = distance / v + v / a if distance > v**2 / a else 2.0 * np.sqrt(distance / a)
    found = JointTrajectory(*(np.array([x]) for x in (q, 0.0, goal, v, a)))
    assert found.duration == pytest.approx(expected, abs=1e-6)


@given(moves())
def test_a_move_starts_in_its_state_keeps_its_limits_and_ends_at_rest(move: tuple[np.ndarray, ...]) -> None:
    position, velocity, goal, max_velocity, max_acceleration = move
    found = JointTrajectory(*move)
    q, qd = (np.array(rows) for rows in zip(*map(found.at, np.linspace(0.0, found.duration, 200)), strict=True))
    dt = found.duration / 199
    assert np.allclose(q[0], position, atol=1e-9) and np.allclose(qd[0], velocity, atol=1e-9)
    assert (np.abs(qd) <= max_velocity + 1e-6).all()
    assert (np.abs(np.diff(qd, axis=0)) <= max_acceleration * dt + 1e-6).all()
    assert np.allclose(
        np.diff(q, axis=0), 0.5 * dt * (qd[1:] + qd[:-1]), atol=0.5 * dt**2 * max_acceleration.max() + 1e-9
    )
    for late in (found.duration, found.duration + 1.0):
        rest, still = found.at(late)
        assert rest.tolist() == goal.tolist() and still.tolist() == [0.0] * len(goal)


@given(moves(), st.floats(0.0, 1.0))
def test_a_move_that_another_process_goes_on_with_is_the_same_to_the_bit(
    move: tuple[np.ndarray, ...], share: float
) -> None:
    found = JointTrajectory(*move)
    for other in (pickle.loads(pickle.dumps(found)), copy.deepcopy(found)):
        assert other.duration == found.duration
        for one, two in zip(found.at(share * found.duration), other.at(share * found.duration), strict=True):
            assert one.tolist() == two.tolist()


def test_a_move_of_hours_is_rejected_with_its_ends_and_what_to_do() -> None:
    with pytest.raises(Rejected) as rejected:
        JointTrajectory(*(np.array([x, x]) for x in (0.123456, 0.0, 2.234567, 1e-5, 1e-5)))
    assert str(rejected.value) == (
        "ruckig finds no trajectory within 7000 s from [0.1235, 0.1235] to [2.2346, 2.2346];"
        " raise 'trajectory_j/set_ratio'"
    )
