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
        H=A @ np.swapaxes(A, 1, 2) + 0.1 * np.eye(6), lever=rng.normal(size=(n - 1, 2, 3)),
        B=rng.normal(size=(n - 1, 3, 3)), compliance=10.0 ** rng.uniform(-4, 2, size=(n - 1, 6)),
        c=rng.normal(size=(n - 1, 6)), g=rng.normal(size=(n, 6)), held=held, Y=np.zeros((n, 6, 6)),
        Z=np.zeros((n - 1, 6, 6)), d=np.zeros((n, 6)), load=np.zeros((n - 1, 6)), felt=np.zeros((2, 6, 6)),
        felt_load=np.zeros((2, 6)),
    )  # fmt: skip


def _factor(k, top):
    factor(len(k.d), top, k.held, k.H.copy(), k.lever, k.B, k.compliance, k.Y, k.Z, k.felt)


@pytest.mark.parametrize("top", [0, 2, 3, 6])
@pytest.mark.parametrize("fixed", [(), (0,), (0, 6), (3,)])
def test_chain_solution_satisfies_every_row(fixed, top):
    n = 7
    k = _chain(n, fixed)
    _factor(k, top)
    solve(n, top, k.lever, k.B, k.Y, k.Z, k.c, k.g, k.d, k.load, k.felt_load)
    for j in range(n - 1):
        rows = _lever_matrix(k.lever[j, 0], k.B[j]) @ k.d[j] - _lever_matrix(k.lever[j, 1], k.B[j]) @ k.d[j + 1]
        assert rows + k.compliance[j] * k.load[j] == pytest.approx(-k.c[j], abs=1e-6)
    for i in range(n):
        if k.held[i]:
            assert not k.d[i].any()
            continue
        pull = k.g[i].copy()
        if i < n - 1:
            pull += _lever_matrix(k.lever[i, 0], k.B[i]).T @ k.load[i]
        if i > 0:
            pull -= _lever_matrix(k.lever[i - 1, 1], k.B[i - 1]).T @ k.load[i - 1]
        assert k.H[i] @ k.d[i] == pytest.approx(pull, abs=1e-6)


@pytest.mark.parametrize(("low", "top"), [(2, 4), (0, 6), (3, 3)])
def test_loads_between_two_nodes_move_them_as_the_whole_chain_states(low, top):
    n = 7
    k = _chain(n, (5,))
    k.c[:] = 0.0
    k.g[:low], k.g[top + 1 :] = 0.0, 0.0
    _factor(k, top)
    solve(n, top, k.lever, k.B, k.Y, k.Z, k.c, k.g, k.d, k.load, k.felt_load)
    within = np.full((n, 6), np.nan)
    solve_within(low, top, k.lever, k.B, k.Y, k.Z, k.g, within, np.zeros((n - 1, 6)), k.felt_load)
    assert within[low : top + 1] == pytest.approx(k.d[low : top + 1], rel=1e-9, abs=1e-12)


def _dense(k):
    """The corrections by elimination with pivots of all rows at once, in extended precision."""
    n = len(k.d)
    A, b = np.zeros((12 * n - 6, 12 * n - 6), np.longdouble), np.zeros(12 * n - 6, np.longdouble)
    for i in range(n):
        A[6 * i : 6 * i + 6, 6 * i : 6 * i + 6], b[6 * i : 6 * i + 6] = k.H[i], k.g[i]
    for j in range(n - 1):
        row = 6 * n + 6 * j
        for node, X in ((j, _lever_matrix(k.lever[j, 0], k.B[j])), (j + 1, -_lever_matrix(k.lever[j, 1], k.B[j]))):
            A[row : row + 6, 6 * node : 6 * node + 6] = X
            A[6 * node : 6 * node + 6, row : row + 6] = -X.T
        A[row : row + 6, row : row + 6], b[row : row + 6] = np.diag(k.compliance[j]), -k.c[j]
    for p in range(len(b)):
        best = p + int(np.argmax(np.abs(A[p:, p])))
        A[[p, best]], b[[p, best]] = A[[best, p]], b[[best, p]]
        share = A[p + 1 :, p] / A[p, p]
        A[p + 1 :] -= share[:, None] * A[p]
        b[p + 1 :] -= share * b[p]
    x = np.zeros_like(b)
    for p in reversed(range(len(b))):
        x[p] = (b[p] - A[p, p + 1 :] @ x[p + 1 :]) / A[p, p]
    return x[: 6 * n].reshape(n, 6).astype(float)


@pytest.mark.parametrize("top", [3, 6])
@pytest.mark.parametrize("seed", range(4))
def test_a_thread_of_micrograms_pressed_by_stiff_contacts_is_solved_to_rounding(seed, top):
    n, rng = 7, np.random.default_rng(seed)
    k = _chain(n, ())
    k.lever[:] = rng.normal(scale=1e-3, size=k.lever.shape)
    k.B[:] = np.eye(3) + rng.normal(scale=0.1, size=k.B.shape)
    k.compliance[:, :3], k.compliance[:, 3:] = 1e3, 1e12
    k.c[:], k.g[:] = rng.normal(scale=1e-6, size=k.c.shape), rng.normal(scale=1e-9, size=k.g.shape)
    for i in range(n):
        # An element of 0.1 mg with a contact of 50 N/mm beside its axis, within a tick of 1 ms.
        normal, arm = rng.normal(size=3), rng.normal(scale=3e-4, size=3)
        J = np.r_[normal, np.cross(arm, normal)] / np.linalg.norm(normal)
        k.H[i] = np.diag([1e-7] * 3 + [1e-14] * 3) + 5e-2 * np.outer(J, J)
    assert max(np.linalg.cond(H) for H in k.H) > 1e11
    _factor(k, top)
    solve(n, top, k.lever, k.B, k.Y, k.Z, k.c, k.g, k.d, k.load, k.felt_load)
    exact = _dense(k)
    for part in (slice(0, 3), slice(3, 6)):
        assert k.d[:, part] == pytest.approx(exact[:, part], abs=1e-6 * np.abs(exact[:, part]).max())
