"""Finds material points: the cell around a position, and where a line crosses the surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import kernel

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

NEWTON = 12
"""Iterations for the place within a cell; three suffice in cells near their shape at rest."""


@kernel
def locate(x: Array, cells: Integers, p: Array, slack: float, weights: Array) -> int:
    """Cell that contains the position ``p`` (3,), or -1; fills its corners' ``weights`` (8,).

    ``slack`` is how far outside the unit cell still counts, in edges.
    """
    for c in range(cells.shape[0]):
        inside = True
        for a in range(3):
            low, high = x[cells[c, 0], a], x[cells[c, 0], a]
            for k in range(1, 8):
                value = x[cells[c, k], a]
                low, high = min(low, value), max(high, value)
            reach = slack * (high - low)
            if p[a] < low - reach or p[a] > high + reach:
                inside = False
                break
        if inside and _place(x, cells[c], p, slack, weights):
            return c
    return -1


@kernel
def _place(x: Array, cell: Integers, p: Array, slack: float, weights: Array) -> bool:
    """Newton's method for the place of ``p`` in a cell; True if it lies inside."""
    u, v, w = 0.5, 0.5, 0.5
    for _ in range(NEWTON):
        rx, ry, rz = -p[0], -p[1], -p[2]
        ax, ay, az, bx, by, bz, cx, cy, cz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(8):
            i = cell[k]
            fu = u if k & 1 else 1.0 - u
            fv = v if k & 2 else 1.0 - v
            fw = w if k & 4 else 1.0 - w
            su = 1.0 if k & 1 else -1.0
            sv = 1.0 if k & 2 else -1.0
            sw = 1.0 if k & 4 else -1.0
            n = fu * fv * fw
            du, dv, dw = su * fv * fw, fu * sv * fw, fu * fv * sw
            rx, ry, rz = rx + n * x[i, 0], ry + n * x[i, 1], rz + n * x[i, 2]
            ax, ay, az = ax + du * x[i, 0], ay + du * x[i, 1], az + du * x[i, 2]
            bx, by, bz = bx + dv * x[i, 0], by + dv * x[i, 1], bz + dv * x[i, 2]
            cx, cy, cz = cx + dw * x[i, 0], cy + dw * x[i, 1], cz + dw * x[i, 2]
            weights[k] = n
        nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        det = ax * nx + ay * ny + az * nz
        if abs(det) < 1e-30:
            return False
        du = -(rx * nx + ry * ny + rz * nz) / det
        dv = -(ax * (ry * cz - rz * cy) + ay * (rz * cx - rx * cz) + az * (rx * cy - ry * cx)) / det
        dw = -(ax * (by * rz - bz * ry) + ay * (bz * rx - bx * rz) + az * (bx * ry - by * rx)) / det
        if abs(du) + abs(dv) + abs(dw) < 1e-10:
            return -slack <= u <= 1.0 + slack and -slack <= v <= 1.0 + slack and -slack <= w <= 1.0 + slack
        u, v, w = u + du, v + dv, w + dw
        if not (abs(u) < 5.0 and abs(v) < 5.0 and abs(w) < 5.0):
            return False
    return False


@kernel
def cross_surface(
    x: Array, faces: Integers, p: Array, t: Array, reach: float, side: float, weights: Array, normal: Array
) -> tuple[int, float]:
    """First face that the line p + s t, 0 ≤ s ≤ reach, crosses: (face, s), or (-1, 0).

    ``side`` is 1 for leaving tissue and -1 for entering it. Fills the ``weights`` (4,) of the face's corners and its
    outward ``normal`` (3,). A face counts as two triangles.
    """
    found, nearest = -1, reach
    for q in range(faces.shape[0]):
        i = faces[q, 0]
        for half in range(2):
            j, k = faces[q, 1 + half], faces[q, 2 + half]
            ax, ay, az = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
            bx, by, bz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
            nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            slope = nx * t[0] + ny * t[1] + nz * t[2]
            if side * slope <= 0.0:
                continue
            ox, oy, oz = p[0] - x[i, 0], p[1] - x[i, 1], p[2] - x[i, 2]
            s = -(ox * nx + oy * ny + oz * nz) / slope
            if s < 0.0 or s > nearest:
                continue
            ox, oy, oz = ox + s * t[0], oy + s * t[1], oz + s * t[2]
            size = nx * nx + ny * ny + nz * nz
            u = ((oy * bz - oz * by) * nx + (oz * bx - ox * bz) * ny + (ox * by - oy * bx) * nz) / size
            v = ((ay * oz - az * oy) * nx + (az * ox - ax * oz) * ny + (ax * oy - ay * ox) * nz) / size
            if u < -1e-9 or v < -1e-9 or u + v > 1.0 + 1e-9:
                continue
            found, nearest = q, s
            for m in range(4):
                weights[m] = 0.0
            weights[0], weights[1 + half], weights[2 + half] = 1.0 - u - v, u, v
            scale = 1.0 / size**0.5
            normal[0], normal[1], normal[2] = scale * nx, scale * ny, scale * nz
    return found, nearest
