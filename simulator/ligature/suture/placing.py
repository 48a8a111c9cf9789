"""Places bodies and their convex parts at the start of a tick; world axes, SI units."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.rotations import matrix_of, multiply, rotate
from ligature.tables import opener

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


class Watch(NamedTuple):
    """The bodies around rods and their convex parts: b bodies, S parts."""

    ranges: Integers  # (b, 2) rows of a body among the parts
    local: Array  # (S, 7) poses of the parts in their bodies' inertial frames
    extent: Array  # (S, 2, 3) their boxes in their own frames
    static: Flags  # (b,)
    turn: Integers  # (1,) the body that is read next although it is far; -1 reads all
    still: Flags  # (b,) whether it need not be read
    near: Flags  # (b,)
    due: Flags  # (b,) whether it was read but its parts are not placed yet
    placed: Flags  # (b,) whether it was ever read
    motion: Array  # (b, 13) pose and twist as they were last read
    pose: Array  # (S, 7)
    box: Array  # (S, 2, 3)
    sweep: Array  # (S,)
    seen: Array  # (b, 13) pose and twist now
    fresh: Flags  # (2, b) scratch: what is read in this tick, what is near
    R: Array  # (3, 3) scratch


def watch(bodies: int, parts: int) -> Watch:
    """Arrays for this many bodies and parts; nothing was read."""
    z, no = np.zeros, np.bool_
    return Watch(
        ranges=z((bodies, 2), np.int64), local=z((parts, 7)), extent=z((parts, 2, 3)), static=z(bodies, no),
        turn=np.full(1, -1), still=z(bodies, no), near=z(bodies, no), due=z(bodies, no), placed=z(bodies, no),
        motion=z((bodies, 13)), pose=z((parts, 7)), box=z((parts, 2, 3)), sweep=z(parts), seen=z((bodies, 13)),
        fresh=z((2, bodies), no), R=z((3, 3)),
    )  # fmt: skip


open_watch = opener(watch(1, 1))


@kernel
def look(table: Integers, corners: Array, dt: float, looks: int, margin: float) -> bool:
    """Read the bodies within ``margin`` of the box ``corners`` (2, 3) and ``looks`` others in turn, and place them.

    Returns whether other bodies are near now.
    """
    w = open_watch(table)
    bodies, turn = w.ranges.shape[0], w.turn[0]
    for k in range(bodies):
        w.fresh[0, k] = turn < 0 or (w.near[k] and not w.still[k])
        w.placed[k] = w.placed[k] and turn >= 0
    if turn >= 0:
        for i in range(min(looks, bodies)):
            w.fresh[0, (turn + i) % bodies] = True
    w.turn[0] = (turn + looks) % bodies if turn >= 0 else 0
    for k in range(bodies):
        if w.fresh[0, k]:
            _read(w, k)
    if not _survey(w, corners, dt, margin):
        return False
    late = False
    for k in range(bodies):
        w.fresh[1, k] = w.near[k]
        if w.near[k] and not w.fresh[0, k] and not w.still[k]:
            late = True
            _read(w, k)
    if late:
        _survey(w, corners, dt, margin)
        for k in range(bodies):
            w.near[k] = w.near[k] or w.fresh[1, k]
    return True


@inlined
def _read(w: Watch, k: int) -> None:
    """Take down where body ``k`` is. One without mass moves by commands alone; while it does, it is read every tick."""
    if w.static[k]:
        moved = False
        for a in range(7):
            moved = moved or w.motion[k, a] != w.seen[k, a]
        w.still[k] = not w.placed[k] or not moved
        if w.placed[k] and w.still[k]:
            return
    for a in range(13):
        w.motion[k, a] = w.seen[k, a]
    w.due[k] = w.placed[k] = True


@inlined
def _survey(w: Watch, corners: Array, dt: float, margin: float) -> bool:
    """Place the parts of the bodies that are due, and flag those near the box; whether a flag changed."""
    changed = False
    for b in range(w.ranges.shape[0]):
        begin, end = w.ranges[b, 0], w.ranges[b, 1]
        if w.due[b]:
            w.due[b] = False
            _place_parts(begin, end, w.local, w.extent, w.motion[b], dt, w.pose, w.box, w.sweep, w.R)
        close = False
        for c in range(begin, end):
            apart = False
            for a in range(3):
                if w.box[c, 0, a] > corners[1, a] + margin or w.box[c, 1, a] < corners[0, a] - margin:
                    apart = True
            if not apart:
                close = True
                break
        changed = changed or close != w.near[b]
        w.near[b] = close
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


class Elements(NamedTuple):
    """The elements of a rod, n of them, the nodes from ``first`` on, and what of the state record has them."""

    first: Integers  # (1,)
    x: Array  # (N, 3) of all nodes, as the next three
    q: Array  # (N, 4)
    v: Array  # (N, 3)
    w: Array  # (N, 3)
    inertial_to_body: Array  # (n, 7) body frames in I
    tension: Array  # (n,)
    bodies: Integers  # (n,) rows of the record
    poses: Array  # (b, 7)
    twists: Array  # (b, 6)
    tensions: Array  # (b,)
    R: Array  # (3, 3) scratch


_open_elements = opener(
    Elements(
        first=np.zeros(1, np.int64),
        x=np.zeros((1, 3)),
        q=np.zeros((1, 4)),
        v=np.zeros((1, 3)),
        w=np.zeros((1, 3)),
        inertial_to_body=np.zeros((1, 7)),
        tension=np.zeros(1),
        bodies=np.zeros(1, np.int64),
        poses=np.zeros((1, 7)),
        twists=np.zeros((1, 6)),
        tensions=np.zeros(1),
        R=np.zeros((3, 3)),
    )  # fmt: skip
)


@kernel
def write_elements(table: Integers) -> None:
    """Poses of body frames, twists and tension of a rod's elements, by a table of `Elements`."""
    e = _open_elements(table)
    for k in range(e.bodies.shape[0]):
        i, b = e.first[0] + k, e.bodies[k]
        q, local, out, twist = e.q[i], e.inertial_to_body[k], e.poses[b], e.twists[b]
        matrix_of(q[0], q[1], q[2], q[3], e.R)
        px, py, pz = rotate(e.R, local[0], local[1], local[2])
        out[0], out[1], out[2] = e.x[i, 0] + px, e.x[i, 1] + py, e.x[i, 2] + pz
        out[3], out[4], out[5], out[6] = multiply(q[0], q[1], q[2], q[3], local[3], local[4], local[5], local[6])
        for a in range(3):
            twist[a], twist[3 + a] = e.v[i, a], e.w[i, a]
        e.tensions[b] = e.tension[k]


@inlined
def find_pushed(first: int, elements: int, met: Flags, impulse: Array, out: Integers) -> int:
    """How many nodes outside a rod have an ``impulse`` (N, 6) and are ``met`` (N,); ``out`` (N,) lists them."""
    count = 0
    for i in range(met.shape[0]):
        if not met[i] or first <= i < first + elements:
            continue
        pushed = False
        for a in range(6):
            pushed = pushed or impulse[i, a] != 0.0
        if pushed:
            out[count] = i
            count += 1
    return count


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
