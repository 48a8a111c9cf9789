"""Mass matrix and Jacobian of a mechanism with loops, their factors, and the rows that count.

Spatial vectors are linear, then angular, in world axes, about the centre of mass of a body of the first loop.
"""

from __future__ import annotations

import math

from ligature.kernels import inlined, kernel
from ligature.model.poses import compose
from ligature.physics.loop_arrays import Array, Integers, Loops
from ligature.physics.trees import SLIDES, Trees, turned

FLAT = 100.0
"""Displacement of a coordinate for each unit of gap that is closed, above which a row is flat; rows below are firm."""

REDUNDANT = 1e-4
"""Motion of a loop's ends, per motion of its mechanism, both relative to its size, below which a row is redundant.

Other joints constrain it then, up to rounding errors: frames of joints are corrected to 1e-6 or better.
"""


@kernel
def prepare(trees: Trees, loops: Loops, m: int, rows: int) -> bool:
    """Mass matrix, Jacobian and their factors of mechanism ``m`` where it is; whether the factor exists."""
    n = loops.size[m]
    looped = loops.begin[m] < loops.begin[m + 1]
    origin = trees.pose[loops.end_row[loops.begin[m], 0] if looped else trees.begin[loops.tree[loops.tree_begin[m]]]]
    ox, oy, oz = origin[0], origin[1], origin[2]
    for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
        for r in range(trees.begin[loops.tree[t]], trees.begin[loops.tree[t] + 1]):
            _vectors(trees, loops, r, ox, oy, oz)
            _inertia(trees, loops, r, ox, oy, oz)
    for i in range(n):
        for j in range(n):
            loops.M[i, j] = 0.0
    for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
        begin = trees.begin[loops.tree[t]]
        for r in range(trees.begin[loops.tree[t] + 1] - 1, begin, -1):
            for a in range(10):
                loops.inertia[trees.rows[r, 0], a] += loops.inertia[r, a]
            _mass(trees, loops, r)
        _mass(trees, loops, begin)
    if not _factor(loops.M, loops.first, n):
        return False
    row = 0
    for c in range(loops.begin[m], loops.begin[m + 1]):
        for i in range(row, row + 6):
            for j in range(n):
                loops.J[i, j] = 0.0
        _derive(trees, loops, loops.end_row[c, 0], 1.0, c, row, ox, oy, oz)
        _derive(trees, loops, loops.end_row[c, 1], -1.0, c, row, ox, oy, oz)
        row += 6
    _select(loops, m, rows)
    for i in range(loops.rank[0]):
        divide(loops, n, i)
    return True


@inlined
def _vectors(trees: Trees, loops: Loops, r: int, ox: float, oy: float, oz: float) -> None:
    """Spatial vectors of the coordinates of row ``r``."""
    width, i = loops.width[r], loops.column[r]
    if width == 1:
        frame, fixed, s = trees.frame[r], trees.fixed[r], loops.axis[i]
        ax, ay, az = turned(frame, fixed[0], fixed[1], fixed[2])
        if trees.rows[r, 1] == SLIDES:
            s[0], s[1], s[2], s[3], s[4], s[5] = ax, ay, az, 0.0, 0.0, 0.0
        else:
            x, y, z = ox - frame[0], oy - frame[1], oz - frame[2]
            s[0], s[1], s[2] = ay * z - az * y, az * x - ax * z, ax * y - ay * x
            s[3], s[4], s[5] = ax, ay, az
    elif width == 6:
        x, y, z = ox - trees.pose[r, 0], oy - trees.pose[r, 1], oz - trees.pose[r, 2]
        for a in range(6):
            for b in range(6):
                loops.axis[i + a, b] = 1.0 if a == b else 0.0
        s = loops.axis
        s[i + 3, 1], s[i + 3, 2] = -z, y
        s[i + 4, 0], s[i + 4, 2] = z, -x
        s[i + 5, 0], s[i + 5, 1] = -y, x


@inlined
def _inertia(trees: Trees, loops: Loops, r: int, ox: float, oy: float, oz: float) -> None:
    """Inertia of the body of row ``r`` about the origin."""
    pose, out, mass, moment = trees.pose[r], loops.inertia[r], trees.mass[r], trees.inertia[r]
    x, y, z = pose[0] - ox, pose[1] - oy, pose[2] - oz
    out[0], out[1], out[2], out[3] = mass, mass * x, mass * y, mass * z
    out[4], out[5], out[6] = mass * (y * y + z * z), mass * (x * x + z * z), mass * (x * x + y * y)
    out[7], out[8], out[9] = -mass * x * y, -mass * x * z, -mass * y * z
    for a in range(3):
        ux, uy, uz = turned(pose, 1.0 if a == 0 else 0.0, 1.0 if a == 1 else 0.0, 1.0 if a == 2 else 0.0)
        out[4] += moment[a] * ux * ux
        out[5] += moment[a] * uy * uy
        out[6] += moment[a] * uz * uz
        out[7] += moment[a] * ux * uy
        out[8] += moment[a] * ux * uz
        out[9] += moment[a] * uy * uz


