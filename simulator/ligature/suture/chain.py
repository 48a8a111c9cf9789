"""Direct solver of a serial chain: rigid nodes joined by compliant six-row joints, in O(nodes).

Solves, for corrections d (n, 6: displacement, rotation) and joint multipliers l (n - 1, 6: force,
moment),

    H_i d_i - X_i^T l_i + X'_i^T l_(i-1) = g_i          (inertia, contacts: node rows)
    X_i d_i - X'_(i+1) d_(i+1) + a_i l_i = -c_i         (joint rows, compliance a_i > 0)

with X = [[1, -[r]], [0, -B]] of the lever r from the node's centre to the pivot. Eliminating nodes
and joints in turn from the first to the last leaves 6 x 6 blocks alone: the block-tridiagonal solver
of Deul et al. (Direct Position-Based Solver for Stiff Rods, 2018), written with the admittance Y of
each node and the impedance Z of each joint, so that nodes of infinite mass (Y = 0) need no special
case. Elimination goes from both ends to one node, the top, so that the motion of the nodes between the
first that is loaded and the top follows from these nodes alone. World axes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@inlined
def invert_spd6(A: Array, out: Array) -> None:
    """Inverse of the symmetric positive definite ``A`` (6, 6) by L D Lᵀ; ``A`` is used up."""
    for j in range(6):
        for k in range(j):
            s = A[j, k] * A[k, k]
            for i in range(j, 6):
                A[i, j] -= A[i, k] * s
        s = 1.0 / A[j, j]
        for i in range(j + 1, 6):
            A[i, j] *= s
    for j in range(6):
        for i in range(j + 1, 6):
            s = -A[i, j]
            for k in range(j + 1, i):
                s -= A[i, k] * out[k, j]
            out[i, j] = s
    for k in range(6):
        pivot = 1.0 / A[k, k]
        out[k, k] = pivot
        for j in range(k):
            A[k, j] = out[k, j]
            out[k, j] *= pivot
    for i in range(6):
        for j in range(i + 1):
            s = out[i, j]
            for k in range(i + 1, 6):
                s += A[k, i] * out[k, j]
            out[i, j] = s
            out[j, i] = s


@inlined
def _carry_admittance(Y: Array, r: Array, B: Array, out: Array) -> None:
    """X Y Xᵀ: the admittance of a node, felt at its pivot in the rows of the joint."""
    rx, ry, rz = r[0], r[1], r[2]
    for c in range(3):
        # Columns of U = Yll - [r] Yal and V = Yla - [r] Yaa; U goes to the upper left, V to the upper right.
        u, v = c, c + 3
        out[0, u] = Y[0, u] - (ry * Y[5, u] - rz * Y[4, u])
        out[1, u] = Y[1, u] - (rz * Y[3, u] - rx * Y[5, u])
        out[2, u] = Y[2, u] - (rx * Y[4, u] - ry * Y[3, u])
        out[0, v] = Y[0, v] - (ry * Y[5, v] - rz * Y[4, v])
        out[1, v] = Y[1, v] - (rz * Y[3, v] - rx * Y[5, v])
        out[2, v] = Y[2, v] - (rx * Y[4, v] - ry * Y[3, v])
    for i in range(3):
        vx, vy, vz = out[i, 3], out[i, 4], out[i, 5]
        out[i, 0] += vy * rz - vz * ry
        out[i, 1] += vz * rx - vx * rz
        out[i, 2] += vx * ry - vy * rx
        for j in range(3):
            s = -(vx * B[j, 0] + vy * B[j, 1] + vz * B[j, 2])
            out[i, 3 + j] = s
            out[3 + j, i] = s
    for j in range(3):
        tx = B[j, 0] * Y[3, 3] + B[j, 1] * Y[4, 3] + B[j, 2] * Y[5, 3]
        ty = B[j, 0] * Y[3, 4] + B[j, 1] * Y[4, 4] + B[j, 2] * Y[5, 4]
        tz = B[j, 0] * Y[3, 5] + B[j, 1] * Y[4, 5] + B[j, 2] * Y[5, 5]
        for i in range(j, 3):
            out[3 + i, 3 + j] = tx * B[i, 0] + ty * B[i, 1] + tz * B[i, 2]


@inlined
def _add_impedance(Z: Array, r: Array, B: Array, H: Array, E: Array) -> None:
    """H += Xᵀ Z X: the impedance of a joint, felt at the centre of the next node; ``E`` (6, 3) is scratch."""
    rx, ry, rz = r[0], r[1], r[2]
    for i in range(6):
        ax, ay, az = Z[i, 0], Z[i, 1], Z[i, 2]
        cx, cy, cz = Z[i, 3], Z[i, 4], Z[i, 5]
        E[i, 0] = -(ay * rz - az * ry) - (cx * B[0, 0] + cy * B[1, 0] + cz * B[2, 0])
        E[i, 1] = -(az * rx - ax * rz) - (cx * B[0, 1] + cy * B[1, 1] + cz * B[2, 1])
        E[i, 2] = -(ax * ry - ay * rx) - (cx * B[0, 2] + cy * B[1, 2] + cz * B[2, 2])
    for i in range(3):
        for j in range(3):
            H[i, j] += Z[i, j]
            H[i, 3 + j] += E[i, j]
            H[3 + j, i] += E[i, j]
    for j in range(3):
        H[3, 3 + j] += ry * E[2, j] - rz * E[1, j] - (B[0, 0] * E[3, j] + B[1, 0] * E[4, j] + B[2, 0] * E[5, j])
        H[4, 3 + j] += rz * E[0, j] - rx * E[2, j] - (B[0, 1] * E[3, j] + B[1, 1] * E[4, j] + B[2, 1] * E[5, j])
        H[5, 3 + j] += rx * E[1, j] - ry * E[0, j] - (B[0, 2] * E[3, j] + B[1, 2] * E[4, j] + B[2, 2] * E[5, j])


@inlined
def apply_lever(d: Array, r: Array, B: Array, out: Array) -> None:
    """out = X d: motion of the pivot, and turn in joint axes with the sign of the first node."""
    out[0] = d[0] - (r[1] * d[5] - r[2] * d[4])
    out[1] = d[1] - (r[2] * d[3] - r[0] * d[5])
    out[2] = d[2] - (r[0] * d[4] - r[1] * d[3])
    for i in range(3):
        out[3 + i] = -(B[i, 0] * d[3] + B[i, 1] * d[4] + B[i, 2] * d[5])


@inlined
def add_joint_force(load: Array, r: Array, B: Array, sign: float, out: Array) -> None:
    """out += sign Xᵀ load: force and moment of a joint on a node's centre."""
    fx, fy, fz = sign * load[0], sign * load[1], sign * load[2]
    out[0] += fx
    out[1] += fy
    out[2] += fz
    out[3] += r[1] * fz - r[2] * fy
    out[4] += r[2] * fx - r[0] * fz
    out[5] += r[0] * fy - r[1] * fx
    for j in range(3):
        out[3 + j] -= sign * (B[0, j] * load[3] + B[1, j] * load[4] + B[2, j] * load[5])


