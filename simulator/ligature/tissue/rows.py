"""Rows of bristles within limits, solved at once with the motion of the rigid body that stretches them.

Each row is a direction e at a point of the body, with a bristle between the body and the point of tissue there: the
force λ = stretch / c within limits. With C the tissue's compliance, J the rows' directions and moments about the body's
centre of mass, and the elastic rows E apart from those at their limits L,

    (c + C_EE) λ_E = e₀ + J_E δ - C_EL λ_L,    H δ = g - Jᵀ λ,

so the tissue looks like a 6 x 6 stiffness to the body. Which rows are at their limits is found by repetition, starting
from the last tick. SI units.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.tissue.dense import cholesky, solve_cholesky

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

MOST_ROWS = 160
"""Rows of a needle at most."""

MOST_PASSES = 12
"""Repetitions for the limits at most."""


class Bristles(NamedTuple):
    """Scratch of a needle's tick: up to M rows."""

    kind: Integers  # (M,)
    point: Integers  # (M,) of the interface
    e: Array  # (M, 3)
    J: Array  # (M, 6)
    rest: Array  # (M,) stretch without motion of the needle and without its forces
    soft: Array  # (M,) c above
    low: Array  # (M,)
    high: Array  # (M,)
    side: Integers  # (M,) 0 elastic, 1 at the upper, -1 at the lower limit
    force: Array  # (M,)
    C: Array  # (M, M)
    A: Array  # (M, M)
    X: Array  # (7, M)
    elastic: Integers  # (M,) the rows that are
    H: Array  # (6, 6)
    g: Array  # (6,)
    K: Array  # (6, 6) stiffness of the rows that are elastic, as the needle sees it
    load: Array  # (6,) force and moment of all rows on the needle where it does not move
    change: Array  # (N, 3) forces on points of the interface without the needle's own, over those of the last step
    base: Array  # (N, 3) where they would put its points at the end of the tick


def row_arrays(points: int, capacity: int) -> Bristles:
    """Scratch for ``capacity`` rows."""
    M, z = capacity, np.zeros
    i = lambda: np.zeros(M, np.int64)  # noqa: E731
    return Bristles(
        i(), i(), z((M, 3)), z((M, 6)), z(M), z(M), z(M), z(M), i(), z(M), z((M, M)), z((M, M)), z((7, M)), i(),
        z((6, 6)), z(6), z((6, 6)), z(6), z((points, 3)), z((points, 3)),
    )  # fmt: skip


@inlined
def set_row(
    rows: Bristles, m: int, kind: int, point: int, ex: float, ey: float, ez: float, rx: float, ry: float, rz: float
) -> None:
    """Let row ``m`` be the direction (ex, ey, ez) at the lever (rx, ry, rz) from the centre of mass."""
    e, J = rows.e[m], rows.J[m]
    e[0], e[1], e[2] = ex, ey, ez
    J[0], J[1], J[2] = ex, ey, ez
    J[3], J[4], J[5] = ry * ez - rz * ey, rz * ex - rx * ez, rx * ey - ry * ex
    rows.kind[m], rows.point[m] = kind, point


@inlined
def reduce_rows(rows: Bristles, m: int) -> int:
    """Stiffness and load of the rows on the needle for the limits as they are; elastic rows, -1 where it failed."""
    n = 0
    for a in range(m):
        if rows.side[a] == 0:
            rows.elastic[n] = a
            n += 1
        else:
            rows.force[a] = rows.high[a] if rows.side[a] > 0 else rows.low[a]
    for i in range(6):
        rows.load[i] = 0.0
        for j in range(6):
            rows.K[i, j] = 0.0
    for a in range(m):
        if rows.side[a] != 0:
            for i in range(6):
                rows.load[i] -= rows.J[a, i] * rows.force[a]
    for p in range(n):
        a = rows.elastic[p]
        b = rows.rest[a]
        for c in range(m):
            if rows.side[c] != 0:
                b -= rows.C[a, c] * rows.force[c]
        rows.X[6, p] = b
        for i in range(6):
            rows.X[i, p] = rows.J[a, i]
        for q in range(p + 1):
            rows.A[p, q] = rows.C[a, rows.elastic[q]]
        rows.A[p, p] += rows.soft[a]
    if not cholesky(rows.A, n):
        return -1
    for c in range(7):
        X = rows.X[c]
        for p in range(n):
            total = X[p]
            for q in range(p):
                total -= rows.A[p, q] * X[q]
            X[p] = total / rows.A[p, p]
    for i in range(6):
        for p in range(n):
            rows.load[i] -= rows.X[i, p] * rows.X[6, p]
        for j in range(i + 1):
            total = 0.0
            for p in range(n):
                total += rows.X[i, p] * rows.X[j, p]
            rows.K[i, j], rows.K[j, i] = total, total
    return n


@inlined
def expand_rows(rows: Bristles, n: int, delta: Array) -> None:
    """Forces of the ``n`` elastic rows after `reduce_rows` for a motion ``delta`` (6,) of the needle."""
    for p in range(n - 1, -1, -1):
        total = rows.X[6, p]
        for i in range(6):
            total += rows.X[i, p] * delta[i]
        for q in range(p + 1, n):
            total -= rows.A[q, p] * rows.force[rows.elastic[q]]
        rows.force[rows.elastic[p]] = total / rows.A[p, p]


@kernel
def solve_rows(rows: Bristles, m: int, H: Array, g: Array, delta: Array) -> int:
    """Forces of the rows and motion ``delta`` (6,) of the needle.

    Returns 1 when `reduce_rows` has seen the limits as they are now, 0 when they changed last, -1 where it failed.
    """
    for turn in range(MOST_PASSES):
        n = reduce_rows(rows, m)
        if n < 0:
            return -1
        for i in range(6):
            delta[i] = g[i] + rows.load[i]
            for j in range(i + 1):
                rows.H[i, j] = H[i, j] + rows.K[i, j]
        if not cholesky(rows.H, 6):
            return -1
        solve_cholesky(rows.H, 6, delta)
        expand_rows(rows, n, delta)
        changed = False
        for a in range(m):
            side = rows.side[a]
            if side == 0:
                if rows.force[a] > rows.high[a]:
                    rows.side[a], changed = 1, True
                elif rows.force[a] < rows.low[a]:
                    rows.side[a], changed = -1, True
            elif turn < MOST_PASSES - 3:
                # At its limit as long as the stretch there would ask for more; in the last passes none comes back.
                bristle = stretch_of(rows, m, a, delta) / rows.soft[a]
                if (side > 0 and bristle < rows.high[a]) or (side < 0 and bristle > rows.low[a]):
                    rows.side[a], changed = 0, True
        if not changed:
            return 1
    return 0


@inlined
def stretch_of(rows: Bristles, m: int, a: int, delta: Array) -> float:
    """Stretch of row ``a``, its bristle's and the tissue's, after the motion ``delta`` (6,) and with the forces."""
    stretch = rows.rest[a]
    for i in range(6):
        stretch += rows.J[a, i] * delta[i]
    for c in range(m):
        stretch -= rows.C[a, c] * rows.force[c]
    return stretch


@inlined
def sum_up(rows: Bristles, m: int, wrench: Array) -> None:
    """Force and moment of all rows on the needle."""
    for i in range(6):
        wrench[i] = 0.0
        for a in range(m):
            wrench[i] -= rows.force[a] * rows.J[a, i]
