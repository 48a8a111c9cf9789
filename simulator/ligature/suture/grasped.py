"""What of a rod is between the pads of jaws, and what these do to it; world axes, SI units."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.rotations import matrix_of, rotate
from ligature.suture.point_constraints import FIRST_GRASP_KEY

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


@inlined
def _nearest_centre(x: Array, px: float, py: float, pz: float) -> int:
    """The element whose centre among ``x`` (n, 3) is nearest to a point, the first of several."""
    found, least = 0, math.inf
    for e in range(x.shape[0]):
        dx, dy, dz = x[e, 0] - px, x[e, 1] - py, x[e, 2] - pz
        square = dx * dx + dy * dy + dz * dz
        if square < least:
            found, least = e, square
    return found


@kernel
def nearest(x: Array, q: Array, ends: Array, starts: Array, point: Array, R: Array, out: Array) -> int:
    """The element nearest to ``point`` (3,) of a rod with elements at ``x`` (n, 3), ``q`` (n, 4).

    ``ends`` (n, 2, 3) are those of the elements' axes in their own frames, ``starts`` (n,) the arc lengths at which
    they begin. ``out`` (7,) gets the element's point nearest to the given one, its direction, and the arc length there;
    ``R`` (3, 3) is scratch.
    """
    e = _nearest_centre(x, point[0], point[1], point[2])
    matrix_of(q[e, 0], q[e, 1], q[e, 2], q[e, 3], R)
    a, b = ends[e, 0], ends[e, 1]
    ax, ay, az = rotate(R, a[0], a[1], a[2])
    bx, by, bz = rotate(R, b[0], b[1], b[2])
    ax, ay, az = ax + x[e, 0], ay + x[e, 1], az + x[e, 2]
    dx, dy, dz = bx + x[e, 0] - ax, by + x[e, 1] - ay, bz + x[e, 2] - az
    square = dx * dx + dy * dy + dz * dz
    along = (point[0] - ax) * dx + (point[1] - ay) * dy + (point[2] - az) * dz
    s, length = min(max(along / square, 0.0), 1.0), math.sqrt(square)
    out[0], out[1], out[2] = ax + s * dx, ay + s * dy, az + s * dz
    out[3], out[4], out[5] = dx / length, dy / length, dz / length
    out[6] = starts[e] + s * length
    return e


@kernel
def assign(nodes: Integers, points: Array, first: int, n: int, x: Array, q: Array, R: Array) -> None:
    """Assign to every grasp the element nearest to its point.

    Grasps are the rows of ``nodes`` (g, 3) and ``points`` (g, 3, 2, 3) whose kind is not 0, see
    `ligature.suture.point_constraints`; the rod's ``n`` elements are the nodes from ``first`` on.
    """
    for g in range(nodes.shape[0]):
        if nodes[g, 2] != 0:
            k, point = nodes[g, 1], points[g, 0, 1]
            matrix_of(q[k, 0], q[k, 1], q[k, 2], q[k, 3], R)
            px, py, pz = rotate(R, point[0], point[1], point[2])
            own = x[first : first + n]
            nodes[g, 0] = first + _nearest_centre(own, x[k, 0] + px, x[k, 1] + py, x[k, 2] + pz)


@kernel
def force_of(node: int, count: int, key: Integers, nodes: Integers, bilateral: Flags, force: Array, out: Array) -> int:
    """Force ``out`` (3,) of the pads of ``node`` on a rod in the last tick; returns the node that they hold, or -1."""
    held = -1
    out[0], out[1], out[2] = 0.0, 0.0, 0.0
    for row in range(count):
        if bilateral[row] and key[row] <= FIRST_GRASP_KEY and nodes[row, 1] == node:
            if held < 0:
                held = nodes[row, 0]
            for a in range(3):
                out[a] += force[row, a]
    return held