@inlined
def _times6(A: Array, v: Array, out: Array) -> None:
    for i in range(6):
        out[i] = A[i, 0] * v[0] + A[i, 1] * v[1] + A[i, 2] * v[2] + A[i, 3] * v[3] + A[i, 4] * v[4] + A[i, 5] * v[5]


@inlined
def _clear_admittance(compliance: Array, Z: Array) -> None:
    for a in range(6):
        for b in range(6):
            Z[a, b] = 0.0
        Z[a, a] = 1.0 / compliance[a]


@inlined
def _invert_node(fixed: bool, H: Array, Y: Array) -> None:
    if fixed:
        for a in range(6):
            for b in range(6):
                Y[a, b] = 0.0
    else:
        invert_spd6(H, Y)


@inlined
def _join(Y: Array, fixed: bool, r: Array, B: Array, compliance: Array, Z: Array, scratch: Array) -> None:
    """Impedance ``Z`` of a joint with the eliminated node of admittance ``Y`` behind it, at its lever ``r``."""
    if fixed:
        _clear_admittance(compliance, Z)
    else:
        _carry_admittance(Y, r, B, scratch)
        for a in range(6):
            scratch[a, a] += compliance[a]
        invert_spd6(scratch, Z)


@kernel
def factor(
    n: int, top: int, fixed: Flags, H: Array, r_near: Array, r_far: Array, B: Array, compliance: Array, Y: Array,
    Z: Array, scratch: Array,
) -> None:  # fmt: skip
    """Eliminate the chain's ``n`` nodes from both ends towards ``top``: fills ``Y`` (n, 6, 6), ``Z`` (n - 1, 6, 6).

    ``H`` is used up. ``r_near[j]``, ``r_far[j]`` are the levers of joint j on its nodes j and j + 1; nodes with
    ``fixed`` do not move.
    """
    for i in range(top):
        _invert_node(fixed[i], H[i], Y[i])
        _join(Y[i], fixed[i], r_near[i], B[i], compliance[i], Z[i], scratch)
        if not fixed[i + 1]:
            _add_impedance(Z[i], r_far[i], B[i], H[i + 1], scratch)
    for i in range(n - 1, top, -1):
        j = i - 1
        _invert_node(fixed[i], H[i], Y[i])
        _join(Y[i], fixed[i], r_far[j], B[j], compliance[j], Z[j], scratch)
        if not fixed[j]:
            _add_impedance(Z[j], r_near[j], B[j], H[j], scratch)
    _invert_node(fixed[top], H[top], Y[top])


