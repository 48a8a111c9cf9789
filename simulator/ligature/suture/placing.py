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


@kernel
def write_elements(first, x, q, v, w, inertial_to_body, tension, bodies, poses, twists, tensions, R):
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
def sound(first, n, x, q, v, w, fastest):
    """Whether the ``n`` nodes from ``first`` on are finite and slower than ``fastest``."""
    for i in range(first, first + n):
        total = q[i, 3]
        for a in range(3):
            if not abs(v[i, a]) < fastest:
                return False
            total += x[i, a] + q[i, a] + w[i, a]
        if not math.isfinite(total):
            return False
    return True
