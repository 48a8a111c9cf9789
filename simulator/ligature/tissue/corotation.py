"""Elastic forces of hexahedra that turn: linear elasticity in the frame that turns with each cell.

The frame is the rotation nearest to the mean deformation gradient of the cell, found from the one of the last step by
Müller's iteration (Müller, Bender, Chentanez, Macklin, A robust method to extract the rotational part of
deformations, MIG 2016). The force is f = -R K (Rᵀ x - X). Quaternions are x y z w.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

MOST_TURNS = 8
"""Iterations of a frame at most; from the last step's frame one to three suffice."""

SMALL_TURN = 1e-9
"""Angle in radians of an iteration after which the frame is found."""


@inlined
def set_rotation(q: Array, R: Array) -> None:
    """R (3, 3) of the quaternion ``q`` (4,)."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@inlined
def turn_towards(F: Array, q: Array, R: Array) -> None:
    """Turn ``q`` (4,) and ``R`` (3, 3) to the rotation nearest to ``F`` (3, 3), from where they are."""
    for _ in range(MOST_TURNS):
        set_rotation(q, R)
        tx, ty, tz, size = 0.0, 0.0, 0.0, 0.0
        for a in range(3):
            tx += R[1, a] * F[2, a] - R[2, a] * F[1, a]
            ty += R[2, a] * F[0, a] - R[0, a] * F[2, a]
            tz += R[0, a] * F[1, a] - R[1, a] * F[0, a]
            size += R[0, a] * F[0, a] + R[1, a] * F[1, a] + R[2, a] * F[2, a]
        scale = 1.0 / (abs(size) + 1e-9)
        tx, ty, tz = scale * tx, scale * ty, scale * tz
        angle = math.sqrt(tx * tx + ty * ty + tz * tz)
        if angle < SMALL_TURN:
            break
        s = math.sin(0.5 * angle) / angle
        ax, ay, az, aw = s * tx, s * ty, s * tz, math.cos(0.5 * angle)
        x, y, z, w = q[0], q[1], q[2], q[3]
        q[0] = aw * x + ax * w + ay * z - az * y
        q[1] = aw * y - ax * z + ay * w + az * x
        q[2] = aw * z + ax * y - ay * x + az * w
        q[3] = aw * w - ax * x - ay * y - az * z
        n = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        for a in range(4):
            q[a] *= n
    set_rotation(q, R)


@kernel
def add_elastic_forces(
    cells: Integers, kind: Integers, K: Array, size: Array, rest: Array, x: Array, q: Array, f: Array, R: Array,
    F: Array, y: Array, g: Array,
) -> float:  # fmt: skip
    """f -= the elastic forces on all nodes; returns the elastic energy in J.

    Parameters: nodes of the cells (m, 8), their kind (m,), stiffness (kinds, 24, 24) and edges (kinds, 3) of a
    kind, positions at rest and now (n, 3), frames (m, 4) which are updated, forces (n, 3), and scratch (3, 3),
    (3, 3), (24,), (24,).
    """
    energy = 0.0
    for c in range(cells.shape[0]):
        Ke, h = K[kind[c]], size[kind[c]]
        for a in range(3):
            for b in range(3):
                F[a, b] = 0.0
        for k in range(8):
            i = cells[c, k]
            sx = 0.25 / h[0] if k & 1 else -0.25 / h[0]
            sy = 0.25 / h[1] if k & 2 else -0.25 / h[1]
            sz = 0.25 / h[2] if k & 4 else -0.25 / h[2]
            for a in range(3):
                F[a, 0] += x[i, a] * sx
                F[a, 1] += x[i, a] * sy
                F[a, 2] += x[i, a] * sz
        turn_towards(F, q[c], R)
        # Relative to one corner, so that distance from the origin costs no digits.
        o = cells[c, 0]
        for k in range(8):
            i = cells[c, k]
            dx, dy, dz = x[i, 0] - x[o, 0], x[i, 1] - x[o, 1], x[i, 2] - x[o, 2]
            for a in range(3):
                y[3 * k + a] = R[0, a] * dx + R[1, a] * dy + R[2, a] * dz - (rest[i, a] - rest[o, a])
        for i in range(24):
            g[i] = 0.0
        for j in range(0, 24, 4):
            p, r, s, t = y[j], y[j + 1], y[j + 2], y[j + 3]
            for i in range(24):
                g[i] += p * Ke[j, i] + r * Ke[j + 1, i] + s * Ke[j + 2, i] + t * Ke[j + 3, i]
        for k in range(8):
            i = cells[c, k]
            gx, gy, gz = g[3 * k], g[3 * k + 1], g[3 * k + 2]
            energy += y[3 * k] * gx + y[3 * k + 1] * gy + y[3 * k + 2] * gz
            for a in range(3):
                f[i, a] -= R[a, 0] * gx + R[a, 1] * gy + R[a, 2] * gz
    return 0.5 * energy
