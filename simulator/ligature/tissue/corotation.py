"""Elastic forces of hexahedra that turn: linear elasticity in the frame that turns with each cell.

The force is f = -R K (Rᵀ x - X) with the rotation R nearest to the mean deformation gradient F of the cell. It is where
tr(Rᵀ F) is greatest, found from the one of the last step by Newton's method: with M = F Rᵀ, S its symmetric part
and t the axial vector of twice the other one, turn R by ω, (tr(S) 1 - S) ω = t.

The places of a box's corners are taken as eight patterns, the products of ±1 along its axes (Walsh, Amer. J. Math. 45,
1923, 5). Patterns along one axis are the edges of F. A box of isotropic material is its own image in three mirrors,
which change the sign of a pattern at most, so stiffness couples not 24 unknowns but three at a time: component a of
pattern p xor 2ᵃ, for each p (`ligature.tissue.elements.blocks`).

Cells of one kind are worked on together, value by value in rows of `LANES`, so that the loops are vectors.
Quaternions are x y z w.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

LANES = 32
"""Cells that are worked on together: what they need stays in the first level of a cache."""

LEAST = 0.05
"""Least determinant of Newton's matrix, over that at rest; below, Müller's step (MIG 2016) turns the frame."""


@inlined
def _gather(cells: Integers, x: Array, first: int, lanes: int, c: Array) -> None:
    """Places of the corners, relative to one of them so that distance from the origin costs no digits."""
    for lane in range(lanes):
        o = cells[first + lane, 0]
        for k in range(8):
            i = cells[first + lane, k]
            for a in range(3):
                c[(3 * k + a) * LANES + lane] = x[i, a] - x[o, a]


@inlined
def _to_patterns(c: Array, lanes: int) -> None:
    """Replace values at corners by their sums with the signs of each pattern: 1 where a corner has the bit, else -1."""
    for a in range(3):
        for lane in range(lanes):
            at = a * LANES + lane
            p, q, r, s = c[at], c[at + 3 * LANES], c[at + 6 * LANES], c[at + 9 * LANES]
            t, u, v, w = c[at + 12 * LANES], c[at + 15 * LANES], c[at + 18 * LANES], c[at + 21 * LANES]
            p, q, r, s, t, u, v, w = q + p, q - p, s + r, s - r, u + t, u - t, w + v, w - v
            p, q, r, s, t, u, v, w = r + p, s + q, r - p, s - q, v + t, w + u, v - t, w - u
            c[at], c[at + 3 * LANES], c[at + 6 * LANES], c[at + 9 * LANES] = t + p, u + q, v + r, w + s
            c[at + 12 * LANES], c[at + 15 * LANES] = t - p, u - q
            c[at + 18 * LANES], c[at + 21 * LANES] = v - r, w - s


@inlined
def _to_corners(c: Array, lanes: int) -> None:
    """Replace forces on patterns by those on corners: the transpose of `_to_patterns`."""
    for a in range(3):
        for lane in range(lanes):
            at = a * LANES + lane
            p, q, r, s = c[at], c[at + 3 * LANES], c[at + 6 * LANES], c[at + 9 * LANES]
            t, u, v, w = c[at + 12 * LANES], c[at + 15 * LANES], c[at + 18 * LANES], c[at + 21 * LANES]
            p, q, r, s, t, u, v, w = p - q, p + q, r - s, r + s, t - u, t + u, v - w, v + w
            p, q, r, s, t, u, v, w = p - r, q - s, p + r, q + s, t - v, u - w, t + v, u + w
            c[at], c[at + 3 * LANES], c[at + 6 * LANES], c[at + 9 * LANES] = p - t, q - u, r - v, s - w
            c[at + 12 * LANES], c[at + 15 * LANES] = p + t, q + u
            c[at + 18 * LANES], c[at + 21 * LANES] = r + v, s + w


@inlined
def _matrix(x: float, y: float, z: float, w: float) -> tuple[float, float, float, float, float, float, float, float,
                                                             float]:  # fmt: skip
    """Rotation of a quaternion, row by row."""
    return (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip


@inlined
def _turn(
    x: float, y: float, z: float, w: float, f: float, g: float, h: float, i: float, j: float, k: float, m: float,
    n: float, o: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """A step from the quaternion x y z w towards the rotation nearest to F = [[f, g, h], [i, j, k], [m, n, o]]."""
    r, s, t, u, v, a, b, c, d = _matrix(x, y, z, w)
    xx, xy, xz = f * r + g * s + h * t, f * u + g * v + h * a, f * b + g * c + h * d
    yx, yy, yz = i * r + j * s + k * t, i * u + j * v + k * a, i * b + j * c + k * d
    zx, zy, zz = m * r + n * s + o * t, m * u + n * v + o * a, m * b + n * c + o * d
    tx, ty, tz = zy - yz, xz - zx, yx - xy
    # Newton's matrix [[a, d, e], [d, b, g], [e, g, c]] and its cofactors.
    a, b, c = yy + zz, xx + zz, xx + yy
    d, e, g = -0.5 * (xy + yx), -0.5 * (xz + zx), -0.5 * (yz + zy)
    aa, bb, cc = b * c - g * g, a * c - e * e, a * b - d * d
    dd, ee, gg = e * g - d * c, d * g - b * e, d * e - a * g
    det = a * aa + d * dd + e * ee
    sound = a > 0.0 and cc > 0.0 and det > 8.0 * LEAST
    scale = 0.5 / (det if sound else 1.0)
    coarse = 0.5 / (abs(xx + yy + zz) + 1e-9)
    px = scale * (aa * tx + dd * ty + ee * tz) if sound else coarse * tx
    py = scale * (dd * tx + bb * ty + gg * tz) if sound else coarse * ty
    pz = scale * (ee * tx + gg * ty + cc * tz) if sound else coarse * tz
    # Tangents of half the angles: the quaternion p 1, times the one before.
    qx, qy, qz = px * w + x + py * z - pz * y, py * w + y + pz * x - px * z, pz * w + z + px * y - py * x
    qw = w - px * x - py * y - pz * z
    scale = 1.0 / math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    return scale * qx, scale * qy, scale * qz, scale * qw


@inlined
def _find_frames(c: Array, size: Array, q: Array, lanes: int, R: Array) -> None:
    """Turn the quaternions q (4, L) to the patterns ``c`` of cells with edges ``size`` (3,), and fill R (9, L)."""
    sx, sy, sz = 0.25 / size[0], 0.25 / size[1], 0.25 / size[2]
    for lane in range(lanes):
        f, g, h = sx * c[3 * LANES + lane], sy * c[6 * LANES + lane], sz * c[12 * LANES + lane]
        i, j, k = sx * c[4 * LANES + lane], sy * c[7 * LANES + lane], sz * c[13 * LANES + lane]
        m, n, o = sx * c[5 * LANES + lane], sy * c[8 * LANES + lane], sz * c[14 * LANES + lane]
        x, y, z, w = q[lane], q[LANES + lane], q[2 * LANES + lane], q[3 * LANES + lane]
        # Twice: the error after one step is about the cube of the turn. A loop here would keep the outer one scalar.
        x, y, z, w = _turn(x, y, z, w, f, g, h, i, j, k, m, n, o)
        x, y, z, w = _turn(x, y, z, w, f, g, h, i, j, k, m, n, o)
        q[lane], q[LANES + lane], q[2 * LANES + lane], q[3 * LANES + lane] = x, y, z, w
        r, s, t, u, v, a, b, d, e = _matrix(x, y, z, w)
        R[lane], R[LANES + lane], R[2 * LANES + lane] = r, s, t
        R[3 * LANES + lane], R[4 * LANES + lane], R[5 * LANES + lane] = u, v, a
        R[6 * LANES + lane], R[7 * LANES + lane], R[8 * LANES + lane] = b, d, e


@inlined
def _rotate(R: Array, v: Array, out: Array, lanes: int) -> None:
    """``out`` = R v for three rows."""
    for lane in range(lanes):
        x, y, z = v[lane], v[LANES + lane], v[2 * LANES + lane]
        out[lane] = R[lane] * x + R[LANES + lane] * y + R[2 * LANES + lane] * z
        out[LANES + lane] = R[3 * LANES + lane] * x + R[4 * LANES + lane] * y + R[5 * LANES + lane] * z
        out[2 * LANES + lane] = R[6 * LANES + lane] * x + R[7 * LANES + lane] * y + R[8 * LANES + lane] * z


@inlined
def _rotate_back(R: Array, v: Array, out: Array, lanes: int) -> None:
    """``out`` = Rᵀ v for three rows."""
    for lane in range(lanes):
        x, y, z = v[lane], v[LANES + lane], v[2 * LANES + lane]
        out[lane] = R[lane] * x + R[3 * LANES + lane] * y + R[6 * LANES + lane] * z
        out[LANES + lane] = R[LANES + lane] * x + R[4 * LANES + lane] * y + R[7 * LANES + lane] * z
        out[2 * LANES + lane] = R[2 * LANES + lane] * x + R[5 * LANES + lane] * y + R[8 * LANES + lane] * z


@inlined
def _resist(K: Array, y: Array, lanes: int, g: Array) -> None:
    """g = K y, block by block (8, 3, 3); the patterns' means, three rows, have no stiffness."""
    for a in range(3):
        for pattern in range(1, 8):
            p = pattern ^ (1 << a)
            # Rows as slices: indices into them that cannot be negative leave the loop a vector.
            i, j, k = 3 * (p ^ 1) * LANES, (3 * (p ^ 2) + 1) * LANES, (3 * (p ^ 4) + 2) * LANES
            m = (3 * pattern + a) * LANES
            r, s, t, out = y[i : i + LANES], y[j : j + LANES], y[k : k + LANES], g[m : m + LANES]
            u, v, w = K[p, a, 0], K[p, a, 1], K[p, a, 2]
            for lane in range(lanes):
                out[lane] = u * r[lane] + v * s[lane] + w * t[lane]
        for lane in range(lanes):
            g[a * LANES + lane] = 0.0


