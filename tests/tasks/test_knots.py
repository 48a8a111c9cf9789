"""What counts as a throw around a vessel, and what does not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.tasks.knots import SquareKnotScore, ThrowScore, knotted_around, turns

from tests.suture.knots import square_knot, wound

CENTRE = np.array([0.03, 0.23, 0.72])
RADIUS = 0.0032


def score(points, hands_empty=True):
    return ThrowScore.of(np.asarray(points), CENTRE, 1.0, hands_empty, 10.0)


def below():
    """A thread that lies straight below the vessel."""
    y = np.linspace(-0.04, 0.08, 120)
    return CENTRE + np.column_stack([0.0 * y, y, np.full_like(y, -RADIUS)])


def coil(count):
    """A thread that turns around the vessel ``count`` times without a knot, its ends along y."""
    angle = np.linspace(np.pi / 2, np.pi / 2 - 2.0 * np.pi * count, 400)
    ring = np.column_stack([np.linspace(-0.004, 0.004, 400), RADIUS * np.cos(angle), RADIUS * np.sin(angle)])
    away = np.linspace(0.0, 0.04, 40)[1:, None] * [0.0, 1.0, 0.0]
    return CENTRE + np.vstack([ring[0] - away[::-1], ring, ring[-1] + away])


def test_a_thread_that_only_lies_below_the_vessel_is_no_throw():
    found = score(below())
    assert (found.determinant, found.success) == (1, False)
    assert abs(found.turns) < 0.5


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_thread_that_is_wound_around_the_vessel_without_a_crossing_is_no_throw(count):
    found = score(coil(count))
    assert abs(found.turns) > 0.9
    assert (found.determinant, found.success) == (1, False)


@pytest.mark.parametrize("lift", [0.01, 0.02])
def test_a_knot_beside_the_vessel_is_no_throw(lift):
    found = score(CENTRE + 1e-3 * wound(2, 3, 3) + [0.0, 0.0, lift])
    assert found.determinant == 3
    assert not found.success


def test_two_throws_are_not_one():
    """A square knot has the determinant of two trefoils."""
    assert score(CENTRE + 1e-3 * square_knot()[::4]).determinant != 3


@settings(max_examples=30, deadline=None)
@given(st.floats(-3.0, 3.0), st.integers(0, 2**16))
def test_turns_are_those_of_the_thread_about_the_vessel(count, seed):
    """Whatever its distance; a winding of so many turns has so many."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0.3, 0.3 + 2.0 * np.pi * count, 500)
    away = 0.003 + 0.02 * np.abs(np.sin(rng.uniform(0.0, 3.0) * angle))
    points = CENTRE + np.column_stack([rng.normal(size=500), away * np.cos(angle), away * np.sin(angle)])
    assert turns(points, CENTRE) == pytest.approx(count, abs=1e-9)


def test_hands_that_hold_the_throw_have_not_made_it():
    free = ThrowScore(3, 1.3, 1.0, True, 10.0)
    assert free.success
    assert not ThrowScore(3, 1.3, 1.0, False, 10.0).success


def square_score(points, hands_empty=True):
    points = np.asarray(points)
    return SquareKnotScore.of(points, CENTRE, RADIUS, np.ones(len(points)), hands_empty, 20.0)


def over_the_vessel(knot):
    """A thread with a knot above the vessel, whose loop, where it has one, goes around it."""
    return CENTRE + 1e-3 * (knot[::4] + [0.0, 0.0, 1.0])


def test_a_square_knot_whose_loop_goes_around_the_vessel_is_one():
    found = square_score(over_the_vessel(square_knot()))
    assert found.success, found.lines()
    assert not square_score(over_the_vessel(square_knot()), hands_empty=False).success


def test_it_is_one_from_either_side_of_the_vessel():
    turned = CENTRE + (over_the_vessel(square_knot()) - CENTRE) * [-1.0, -1.0, 1.0]
    assert square_score(turned).success


HITCHED = {
    "around": [(0, 55, -18), (0, 28, -11), (0, 8, -6), (0, 2, -4.5), (0, -3, -4), (0, -6, 0), (0, -3, 5), (0.5, 3, 5)],
    1: [(6, 24, -8.5), (5, 28, -15.5), (-6, 28, -14.5), (-7, 14, -5.9), (0, 14, -6.4), (9, 14, -6.4)],
    "over": [(12, 10, 5), (0, 20, 10), (-8, 40, -4)],
    -1: [(-6, 42, -10), (-5, 44, -20), (6, 44, -20), (7, 34, -10), (0, 34, -11.5), (-9, 34, -11.5)],
}
"""Corners in millimetres from the vessel: a short end and a long one around that, two half hitches of the long end around
the short one, and its way between them."""


def hitched(end, *, granny=False):
    """Two half hitches of opposite hands around a straight short end, whose long end leads to ``end`` (3,)."""
    second = np.array(HITCHED[-1], dtype=float) * ([-1.0, 1.0, 1.0] if granny else [1.0, 1.0, 1.0])
    corners = np.vstack([HITCHED["around"], HITCHED[1], HITCHED["over"], second, [end]])
    parts = [np.linspace(a, b, 12, endpoint=False) for a, b in zip(corners[:-1], corners[1:], strict=True)]
    return CENTRE + 1e-3 * np.vstack([*parts, corners[-1]])


@settings(max_examples=30, deadline=None)
@given(st.floats(20.0, 60.0), st.floats(-40.0, 80.0), st.floats(0.0, 40.0), st.booleans())
def test_where_the_ends_of_a_knot_lead_does_not_change_it(x, y, z, granny):
    """They went on along y, the farther one backwards through the knot."""
    found = square_score(hitched((x if granny else -x, y, z), granny=granny))
    assert (found.determinant, abs(found.signature), found.colourings) == (9, 4 if granny else 0, 27)
    assert found.success == (not granny)


def in_one_end(knot):
    """A thread that lies below the vessel, with a knot in its long end."""
    knot = 1e-3 * knot
    lying = below()[:60]
    return np.vstack([lying, knot - knot[0] + lying[-1] + [0.0, 1e-3, 0.0]])


@pytest.mark.parametrize("knot", [square_knot()[::4], wound(2, 3, 3)[::6]], ids=["square", "trefoil"])
def test_a_knot_in_one_end_of_a_thread_below_the_vessel_is_not_around_it(knot):
    assert not knotted_around(in_one_end(knot), CENTRE, RADIUS)


def test_a_square_knot_in_one_end_does_not_count():
    found = square_score(in_one_end(square_knot()[::4]))
    assert (found.determinant, found.signature, found.colourings) == (9, 0, 27)
    assert not found.success


@pytest.mark.parametrize("count", [1, 2])
def test_a_coil_is_no_square_knot(count):
    assert not square_score(coil(count)).success


def test_one_throw_and_a_straight_thread_are_no_square_knot():
    assert not square_score(below()).success
    assert not square_score(CENTRE + 1e-3 * wound(2, 3, 3)[::6]).success


@pytest.mark.parametrize(
    ("signature", "colourings", "counts"), [(0, 27, True), (4, 27, False), (-4, 27, False), (0, 9, False)]
)
def test_only_a_square_knot_counts(signature, colourings, counts):
    """Neither a granny knot nor the stevedore knot, which has the same determinant and signature."""
    assert SquareKnotScore(9, signature, colourings, True, 1.0, True, 20.0).success == counts