@inlined
def _mass(trees: Trees, loops: Loops, r: int) -> None:
    """Rows of the mass matrix that belong to row ``r``, which has the inertia of all that it carries."""
    b = loops.inertia[r]
    for i in range(loops.column[r], loops.column[r] + loops.width[r]):
        s = loops.axis[i]
        px = b[0] * s[0] + s[4] * b[3] - s[5] * b[2]
        py = b[0] * s[1] + s[5] * b[1] - s[3] * b[3]
        pz = b[0] * s[2] + s[3] * b[2] - s[4] * b[1]
        lx = b[4] * s[3] + b[7] * s[4] + b[8] * s[5] + b[2] * s[2] - b[3] * s[1]
        ly = b[7] * s[3] + b[5] * s[4] + b[9] * s[5] + b[3] * s[0] - b[1] * s[2]
        lz = b[8] * s[3] + b[9] * s[4] + b[6] * s[5] + b[1] * s[1] - b[2] * s[0]
        at = r
        while at >= 0:
            for j in range(loops.column[at], loops.column[at] + loops.width[at]):
                u = loops.axis[j]
                value = u[0] * px + u[1] * py + u[2] * pz + u[3] * lx + u[4] * ly + u[5] * lz
                loops.M[i, j] = value
                loops.M[j, i] = value
            at = trees.rows[at, 0]


@inlined
def _derive(trees: Trees, loops: Loops, r: int, sign: float, c: int, row: int, ox: float, oy: float, oz: float) -> None:
    """Add to the six rows from ``row`` the derivative of closure ``c``'s end on row ``r`` by the joints up to it."""
    end = loops.end[0] if sign > 0.0 else loops.end[1]
    compose(trees.pose[r], loops.end_frame[c, 0 if sign > 0.0 else 1], end)
    x, y, z = end[0] - ox, end[1] - oy, end[2] - oz
    at = r
    while at >= 0:
        for j in range(loops.column[at], loops.column[at] + loops.width[at]):
            s = loops.axis[j]
            loops.J[row, j] += sign * (s[0] + s[4] * z - s[5] * y)
            loops.J[row + 1, j] += sign * (s[1] + s[5] * x - s[3] * z)
            loops.J[row + 2, j] += sign * (s[2] + s[3] * y - s[4] * x)
            if not loops.point[c]:
                for a in range(3):
                    loops.J[row + 3 + a, j] += sign * s[3 + a]
        at = trees.rows[at, 0]


@inlined
def _factor(A: Array, first: Integers, n: int) -> bool:
    """Replace the lower triangle of ``A`` (n, n), row i of which begins at ``first``, by its factor L, A = L Lᵀ."""
    for i in range(n):
        for j in range(first[i], i + 1):
            s = A[i, j]
            for k in range(first[i], j):
                s -= A[i, k] * A[j, k]
            if j < i:
                A[i, j] = s / A[j, j]
            elif s > 0.0:
                A[i, i] = math.sqrt(s)
            else:
                return False
    return True


@inlined
def _select(loops: Loops, m: int, rows: int) -> None:
    """Fill `row_of` with independent rows of J, and `rank` and `firm`.

    Pivoted Cholesky factorisation of the Gram matrix, lengths divided by the size of the mechanism. Rows that other
    joints constrain as well, up to rounding errors, or that vanish in a flat place, are left out of both projections.
    """
    n, A, left, J, size = loops.size[m], loops.A, loops.multiplier, loops.J, loops.extent[m]
    for i in range(rows):
        left[i] = 0.0
        for a in range(n):
            u = J[i, a] * (size if loops.linear[a] else 1.0) / (size if i % 6 < 3 else 1.0)
            left[i] += u * u
    loops.rank[0], loops.firm[0] = 0, 0
    for rank in range(min(rows, n)):
        best = 0
        for i in range(rows):
            if left[i] > left[best]:
                best = i
        if left[best] < REDUNDANT * REDUNDANT:
            break
        loops.rank[0] = rank + 1
        root = math.sqrt(left[best])
        if FLAT * root > 1.0:
            loops.firm[0] = rank + 1
        for i in range(rows):
            s = 0.0
            for a in range(n):
                s += J[i, a] * J[best, a] * (size * size if loops.linear[a] else 1.0)
            s /= (size if i % 6 < 3 else 1.0) * (size if best % 6 < 3 else 1.0)
            for k in range(rank):
                s -= A[i, k] * A[best, k]
            A[i, rank] = s / root
            left[i] -= A[i, rank] * A[i, rank]
        left[best] = -1.0
        loops.row_of[rank] = best


@inlined
def divide(loops: Loops, n: int, i: int) -> None:
    """Row ``i`` of B: L⁻¹ times its row of J, of length 1."""
    L, y, square, row = loops.M, loops.B[i], 0.0, loops.row_of[i]
    for a in range(n):
        s = loops.J[row, a]
        for k in range(loops.first[a], a):
            s -= L[a, k] * y[k]
        y[a] = s / L[a, a]
        square += y[a] * y[a]
    loops.scale[i] = math.sqrt(square)
    for a in range(n):
        y[a] /= loops.scale[i]
