"""Bends that stay in a thread, and knots over wounds that hold because of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.suture import layout
from ligature.suture.plasticity import set_bends

from tests.suture.throws import KnotOverWound

YIELD = 0.02
"""Stretch of the skin from which a bend stays."""


def _joints(rng, n=20):
    """Joints bent at random, some of them locked about an axis, some elastic."""
    joints = layout.joints(n)
    joints.stiffness[:] = 10.0 ** rng.uniform(-6.0, -2.0, size=(n, 3))
    joints.angle[:], joints.rest[:] = rng.normal(scale=0.5, size=(2, n, 3))
    joints.high[:] = np.where(rng.random((n, 3)) < 0.2, 0.0, 3.0)
    joints.low[:] = -joints.high
    joints.yields[:] = np.where(rng.random(n) < 0.2, np.inf, 10.0 ** rng.uniform(-7.0, -2.0, size=n))
    return joints


def _moment(joints):
    free = joints.low != joints.high
    return np.where(free, joints.stiffness * (joints.angle - joints.rest), 0.0)


@given(st.integers(0, 2**32 - 1))
def test_no_joint_bears_more_than_its_yield_moment_and_the_moment_keeps_its_direction(seed):
    joints = _joints(np.random.default_rng(seed))
    before, rest = _moment(joints), joints.rest.copy()
    set_bends(joints)
    after, size = _moment(joints), np.linalg.norm(before, axis=1)
    kept = np.minimum(1.0, joints.yields / np.maximum(size, 1e-300))
    np.testing.assert_allclose(after, kept[:, None] * before, rtol=1e-9, atol=1e-18)
    elastic = size <= joints.yields
    assert (joints.rest[elastic] == rest[elastic]).all()
    assert (joints.rest[joints.low == joints.high] == rest[joints.low == joints.high]).all()


def _arc(kit, strain, thick=0.8e-3, n=20, step=1e-3):
    """A straight thread, held for a tick in an arc that stretches its skin by ``strain``, and the elements' length."""
    turn = step * strain / (0.5 * thick) * np.arange(n)
    way = step * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    points = np.vstack([np.zeros(3), np.cumsum(way, axis=0)])
    made = kit.from_material(points, thick, 1e7, 1100.0, gravity=(0, 0, 0), damping=0.02, yield_strain=YIELD)
    rod = kit.Bench([]).add(kit.damped(made, 0.9))
    for held in (True, False):
        for element in range(n):
            rod.hold_element(element, held)
        if held:
            rod.step()
    return rod, step


@pytest.mark.parametrize("strain", [0.5, 0.9, 1.5, 3.0, 4.0])
def test_a_bent_thread_springs_back_by_its_yield_strain_and_no_further(kit, strain):
    """Of perfect plasticity: what is left of a bend is what went beyond the elastic limit."""
    rod, step = _arc(kit, strain * YIELD)
    for _ in range(400):
        rod.step()
    bent = np.linalg.norm(rod.joints.angle, axis=1) * 0.4e-3 / step
    assert bent.mean() == pytest.approx(YIELD * max(strain - 1.0, 0.0), abs=1e-6 * YIELD)


def test_bends_that_stay_are_part_of_snapshots_and_vanish_at_a_reset(kit):
    rod, _ = _arc(kit, 3.0 * YIELD)
    assert np.abs(rod.joints.rest).max() > 0.01
    held = {name: np.copy(value) if isinstance(value, np.ndarray) else value for name, value in rod.snapshot().items()}
    ways = []
    for _ in range(2):
        rod.restore(held)
        for _ in range(50):
            rod.step()
        ways.append((rod.positions.tobytes(), rod.joints.rest.tobytes()))
    assert ways[0] == ways[1]
    rod.reset()
    assert not rod.joints.rest.any()


def _held(knot, ticks):
    knot.draw()
    knot.let_go()
    knot.rest(ticks)
    return knot.gap


@pytest.mark.slow
def test_three_throws_hold_the_lips_of_a_wound_for_ten_seconds():
    knot = KnotOverWound((1, -1, 1), YIELD, friction=0.55)
    assert knot.determinant() == 27
    knot.draw()
    assert knot.loop > 0.3
    knot.let_go()
    for _ in range(100):
        knot.rest(100)
        assert knot.gap < 0.5e-3
    assert knot.ends.max() < 0.05
    assert knot.loop > 0.7
    assert knot.determinant() == 27
    assert knot.rod.settled_soundly


@pytest.mark.slow
def test_the_same_knot_in_a_thread_that_springs_back_lets_the_wound_gape():
    assert _held(KnotOverWound((1, -1, 1), np.inf, friction=0.55), 300) > 1e-3
