"""Cosserat rod of rigid elements, solved directly: compiled kernels of one tick.

Every element has a position, a unit quaternion (x y z w), a mass and principal moments of inertia.
Neighbours are tied by three rows that close the gap at their common pivot and three that bend and
twist elastically. All rows of a chain form a block-tridiagonal system that is solved exactly in one
sweep (XPBD with a direct solver: Deul, Kugelstadt, Weiler, Bender 2018), so that neither the number
of elements nor mass ratios soften it. The elastic rows are integrated implicitly with their damping:
``λ = −(k dt² + d dt) φ' + d dt φ`` with the bending angles φ before and φ' after the tick.
World axes, SI units.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

FREE = 1e20
"""Compliance that stands for a spring of no stiffness (rad/(N·m·s²), all rows being scaled by dt²)."""


@njit(cache=True)
def rotate(q: Array, v: Array, out: Array) -> None:
    """Write ``v`` (3,) turned by the unit quaternion ``q`` (4,) into ``out`` (3,)."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    cx = y * v[2] - z * v[1] + w * v[0]
    cy = z * v[0] - x * v[2] + w * v[1]
    cz = x * v[1] - y * v[0] + w * v[2]
    out[0] = v[0] + 2.0 * (y * cz - z * cy)
    out[1] = v[1] + 2.0 * (z * cx - x * cz)
    out[2] = v[2] + 2.0 * (x * cy - y * cx)


@njit(cache=True)
def quaternion_to_matrix(q: Array, R: Array) -> None:
    """Write the rotation (3, 3) of ``q`` into ``R``."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    R[0, 0] = 1 - 2 * (y * y + z * z)
    R[0, 1] = 2 * (x * y - z * w)
    R[0, 2] = 2 * (x * z + y * w)
    R[1, 0] = 2 * (x * y + z * w)
    R[1, 1] = 1 - 2 * (x * x + z * z)
    R[1, 2] = 2 * (y * z - x * w)
    R[2, 0] = 2 * (x * z - y * w)
    R[2, 1] = 2 * (y * z + x * w)
    R[2, 2] = 1 - 2 * (x * x + y * y)


@njit(cache=True)
def turn(q: Array, dx: float, dy: float, dz: float) -> None:
    """Turn the quaternion ``q`` in place by the small rotation vector (dx, dy, dz) in world axes."""
    angle2 = dx * dx + dy * dy + dz * dz
    # sin(a/2)/a and cos(a/2) to fourth order: turns within a tick are far below a radian
    s = 0.5 - angle2 / 48.0
    c = 1.0 - angle2 / 8.0
    ax, ay, az = s * dx, s * dy, s * dz
    x, y, z, w = q[0], q[1], q[2], q[3]
    q[0] = c * x + ax * w + ay * z - az * y
    q[1] = c * y + ay * w + az * x - ax * z
    q[2] = c * z + az * w + ax * y - ay * x
    q[3] = c * w - ax * x - ay * y - az * z
    n = 1.0 / (q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2) ** 0.5
    for i in range(4):
        q[i] *= n


@njit(cache=True)
def rotation_between(p: Array, q: Array, out: Array) -> None:
    """Write the rotation vector (3,), world axes, that turns the frame ``p`` to ``q``."""
    ax, ay, az, aw = -p[0], -p[1], -p[2], p[3]
    x, y, z, w = q[0], q[1], q[2], q[3]
    vx = w * ax + x * aw + y * az - z * ay
    vy = w * ay - x * az + y * aw + z * ax
    vz = w * az + x * ay - y * ax + z * aw
    vw = w * aw - x * ax - y * ay - z * az
    if vw < 0.0:
        vx, vy, vz, vw = -vx, -vy, -vz, -vw
    s = (vx * vx + vy * vy + vz * vz) ** 0.5
    k = 2.0 if s < 1e-12 else 2.0 * np.arctan2(s, vw) / s
    out[0], out[1], out[2] = k * vx, k * vy, k * vz


@njit(cache=True)
def world_inverse_inertia(q: Array, inverse: Array, out: Array, R: Array) -> None:
    """Write the inverse inertia (3, 3) in world axes of principal inverses (3,) into ``out``."""
    quaternion_to_matrix(q, R)
    for i in range(3):
        for j in range(3):
            out[i, j] = R[i, 0] * inverse[0] * R[j, 0] + R[i, 1] * inverse[1] * R[j, 1] + R[i, 2] * inverse[2] * R[j, 2]


@njit(cache=True)
def bend(qa: Array, qb: Array, rest_a: Array, rest_b: Array, frame: Array, out: Array) -> None:
    """Write the bending angles (3,) of a joint in its frame on element a; ``frame`` (3, 3) is filled.

    ``rest_a`` and ``rest_b`` (4,) are the joint's frames in the elements.
    """
    pa, pb, v = np.empty(4), np.empty(4), np.empty(3)
    multiply(qa, rest_a, pa)
    multiply(qb, rest_b, pb)
    rotation_between(pa, pb, v)
    quaternion_to_matrix(pa, frame)
    for i in range(3):
        out[i] = frame[0, i] * v[0] + frame[1, i] * v[1] + frame[2, i] * v[2]


@njit(cache=True)
def multiply(a: Array, b: Array, out: Array) -> None:
    """Write the quaternion product a b into ``out`` (4,)."""
    out[0] = a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1]
    out[1] = a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0]
    out[2] = a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3]
    out[3] = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]


@njit(cache=True)
def _rows(
    sign: float, r: Array, frame: Array, inverse_mass: float, inverse_inertia: Array, J: Array, WJ: Array
) -> None:
    """Jacobian ``J`` (6, 6) of a joint's rows for one element, and its product ``WJ`` with the inverse mass."""
    J[:] = 0.0
    for i in range(3):
        J[i, i] = sign
        for k in range(3):
            J[3 + i, 3 + k] = sign * frame[k, i]
    # d(x + r)/dθ = −[r]×
    J[0, 4], J[0, 5] = sign * r[2], -sign * r[1]
    J[1, 3], J[1, 5] = -sign * r[2], sign * r[0]
    J[2, 3], J[2, 4] = sign * r[1], -sign * r[0]
    for i in range(6):
        for k in range(3):
            WJ[i, k] = inverse_mass * J[i, k]
            WJ[i, 3 + k] = (
                J[i, 3] * inverse_inertia[0, k] + J[i, 4] * inverse_inertia[1, k] + J[i, 5] * inverse_inertia[2, k]
            )


