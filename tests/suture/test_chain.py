"""The direct solver against a dense solution of the same equations."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.suture.chain import factor, solve


def _cross_matrix(r):
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])


def _lever_matrix(r, B):
    X = np.zeros((6, 6))
    X[:3, :3], X[:3, 3:], X[3:, 3:] = np.eye(3), -_cross_matrix(r), -B
    return X


@pytest.mark.parametrize("fixed", [(), (0,), (0, 6), (3,)])
def test_chain_solution_satisfies_every_row(fixed):
    rng = np.random.default_rng(7)
    n = 7
    A = rng.normal(size=(n, 6, 6))
    H = A @ np.swapaxes(A, 1, 2) + 0.1 * np.eye(6)
    near, far, B = rng.normal(size=(n - 1, 3)), rng.normal(size=(n - 1, 3)), rng.normal(size=(n - 1, 3, 3))
    compliance = 10.0 ** rng.uniform(-4, 2, size=(n - 1, 6))
    c, g = rng.normal(size=(n - 1, 6)), rng.normal(size=(n, 6))
    held = np.zeros(n, dtype=np.bool_)
    held[list(fixed)] = True
    Y, Z, d, load = np.zeros((n, 6, 6)), np.zeros((n - 1, 6, 6)), np.zeros((n, 6)), np.zeros((n - 1, 6))
    factor(n, held, H.copy(), near, far, B, compliance, Y, Z, np.zeros((6, 6)))
    solve(n, near, far, B, Y, Z, c, g, d, load, np.zeros((6, 6)))
    for j in range(n - 1):
        rows = _lever_matrix(near[j], B[j]) @ d[j] - _lever_matrix(far[j], B[j]) @ d[j + 1]
        assert rows + compliance[j] * load[j] == pytest.approx(-c[j], abs=1e-6)
    for i in range(n):
        if held[i]:
            assert not d[i].any()
            continue
        pull = g[i].copy()
        if i < n - 1:
            pull += _lever_matrix(near[i], B[i]).T @ load[i]
        if i > 0:
            pull -= _lever_matrix(far[i - 1], B[i - 1]).T @ load[i - 1]
        assert H[i] @ d[i] == pytest.approx(pull, abs=1e-6)
