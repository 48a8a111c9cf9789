"""The program that makes a square knot over a wound in soft tissue with two arms."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.environments.hand import SHUT, Hand
from ligature.environments.tying import WRONG
from ligature.tasks.knots import SQUARE_KNOT

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))

import soft_knot  # noqa: E402

GOOD = soft_knot.Outcome(SQUARE_KNOT, (4e-3, 0.0, 0.30e-3, 0.35e-3), True, True, 60.0)


def test_a_knot_counts_where_it_is_square_and_holds_the_wound_closed_by_itself() -> None:
    assert GOOD.success
    granny, slips, gapes = (9, 4, 27), (4e-3, 0.0, 0.2e-3, 0.4e-3), (4e-3, 0.0, 0.6e-3, 0.6e-3)
    for bad in (
        {"kind": granny}, {"gaps": slips}, {"gaps": gapes}, {"sewn": False}, {"hands_empty": False}, {"stopped": "lost"}
    ):  # fmt: skip
        assert not replace(GOOD, **bad).success


@pytest.mark.parametrize("seed", [1, 2])
def test_a_hand_that_lost_its_end_takes_it_again(seed: int) -> None:
    simulation = ligature.Simulation(ligature.load(soft_knot.SCENE))
    goal = soft_knot.begun(simulation, seed)
    theatre = soft_knot.Theatre(simulation, goal)
    knotter = soft_knot.Knotting(Hand(theatre, 0))
    assert knotter.beyond(soft_knot.RIGHT, len(goal.elements)) == len(goal.elements) - 1  # a hand may hold its very end
    aside = np.append(np.random.default_rng(seed).uniform(-0.01, 0.01, 2), 0.01)
    theatre.run(knotter.go(soft_knot.RIGHT, knotter.moved(soft_knot.RIGHT, *aside), SHUT))
    theatre.run(knotter.leave(soft_knot.RIGHT))
    theatre.wait(1.0)
    assert goal.held(soft_knot.RIGHT) is None
    theatre.run(knotter.tries(soft_knot.RIGHT, partial(knotter.regain, soft_knot.RIGHT, soft_knot.LONG_END)))
    held = goal.held(soft_knot.RIGHT)
    first, last, _ = soft_knot.LONG_END.indices(len(goal.elements))
    assert held is not None and first - WRONG <= held < last + WRONG
    theatre.run(knotter.regain(soft_knot.RIGHT, soft_knot.LONG_END))
    assert goal.held(soft_knot.RIGHT) == held  # it holds it


def test_it_waits_until_something_is_so_and_states_whether_it_was() -> None:
    simulation = ligature.Simulation(ligature.load(soft_knot.SCENE))
    theatre = soft_knot.Theatre(simulation, soft_knot.begun(simulation, 0))
    begin = simulation.time
    assert theatre.wait(1.0, lambda: simulation.time > begin + 0.1)
    assert begin + 0.1 < simulation.time <= begin + 0.1 + 1.5 * soft_knot.CONTROL * simulation.dt
    assert not theatre.wait(0.1) and simulation.time > begin + 0.19


@pytest.mark.slow
def test_two_arms_make_a_square_knot_that_holds_the_wound_closed_for_ten_seconds() -> None:
    simulation = ligature.Simulation(ligature.load(soft_knot.SCENE))
    outcome = soft_knot.operate(simulation)
    assert outcome.success, outcome.lines()
    assert outcome.gaps[0] == pytest.approx(4e-3, abs=0.1e-3)
