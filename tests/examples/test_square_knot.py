"""The program that makes a square knot around a vessel with two arms."""

from __future__ import annotations

import sys
from pathlib import Path

import ligature
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.model.frames import frame
from scipy.spatial import ConvexHull

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))

import looping  # noqa: E402
import square_knot  # noqa: E402
import two_arms  # noqa: E402


@given(st.floats(-2.0, -1.2), st.floats(0.01, 0.05), st.floats(1.1, 3.0), st.floats(0.011, 0.045))
def test_a_taut_thread_around_the_jaws_is_half_the_hull_of_its_ends_and_the_jaws(
    at: float, away: float, angle: float, radius: float
) -> None:
    """Up to half a turn: the shortest way around a circle is the part of the convex hull on that side."""
    anchor, end = (r * np.array([np.cos(a), np.sin(a)]) for r, a in ((away, at), (radius, angle)))
    found = looping.length_around(anchor, angle, radius)
    around = np.linspace(0.0, 2.0 * np.pi, 4000)
    circle = looping.FINGER * np.column_stack([np.cos(around), np.sin(around)])
    points = np.vstack([anchor, end, circle])
    hull = points[ConvexHull(points).vertices]  # counter-clockwise
    start = int(np.flatnonzero((hull == anchor).all(axis=1))[0])
    way = np.roll(hull, -start, axis=0)
    stop = int(np.flatnonzero((way == end).all(axis=1))[0])
    length = float(np.linalg.norm(np.diff(way[: stop + 1], axis=0), axis=1).sum())
    assert found == pytest.approx(length, rel=2e-3)


@given(st.floats(0.02, 0.045), st.floats(1.0, 7.3), st.floats(0.05, 0.1))
def test_the_left_tool_never_draws_the_thread_taut_but_where_it_must_keep_clear(
    height: float, angle: float, length: float
) -> None:
    anchor = np.array([0.003, -height])
    radius = looping.radius_for(anchor, angle, length)
    assert radius >= looping.THINNEST
    assert radius == looping.THINNEST or looping.length_around(anchor, angle, radius) <= length


@given(st.integers(-4, 4), st.floats(0.004, 0.012), st.floats(-0.002, 0.002), st.integers(0, 2**32 - 1))
def test_a_thread_around_the_right_tool_is_drawn_to_the_torus_knot_of_its_turns(
    turns: int, radius: float, aside: float, seed: int
) -> None:
    """Of 2 n + 1 crossings: determinant ``|2 n + 1|``, signature ``|2 n + 1| - 1`` (Livingston, Knot Theory, 1993)."""
    right = frame(np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]), [0.0, 0.0, 0.03])
    way = square_knot.TAKES / np.linalg.norm(square_knot.TAKES)
    across = np.cross([0.0, 1.0, 0.0], way) / np.linalg.norm(np.cross([0.0, 1.0, 0.0], way))
    left = frame(np.column_stack([across, np.cross(way, across), way]), [0.01, 0.03, 0.06])
    below = np.array([[-0.02, aside, 0.03], [0.0, -0.003, 0.0], [0.0, 0.003, 0.0], [0.008, 0.016, 0.02]])
    angle = np.linspace(0.0, 2.0 * np.pi * turns, 40 * abs(turns) + 2)
    towards_the_tip = np.linspace(0.008, 0.002, len(angle))
    around = np.column_stack([towards_the_tip, radius * np.cos(angle), 0.03 + radius * np.sin(angle)])
    thread = np.vstack([below, around])
    thread += np.random.default_rng(seed).uniform(-1e-5, 1e-5, thread.shape)
    found, crossings = looping.drawn(thread, right, left), 2 * turns + 1
    assert found.determinant == abs(crossings)
    assert found.signature == np.sign(crossings) * (abs(crossings) - 1)


def test_a_thread_that_nobody_wraps_has_no_knot() -> None:
    simulation = ligature.Simulation(ligature.load(square_knot.SCENE))
    score = square_knot.Knotter(simulation).score()
    assert (score.determinant, score.success) == (1, False)


@pytest.mark.parametrize("seed", range(1, 9))
def test_another_seed_lays_vessel_and_thread_elsewhere_together(seed: int) -> None:
    """Moved without the ridges that hold it, the thread would begin inside them, and be pushed out with newtons."""
    scene = ligature.load(square_knot.SCENE)
    block = next(body.index for body in scene.bodies if body.identity.name == "Block")
    lain = [block, *scene.rods[0].bodies]
    here, there = (ligature.Simulation(s) for s in (scene, square_knot.scattered(scene, seed)))
    moved = there.state["body_pose"][0, lain, :3] - here.state["body_pose"][0, lain, :3]
    assert (np.abs(moved[0, :2]) > 0.0).all() and (np.abs(moved[0, :2]) <= square_knot.SHIFT).all()
    assert np.allclose(moved, moved[0], atol=1e-9) and moved[0, 2] == 0.0
    there.step(300)
    assert there.state["rod_tension"][0].max() < 0.1


@pytest.mark.parametrize("throw", [0, 1])
def test_tables_of_a_throw_go_from_its_first_to_its_last_angle(throw: int) -> None:
    """`numpy.interp` takes angles that do not rise without a word."""
    for table in (looping.SHARES[throw], looping.ASIDE[throw]):
        angles = [angle for angle, _ in table]
        assert angles == sorted(set(angles)) and angles[-1] == looping.END
        assert all(looping.between(table, angle) == value for angle, value in table)


@pytest.mark.slow
def test_the_short_end_stands_where_the_right_arm_bends_it() -> None:
    """Without the yield of the scene's thread it springs back by tens of millimetres."""
    knotter = square_knot.Knotter(ligature.Simulation(ligature.load(square_knot.SCENE)))
    knotter.take(two_arms.RIGHT, square_knot.REACHES, knotter.tail, 1)
    knotter.stand()
    stood = knotter.points()[knotter.tail]
    assert abs(stood[0] - knotter.vessel[0] - square_knot.LEAN) < 0.025  # last bits, other processors: 3 to 20 mm
    assert abs(stood[1] - knotter.vessel[1]) < 0.009
    assert knotter.held(two_arms.RIGHT) is None
    knotter.wait(0.5)
    assert np.linalg.norm(knotter.points()[knotter.tail] - stood) < 0.001


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_two_arms_make_a_square_knot_that_holds() -> None:
    simulation = ligature.Simulation(ligature.load(square_knot.SCENE))
    score, stopped = square_knot.operate(simulation)
    assert stopped == ""
    assert score.success, score.lines()
