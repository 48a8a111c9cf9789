"""Brings bodies and their convex parts to where they are at the start of a tick; world axes, SI units."""

from __future__ import annotations

import math

from ligature.suture.compiled import inlined, kernel
from ligature.suture.rotations import matrix_of, multiply, rotate


@inlined
def _compose(pose, local, out_p, out_q, R):
    matrix_of(pose[3], pose[4], pose[5], pose[6], R)
    x, y, z = rotate(R, local[0], local[1], local[2])
    out_p[0], out_p[1], out_p[2] = pose[0] + x, pose[1] + y, pose[2] + z
    out_q[0], out_q[1], out_q[2], out_q[3] = multiply(
        pose[3], pose[4], pose[5], pose[6], local[3], local[4], local[5], local[6]
    )


@kernel
def place_parts(begin, end, local, extent, pose, twist, dt, out_pose, out_box, out_sweep, R):
    """Pose, box and sweep of the parts ``begin`` … ``end`` of a body.

    ``pose`` is that of the body's inertial frame, ``local`` (S, 7) are those of the parts in it, and
    ``extent`` (S, 2, 3) their boxes in their own frames.
    """
    for c in range(begin, end):
        out = out_pose[c]
        _compose(pose, local[c], out[0:3], out[3:7], R)
        matrix_of(out[3], out[4], out[5], out[6], R)
        far = 0.0
        for a in range(3):
            low, high = out[a], out[a]
            for b in range(3):
                u, v = R[a, b] * extent[c, 0, b], R[a, b] * extent[c, 1, b]
                low += min(u, v)
                high += max(u, v)
            out_box[c, 0, a], out_box[c, 1, a] = low, high
            far += max(abs(low - pose[a]), abs(high - pose[a])) ** 2
        speed = math.sqrt(twist[0] ** 2 + twist[1] ** 2 + twist[2] ** 2)
        spin = math.sqrt(twist[3] ** 2 + twist[4] ** 2 + twist[5] ** 2)
        out_sweep[c] = dt * (speed + spin * math.sqrt(far))


@kernel
def near_bodies(ranges, box, low, high, margin, near):
    """Flag in ``near`` (b,) the bodies with a part whose box comes within ``margin`` of the box ``low`` … ``high``."""
    for b in range(ranges.shape[0]):
        near[b] = False
        for c in range(ranges[b, 0], ranges[b, 1]):
            apart = False
            for a in range(3):
                if box[c, 0, a] > high[a] + margin or box[c, 1, a] < low[a] - margin:
                    apart = True
            if not apart:
                near[b] = True
                break


@kernel
def bounds(points, out):
    """Corners ``out`` (2, 3) of the box around ``points`` (n, 3)."""
    for a in range(3):
        out[0, a], out[1, a] = points[0, a], points[0, a]
        for i in range(1, points.shape[0]):
            out[0, a] = min(out[0, a], points[i, a])
            out[1, a] = max(out[1, a], points[i, a])
