"""Places bodies and their convex parts at the start of a tick; world axes, SI units."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.suture.rotations import matrix_of, multiply, rotate

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


@inlined
def _compose(pose: Array, local: Array, out_p: Array, out_q: Array, R: Array) -> None:
    matrix_of(pose[3], pose[4], pose[5], pose[6], R)
    x, y, z = rotate(R, local[0], local[1], local[2])
    out_p[0], out_p[1], out_p[2] = pose[0] + x, pose[1] + y, pose[2] + z
    out_q[0], out_q[1], out_q[2], out_q[3] = multiply(
        pose[3], pose[4], pose[5], pose[6], local[3], local[4], local[5], local[6]
    )


@kernel
def survey(
    due: Flags, ranges: Integers, local: Array, extent: Array, motion: Array, dt: float, out_pose: Array,
    out_box: Array, out_sweep: Array, corners: Array, margin: float, near: Flags, R: Array,
) -> bool:  # fmt: skip
    """Place the parts of the bodies that are ``due`` (b,), and flag in ``near`` (b,) those within ``margin`` of a box.

    ``motion`` (b, 13) are pose and twist of the bodies' inertial frames, ``ranges`` (b, 2) their rows among
    the parts; ``local`` (S, 7) are the parts' poses in those frames and ``extent`` (S, 2, 3) their boxes in their own.
    ``corners`` (2, 3) is the box around all rods. Returns whether a flag changed; ``due`` is cleared.
    """
    changed = False
    for b in range(ranges.shape[0]):
        begin, end = ranges[b, 0], ranges[b, 1]
        if due[b]:
            due[b] = False
            _place_parts(begin, end, local, extent, motion[b], dt, out_pose, out_box, out_sweep, R)
        close = False
        for c in range(begin, end):
            apart = False
            for a in range(3):
                if out_box[c, 0, a] > corners[1, a] + margin or out_box[c, 1, a] < corners[0, a] - margin:
                    apart = True
            if not apart:
                close = True
                break
        changed = changed or close != near[b]
        near[b] = close
    return changed


@inlined
def _place_parts(
    begin: int, end: int, local: Array, extent: Array, motion: Array, dt: float, out_pose: Array, out_box: Array,
    out_sweep: Array, R: Array,
) -> None:  # fmt: skip
    """Pose, box and sweep of the parts ``begin`` … ``end`` of a body."""
    speed = math.sqrt(motion[7] ** 2 + motion[8] ** 2 + motion[9] ** 2)
    spin = math.sqrt(motion[10] ** 2 + motion[11] ** 2 + motion[12] ** 2)
    for c in range(begin, end):
        out = out_pose[c]
        _compose(motion, local[c], out[0:3], out[3:7], R)
        matrix_of(out[3], out[4], out[5], out[6], R)
        far = 0.0
        for a in range(3):
            low, high = out[a], out[a]
            for b in range(3):
                u, v = R[a, b] * extent[c, 0, b], R[a, b] * extent[c, 1, b]
                low += min(u, v)
                high += max(u, v)
            out_box[c, 0, a], out_box[c, 1, a] = low, high
            far += max(abs(low - motion[a]), abs(high - motion[a])) ** 2
        out_sweep[c] = dt * (speed + spin * math.sqrt(far))


@kernel
def bounds(points: Array, out: Array) -> None:
    """Corners ``out`` (2, 3) of the box around ``points`` (n, 3)."""
    for a in range(3):
        out[0, a], out[1, a] = points[0, a], points[0, a]
        for i in range(1, points.shape[0]):
            out[0, a] = min(out[0, a], points[i, a])
            out[1, a] = max(out[1, a], points[i, a])


@kernel
def write_elements(
    first: int, x: Array, q: Array, v: Array, w: Array, inertial_to_body: Array, tension: Array, bodies: Integers,
    poses: Array, twists: Array, tensions: Array, R: Array,
) -> None:  # fmt: skip
    """Poses of body frames, twists and tension of a rod's elements, to rows ``bodies`` (n,) of the last arrays.

    The elements are the nodes from ``first`` on; ``inertial_to_body`` (n, 7) are their body frames in I.
    """
    for e in range(bodies.shape[0]):
        i, b = first + e, bodies[e]
        local, out = inertial_to_body[e], poses[b]
        matrix_of(q[i, 0], q[i, 1], q[i, 2], q[i, 3], R)
        px, py, pz = rotate(R, local[0], local[1], local[2])
        out[0], out[1], out[2] = x[i, 0] + px, x[i, 1] + py, x[i, 2] + pz
        out[3], out[4], out[5], out[6] = multiply(
            q[i, 0], q[i, 1], q[i, 2], q[i, 3], local[3], local[4], local[5], local[6]
        )
        for a in range(3):
            twists[b, a], twists[b, 3 + a] = v[i, a], w[i, a]
        tensions[b] = tension[e]


@kernel
def sound(first: int, n: int, x: Array, q: Array, v: Array, w: Array, max_speed: float) -> bool:
    """Whether the ``n`` nodes from ``first`` on are finite and slower than ``max_speed``."""
    for i in range(first, first + n):
        total = q[i, 3]
        for a in range(3):
            if not abs(v[i, a]) < max_speed:
                return False
            total += x[i, a] + q[i, a] + w[i, a]
        if not math.isfinite(total):
            return False
    return True
