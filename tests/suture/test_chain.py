"""The direct solver against a dense solution of the same equations."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from ligature.suture.chain import factor, solve, solve_within


def _cross_matrix(r):
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])


def _lever_matrix(r, B):
    X = np.zeros((6, 6))
    X[:3, :3], X[:3, 3:], X[3:, 3:] = np.eye(3), -_cross_matrix(r), -B
    return X


def _chain(n, fixed):
    """Random matrices, rows and loads of a chain."""
    rng = np.random.default_rng(7)
    A = rng.normal(size=(n, 6, 6))
    held = np.zeros(n, dtype=np.bool_)
    held[list(fixed)] = True
    return SimpleNamespace(
        H=A @ np.swapaxes(A, 1, 2) + 0.1 * np.eye(6), near=rng.normal(size=(n - 1, 3)), far=rng.normal(size=(n - 1, 3)),
        B=rng.normal(size=(n - 1, 3, 3)), compliance=10.0 ** rng.uniform(-4, 2, size=(n - 1, 6)),
        c=rng.normal(size=(n - 1, 6)), g=rng.normal(size=(n, 6)), held=held, Y=np.zeros((n, 6, 6)),
        Z=np.zeros((n - 1, 6, 6)), d=np.zeros((n, 6)), load=np.zeros((n - 1, 6)), scratch=np.zeros((6, 6)),
    )  # fmt: skip


def _factor(k, top):
    factor(len(k.d), top, k.held, k.H.copy(), k.near, k.far, k.B, k.compliance, k.Y, k.Z, k.scratch)


@pytest.mark.parametrize("top", [0, 2, 3, 6])
@pytest.mark.parametrize("fixed", [(), (0,), (0, 6), (3,)])
def test_chain_solution_satisfies_every_row(fixed, top):
    n = 7
    k = _chain(n, fixed)
    _factor(k, top)
    solve(n, top, k.near, k.far, k.B, k.Y, k.Z, k.c, k.g, k.d, k.load, k.scratch)
    for j in range(n - 1):
        rows = _lever_matrix(k.near[j], k.B[j]) @ k.d[j] - _lever_matrix(k.far[j], k.B[j]) @ k.d[j + 1]
        assert rows + k.compliance[j] * k.load[j] == pytest.approx(-k.c[j], abs=1e-6)
    for i in range(n):
        if k.held[i]:
            assert not k.d[i].any()
            continue
        pull = k.g[i].copy()
        if i < n - 1:
            pull += _lever_matrix(k.near[i], k.B[i]).T @ k.load[i]
        if i > 0:
            pull -= _lever_matrix(k.far[i - 1], k.B[i - 1]).T @ k.load[i - 1]
        assert k.H[i] @ k.d[i] == pytest.approx(pull, abs=1e-6)


@pytest.mark.parametrize(("low", "top"), [(2, 4), (0, 6), (3, 3)])
def test_loads_between_two_nodes_move_them_as_the_whole_chain_states(low, top):
    n = 7
    k = _chain(n, (5,))
    k.c[:] = 0.0
    k.g[:low], k.g[top + 1 :] = 0.0, 0.0
    _factor(k, top)
    solve(n, top, k.near, k.far, k.B, k.Y, k.Z, k.c, k.g, k.d, k.load, k.scratch)
    within = np.full((n, 6), np.nan)
    solve_within(low, top, k.near, k.far, k.B, k.Y, k.Z, k.g, within, np.zeros((n - 1, 6)), k.scratch)
    assert within[low : top + 1] == pytest.approx(k.d[low : top + 1], rel=1e-9, abs=1e-12)
