"""Solves a rod together with the nodes that contacts couple to it: conjugate gradients around the chain's solver.

The matrices of the two nodes of a closed contact treat each as held by a spring fixed in space. The effect of one
node's motion on the other remains, and is iterated to rounding with the chain's direct solver as preconditioner.
Only coupled nodes and those between them take part, however long the rod. World
axes, SI units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.rotations import cross, rotate
from ligature.suture.chain import factor, invert_spd6, solve, solve_within
from ligature.suture.coupling import push
from ligature.suture.layout import Nodes, Touches, Work

Array = NDArray[np.float64]


MAX_CG = 40

CG_TOLERANCE = 1e-6
"""Residual energy, relative to the first, at which the coupling is solved, as a rule."""


@inlined
def solve_coupled(
    n: int, total: int, nodes: Nodes, touches: Touches, work: Work, most: int = MAX_CG, tolerance: float = CG_TOLERANCE
) -> None:
    """Correction ``work.d`` and joint loads ``work.load`` of a linearised step: of the chain and of what it touches.

    At most ``most`` iterations of the coupling leave a residual energy of ``tolerance``, relative to the first.
    """
    low, high, rows = gather(n, total, nodes, touches, work)
    top = high if high >= 0 else n // 2
    factor(n, top, nodes.fixed, work.H, work.lever, work.B, work.compliance, work.Y, work.Z, work.felt)
    solve(n, top, work.lever, work.B, work.Y, work.Z, work.c, work.g, work.d, work.load, work.felt_load)
    if rows > 0:
        couple(n, low, high, rows, nodes, touches, work, most, tolerance)


@kernel
def gather(n: int, total: int, nodes: Nodes, touches: Touches, work: Work) -> tuple[int, int, int]:
    """Find the nodes that closed contacts couple: returns the first and last node of the chain, and a count of rows.

    ``work.rows`` receives these nodes and those between them, then the bodies with a load. Without contacts
    between movable nodes the first is past the last, which is -1.
    """
    low, high = n, -1
    for i in range(n, total):
        work.pushed[i] = False
        if not nodes.met[i]:
            continue
        for a in range(6):
            work.d[i, a] = 0.0
            work.pushed[i] = work.pushed[i] or work.g[i, a] != 0.0
    for c in range(touches.count[0]):
        i, k = touches.node[c, 0], touches.node[c, 1]
        if not touches.closed[c] or nodes.fixed[k]:
            continue
        if k >= n:
            work.pushed[k] = True
        if not nodes.fixed[i]:
            low, high = min(low, i), max(high, i)
            if k < n:
                low, high = min(low, k), max(high, k)
    rows = 0
    for i in range(low, high + 1):
        work.rows[rows] = i
        rows += 1
    for i in range(n, total):
        if work.pushed[i] and not nodes.fixed[i]:
            work.rows[rows] = i
            rows += 1
    return low, high, rows


@inlined
def _apply_coupling(rows: int, nodes: Nodes, touches: Touches, work: Work, p: Array, out: Array) -> None:
    """out = E p: the load on each movable node of a contact from the other's motion."""
    for m in range(rows):
        i = work.rows[m]
        for a in range(6):
            out[i, a] = 0.0
    for c in range(touches.count[0]):
        i, k = touches.node[c, 0], touches.node[c, 1]
        if not touches.closed[c] or nodes.fixed[i] or nodes.fixed[k]:
            continue
        K, arms = work.K[c], work.arms[c]
        ax, ay, az, bx, by, bz = arms[0, 0], arms[0, 1], arms[0, 2], arms[1, 0], arms[1, 1], arms[1, 2]
        ux, uy, uz = cross(p[i, 3], p[i, 4], p[i, 5], ax, ay, az)
        vx, vy, vz = cross(p[k, 3], p[k, 4], p[k, 5], bx, by, bz)
        fx, fy, fz = rotate(K, p[k, 0] + vx, p[k, 1] + vy, p[k, 2] + vz)
        push(out[i], -1.0, fx, fy, fz, ax, ay, az)
        fx, fy, fz = rotate(K, p[i, 0] + ux, p[i, 1] + uy, p[i, 2] + uz)
        push(out[k], -1.0, fx, fy, fz, bx, by, bz)


