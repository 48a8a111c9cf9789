"""What counts as the first throw of a ligature: by the crossings of the thread, not by what is near to what."""

from __future__ import annotations

from collections.abc import Iterator

import ligature
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.environments.goals import FirstThrow
from ligature.environments.goals.tying import LYING
from ligature.environments.suturing import _scene

from tests.tasks.test_knots import CENTRE, HITCHED, hitched


@pytest.fixture(scope="module")
def goal() -> Iterator[FirstThrow]:
    simulation = ligature.Simulation(_scene("first_throw", FirstThrow.arms))
    yield FirstThrow(simulation, [simulation.arms[name] for name in FirstThrow.arms])  # type: ignore[misc]
    simulation.close()


def upright(goal: FirstThrow, corners: np.ndarray) -> np.ndarray:
    """A thread around a vessel along x, given in millimetres from it, around the upright one of the scene."""
    parts = [np.linspace(a, b, 12, endpoint=False) for a, b in zip(corners[:-1], corners[1:], strict=True)]
    return goal.vessel + 1e-3 * np.vstack([*parts, corners[-1]]) @ LYING.T


ENDS = st.tuples(st.floats(15.0, 60.0), st.floats(-40.0, 60.0), st.floats(0.0, 30.0))


@settings(max_examples=10, deadline=None)
@given(end=ENDS)
def test_a_half_hitch_around_the_vessel_is_a_throw_wherever_its_end_leads(
    goal: FirstThrow, end: tuple[float, float, float]
) -> None:
    assert goal.thrown(upright(goal, np.vstack([HITCHED["around"], HITCHED[1], [end]])))


@settings(max_examples=10, deadline=None)
@given(end=ENDS)
def test_a_long_end_that_goes_around_the_short_one_beside_the_loop_is_none(
    goal: FirstThrow, end: tuple[float, float, float]
) -> None:
    """It comes back above the short end farther from the vessel than where it went below."""
    beside = [(6, 20, -8.5), (5, 24, -15.5), (-6, 24, -14.5), (-7, 34, -5.9), (0, 34, -6.4), (9, 34, -6.4)]
    assert not goal.thrown(upright(goal, np.vstack([HITCHED["around"], beside, [end]])))


def test_a_second_throw_is_not_the_first_one(goal: FirstThrow) -> None:
    for granny in (False, True):
        points = hitched((40.0 if granny else -40.0, 30.0, 10.0), granny=granny)
        assert not goal.thrown(goal.vessel + (points - CENTRE) @ LYING.T)


def test_a_thread_that_lies_as_the_scene_has_it_has_no_throw_and_no_loop(goal: FirstThrow) -> None:
    assert not goal.thrown(goal.points())
    assert goal.slack(goal.points()) == FirstThrow.LOOP


@settings(max_examples=20, deadline=None)
@given(radius=st.floats(0.0053, 0.012))
def test_slack_is_how_much_longer_the_loop_is_than_around_the_vessel(goal: FirstThrow, radius: float) -> None:
    angle = np.arange(0.0, -2.0 * np.pi, -goal.length / radius)
    ring = radius * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    away = np.arange(1, 40)[:, None] * goal.length * [0.0, 1.0, 0.0]
    points = goal.vessel + np.vstack([ring[0] + away[::-1], ring, ring[-1] + away + [0.0, 0.0, 0.0006]])
    assert goal.slack(points) == pytest.approx(2.0 * np.pi * (radius - 0.00525), abs=0.003)


def test_a_scene_without_a_vessel_is_refused() -> None:
    simulation = ligature.Simulation(ligature.load("suturing_small", [0, 1, 2, 3, 4]))
    arms = [simulation.arms[name] for name in FirstThrow.arms]
    with pytest.raises(ValueError, match="has no body 'Vessel' with a cylinder, or no thread"):
        FirstThrow(simulation, arms)  # type: ignore[arg-type]
    simulation.close()