@njit(cache=True)
def _factor(A: Array) -> None:
    """Cholesky factor of the symmetric positive definite ``A`` (6, 6), in place in its lower half."""
    for j in range(6):
        for k in range(j):
            A[j, j] -= A[j, k] * A[j, k]
        A[j, j] = A[j, j] ** 0.5
        for i in range(j + 1, 6):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            A[i, j] /= A[j, j]


@njit(cache=True)
def _solve(L: Array, b: Array) -> None:
    """Solve L Lᵀ x = b (6,) in place."""
    for i in range(6):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] /= L[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            b[i] -= L[k, i] * b[k]
        b[i] /= L[i, i]


@njit(cache=True)
def solve_joints(
    x: Array,
    q: Array,
    inverse_mass: Array,
    inverse_inertia: Array,
    pivot_a: Array,
    pivot_b: Array,
    rest_a: Array,
    rest_b: Array,
    stiffness: Array,
    carried: Array,
    multiplier: Array,
) -> None:
    """One exact sweep over all joints of a chain: positions ``x`` (n, 3) and quaternions ``q`` (n, 4) move.

    Joint j ties elements j and j+1 at ``pivot_a[j]``, ``pivot_b[j]`` (element frames).
    ``stiffness`` (n-1, 3) is k dt² + d dt, ``carried`` (n-1, 3) is d dt φ of the tick's start, in the
    joint frames. ``multiplier`` (n-1, 6) accumulates λ (N·s² along world axes, N·m·s² in joint frames).
    """
    n = x.shape[0] - 1
    D, U, rhs = np.zeros((n, 6, 6)), np.zeros((n, 6, 6)), np.zeros((n, 6))
    Ja, Jb, Wa, Wb = np.zeros((n, 6, 6)), np.zeros((n, 6, 6)), np.zeros((n, 6, 6)), np.zeros((n, 6, 6))
    ra, rb, angles, R = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    I_world = np.empty((n + 1, 3, 3))
    for i in range(n + 1):
        world_inverse_inertia(q[i], inverse_inertia[i], I_world[i], R)
    for j in range(n):
        rotate(q[j], pivot_a[j], ra)
        rotate(q[j + 1], pivot_b[j], rb)
        bend(q[j], q[j + 1], rest_a[j], rest_b[j], R, angles)
        _rows(-1.0, ra, R, inverse_mass[j], I_world[j], Ja[j], Wa[j])
        _rows(1.0, rb, R, inverse_mass[j + 1], I_world[j + 1], Jb[j], Wb[j])
        for i in range(3):
            rhs[j, i] = -(x[j + 1, i] + rb[i] - x[j, i] - ra[i])
            k = stiffness[j, i]
            compliance = 1.0 / k if k > 1.0 / FREE else FREE
            rest = carried[j, i] * compliance
            rhs[j, 3 + i] = -(angles[i] - rest) - compliance * multiplier[j, 3 + i]
            D[j, 3 + i, 3 + i] = compliance
        for a in range(6):
            for b in range(6):
                total = 0.0
                for k in range(6):
                    total += Wa[j, a, k] * Ja[j, b, k] + Wb[j, a, k] * Jb[j, b, k]
                D[j, a, b] += total
        for i in range(3):
            D[j, i, i] *= 1.0 + 1e-12
    for j in range(n - 1):
        for a in range(6):
            for b in range(6):
                total = 0.0
                for k in range(6):
                    total += Wb[j, a, k] * Ja[j + 1, b, k]
                U[j, a, b] = total
    _sweep(D, U, rhs)
    for j in range(n):
        for i in range(6):
            multiplier[j, i] += rhs[j, i]
    _move(x, q, rhs, Wa, Wb)


@njit(cache=True)
def _sweep(D: Array, U: Array, rhs: Array) -> None:
    """Solve the block-tridiagonal system with diagonal ``D`` and upper ``U`` blocks; result in ``rhs``."""
    n = D.shape[0]
    column = np.empty(6)
    _factor(D[0])
    for j in range(1, n):
        # X = D[j-1]^-1 U[j-1], kept in U; then eliminate it from block j
        upper = U[j - 1].copy()
        for b in range(6):
            for a in range(6):
                column[a] = upper[a, b]
            _solve(D[j - 1], column)
            for a in range(6):
                U[j - 1, a, b] = column[a]
        for a in range(6):
            for b in range(6):
                total = 0.0
                for k in range(6):
                    total += upper[k, a] * U[j - 1, k, b]
                D[j, a, b] -= total
        for a in range(6):
            total = 0.0
            for k in range(6):
                total += U[j - 1, k, a] * rhs[j - 1, k]
            rhs[j, a] -= total
        _factor(D[j])
    _solve(D[n - 1], rhs[n - 1])
    for j in range(n - 2, -1, -1):
        _solve(D[j], rhs[j])
        for a in range(6):
            for b in range(6):
                rhs[j, a] -= U[j, a, b] * rhs[j + 1, b]


@njit(cache=True)
def _move(x: Array, q: Array, rhs: Array, Wa: Array, Wb: Array) -> None:
    """Apply the corrections W Jᵀ λ to every element."""
    step = np.empty(6)
    n = rhs.shape[0]
    for i in range(n + 1):
        step[:] = 0.0
        for k in range(6):
            for a in range(6):
                if i < n:
                    step[k] += Wa[i, a, k] * rhs[i, a]
                if i > 0:
                    step[k] += Wb[i - 1, a, k] * rhs[i - 1, a]
        x[i, 0] += step[0]
        x[i, 1] += step[1]
        x[i, 2] += step[2]
        turn(q[i], step[3], step[4], step[5])
