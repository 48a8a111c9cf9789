"""Finds the contact points of a rod at the start of a tick: capsules against convex parts, and against themselves.

The search finds a contact before its surfaces touch, while the largest motion of a tick still fits between them, with
the plane that the element must not cross: so nothing tunnels. Friction continues from the last tick's contact of the
same pair. World axes, SI units.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.mesh.distance import signed_distance
from ligature.rotations import cross, matrix_of, rotate, rotate_back
from ligature.suture.layout import FrictionMode, Nodes, Shapes, Touches, Work

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


SLACK = 0.5
"""Distance, in radii, at which a contact is found even at rest."""

MAX_TENSION_REACH = 4.0
"""Maximum distance, in radii, by which tension widens the search for contacts with bodies."""

RECOVERY = 0.1
"""Speed in m/s at which a rod that starts inside a body is pushed out."""

BLEND = 0.05
"""Difference in depth, in radii, within which both ends of an element count as touching alike."""

MAX_SINK = 0.25
"""Depth, as a share of the sum of the radii, from which two elements inside each other part at once."""

GROUP = 8
"""Elements that share a box in the search for self contact."""


@kernel
def detect(
    first: int, n: int, nodes: Nodes, shapes: Shapes, old: Touches, new: Touches, work: Work, tension: Array,
    counts: Integers, self_skip: int, dt: float,
) -> None:  # fmt: skip
    """Fill ``new`` with the contacts of elements ``first`` … ``first + n - 1``; ``old`` are the last tick's.

    ``tension`` (elements,) is that of the last tick. ``counts`` returns the contacts found, and those for
    which the table has no room. Point constraints and grasps at the head of ``new`` stay.
    """
    constraints = new.count[0]
    capacity = new.node.shape[0]
    _world_segments(first, n, nodes, work, tension, dt)
    missed = _touch_bodies(first, n, nodes, shapes, new, work, capacity, dt)
    settled = new.count[0]
    missed += _touch_self(first, n, nodes, shapes, new, work, capacity, self_skip)
    _sort(new, settled)
    _continue_friction(old, new, constraints)
    counts[0], counts[1] = new.count[0], missed


@inlined
def _world_segments(first: int, n: int, nodes: Nodes, work: Work, tension: Array, dt: float) -> None:
    """Segment, reach and box of every element, and of groups of them; a box covers what the tick may sweep."""
    for e in range(n):
        i = first + e
        R = work.R[i]
        matrix_of(nodes.q[i, 0], nodes.q[i, 1], nodes.q[i, 2], nodes.q[i, 3], R)
        p = work.segment[e]
        for s in range(2):
            ex, ey, ez = rotate(R, nodes.axis[i, s, 0], nodes.axis[i, s, 1], nodes.axis[i, s, 2])
            p[s, 0], p[s, 1], p[s, 2] = nodes.x[i, 0] + ex, nodes.x[i, 1] + ey, nodes.x[i, 2] + ez
        vx, vy, vz = nodes.v[i, 0], nodes.v[i, 1], nodes.v[i, 2]
        wx, wy, wz = nodes.w[i, 0], nodes.w[i, 1], nodes.w[i, 2]
        for s in range(2):
            rx, ry, rz = p[s, 0] - nodes.x[i, 0], p[s, 1] - nodes.x[i, 1], p[s, 2] - nodes.x[i, 2]
            ux, uy, uz = cross(wx, wy, wz, rx, ry, rz)
            work.ahead[e, s, 0] = p[s, 0] + dt * (vx + ux)
            work.ahead[e, s, 1] = p[s, 1] + dt * (vy + uy)
            work.ahead[e, s, 2] = p[s, 2] + dt * (vz + uz)
        arm = 0.5 * _distance(p[0], p[1])
        speed = math.sqrt(vx * vx + vy * vy + vz * vz) + arm * math.sqrt(wx * wx + wy * wy + wz * wz)
        reach = speed * dt + SLACK * nodes.radius[i]
        work.reach[e] = reach
        work.clear[e] = SLACK * nodes.radius[i]
        size = nodes.radius[i] + reach
        for a in range(3):
            work.box[e, 0, a] = min(p[0, a], p[1, a]) - size
            work.box[e, 1, a] = max(p[0, a], p[1, a]) + size
        # A light taut element is thrown farther in a tick than its motion shows.
        work.thrown[e] = min(abs(tension[e]) * dt * dt / nodes.mass[i], MAX_TENSION_REACH * nodes.radius[i])
    for g in range((n + GROUP - 1) // GROUP):
        box, work.group_thrown[g] = work.group_box[g], 0.0
        for a in range(3):
            box[0, a], box[1, a] = 1e300, -1e300
        for e in range(g * GROUP, min(n, (g + 1) * GROUP)):
            work.group_thrown[g] = max(work.group_thrown[g], work.thrown[e])
            for a in range(3):
                box[0, a] = min(box[0, a], work.box[e, 0, a])
                box[1, a] = max(box[1, a], work.box[e, 1, a])


@inlined
def _distance(a: Array, b: Array) -> float:
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@inlined
def _touch_bodies(
    first: int, n: int, nodes: Nodes, shapes: Shapes, new: Touches, work: Work, capacity: int, dt: float
) -> int:
    """Contacts of elements with parts of bodies, boxes of groups first."""
    missed = 0
    R, groups = work.R[nodes.x.shape[0]], (n + GROUP - 1) // GROUP
    for c in range(shapes.node.shape[0]):
        if shapes.node[c] < 0:
            continue
        pose, sweep, turned = shapes.pose[c], shapes.sweep[c], False
        for g in range(groups):
            if _outside(work.group_box[g], shapes.box[c], sweep + work.group_thrown[g]):
                continue
            if not turned:
                matrix_of(pose[3], pose[4], pose[5], pose[6], R)
                q = nodes.q[shapes.node[c]]
                matrix_of(q[0], q[1], q[2], q[3], work.R[shapes.node[c]])
                turned = True
            for e in range(g * GROUP, min(n, (g + 1) * GROUP)):
                if not (_outside(work.box[e], shapes.box[c], sweep + work.thrown[e]) or shapes.skip[c, e]):
                    missed += _touch_part(first, nodes, shapes, new, work, capacity, c, e, R, dt)
    return missed


@inlined
def _outside(box: Array, part: Array, margin: float) -> bool:
    """Whether a box (2, 3) lies farther than ``margin`` from another along one axis."""
    outside = False
    for a in range(3):
        if box[0, a] > part[1, a] + margin or box[1, a] < part[0, a] - margin:
            outside = True
    return outside


@inlined
def _touch_part(
    first: int, nodes: Nodes, shapes: Shapes, new: Touches, work: Work, capacity: int, c: int, e: int, R: Array,
    dt: float,
) -> int:  # fmt: skip
    """Record the contact of element ``e`` with part ``c``, turned by ``R`` (3, 3), if there is one; 1 without room."""
    p, normal, k = work.three[0], work.three[1], shapes.node[c]
    planes = shapes.planes[shapes.plane_range[c, 0] : shapes.plane_range[c, 1]]
    thrown, radius = work.thrown[e], nodes.radius[first + e]
    reach = radius + work.reach[e] + (shapes.sweep[c] + thrown)
    s, d = deepest(shapes.kind[c], shapes.size[c], planes, shapes.pose[c], R, work.segment[e], reach, radius, p,
                    normal)  # fmt: skip
    nx, ny, nz = rotate(R, normal[0], normal[1], normal[2])
    if d > reach or _recede(nodes, work, e, k, s, d - radius - thrown, nx, ny, nz, dt):
        return 0
    if new.count[0] == capacity:
        return 1
    _record(first, nodes, new, work, e, k, c, s, d, 0.0, nx, ny, nz, shapes.friction[c], dt)
    return 0


@inlined
def _recede(
    nodes: Nodes, work: Work, e: int, k: int, s: float, gap: float, nx: float, ny: float, nz: float, dt: float
) -> bool:
    """Whether element ``e`` at ``s`` stays clear of the plane that node ``k`` shows it, by their present motion."""
    begin, end = work.segment[e], work.ahead[e]
    px = begin[0, 0] + s * (begin[1, 0] - begin[0, 0])
    py = begin[0, 1] + s * (begin[1, 1] - begin[0, 1])
    pz = begin[0, 2] + s * (begin[1, 2] - begin[0, 2])
    ux, uy, uz = cross(
        nodes.w[k, 0], nodes.w[k, 1], nodes.w[k, 2], px - nodes.x[k, 0], py - nodes.x[k, 1], pz - nodes.x[k, 2]
    )
    mx = end[0, 0] + s * (end[1, 0] - end[0, 0]) - px - dt * (nodes.v[k, 0] + ux)
    my = end[0, 1] + s * (end[1, 1] - end[0, 1]) - py - dt * (nodes.v[k, 1] + uy)
    mz = end[0, 2] + s * (end[1, 2] - end[0, 2]) - pz - dt * (nodes.v[k, 2] + uz)
    return gap + min(nx * mx + ny * my + nz * mz, 0.0) > work.clear[e]


@inlined
def _depth_at(
    kind: int, size: Array, planes: Array, pose: Array, R: Array, segment: Array, s: float, p: Array, normal: Array
) -> float:
    dx = segment[0, 0] + s * (segment[1, 0] - segment[0, 0]) - pose[0]
    dy = segment[0, 1] + s * (segment[1, 1] - segment[0, 1]) - pose[1]
    dz = segment[0, 2] + s * (segment[1, 2] - segment[0, 2]) - pose[2]
    p[0], p[1], p[2] = rotate_back(R, dx, dy, dz)
    return signed_distance(kind, size, planes, p, normal)


@inlined
def deepest(
    kind: int, size: Array, planes: Array, pose: Array, R: Array, segment: Array, reach: float, radius: float,
    p: Array, normal: Array,
) -> tuple[float, float]:  # fmt: skip
    """Parameter (0..1) of the point of a segment nearest to a convex part, and the distance there.

    The distance is convex along the segment, so its slope brackets the lowest point. Where both ends
    lie over one face, the point moves from the middle to the lower end as the element tilts.
    """
    middle = _depth_at(kind, size, planes, pose, R, segment, 0.5, p, normal)
    if middle > reach + 0.5 * _distance(segment[0], segment[1]):
        return 0.5, middle
    tx, ty, tz = rotate_back(
        R,
        segment[1, 0] - segment[0, 0],
        segment[1, 1] - segment[0, 1],
        segment[1, 2] - segment[0, 2],
    )
    slope = normal[0] * tx + normal[1] * ty + normal[2] * tz
    low, high, s = 0.0, 1.0, 0.5
    near = 1.0 if slope < 0.0 else 0.0
    end = _depth_at(kind, size, planes, pose, R, segment, near, p, normal)
    end_slope = normal[0] * tx + normal[1] * ty + normal[2] * tz
    if slope * end_slope >= 0.0:
        # Downhill all the way: the lower end, or between it and the middle where the slope is slight.
        tilt = abs(end_slope)
        share = 1.0 if tilt <= BLEND * radius else BLEND * radius / tilt
        s = near + (0.5 - near) * share
        depth = _depth_at(kind, size, planes, pose, R, segment, s, p, normal)
        if depth <= end + BLEND * radius:
            return s, depth
        # Not over one face: the part curves away below, as a needle under a joint of the thread.
        return near, _depth_at(kind, size, planes, pose, R, segment, near, p, normal)
    if near == 1.0:
        low = 0.5
    else:
        high = 0.5
    depth = middle
    for _ in range(8):
        s = 0.5 * (low + high)
        depth = _depth_at(kind, size, planes, pose, R, segment, s, p, normal)
        slope = normal[0] * tx + normal[1] * ty + normal[2] * tz
        if slope < 0.0:
            low = s
        else:
            high = s
    return s, depth


@inlined
def _record(
    first: int, nodes: Nodes, new: Touches, work: Work, e: int, k: int, key: int, s: float, d: float, inside: float,
    nx: float, ny: float, nz: float, friction: float, dt: float,
) -> None:  # fmt: skip
    """Add the contact of element ``e`` at ``s`` with node ``k``, whose surface is at ``d`` along -normal.

    ``inside`` is the depth of the point that node ``k`` keeps, below its skin. Both nodes have their matrix ``work.R``.
    """
    c, i = new.count[0], first + e
    new.count[0] = c + 1
    new.node[c, 0], new.node[c, 1], new.key[c] = i, k, key
    radius = nodes.radius[i]
    segment, local, start = work.segment[e], new.local[c], new.start[c]
    new.normal[c, 0], new.normal[c, 1], new.normal[c, 2] = nx, ny, nz
    for a in range(3):
        along = segment[0, a] + s * (segment[1, a] - segment[0, a])
        start[0, a] = along
        start[1, a] = along - (d + inside) * new.normal[c, a]
    _to_local(nodes, work, i, start[0], local[0])
    _to_local(nodes, work, k, start[1], local[1])
    new.arm[c, 0], new.arm[c, 1] = -radius, inside
    gap = d - radius
    new.gap[c] = gap
    new.target[c] = min(0.0, gap + RECOVERY * dt)
    new.friction[c] = friction * nodes.friction[i]
    new.bilateral[c] = False
    new.press[c] = 0.0
    new.closed[c] = False
    new.mode[c], new.switches[c] = FrictionMode.SLIPS, 0
    for a in range(3):
        new.slip[c, a] = 0.0


@inlined
def _to_local(nodes: Nodes, work: Work, i: int, point: Array, out: Array) -> None:
    out[0], out[1], out[2] = rotate_back(
        work.R[i], point[0] - nodes.x[i, 0], point[1] - nodes.x[i, 1], point[2] - nodes.x[i, 2]
    )


@inlined
def _touch_self(
    first: int, n: int, nodes: Nodes, shapes: Shapes, new: Touches, work: Work, capacity: int, self_skip: int
) -> int:
    """Contacts between elements more than ``self_skip`` apart along the rod, boxes of groups first."""
    missed = 0
    groups = (n + GROUP - 1) // GROUP
    offset = shapes.node.shape[0]
    for g in range(groups):
        for h in range(g, groups):
            if not overlap(work.group_box[g], work.group_box[h]):
                continue
            for i in range(g * GROUP, min(n, (g + 1) * GROUP)):
                for j in range(max(i + 1 + self_skip, h * GROUP), min(n, (h + 1) * GROUP)):
                    if not overlap(work.box[i], work.box[j]):
                        continue
                    missed += _touch_pair(first, nodes, new, work, capacity, i, j, offset)
    return missed


@inlined
def overlap(a: Array, b: Array) -> bool:
    """Whether two boxes (2, 3) share a point."""
    return (
        a[0, 0] <= b[1, 0] and b[0, 0] <= a[1, 0]
        and a[0, 1] <= b[1, 1] and b[0, 1] <= a[1, 1]
        and a[0, 2] <= b[1, 2] and b[0, 2] <= a[1, 2]
    )  # fmt: skip


@inlined
def nearest(a: Array, b: Array) -> tuple[float, float]:
    """Parameters (0..1) of the nearest points of two segments, for crossing and parallel ones alike.

    Source: Ericson, Real-Time Collision Detection, §5.1.9; parallel segments meet in the middle of
    what they share.
    """
    ux, uy, uz = a[1, 0] - a[0, 0], a[1, 1] - a[0, 1], a[1, 2] - a[0, 2]
    vx, vy, vz = b[1, 0] - b[0, 0], b[1, 1] - b[0, 1], b[1, 2] - b[0, 2]
    wx, wy, wz = a[0, 0] - b[0, 0], a[0, 1] - b[0, 1], a[0, 2] - b[0, 2]
    uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
    uv = ux * vx + uy * vy + uz * vz
    uw, vw = ux * wx + uy * wy + uz * wz, vx * wx + vy * wy + vz * wz
    determinant = uu * vv - uv * uv
    if determinant > 1e-6 * uu * vv:
        s = min(max((uv * vw - vv * uw) / determinant, 0.0), 1.0)
    else:
        at, bt = -uw / uu, (uv - uw) / uu
        at, bt = min(max(at, 0.0), 1.0), min(max(bt, 0.0), 1.0)
        s = 0.5 * (at + bt)
    t = (uv * s + vw) / vv
    if t < 0.0:
        t = 0.0
        s = min(max(-uw / uu, 0.0), 1.0)
    elif t > 1.0:
        t = 1.0
        s = min(max((uv - uw) / uu, 0.0), 1.0)
    return s, t


@inlined
def _pass(a: Array, b: Array, dx: float, dy: float, dz: float, length: float, both: float) -> bool:
    """Whether strands that were (dx, dy, dz) apart end the tick apart, and on the same sides of each other."""
    s, t = nearest(a, b)
    ex = a[0, 0] + s * (a[1, 0] - a[0, 0]) - b[0, 0] - t * (b[1, 0] - b[0, 0])
    ey = a[0, 1] + s * (a[1, 1] - a[0, 1]) - b[0, 1] - t * (b[1, 1] - b[0, 1])
    ez = a[0, 2] + s * (a[1, 2] - a[0, 2]) - b[0, 2] - t * (b[1, 2] - b[0, 2])
    end = math.sqrt(ex * ex + ey * ey + ez * ez)
    return end > (1.0 + SLACK) * both and dx * ex + dy * ey + dz * ez > 0.5 * length * end


@inlined
def _touch_pair(first: int, nodes: Nodes, new: Touches, work: Work, capacity: int, i: int, j: int, offset: int) -> int:
    a, b = work.segment[i], work.segment[j]
    s, t = nearest(a, b)
    dx = a[0, 0] + s * (a[1, 0] - a[0, 0]) - b[0, 0] - t * (b[1, 0] - b[0, 0])
    dy = a[0, 1] + s * (a[1, 1] - a[0, 1]) - b[0, 1] - t * (b[1, 1] - b[0, 1])
    dz = a[0, 2] + s * (a[1, 2] - a[0, 2]) - b[0, 2] - t * (b[1, 2] - b[0, 2])
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    near = nodes.radius[first + j]
    d = length - near
    if length < 1e-12 or d > nodes.radius[first + i] + work.reach[i] + work.reach[j]:
        return 0
    both = near + nodes.radius[first + i]
    if length > both + 2.0 * SLACK * near and _pass(work.ahead[i], work.ahead[j], dx, dy, dz, length, both):
        return 0
    if new.count[0] == capacity:
        return 1
    per = 1.0 / length
    # Already inside each other: recover no faster than other contacts, but do not yield to a load either.
    c = new.count[0]
    _record(first, nodes, new, work, i, first + j, offset + j, s, d, near, dx * per, dy * per, dz * per,
            nodes.friction[first + j], 1e-3)  # fmt: skip
    new.target[c] = max(new.target[c], -MAX_SINK * both)
    return 0


@inlined
def _before(touches: Touches, a: int, b: int) -> bool:
    if touches.key[a] != touches.key[b]:
        return touches.key[a] < touches.key[b]
    return touches.node[a, 0] < touches.node[b, 0]


@inlined
def _swap(touches: Touches, a: int, b: int) -> None:
    for s in range(2):
        touches.node[a, s], touches.node[b, s] = touches.node[b, s], touches.node[a, s]
        for k in range(3):
            touches.local[a, s, k], touches.local[b, s, k] = touches.local[b, s, k], touches.local[a, s, k]
            touches.start[a, s, k], touches.start[b, s, k] = touches.start[b, s, k], touches.start[a, s, k]
    for k in range(3):
        touches.normal[a, k], touches.normal[b, k] = touches.normal[b, k], touches.normal[a, k]
    touches.key[a], touches.key[b] = touches.key[b], touches.key[a]
    touches.gap[a], touches.gap[b] = touches.gap[b], touches.gap[a]
    touches.target[a], touches.target[b] = touches.target[b], touches.target[a]
    touches.friction[a], touches.friction[b] = touches.friction[b], touches.friction[a]
    touches.arm[a, 1], touches.arm[b, 1] = touches.arm[b, 1], touches.arm[a, 1]
    touches.arm[a, 0], touches.arm[b, 0] = touches.arm[b, 0], touches.arm[a, 0]


@inlined
def _sort(touches: Touches, begin: int) -> None:
    """Sort new contacts from ``begin`` on by key and element (insertion sort)."""
    for c in range(begin + 1, touches.count[0]):
        k = c
        while k > begin and _before(touches, k, k - 1):
            _swap(touches, k, k - 1)
            k -= 1


@inlined
def _continue_friction(old: Touches, new: Touches, constraints: int) -> None:
    """Continue slip, normal force and mode of the last tick's contacts; both lists are sorted."""
    o = 0
    while o < old.count[0] and old.bilateral[o]:
        o += 1
    for c in range(constraints, new.count[0]):
        while o < old.count[0] and (
            old.key[o] < new.key[c] or (old.key[o] == new.key[c] and old.node[o, 0] < new.node[c, 0])
        ):
            o += 1
        if o == old.count[0] or old.key[o] != new.key[c] or old.node[o, 0] != new.node[c, 0]:
            continue
        n, slip = new.normal[c], old.slip[o]
        along = n[0] * slip[0] + n[1] * slip[1] + n[2] * slip[2]
        flat = slip[0] ** 2 + slip[1] ** 2 + slip[2] ** 2
        # A jittering normal must not shorten the slip: rotate it, keep its length.
        scale = math.sqrt(flat / (flat - along * along)) if flat > 2.0 * along * along else 1.0
        for a in range(3):
            new.slip[c, a] = scale * (slip[a] - along * n[a])
        new.press[c] = old.press[o]
        new.closed[c] = old.closed[o]
        new.mode[c] = old.mode[o]
