"""Invariants of knots from their diagrams, against each other and against tables of knots."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.tasks.diagrams import Diagram, crossings
from ligature.tasks.knots import determinant

from tests.suture.knots import square_knot, wander, wound
from tests.tasks.threads import closed

LEFT, RIGHT = wound(2, 3, 3)[::6], wound(2, 3, 3, -1)[::6]
FAR = 100.0


def after(first, second):
    """A thread with one knot after the other."""
    return np.vstack([first, second + first[-1] - second[0] + [0.0, 1e-3, 0.0]])


TABLE = {
    "none": (np.linspace([0.0, -30.0, 0.0], [0.0, 30.0, 0.0], 50), (1, 0, 3)),
    "left-handed trefoil": (LEFT, (3, 2, 9)),
    "right-handed trefoil": (RIGHT, (3, -2, 9)),
    "figure of eight": (wound(3, 2, 4)[::6], (5, 0, 3)),
    "five crossings on a torus, left-handed": (wound(2, 5, 5)[::6], (5, 4, 3)),
    "square": (square_knot()[::4], (9, 0, 27)),
    "square, of two trefoils": (after(LEFT, RIGHT), (9, 0, 27)),
    "granny": (after(LEFT, LEFT), (9, 4, 27)),
    "granny of the other hand": (after(RIGHT, RIGHT), (9, -4, 27)),
}
"""Knots, with determinant, signature and three-colourings of Rolfsen's table; a sum of knots adds and multiplies."""


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", TABLE)
def test_a_knot_has_the_invariants_of_the_table_in_each_shadow(name, seed):
    points, expected = TABLE[name]
    diagram = Diagram.of(closed(points, FAR), seed)
    assert (diagram.determinant, diagram.signature, diagram.colourings) == expected


def test_the_crossings_of_a_left_handed_trefoil_are_negative():
    """Its signature is positive, by the same convention (Gordon, Litherland 1978)."""
    assert sum(crossing.sign for crossing in crossings(closed(LEFT, FAR))) < -2


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_invariants_do_not_depend_on_the_shadow_and_agree_with_each_other(seed):
    """Of a random thread; the determinant from arcs, not regions; a mirror image has the opposite signature."""
    points = closed(wander(np.random.default_rng(seed))[::6], FAR)
    one, other = Diagram.of(points, 0), Diagram.of(points, 1)
    mirrored = Diagram.of(points * [1.0, 1.0, -1.0], 2)
    assert one.determinant == other.determinant == mirrored.determinant == determinant(points)
    assert one.signature == other.signature == -mirrored.signature
    assert one.colourings == other.colourings == mirrored.colourings
    assert (one.colourings > 3) == (one.determinant % 3 == 0)
    assert one.determinant % 4 == (1 if one.signature % 4 == 0 else 3)
