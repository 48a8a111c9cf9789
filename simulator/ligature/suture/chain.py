"""Direct solver of a serial chain: rigid nodes joined by compliant six-row joints, in O(nodes).

Solves, for corrections d (n, 6: displacement, rotation) and joint multipliers l (n - 1, 6: force,
moment),

    H_i d_i - X_i^T l_i + X'_i^T l_(i-1) = g_i          (inertia, contacts: node rows)
    X_i d_i - X'_(i+1) d_(i+1) + a_i l_i = -c_i         (joint rows, compliance a_i > 0)

with X = [[1, -[r]], [0, -B]] of the lever r from the node's centre to the pivot. Eliminating nodes
and joints in turn from the first to the last leaves 6 x 6 blocks alone: the block-tridiagonal solver
of Deul et al. (Direct Position-Based Solver for Stiff Rods, 2018), written with the admittance Y of
each node and the impedance Z of each joint,

    Y_i = (H_i + X'_i^T Z_(i-1) X'_i)^-1,    Z_i = (X_i Y_i X_i^T + a_i)^-1,

so that nodes of infinite mass (Y = 0) need no special case. Elimination goes from both ends to one node, the top, so
that the motion of the nodes between the first that is loaded and the top follows from these nodes alone. From the last
node the equations are the same with X and X' exchanged and the sign of l reversed. So both ends are eliminated at
once, one in each lane of a register (`ligature.unrolled`), as long as nodes are left on both sides.

Of symmetric matrices only the lower half counts. World axes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.unrolled import Flags, Matrix, Rows, cross_matrix, lower, symmetric, unrolled

Array = NDArray[np.float64]
Flagged = NDArray[np.bool_]

HEAD, TAIL = 0, 1
"""The sides of the top: what is eliminated from the first node on, and from the last."""

_SIGN = np.array([1.0, -1.0])
"""Sign of the joints' multipliers on either side."""


def _inverse(A: Matrix) -> Matrix:
    """Inverse of the symmetric positive definite ``A``: one row is swept after the other (Goodnight 1979)."""
    for k in range(len(A)):
        per, row = 1.0 / A[k, k], A[k].copy()
        share = row * per
        A = symmetric(A - np.outer(share, row))
        A[k], A[:, k], A[k, k] = share, share, -per
    return -A


def _jacobian(r: Matrix, B: Matrix) -> Matrix:
    """X: motion of the pivot, and turn in joint axes with the sign of the first node."""
    return np.block([[np.eye(3), -cross_matrix(r)], [np.zeros((3, 3)), -B]])


@unrolled(A=(6, 6), out=(6, 6))
def _invert(row: Any, A: Rows, out: Rows) -> None:
    out[row] = _inverse(symmetric(A[row]))


@inlined
def invert_spd6(A: Array, out: Array) -> None:
    """Inverse of the symmetric positive definite ``A`` (6, 6), of which the lower half counts."""
    _invert(0, A, out)


_BLOCKS = {
    "fixed": (), "H": (6, 6), "lever": (3,), "B": (3, 3), "compliance": (6,), "Y": (6, 6), "Z": (6, 6), "c": (6,),
    "g": (6,), "d": (6,), "load": (6,), "felt": (6, 6), "felt_load": (6,), "sign": (1,),
}  # fmt: skip
"""Shapes of the rows of a chain's arrays: nodes i, joints j, two levers of each joint, two sides."""


@unrolled(**_BLOCKS)
def _eliminate(
    i: Any, j: Any, near: Any, far: Any, side: Any, fixed: Flags, H: Rows, lever: Rows, B: Rows, compliance: Rows,
    felt: Rows, Y: Rows, Z: Rows,
) -> None:  # fmt: skip
    """Eliminate node ``i`` and joint ``j`` beyond it; ``felt`` is what the next node feels of them, X'^T Z X'."""
    admittance = fixed.choose(i, _inverse(symmetric(H[i] + felt[side])), 0.0)
    X, X_next = _jacobian(lever[near], B[j]), _jacobian(lever[far], B[j])
    impedance = _inverse(X @ admittance @ X.T + np.diag(compliance[j]))
    felt[side] = lower(X_next.T @ impedance @ X_next)
    Y[i], Z[j] = lower(admittance), lower(impedance)


@unrolled(**_BLOCKS)
def _close(i: Any, head: Any, tail: Any, fixed: Flags, H: Rows, felt: Rows, Y: Rows) -> None:
    """Eliminate the top ``i``, which feels both sides."""
    Y[i] = lower(fixed.choose(i, _inverse(symmetric(H[i] + felt[head] + felt[tail])), 0.0))


@unrolled(**_BLOCKS)
def _advance(
    i: Any, j: Any, near: Any, far: Any, side: Any, sign: Rows, lever: Rows, B: Rows, Y: Rows, Z: Rows, c: Rows | None,
    g: Rows, felt_load: Rows, d: Rows, load: Rows,
) -> None:  # fmt: skip
    """Correct node ``i`` and joint ``j`` as if nothing lay beyond them; ``felt_load`` is what the next node feels."""
    s = sign[side]
    X, X_next = _jacobian(lever[near], B[j]), _jacobian(lever[far], B[j])
    d[i] = moved = symmetric(Y[i]) @ (g[i] + felt_load[side])
    gap = s * (X @ moved) if c is None else s * (X @ moved) + c[j]
    load[j] = multiplier = -(symmetric(Z[j]) @ gap)
    felt_load[side] = -s * (X_next.T @ multiplier)


