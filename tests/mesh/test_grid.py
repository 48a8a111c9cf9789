"""Grids: which cells share nodes, what lies on the surface, and which nodes face each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.mesh.grid import Cut, build_grid


def _lattice(shape):
    return [np.linspace(0.0, 0.01 * n, n + 1) for n in shape]


def _volume(grid):
    """Volume inside the surface, by the divergence theorem over triangles."""
    a, b, c, d = (grid.nodes[grid.faces[:, k]] for k in range(4))
    return (np.einsum("ij,ij->i", a, np.cross(b, c)) + np.einsum("ij,ij->i", a, np.cross(c, d))).sum() / 6.0


@settings(max_examples=40, deadline=None)
@given(shape=st.tuples(*[st.integers(1, 4)] * 3), seed=st.integers(0, 2**31))
def test_surface_encloses_the_filled_cells_and_has_no_border(shape, seed):
    rng = np.random.default_rng(seed)
    filled = rng.uniform(size=shape) < 0.7
    filled[-1, -1, -1] = True
    grid = build_grid(_lattice(shape), filled)
    assert _volume(grid) == pytest.approx(filled.sum() * 1e-6)
    edges = np.concatenate([np.stack([grid.faces[:, k], grid.faces[:, (k + 1) % 4]], axis=1) for k in range(4)])
    assert set(map(tuple, edges)) == set(map(tuple, edges[:, ::-1]))
    np.testing.assert_allclose(grid.nodes[grid.cells].mean(axis=1), (grid.cell_site + 0.5) * 0.01)


def test_cut_doubles_its_inner_nodes_and_leaves_its_ends_whole():
    mask = np.zeros((6, 3), dtype=bool)
    mask[1:5, 1:] = True  # open at the top, closed at its ends and its bottom
    whole, cut = build_grid(_lattice((6, 4, 3))), build_grid(_lattice((6, 4, 3)), cuts=[Cut(1, 2, mask)])
    # 3 planes of inner nodes along x, 2 above the bottom of the cut
    assert len(cut.nodes) - len(whole.nodes) == len(cut.lips) == 3 * 2
    a, b = cut.nodes[cut.lips].transpose(1, 0, 2)
    np.testing.assert_array_equal(a, b)
    assert (cut.lip_axis == 1).all()
    # The first of a pair belongs to cells below the plane.
    for low, high in cut.lips:
        assert (cut.cell_site[(cut.cells == low).any(axis=1), 1] == 1).all()
        assert (cut.cell_site[(cut.cells == high).any(axis=1), 1] == 2).all()


def test_walls_of_a_gaping_wound_face_each_other():
    filled = np.ones((6, 5, 3), dtype=bool)
    filled[1:5, 2, 1:] = False
    grid = build_grid(_lattice((6, 5, 3)), filled, closing=(1,))
    across = np.diff(grid.nodes[grid.lips], axis=1)[:, 0]
    np.testing.assert_allclose(across, np.tile([0.0, 0.01, 0.0], (len(across), 1)), atol=1e-12)
    assert len(across) == 5 * 3


def test_cells_that_meet_at_an_edge_alone_stay_apart():
    filled = np.array([[[True], [False]], [[False], [True]]])
    assert len(build_grid(_lattice((2, 2, 1)), filled).nodes) == 16


def test_lattice_and_cuts_that_do_not_fit_are_rejected():
    with pytest.raises(ValueError, match="planes of y must be two or more increasing"):
        build_grid([np.arange(3.0), np.array([1.0, 0.0]), np.arange(3.0)])
    with pytest.raises(ValueError, match="at least one"):
        build_grid(_lattice((2, 2, 2)), np.zeros((2, 2, 2), dtype=bool))
    with pytest.raises(ValueError, match="cut at plane 2 of axis 0 lies outside 1 … 1"):
        build_grid(_lattice((2, 2, 2)), cuts=[Cut(0, 2, np.ones((2, 2), dtype=bool))])
