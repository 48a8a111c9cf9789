"""The factor against SciPy's solver, which knows nothing of it."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.mesh.grid import build_grid
from ligature.tissue.factorisation import Factor


def _matrix(grid, rng):
    """A random positive definite matrix with a block for each pair of nodes of a cell."""
    size = 3 * len(grid.nodes)
    A = sp.csr_matrix((size, size))
    for cell in grid.cells:
        dofs = (3 * cell[:, None] + np.arange(3)).ravel()
        rows = sp.csr_matrix((rng.normal(size=2 * 24), (np.repeat([0, 1], 24), np.tile(dofs, 2))), shape=(2, size))
        A = A + rows.T @ rows
    A = (A + 0.1 * sp.eye(size)).tocsr()
    A.sort_indices()
    return A


@settings(max_examples=15, deadline=None)
@given(
    shape=st.tuples(*[st.integers(1, 5)] * 3), seed=st.integers(0, 2**31), leaf=st.integers(1, 20),
    emptiness=st.floats(0.0, 0.6),
)  # fmt: skip
def test_solution_is_that_of_scipy_for_any_grid(shape, seed, leaf, emptiness):
    rng = np.random.default_rng(seed)
    filled = rng.uniform(size=shape) >= emptiness
    filled[0, 0, 0] = True
    grid = build_grid([np.arange(n + 1.0) for n in shape], filled)
    A = _matrix(grid, rng)
    b = rng.normal(size=A.shape[0])
    x = Factor(A, grid.site, leaf).solve(b)
    np.testing.assert_allclose(x, sp.linalg.spsolve(A.tocsc(), b), rtol=1e-9, atol=1e-9 * np.abs(x).max())


def test_matrix_that_is_not_positive_definite_is_rejected():
    grid = build_grid([np.arange(4.0)] * 3)
    A = sp.eye(3 * len(grid.nodes), format="lil")
    A[7, 7] = -1.0
    with pytest.raises(ValueError, match="not positive definite"):
        Factor(A.tocsr(), grid.site)