@unrolled(**_BLOCKS)
def _turn_back(i: Any, head: Any, tail: Any, Y: Rows, g: Rows, felt_load: Rows, d: Rows) -> None:
    """Correct the top ``i``, which feels both sides."""
    d[i] = symmetric(Y[i]) @ (g[i] + felt_load[head] + felt_load[tail])


@unrolled(**_BLOCKS)
def _return(
    i: Any, j: Any, following: Any, near: Any, far: Any, side: Any, sign: Rows, lever: Rows, B: Rows, Y: Rows, Z: Rows,
    d: Rows, load: Rows,
) -> None:  # fmt: skip
    """Complete node ``i`` and joint ``j`` from the node ``following``, towards the top."""
    s = sign[side]
    X, X_next = _jacobian(lever[near], B[j]), _jacobian(lever[far], B[j])
    load[j] = multiplier = load[j] + s * (symmetric(Z[j]) @ (X_next @ d[following]))
    d[i] = d[i] + s * (symmetric(Y[i]) @ (X.T @ multiplier))


@inlined
def _clear(out: Array) -> None:
    for s in range(2):
        out[s] = 0.0


@kernel
def factor(
    n: int, top: int, fixed: Flagged, H: Array, lever: Array, B: Array, compliance: Array, Y: Array, Z: Array,
    felt: Array,
) -> None:  # fmt: skip
    """Eliminate the chain's ``n`` nodes from both ends towards ``top``: fills ``Y`` (n, 6, 6), ``Z`` (n - 1, 6, 6).

    ``lever`` (n - 1, 2, 3) are those of joint j on its nodes j and j + 1; nodes with ``fixed`` do not move. ``felt``
    (2, 6, 6) is scratch.
    """
    _clear(felt)
    pairs = min(top, n - 1 - top)
    for i in range(pairs):
        k = n - 1 - i
        _eliminate((i, k), (i, k - 1), (2 * i, 2 * k - 1), (2 * i + 1, 2 * k - 2), (HEAD, TAIL), fixed, H, lever, B,
                   compliance, felt, Y, Z)  # fmt: skip
    for i in range(pairs, top):
        _eliminate(i, i, 2 * i, 2 * i + 1, HEAD, fixed, H, lever, B, compliance, felt, Y, Z)
    for k in range(n - 1 - pairs, top, -1):
        _eliminate(k, k - 1, 2 * k - 1, 2 * k - 2, TAIL, fixed, H, lever, B, compliance, felt, Y, Z)
    _close(top, HEAD, TAIL, fixed, H, felt, Y)


@kernel
def solve(
    n: int, top: int, lever: Array, B: Array, Y: Array, Z: Array, c: Array, g: Array, d: Array, load: Array,
    felt_load: Array,
) -> None:  # fmt: skip
    """Corrections ``d`` (n, 6) and multipliers ``load`` (n - 1, 6) for the rows ``c`` and loads ``g`` of the nodes.

    ``top`` is that of `factor`; ``felt_load`` (2, 6) is scratch.
    """
    _clear(felt_load)
    pairs = min(top, n - 1 - top)
    for i in range(pairs):
        k = n - 1 - i
        _advance((i, k), (i, k - 1), (2 * i, 2 * k - 1), (2 * i + 1, 2 * k - 2), (HEAD, TAIL), _SIGN, lever, B, Y, Z, c,
                 g, felt_load, d, load)  # fmt: skip
    for i in range(pairs, top):
        _advance(i, i, 2 * i, 2 * i + 1, HEAD, _SIGN, lever, B, Y, Z, c, g, felt_load, d, load)
    for k in range(n - 1 - pairs, top, -1):
        _advance(k, k - 1, 2 * k - 1, 2 * k - 2, TAIL, _SIGN, lever, B, Y, Z, c, g, felt_load, d, load)
    _turn_back(top, HEAD, TAIL, Y, g, felt_load, d)
    for i in range(top - 1, pairs - 1, -1):
        _return(i, i, i + 1, 2 * i, 2 * i + 1, HEAD, _SIGN, lever, B, Y, Z, d, load)
    for k in range(top + 1, n - pairs):
        _return(k, k - 1, k - 1, 2 * k - 1, 2 * k - 2, TAIL, _SIGN, lever, B, Y, Z, d, load)
    for i in range(pairs - 1, -1, -1):
        k = n - 1 - i
        _return((i, k), (i, k - 1), (i + 1, k - 1), (2 * i, 2 * k - 1), (2 * i + 1, 2 * k - 2), (HEAD, TAIL), _SIGN,
                lever, B, Y, Z, d, load)  # fmt: skip


@kernel
def solve_within(
    low: int, top: int, lever: Array, B: Array, Y: Array, Z: Array, g: Array, d: Array, load: Array, felt_load: Array
) -> None:
    """Corrections ``d`` of the nodes ``low`` … ``top`` for loads ``g`` on them alone; what lies outside yields along.

    Outside, nothing is computed; ``load`` and ``felt_load`` are scratch.
    """
    _clear(felt_load)
    for i in range(low, top):
        _advance(i, i, 2 * i, 2 * i + 1, HEAD, _SIGN, lever, B, Y, Z, None, g, felt_load, d, load)
    _turn_back(top, HEAD, TAIL, Y, g, felt_load, d)
    for i in range(top - 1, low - 1, -1):
        _return(i, i, i + 1, 2 * i, 2 * i + 1, HEAD, _SIGN, lever, B, Y, Z, d, load)
