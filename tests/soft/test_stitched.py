"""Knots over a wound in soft tissue hold it closed against its own tension."""

from __future__ import annotations

import numpy as np
import pytest

from tests.soft.stitched import StitchedWound, Thread

THREAD = Thread(thick=0.4e-3, youngs=4e7, drawn=2.0, yield_strain=0.02, friction=0.55)
"""As stiff in bending as a monofilament of 0.15 mm and 2 GPa; friction of thread on thread is the product of both, 0.30."""

PRESS = 1.3
"""N with which fingers press each lip: just enough to close the wound."""

CLOSED = 0.5e-3

WIDTH, TENSION = 4e-3, 0.5
"""Metres by which the wound gapes without a stitch, and newtons that a loop bears which keeps it closed."""


def _let_go(senses, thread=THREAD, press=PRESS, ticks=300):
    wound = StitchedWound(senses[0], thread, press)
    wound.knot(senses)
    assert wound.determinant() == np.prod([2 * abs(sense) + 1 for sense in senses])
    wound.let_go()
    wound.rest(ticks)
    return wound


def test_one_throw_alone_lets_the_wound_gape():
    """Without hands at its ends nothing but its stiffness holds a half knot: its legs go slack, and the lips part.

    A bend that yields stands for its moment over the distance of two strands. What the loop still bears, by friction in
    the lips, is the share of the wound's width that it keeps closed, as the tissue is elastic.
    """
    wound = _let_go((1,), ticks=1500)
    bend = THREAD.youngs * np.pi / 32.0 * THREAD.thick**2 * THREAD.yield_strain
    assert wound.legs.max() < bend
    assert wound.gap > (1.0 - wound.loop / TENSION) * WIDTH > 0.5 * WIDTH


def test_a_square_knot_of_two_throws_keeps_the_wound_closed_when_hands_and_fingers_leave():
    wound = _let_go((1, -1), ticks=500)
    assert wound.gap < CLOSED
    assert wound.ends.max() < 0.01
    assert wound.loop > 0.3
    assert wound.determinant() == 9


@pytest.mark.slow
@pytest.mark.parametrize("senses", [(1, -1, 1), (2, -1, 1)], ids=["square", "surgeon's"])
def test_a_knot_of_three_throws_holds_the_lips_of_soft_tissue_for_ten_seconds(senses):
    wound = _let_go(senses, ticks=0)
    before = wound.determinant()
    for _ in range(100):
        wound.rest(100)
        assert wound.gap < CLOSED
        assert wound.rod.settled_soundly
    assert wound.ends.max() < 0.05
    assert wound.loop > 0.3
    assert wound.thread.inside.engaged.sum() == 10
    assert wound.determinant() == before


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_knots_in_threads_of_other_stiffness_and_friction_hold_as_well(seed):
    rng = np.random.default_rng(seed)
    thread = Thread(
        thick=0.4e-3,
        youngs=10.0 ** rng.uniform(7.3, 8.0),
        drawn=rng.uniform(1.5, 2.5),
        yield_strain=rng.choice([0.01, 0.02, 0.04]),
        friction=np.sqrt(rng.uniform(0.2, 0.4)),
    )
    wound = _let_go(((2, -1, 1), (1, -1, 1))[seed % 2], thread, rng.uniform(1.3, 2.0), ticks=500)
    before = wound.gap
    wound.rest(1000)
    assert wound.gap < min(CLOSED, before + 0.05e-3), thread
