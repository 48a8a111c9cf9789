"""What counts as a throw of a ligature, and as a square knot: by the crossings of the thread, not by what is near."""

from __future__ import annotations

from collections.abc import Iterator

import ligature
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.environments.goals import FirstThrow, KnotTie
from ligature.environments.goals.ligating import LEFT, LYING, RIGHT, Ligating
from ligature.environments.knotting import Knotter
from ligature.environments.options import task_scene
from ligature.environments.tying import Missed, shorter
from ligature.model.frames import frame
from scipy.spatial.transform import Rotation

from tests.tasks.test_knots import CENTRE, HITCHED, hitched


@pytest.fixture(scope="module")
def goal() -> Iterator[FirstThrow]:
    simulation = ligature.Simulation(task_scene("first_throw", FirstThrow.arms))
    yield FirstThrow(simulation, [simulation.arms[name] for name in FirstThrow.arms])  # type: ignore[misc]
    simulation.close()


@pytest.fixture(scope="module")
def knot(goal: FirstThrow) -> KnotTie:
    return KnotTie(goal._simulation, goal._arms)


def upright(goal: Ligating, corners: np.ndarray) -> np.ndarray:
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


@settings(max_examples=10, deadline=None)
@given(end=ENDS, granny=st.booleans())
def test_a_second_throw_counts_where_it_makes_a_square_knot(
    knot: KnotTie, end: tuple[float, float, float], granny: bool
) -> None:
    end = (end[0] if granny else -end[0], end[1], end[2])
    assert knot.throws(knot.vessel + (hitched(end, granny=granny) - CENTRE) @ LYING.T) == (1 if granny else 2)


@settings(max_examples=10, deadline=None)
@given(end=ENDS)
def test_one_throw_is_half_of_a_square_knot(knot: KnotTie, end: tuple[float, float, float]) -> None:
    assert knot.throws(upright(knot, np.vstack([HITCHED["around"], HITCHED[1], [end]]))) == 1


@settings(max_examples=10, deadline=None)
@given(share=st.floats(0.07, 0.11) | st.floats(0.13, 1.0))
def test_a_knot_is_close_where_both_throws_are_at_the_vessel(knot: KnotTie, share: float) -> None:
    """What is beyond 6 mm from the vessel's middle has a share of its size; both ends lead on as they did."""
    corners = np.vstack([HITCHED["around"], HITCHED[1], HITCHED["over"], HITCHED[-1]]).astype(float) * [0.6, 1.0, 1.0]
    for axis, side in ((1, 1.0), (2, -1.0)):
        beyond = side * corners[:, axis] > 6.0
        corners[beyond, axis] = share * corners[beyond, axis] + (1.0 - share) * side * 6.0
    points = upright(knot, np.vstack([(0.0, 60.0, -20.0), corners, (-40.0, 30.0, 10.0)]))
    assert knot.throws(points) == 2
    assert knot.close(points) == (share < 0.12)


@settings(max_examples=10, deadline=None)
@given(aside=st.floats(0.012, 0.1), angle=st.floats(0.0, 2.0 * np.pi))
def test_a_square_knot_beside_the_vessel_is_none(knot: KnotTie, aside: float, angle: float) -> None:
    points = knot.vessel + (hitched((-40.0, 30.0, 10.0)) - CENTRE) @ LYING.T
    assert knot.throws(points + (0.06 + aside) * np.array([np.cos(angle), np.sin(angle), 0.0])) == 0


def test_a_thread_that_lies_as_the_scene_has_it_has_no_throw_and_no_loop(goal: FirstThrow) -> None:
    assert not goal.thrown(goal.points())
    assert goal.slack(goal.points()) == FirstThrow.LOOP


def test_a_thread_that_lies_as_the_scene_has_it_has_no_square_knot(knot: KnotTie) -> None:
    assert knot.throws(knot.points()) == 0 and not knot.close(knot.points())


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


@given(st.integers(0, 2**32 - 1))
def test_of_two_grasps_half_a_turn_apart_a_hand_takes_the_one_that_turns_it_less(seed: int) -> None:
    tool, T = (frame(R, np.zeros(3)) for R in Rotation.random(2, random_state=seed).as_matrix())
    turned = T @ frame(Rotation.from_euler("z", np.pi).as_matrix(), np.zeros(3))
    found = shorter(T, tool)
    assert min(np.abs(found - one).max() for one in (T, turned)) < 1e-12
    least, *others = (Rotation.from_matrix(tool[:3, :3].T @ one[:3, :3]).magnitude() for one in (found, T, turned))
    assert least <= min(others) + 1e-9


class Clumsy(Knotter):
    """Misses either throw so many times."""

    FURTHER, TRIES = 4, 6

    def __init__(self, misses: int) -> None:
        self.misses, self.done = misses, ""
        self.places: list[int] = []

    def bring(self) -> Iterator[np.ndarray]:
        yield from self._do("bring ")

    hook = under = bring

    def through(self) -> Iterator[np.ndarray]:
        yield from self._do("through ")
        self.places.append(self.further)
        self.misses -= 1
        if self.misses >= 0:
            raise Missed("the loop is not around the tool")

    back_through = through

    def draw(self) -> Iterator[np.ndarray]:
        yield from self._do("draw ")

    def leave(self, number: int) -> Iterator[np.ndarray]:
        yield from self._do(f"leave{number} ")

    def _do(self, name: str) -> Iterator[np.ndarray]:
        self.done += name
        yield np.zeros(14)


@pytest.mark.parametrize("misses", range(Clumsy.TRIES))
def test_a_missed_throw_is_made_again_further_along_the_thread(misses: int) -> None:
    knotter = Clumsy(misses)
    assert len(list(knotter.first())) == 3 * misses + 3
    assert knotter.done == f"bring through leave{LEFT} " * misses + "bring through draw "
    assert knotter.places == [4 * (k % 3) for k in range(misses + 1)]
    knotter = Clumsy(misses)
    assert len(list(knotter.second())) == 4 * misses + 3
    assert knotter.done == f"bring bring through leave{RIGHT} " * misses + "bring bring through "
    assert knotter.places == [4 * (k % 3) for k in range(misses + 1)]


def test_a_throw_that_is_missed_every_time_is_reported() -> None:
    for throw in (Knotter.first, Knotter.second):
        with pytest.raises(Missed, match="not around the tool"):
            list(throw(Clumsy(Clumsy.TRIES)))