@kernel
def add_elastic_forces(
    cells: Integers, batches: Integers, K: Array, size: Array, edges: Array, x: Array, q: Array, f: Array, R: Array,
    c: Array, y: Array,
) -> None:  # fmt: skip
    """f -= the elastic forces on all nodes.

    Parameters: nodes of the cells (m, 8), kind by kind; batches of cells of one kind: first, count ≤ `LANES`, kind
    (b, 3); stiffness (kinds, 8, 3, 3) and edges (kinds, 3) of a kind; exact edges of the cells (m, 3); positions
    (n, 3); frames (b, 4 `LANES`), which are updated; forces (n, 3); and scratch for 9, 24 and 24 rows.
    """
    for batch in range(batches.shape[0]):
        first, lanes, kind = batches[batch, 0], batches[batch, 1], batches[batch, 2]
        _gather(cells, x, first, lanes, c)
        _to_patterns(c, lanes)
        _find_frames(c, size[kind], q[batch], lanes, R)
        for pattern in range(1, 8):
            at, end = 3 * pattern * LANES, 3 * (pattern + 1) * LANES
            _rotate_back(R, c[at:end], y[at:end], lanes)
        for lane in range(lanes):
            # At rest exactly nothing is left.
            y[3 * LANES + lane] -= 4.0 * edges[first + lane, 0]
            y[7 * LANES + lane] -= 4.0 * edges[first + lane, 1]
            y[14 * LANES + lane] -= 4.0 * edges[first + lane, 2]
            for a in range(3):
                y[a * LANES + lane] = 0.0
        _resist(K[kind], y, lanes, c)
        for pattern in range(8):
            at, end = 3 * pattern * LANES, 3 * (pattern + 1) * LANES
            _rotate(R, c[at:end], y[at:end], lanes)
        _to_corners(y, lanes)
        for lane in range(lanes):
            for k in range(8):
                i = cells[first + lane, k]
                for a in range(3):
                    f[i, a] -= y[(3 * k + a) * LANES + lane]
