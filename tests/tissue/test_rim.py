"""A thread that turns where it leaves its path: what the rim bears, tension passed on, no path lost at any angle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ligature.model.material import TissueMaterial

from tests.tissue.conftest import SIZE, pad
from tests.tissue.strings import String

FRICTION = 1.0


def _threaded(path, away, apart, tail=0.012, free=0.02, strength=6655.0):
    """A block with a thread through ``path`` (k, 3) that goes on straight at both ends: back, and ``away``."""
    block = pad(TissueMaterial(1e5, friction=FRICTION, strength=strength), cells=(12, 8, 3))
    back = path[0] - path[1]
    back = back / np.linalg.norm(back)
    behind = path[0] + back * np.linspace(tail, 0.0, 13)[:-1, None]
    ahead = path[-1] + away * np.linspace(0.0, free, 21)[1:, None]
    points = np.vstack([behind, path, ahead])[::-1]
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    even = np.linspace(0.0, length[-1], round(length[-1] / apart) + 1)
    thread = block.add_thread(1e-4)
    laid = block.lay_path(path, 1e-4)
    thread.insert(laid, free)
    string = String(block, thread, np.column_stack([np.interp(even, length, c) for c in points.T]), stiffness=3e4)
    return block, string, block.paths.node[laid, : len(path)].copy()


def _pull(block, string, nodes, away, tension, ticks=300):
    """Hold the last point and draw the first ``away`` by ``tension``, which grows for 100 ticks; watch the path.

    Returns the forces of the tissue's nodes (k, 3) and of what holds the last point (3,), means of the last 50 ticks.
    """
    last = len(string.x) - 1
    string.held = {last: string.x[last].copy()}
    borne, held = np.zeros((len(nodes), 3)), np.zeros(3)
    for tick in range(ticks):
        string.load[0] = tension * min(1.0, (tick + 1) / 100) * away
        string.tick()
        block.step()
        now = string.thread.snapshot()
        assert now["engaged"][nodes].all(), (tick, now["engaged"][nodes])
        assert (np.diff(now["at"][nodes]) < 0.0).all(), "the thread's order along its path is lost"
        if tick >= ticks - 50:
            borne += block.interface.points.force[nodes] / 50
            held += string.pull[last] / 50
    assert np.isfinite(string.x).all()
    return borne, held


def _upwards(turn, height=6e-3):
    """A quarter of a circle from below that comes out upright, and the direction ``turn`` radians from there."""
    arc = np.linspace(0.0, 0.5 * np.pi, 6)
    x, z = height * np.sin(arc), SIZE[2] - 1e-6 - height * np.cos(arc)
    path = np.column_stack([0.014 + x, np.full(6, 0.0155), z])
    return path, np.array([-np.sin(turn), 0.0, np.cos(turn)])


@pytest.mark.parametrize("apart", [1e-3, 2.5e-3])
@pytest.mark.parametrize("degrees", [0, 60, 120, 175])
def test_the_tissue_bears_what_a_ring_on_the_thread_would(degrees, apart):
    path, away = _upwards(np.radians(degrees))
    block, string, nodes = _threaded(path, away, apart)
    borne, held = _pull(block, string, nodes, away, 0.3)
    np.testing.assert_allclose(borne.sum(axis=0), 0.3 * away + held, atol=0.02 * 0.3)


@pytest.mark.parametrize("degrees", [0, 30, 60, 90])
def test_tension_is_passed_on_around_the_rim_but_for_friction_inside(degrees):
    path, away = _upwards(np.radians(degrees))
    block, string, nodes = _threaded(path, away, 1e-3)
    _, held = _pull(block, string, nodes, away, 0.3)
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    assert np.linalg.norm(held) == pytest.approx(0.3 - FRICTION * length, rel=0.1)


@pytest.mark.parametrize("strength", [60.0, 150.0])
@pytest.mark.parametrize("degrees", [40, 60, 90, 120])
def test_the_rim_tears_where_the_thread_that_turns_over_it_bears_more_than_its_strength(degrees, strength):
    """2 T sin(θ / 2) is the tissue's strength over the half spacing of nodes that the rim stands for."""
    turn = np.radians(degrees)
    path, away = _upwards(turn)
    block, string, nodes = _threaded(path, away, 1e-3, strength=strength)
    expected = strength * 0.5 * np.linalg.norm(path[-1] - path[-2]) / (2.0 * np.sin(0.5 * turn))
    string.held = {len(string.x) - 1: string.x[-1].copy()}
    before = block.interface.points.weights[nodes[-1]].copy()
    loads = np.linspace(0.0, 1.5 * expected, 850)[1:]
    for load in loads:
        string.load[0] = load * away
        string.tick()
        block.step()
        if (block.interface.points.weights[nodes[-1]] != before).any():
            break
    assert load == pytest.approx(expected, rel=0.15)


_angle = st.floats(-1.0, 1.0)


@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    turn=st.floats(0.0, np.pi),
    aside=st.floats(0.0, 2.0 * np.pi),
    sweep=st.floats(0.3, 1.5),
    slant=_angle,
    depth=st.floats(2e-3, 7e-3),
    tension=st.floats(0.02, 0.6),
    apart=st.sampled_from([0.7e-3, 1.4e-3, 2.5e-3]),
)
@example(turn=3.1, aside=0.0, sweep=1.5, slant=0.0, depth=6e-3, tension=0.6, apart=2.5e-3)
@example(turn=2.7, aside=np.pi, sweep=1.0, slant=0.5, depth=4e-3, tension=0.5, apart=2.5e-3)
def test_no_path_loses_its_thread_at_any_angle_of_pull(turn, aside, sweep, slant, depth, tension, apart):
    """Arcs of any radius and slant that come out of the top; the thread is drawn on at any angle, also back inside."""
    arc = np.linspace(0.0, sweep, max(4, round(depth / 1.4e-3) + 1))
    radius = depth / (1.0 - np.cos(sweep) + 1e-9)
    radius = min(radius, 0.008)
    x, z = radius * np.sin(arc), radius * (1.0 - np.cos(arc))
    across = np.array([np.cos(slant), np.sin(slant), 0.0])
    path = np.array([0.016, 0.015, SIZE[2] - 1e-6 - z[-1]]) + x[:, None] * across + z[:, None] * [0.0, 0.0, 1.0]
    t = path[-1] - path[-2]
    t /= np.linalg.norm(t)
    n = np.cross(t, across if abs(t @ across) < 0.9 else [0.0, 0.0, 1.0])
    n /= np.linalg.norm(n)
    side = np.cos(aside) * n + np.sin(aside) * np.cross(t, n)
    away = np.cos(turn) * t + np.sin(turn) * side
    block, string, nodes = _threaded(path, away, apart)
    _pull(block, string, nodes, away, tension)