@kernel
def solve(
    n: int, top: int, r_near: Array, r_far: Array, B: Array, Y: Array, Z: Array, c: Array, g: Array, d: Array,
    load: Array, scratch: Array,
) -> None:  # fmt: skip
    """Corrections ``d`` (n, 6) and multipliers ``load`` (n - 1, 6) for the rows ``c`` and loads ``g`` of the nodes.

    ``top`` is that of `factor`; ``g`` is left as it came.
    """
    u, w, far = scratch[0], scratch[1], scratch[2]
    for i in range(top):
        for a in range(6):
            w[a] = g[i, a]
        if i > 0:
            add_joint_force(load[i - 1], r_far[i - 1], B[i - 1], -1.0, w)
        _times6(Y[i], w, d[i])
        apply_lever(d[i], r_near[i], B[i], u)
        for a in range(6):
            u[a] = -(u[a] + c[i, a])
        _times6(Z[i], u, load[i])
    for i in range(n - 1, top, -1):
        for a in range(6):
            w[a] = g[i, a]
        if i < n - 1:
            add_joint_force(load[i], r_near[i], B[i], 1.0, w)
        _times6(Y[i], w, d[i])
        apply_lever(d[i], r_far[i - 1], B[i - 1], u)
        for a in range(6):
            u[a] -= c[i - 1, a]
        _times6(Z[i - 1], u, load[i - 1])
    for a in range(6):
        w[a] = g[top, a]
    if top > 0:
        add_joint_force(load[top - 1], r_far[top - 1], B[top - 1], -1.0, w)
    if top < n - 1:
        add_joint_force(load[top], r_near[top], B[top], 1.0, w)
    _times6(Y[top], w, d[top])
    _substitute_back(0, top, r_near, r_far, B, Y, Z, d, load, u, w, far)
    for i in range(top + 1, n):
        j = i - 1
        apply_lever(d[j], r_near[j], B[j], far)
        _times6(Z[j], far, u)
        for a in range(6):
            load[j, a] -= u[a]
            w[a] = 0.0
        add_joint_force(load[j], r_far[j], B[j], -1.0, w)
        _times6(Y[i], w, u)
        for a in range(6):
            d[i, a] += u[a]


@inlined
def _substitute_back(
    low: int, top: int, r_near: Array, r_far: Array, B: Array, Y: Array, Z: Array, d: Array, load: Array, u: Array,
    w: Array, far: Array,
) -> None:  # fmt: skip
    """Complete nodes and joints below ``top``, down to ``low``, from what is above them."""
    for i in range(top - 1, low - 1, -1):
        apply_lever(d[i + 1], r_far[i], B[i], far)
        _times6(Z[i], far, u)
        for a in range(6):
            load[i, a] += u[a]
            w[a] = 0.0
        add_joint_force(load[i], r_near[i], B[i], 1.0, w)
        _times6(Y[i], w, u)
        for a in range(6):
            d[i, a] += u[a]


@kernel
def solve_within(
    low: int, top: int, r_near: Array, r_far: Array, B: Array, Y: Array, Z: Array, g: Array, d: Array, load: Array,
    scratch: Array,
) -> None:  # fmt: skip
    """Corrections ``d`` of the nodes ``low`` … ``top`` for loads ``g`` on them alone; what lies outside yields along.

    Outside, nothing is computed; ``load`` is scratch.
    """
    u, w, far = scratch[0], scratch[1], scratch[2]
    for i in range(low, top + 1):
        for a in range(6):
            w[a] = g[i, a]
        if i > low:
            add_joint_force(load[i - 1], r_far[i - 1], B[i - 1], -1.0, w)
        _times6(Y[i], w, d[i])
        if i < top:
            apply_lever(d[i], r_near[i], B[i], u)
            for a in range(6):
                u[a] = -u[a]
            _times6(Z[i], u, load[i])
    _substitute_back(low, top, r_near, r_far, B, Y, Z, d, load, u, w, far)
