"""Steps and speeds that close loops: least squares in the metric of mass, within the limits of the coordinates."""

from __future__ import annotations

import math

from ligature.kernels import inlined, kernel
from ligature.physics.loop_arrays import Array, Loops
from ligature.physics.loop_matrices import divide
from ligature.physics.trees import SLACK

WEAK = 1e-12
"""Squared length, in the metric of mass, below which a row of length 1 depends on those before it.

Links of grams that hold kilograms leave 1e-6 of a row.
"""

AT_LIMIT = 1e-6
"""Distance (m, rad) from its limit at which an axis does not move on."""

SWEEPS = 3
"""Most rounds that search for axes which would pass their limits."""


@inlined
def _couple(loops: Loops, n: int, total: int) -> None:
    """Factor of B Bᵀ for ``total`` rows; a row that depends on those before it is left out."""
    A = loops.A
    for i in range(total):
        for j in range(i + 1):
            s = 0.0
            for a in range(n):
                s += loops.B[i, a] * loops.B[j, a]
            for k in range(j):
                s -= A[i, k] * A[j, k]
            if j < i:
                A[i, j] = s / A[j, j]
            else:
                A[i, i] = math.sqrt(s) if s > WEAK else math.inf


@inlined
def _solve(loops: Loops, n: int, total: int) -> None:
    """Fill `step` with M⁻¹Jᵀ (J M⁻¹Jᵀ)⁻¹ times `multiplier`, which is overwritten."""
    A, x, L, y = loops.A, loops.multiplier, loops.M, loops.step
    for i in range(total):
        s = x[i] / loops.scale[i]
        for k in range(i):
            s -= A[i, k] * x[k]
        x[i] = s / A[i, i]
    for i in range(total - 1, -1, -1):
        x[i] /= A[i, i]
        for k in range(i):
            x[k] -= x[i] * A[i, k]
    for a in range(n):
        y[a] = 0.0
    for i in range(total):
        for a in range(n):
            y[a] += loops.B[i, a] * x[i]
    for a in range(n - 1, -1, -1):
        y[a] /= L[a, a]
        for k in range(loops.first[a], a):
            y[k] -= y[a] * L[a, k]


@inlined
def _keep(loops: Loops, n: int, i: int, row: int, coordinate: int) -> None:
    """Make row ``i`` of B, ``row`` of J, the constraint of one coordinate."""
    for a in range(n):
        loops.J[row, a] = 0.0
    loops.J[row, coordinate] = 1.0
    loops.row_of[i] = row
    divide(loops, n, i)


@kernel
def find_step(loops: Loops, n: int, rows: int, share: float) -> bool:
    """Fill `step` with the step that closes a share of the gaps within the limits; whether it is finite."""
    rank, more = loops.rank[0], 0
    for _ in range(SWEEPS):
        _couple(loops, n, rank + more)
        for i in range(rank + more):
            error = loops.error[loops.row_of[i]]
            loops.multiplier[i] = -share * error if i < rank else error
        _solve(loops, n, rank + more)
        found = 0
        for a in range(n):
            low, high = loops.bound[a, 0], loops.bound[a, 1]
            q, after = loops.place[a], loops.place[a] + loops.step[a]
            if not abs(after) < math.inf:
                return False
            below, above = after < low - AT_LIMIT and after < q, after > high + AT_LIMIT and after > q
            if (below or above) and more + found < n:
                row = rows + more + found
                _keep(loops, n, rank + more + found, row, a)
                loops.error[row] = min(low - q, 0.0) if below else max(high - q, 0.0)
                found += 1
        if found == 0:
            break
        more += found
    return True


@kernel
def correct_speeds(loops: Loops, n: int, rows: int, dt: float) -> None:
    """Remove from `speed` what opens loops, passes limits or exceeds `Loops.most`; kinetic energy never grows.

    If the projection reversed part of this tick's motion, of ``dt``, as in a flat place that rounding errors of the
    joints block, the speeds along it are removed too.
    """
    rank, more, v = loops.rank[0], 0, loops.speed
    before = product(loops, n, v, v)
    for sweep in range(SWEEPS + 1):
        _couple(loops, n, rank + more)
        _constrain(loops, n, rank, more, v)
        found = 0
        for a in range(n):
            stopped = (v[a] < 0.0 and loops.place[a] <= loops.bound[a, 0] + AT_LIMIT) or (
                v[a] > 0.0 and loops.place[a] >= loops.bound[a, 1] - AT_LIMIT
            )
            fast = abs(v[a]) > SLACK * loops.most[a]
            if (fast or stopped) and sweep < SWEEPS and more + found < n:
                row = rows + more + found
                _keep(loops, n, rank + more + found, row, a)
                loops.error[row] = 0.0 if stopped else math.copysign(loops.most[a], v[a])
                found += 1
        if found == 0:
            break
        more += found
    after = product(loops, n, v, v)
    share = min(1.0, math.sqrt(before / after)) if after > 0.0 else 1.0
    for a in range(n):
        v[a] *= share
    for i in range(rank, rank + more):
        loops.error[loops.row_of[i]] = 0.0
    way = loops.shift
    _constrain(loops, n, rank, more, way)
    square = product(loops, n, way, way)
    if square == 0.0:
        return
    taken = min(max(-product(loops, n, v, way) / square, 0.0), 1.0 / dt)
    for a in range(n):
        v[a] += taken * way[a]


@inlined
def _constrain(loops: Loops, n: int, rank: int, more: int, v: Array) -> None:
    """Project speeds ``v`` onto the rows of closures, and of ``more`` coordinates, whose speeds `error` states."""
    for _ in range(2):  # the second takes up what the first leaves where grams hold kilograms
        for i in range(rank + more):
            row = loops.row_of[i]
            s = 0.0 if i < rank else loops.error[row]
            for a in range(n):
                s -= loops.J[row, a] * v[a]
            loops.multiplier[i] = s
        _solve(loops, n, rank + more)
        for a in range(n):
            v[a] += loops.step[a]


@inlined
def product(loops: Loops, n: int, v: Array, w: Array) -> float:
    """The product vᵀ M w: twice the kinetic energy, of one with itself."""
    total = 0.0
    for k in range(n):
        s, t = 0.0, 0.0
        for a in range(k, n):
            if loops.first[a] <= k:
                s += loops.M[a, k] * v[a]
                t += loops.M[a, k] * w[a]
        total += s * t
    return total