@inlined
def _precondition(n: int, low: int, high: int, rows: int, work: Work, g: Array, d: Array) -> None:
    """d = S⁻¹ g: the chain by its direct solver, every body alone."""
    solve_within(low, high, work.lever, work.B, work.Y, work.Z, g, d, work.coupled_load, work.felt_load)
    _move_bodies(n, rows, work, g, d)


@inlined
def _move_bodies(n: int, rows: int, work: Work, g: Array, d: Array) -> None:
    for m in range(rows):
        i = work.rows[m]
        if i >= n:
            for a in range(6):
                s = 0.0
                for b in range(6):
                    s += work.Y[i, a, b] * g[i, b]
                d[i, a] = s


@inlined
def _dot(rows: int, work: Work, a: Array, b: Array) -> float:
    s = 0.0
    for m in range(rows):
        i = work.rows[m]
        for k in range(6):
            s += a[i, k] * b[i, k]
    return s


@kernel
def couple(
    n: int, low: int, high: int, rows: int, nodes: Nodes, touches: Touches, work: Work, most: int, tolerance: float
) -> None:
    """Complete ``work.d`` and ``work.load`` by the coupling of contacts between movable nodes.

    ``low``, ``high``, ``rows`` are from `gather`; the chain's elimination must end at ``high``. ``most`` and
    ``tolerance`` are those of `solve_coupled`.
    """
    for m in range(rows):
        if work.rows[m] >= n:
            invert_spd6(work.H[work.rows[m]], work.Y[work.rows[m]])
    _move_bodies(n, rows, work, work.g, work.d)
    if high < 0:
        return
    _iterate(n, low, high, rows, nodes, touches, work, most, tolerance)
    felt = work.cg[0]
    _apply_coupling(rows, nodes, touches, work, work.d, felt)
    for i in range(low, high + 1):
        for a in range(6):
            work.g[i, a] -= felt[i, a]
    solve(n, high, work.lever, work.B, work.Y, work.Z, work.c, work.g, work.d, work.load, work.felt_load)


@inlined
def _iterate(
    n: int, low: int, high: int, rows: int, nodes: Nodes, touches: Touches, work: Work, most: int, tolerance: float
) -> None:
    """Conjugate gradients for ``work.d`` of the coupled nodes."""
    p, r, z, s = work.cg[0], work.cg[1], work.cg[2], work.cg[3]
    _apply_coupling(rows, nodes, touches, work, work.d, r)
    for m in range(rows):
        i = work.rows[m]
        for a in range(6):
            r[i, a] = -r[i, a]
    _precondition(n, low, high, rows, work, r, z)
    energy = _dot(rows, work, r, z)
    enough = tolerance * energy
    # s keeps S p by recurrence, so that S itself is never applied.
    for m in range(rows):
        i = work.rows[m]
        for a in range(6):
            p[i, a], s[i, a] = z[i, a], r[i, a]
    for _ in range(most):
        if energy <= enough:
            break
        q = z
        _apply_coupling(rows, nodes, touches, work, p, q)
        for m in range(rows):
            i = work.rows[m]
            for a in range(6):
                q[i, a] += s[i, a]
        curvature = _dot(rows, work, p, q)
        if curvature <= 0.0:
            break
        step = energy / curvature
        for m in range(rows):
            i = work.rows[m]
            for a in range(6):
                work.d[i, a] += step * p[i, a]
                r[i, a] -= step * q[i, a]
        _precondition(n, low, high, rows, work, r, z)
        before, energy = energy, _dot(rows, work, r, z)
        beta = energy / before
        for m in range(rows):
            i = work.rows[m]
            for a in range(6):
                p[i, a] = z[i, a] + beta * p[i, a]
                s[i, a] = r[i, a] + beta * s[i, a]
