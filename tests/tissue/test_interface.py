"""Points of contact: their compliance against the grid's own solves, and which of them are listed as used."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.tissue import elastic
from ligature.tissue.layout import LEAVING, MOST_POINTS, USED

from tests.tissue.conftest import pad

ACTS = st.lists(st.tuples(st.sampled_from(["add", "place", "release", "tick"]), st.integers(0, 10**6)), max_size=40)


def _where(interface, rng):
    """Nodes and weights of a place in a random cell, or on a random face."""
    grid = interface.elastic.grid
    if rng.random() < 0.5:
        nodes = grid.cells[rng.integers(len(grid.cells))]
    else:
        nodes = grid.faces[rng.integers(len(grid.faces))]
    return nodes, rng.dirichlet(np.ones(len(nodes)))


def _compliance(grid, points):
    """C of all used points, from one response of the grid for each."""
    used = np.flatnonzero(points.status)
    W = points.weights[used]
    rows = [grid.response(points.nodes[i], points.weights[i]) for i in used]
    C = [[np.einsum("k,bka->ab", W[j], R[:, points.nodes[n]]) for j, n in enumerate(used)] for R in rows]
    return used, np.array(C).reshape(len(used), len(used), 3, 3)


@pytest.mark.parametrize("tabulated", [True, False])
@settings(max_examples=15, deadline=None)
@given(acts=ACTS)
def test_used_points_are_listed_and_their_compliance_is_that_of_the_grid(tabulated, acts):
    before, elastic.TABLE_NODES = elastic.TABLE_NODES, 1500 if tabulated else 0
    try:
        block = pad(cells=(5, 4, 2))
    finally:
        elastic.TABLE_NODES = before
    assert bool(len(block.elastic.responses)) == tabulated
    interface, points = block.interface, block.interface.points
    for act, seed in acts:
        rng = np.random.default_rng(seed)
        used = np.flatnonzero(points.status == USED)
        if act == "add":
            interface.add(*_where(interface, rng))
        elif act == "tick":
            points.force[used] = rng.normal(size=(len(used), 3)) * 1e-3
            block.step()
        elif len(used):
            i = int(rng.choice(used))
            interface.release(i) if act == "release" else interface.place(i, *_where(interface, rng))
    used = np.flatnonzero(points.status)
    assert interface.unused == MOST_POINTS - len(used)
    np.testing.assert_array_equal(points.used[: len(used)], used)
    known, C = _compliance(block.elastic, points)
    # Rows by the point that is pushed: C_ij moves i for a force on j.
    np.testing.assert_allclose(points.C[np.ix_(known, known)], C.transpose(1, 0, 2, 3), rtol=1e-9, atol=1e-12)


def test_a_point_that_leaves_hands_over_what_it_pushed(kit):
    block = kit.pad()
    interface, points = block.interface, block.interface.points
    top = int(np.argmax(block.elastic.grid.nodes[:, 2] - 1e-3 * np.abs(block.elastic.grid.nodes[:, 0] - 0.02)))
    i = interface.add(np.array([top]), np.ones(1))
    points.force[i] = [0.0, 0.0, -0.01]
    interface.release(i)
    assert points.status[i] == LEAVING
    expected = block.positions[top, 2] + 0.25 * points.C[i, i, 2, 2] * -0.01  # one of four ticks
    for _ in range(4):
        block.step()
    assert block.positions[top, 2] == pytest.approx(expected, abs=1e-12)
    assert interface.unused == MOST_POINTS and not points.force.any()
