"""Tracks needles and rods through holes: finds new passages and follows the present ones.

World axes, SI units; arrays as in `ligature.suture.passages`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.rotations import cross, matrix_of, rotate, rotate_back
from ligature.suture import layout
from ligature.suture import passages as arrays
from ligature.suture.layout import FrictionMode
from ligature.tables import opener

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


open_nodes = opener(layout.nodes(1))
open_passages = opener(arrays.passages(1))
open_sites = opener(arrays.sites(1))
open_paths = opener(arrays.paths(1, 1))

LEAST_SLOPE = 0.3
"""Cosine between a path and the axis of a hole below which the path lies across the hole."""

APART = 0.002
"""Distance along a path, in metres, within which two crossings of one hole are the same passage."""

LOST = 0.003
"""Distance in metres from a path to its puncture at which the passage ends."""


@inlined
def _wrap(angle: float, middle: float) -> float:
    return middle + (angle - middle + math.pi) % (2.0 * math.pi) - math.pi


@inlined
def _body_rotation(pose: Array, R: Array) -> None:
    matrix_of(pose[3], pose[4], pose[5], pose[6], R)


@inlined
def _into_hole(sites: arrays.Sites, h: int, R: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A world point in the frame of hole ``h``, whose body has the rotation ``R``."""
    p, o, L = sites.pose[h], sites.origin[h], sites.R[h]
    bx, by, bz = rotate_back(R, x - p[0], y - p[1], z - p[2])
    return rotate_back(L, bx - o[0], by - o[1], bz - o[2])


@inlined
def _turn_into_hole(sites: arrays.Sites, h: int, R: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A world direction in the frame of hole ``h``."""
    bx, by, bz = rotate_back(R, x, y, z)
    return rotate_back(sites.R[h], bx, by, bz)


@inlined
def _known(p: arrays.Passages, path: int, hole: int, depth: float) -> bool:
    """Whether a crossing of ``hole`` at ``depth`` belongs to a present passage."""
    known = False
    for c in range(p.filled[0]):
        same = p.path[c] == path and p.hole[c] == hole
        known = known or (same and abs(p.depth[c] - depth) < APART)
    return known


@inlined
def _enter(
    p: arrays.Passages, sites: arrays.Sites, path: int, hole: int, owner: int, node: int, element: int,
    depth: float, x: float, y: float, z: float,
) -> int:  # fmt: skip
    """A new passage at the world point; returns its row, -1 when the table is full."""
    c = p.filled[0]
    if c == p.hole.shape[0]:
        return -1
    p.filled[0] = c + 1
    p.hole[c], p.path[c], p.owner[c], p.node[c], p.element[c] = hole, path, owner, node, element
    p.anchor[c], p.depth[c] = depth, depth
    pose = sites.pose[hole]
    _body_rotation(pose, p.B)
    px, py, pz = rotate_back(p.B, x - pose[0], y - pose[1], z - pose[2])
    p.point[c, 0], p.point[c, 1], p.point[c, 2] = px, py, pz
    for r in range(6):
        p.mode[c, r] = FrictionMode.STICKS
        p.force[c, r] = 0.0
    return c


@inlined
def _set_axes(p: arrays.Passages, c: int, tx: float, ty: float, tz: float, nx: float, ny: float, nz: float) -> None:
    """Axes of passage ``c``: tangent, normal, and outwards."""
    ox, oy, oz = cross(tx, ty, tz, nx, ny, nz)
    A = p.axes[c]
    A[0, 0], A[1, 0], A[2, 0] = tx, ty, tz
    A[0, 1], A[1, 1], A[2, 1] = nx, ny, nz
    A[0, 2], A[1, 2], A[2, 2] = ox, oy, oz


@inlined
def _mark_axes(p: arrays.Passages, c: int) -> None:
    """Fix the present axes of passage ``c`` in the hole's body, whose rotation is in ``p.B``."""
    for k in range(3):
        a, b, d = rotate_back(p.B, p.axes[c, 0, k], p.axes[c, 1, k], p.axes[c, 2, k])
        p.frame[c, 0, k], p.frame[c, 1, k], p.frame[c, 2, k] = a, b, d


@inlined
def _arc_axes(p: arrays.Passages, c: int, paths: arrays.Paths, path: int, angle: float) -> None:
    """Axes of passage ``c`` where the needle, whose rotation is in ``p.A``, has the given angle."""
    X, Y = paths.x[path], paths.y[path]
    ca, sa = math.cos(angle), math.sin(angle)
    tx, ty, tz = rotate(p.A, ca * Y[0] - sa * X[0], ca * Y[1] - sa * X[1], ca * Y[2] - sa * X[2])
    nx, ny, nz = cross(X[0], X[1], X[2], Y[0], Y[1], Y[2])
    nx, ny, nz = rotate(p.A, nx, ny, nz)
    _set_axes(p, c, tx, ty, tz, nx, ny, nz)


@inlined
def _arc_point(p: arrays.Passages, paths: arrays.Paths, path: int, angle: float) -> tuple[float, float, float]:
    """World point of a needle, whose rotation is in ``p.A``, at an angle of its arc."""
    X, Y, m, pose, r = paths.x[path], paths.y[path], paths.centre[path], paths.pose[path], paths.radius[path]
    ca, sa = r * math.cos(angle), r * math.sin(angle)
    x, y, z = rotate(p.A, m[0] + ca * X[0] + sa * Y[0], m[1] + ca * X[1] + sa * Y[1], m[2] + ca * X[2] + sa * Y[2])
    return pose[0] + x, pose[1] + y, pose[2] + z


@inlined
def _enter_needle(p: arrays.Passages, paths: arrays.Paths, sites: arrays.Sites, path: int, hole: int) -> None:
    """Find where the arc of a needle crosses the opening of a hole that it did not pass before."""
    _body_rotation(paths.pose[path], p.A)
    _body_rotation(sites.pose[hole], p.B)
    X, Y, m, pose, r = paths.x[path], paths.y[path], paths.centre[path], paths.pose[path], paths.radius[path]
    cx, cy, cz = rotate(p.A, m[0], m[1], m[2])
    cx, cy, cz = _into_hole(sites, hole, p.B, pose[0] + cx, pose[1] + cy, pose[2] + cz)
    ax, ay, az = rotate(p.A, X[0], X[1], X[2])
    ax, ay, az = _turn_into_hole(sites, hole, p.B, ax, ay, az)
    bx, by, bz = rotate(p.A, Y[0], Y[1], Y[2])
    bx, by, bz = _turn_into_hole(sites, hole, p.B, bx, by, bz)
    amplitude = r * math.sqrt(az * az + bz * bz)
    if amplitude <= abs(cz):
        return
    base, spread = math.atan2(bz, az), math.acos(-cz / amplitude)
    middle = 0.5 * (paths.begin[path] + paths.end[path])
    best, steepest = 0.0, LEAST_SLOPE
    for side in range(2):
        angle = _wrap(base + (spread if side == 0 else -spread), middle)
        if angle < paths.begin[path] or angle > paths.end[path]:
            continue
        ca, sa = math.cos(angle), math.sin(angle)
        slope = abs(ca * bz - sa * az)
        inside = abs(cx + r * (ca * ax + sa * bx)) <= sites.half[hole, 0]
        inside = inside and abs(cy + r * (ca * ay + sa * by)) <= sites.half[hole, 1]
        if inside and slope >= steepest:
            best, steepest = angle, slope
    depth = r * (paths.end[path] - best)
    if steepest == LEAST_SLOPE or _known(p, path, hole, depth):
        return
    x, y, z = _arc_point(p, paths, path, best)
    c = _enter(p, sites, path, hole, paths.owner[path], paths.node[path], 0, depth, x, y, z)
    if c >= 0:
        _arc_axes(p, c, paths, path, best)
        _mark_axes(p, c)


@kernel
def follow_needle(passage_table: Integers, path_table: Integers, site_table: Integers, c: int) -> bool:
    """Bring passage ``c`` of a needle up to date; False when the needle has left the hole."""
    p, paths, sites = open_passages(passage_table), open_paths(path_table), open_sites(site_table)
    path, pose = p.path[c], sites.pose[p.hole[c]]
    _body_rotation(paths.pose[path], p.A)
    _body_rotation(pose, p.B)
    hx, hy, hz = rotate(p.B, p.point[c, 0], p.point[c, 1], p.point[c, 2])
    hx, hy, hz = pose[0] + hx, pose[1] + hy, pose[2] + hz
    body, m, X, Y = paths.pose[path], paths.centre[path], paths.x[path], paths.y[path]
    ux, uy, uz = rotate_back(p.A, hx - body[0], hy - body[1], hz - body[2])
    ux, uy, uz = ux - m[0], uy - m[1], uz - m[2]
    around = math.atan2(ux * Y[0] + uy * Y[1] + uz * Y[2], ux * X[0] + uy * X[1] + uz * X[2])
    angle = _wrap(around, 0.5 * (paths.begin[path] + paths.end[path]))
    if not (paths.begin[path] <= angle <= paths.end[path]):
        return False
    p.depth[c] = paths.radius[path] * (paths.end[path] - angle)
    _arc_axes(p, c, paths, path, angle)
    x, y, z = _arc_point(p, paths, path, angle)
    p.owner[c], p.node[c] = paths.owner[path], paths.node[path]
    return _relate(p, paths, sites, c, x, y, z, hx, hy, hz, body[0], body[1], body[2], body[3:7],
                   1.0 / paths.radius[path])  # fmt: skip


@inlined
def _element_ends(p: arrays.Passages, nodes: layout.Nodes, i: int) -> tuple[float, float, float, float, float, float]:
    """World ends of the axis of rod node ``i``."""
    q, axis = nodes.q[i], nodes.axis[i]
    matrix_of(q[0], q[1], q[2], q[3], p.A)
    ax, ay, az = rotate(p.A, axis[0, 0], axis[0, 1], axis[0, 2])
    bx, by, bz = rotate(p.A, axis[1, 0], axis[1, 1], axis[1, 2])
    x, y, z = nodes.x[i, 0], nodes.x[i, 1], nodes.x[i, 2]
    return x + ax, y + ay, z + az, x + bx, y + by, z + bz


@inlined
def _rod_axes(p: arrays.Passages, c: int, tx: float, ty: float, tz: float) -> None:
    """Axes of passage ``c`` about a tangent, the second one near that of the puncture; ``p.B`` is the body's."""
    f = p.frame[c]
    nx, ny, nz = rotate(p.B, f[0, 1], f[1, 1], f[2, 1])
    along = nx * tx + ny * ty + nz * tz
    nx, ny, nz = nx - along * tx, ny - along * ty, nz - along * tz
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    if size < 1e-3:
        # The rod has turned a quarter since it was marked: any axis across it will do.
        ex, ey, ez = (1.0, 0.0, 0.0) if abs(tx) < 0.6 else (0.0, 1.0, 0.0)
        nx, ny, nz = cross(tx, ty, tz, ex, ey, ez)
        size = math.sqrt(nx * nx + ny * ny + nz * nz)
    _set_axes(p, c, tx, ty, tz, nx / size, ny / size, nz / size)


@inlined
def _enter_rod(
    p: arrays.Passages, sites: arrays.Sites, nodes: layout.Nodes, first: int, before: Array, path: int, owner: int,
    hole: int,
) -> None:  # fmt: skip
    """Find elements of a rod that cross the opening of a hole where it did not pass before."""
    _body_rotation(sites.pose[hole], p.B)
    n = before.shape[0] - 1
    for e in range(n):
        ax, ay, az, bx, by, bz = _element_ends(p, nodes, first + e)
        fx, fy, fz = _into_hole(sites, hole, p.B, ax, ay, az)
        gx, gy, gz = _into_hole(sites, hole, p.B, bx, by, bz)
        if fz * gz > 0.0 or fz == gz:
            continue
        s = fz / (fz - gz)
        length = before[e + 1] - before[e]
        px, py = fx + s * (gx - fx), fy + s * (gy - fy)
        if abs(px) > sites.half[hole, 0] or abs(py) > sites.half[hole, 1]:
            continue
        depth = before[n] - before[e] - s * length
        if abs(gz - fz) < LEAST_SLOPE * length or _known(p, path, hole, depth):
            continue
        x, y, z = ax + s * (bx - ax), ay + s * (by - ay), az + s * (bz - az)
        c = _enter(p, sites, path, hole, owner, first + e, e, depth, x, y, z)
        if c >= 0:
            # Any axes about the tangent will do for a round thread.
            per = 1.0 / math.sqrt((bx - ax) ** 2 + (by - ay) ** 2 + (bz - az) ** 2)
            for k in range(3):
                for m in range(3):
                    p.frame[c, k, m] = 0.0
            _rod_axes(p, c, per * (bx - ax), per * (by - ay), per * (bz - az))
            _mark_axes(p, c)


@kernel
def follow_rod(
    passage_table: Integers, path_table: Integers, site_table: Integers, node_table: Integers, first: int,
    before: Array, c: int,
) -> bool:  # fmt: skip
    """Bring passage ``c`` of a rod up to date; False when the rod has left the hole."""
    p, paths, sites = open_passages(passage_table), open_paths(path_table), open_sites(site_table)
    nodes = open_nodes(node_table)
    pose = sites.pose[p.hole[c]]
    _body_rotation(pose, p.B)
    hx, hy, hz = rotate(p.B, p.point[c, 0], p.point[c, 1], p.point[c, 2])
    hx, hy, hz = pose[0] + hx, pose[1] + hy, pose[2] + hz
    n = before.shape[0] - 1
    e, came = p.element[c], 0
    while True:
        ax, ay, az, bx, by, bz = _element_ends(p, nodes, first + e)
        ux, uy, uz = bx - ax, by - ay, bz - az
        square = ux * ux + uy * uy + uz * uz
        s = ((hx - ax) * ux + (hy - ay) * uy + (hz - az) * uz) / square
        step = 0
        if s < 0.0:
            step = -1
        elif s > 1.0:
            step = 1
        if step == 0 or step == -came:
            break
        if e + step < 0 or e + step >= n:
            return False
        e, came = e + step, step
    s = min(max(s, 0.0), 1.0)
    p.element[c], p.node[c] = e, first + e
    p.depth[c] = before[n] - before[e] - s * (before[e + 1] - before[e])
    per = 1.0 / math.sqrt(square)
    _rod_axes(p, c, per * ux, per * uy, per * uz)
    i = first + e
    return _relate(
        p, paths, sites, c, ax + s * ux, ay + s * uy, az + s * uz, hx, hy, hz,
        nodes.x[i, 0], nodes.x[i, 1], nodes.x[i, 2], nodes.q[i], 0.0,
    )  # fmt: skip


@inlined
def _relate(
    p: arrays.Passages, paths: arrays.Paths, sites: arrays.Sites, c: int, x: float, y: float, z: float, hx: float,
    hy: float, hz: float, nx: float, ny: float, nz: float, q: Array, bend: float,
) -> bool:  # fmt: skip
    """Stretch, levers and constants of passage ``c``, whose path is at x, y, z and whose puncture at h.

    A stretch beyond the tissue's strength moves the puncture. ``p.B`` holds the rotation of the hole's
    body; ``q`` (4,) is the node's; ``bend`` is the curvature, 0 for threads, which may turn. False when
    path and puncture have parted.
    """
    dx, dy, dz = x - hx, y - hy, z - hz
    if not (dx * dx + dy * dy + dz * dz < LOST * LOST):
        return False
    hole, path, A, E = p.hole[c], p.path[c], p.axes[c], p.stretch[c]
    ox, oy, _oz = _into_hole(sites, hole, p.B, hx, hy, hz)
    if abs(ox) > sites.half[hole, 0] + LOST or abs(oy) > sites.half[hole, 1] + LOST:
        return False
    p.x[c, 0], p.x[c, 1], p.x[c, 2] = nx, ny, nz
    p.lever[c, 0], p.lever[c, 1], p.lever[c, 2] = x - nx, y - ny, z - nz
    for k in range(4):
        p.q[c, k] = q[k]
    for r in range(6):
        p.stiffness[c, r] = paths.stiffness[path, hole, r]
        p.damping[c, r] = paths.damping[path, hole, r]
        p.limit[c, r] = paths.limit[path, hole, r]
        p.impulse[c, r] = 0.0
        E[r] = 0.0
    E[0] = p.depth[c] - p.anchor[c]
    E[1] = dx * A[0, 1] + dy * A[1, 1] + dz * A[2, 1]
    E[2] = dx * A[0, 2] + dy * A[1, 2] + dz * A[2, 2]
    p.bend[c] = bend
    if bend > 0.0:
        _turned(p, c)
    _tear(p, c)
    _recoil(p, sites, c, hole, x, y, z)
    return True


@inlined
def _turned(p: arrays.Passages, c: int) -> None:
    """Rotation of the axes against those of the puncture, in the former, to ``stretch[3:]``."""
    A, E, f = p.axes[c], p.stretch[c], p.frame[c]
    sx, sy, sz, trace = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        fx, fy, fz = rotate(p.B, f[0, k], f[1, k], f[2, k])
        vx, vy, vz = cross(fx, fy, fz, A[0, k], A[1, k], A[2, k])
        sx, sy, sz = sx + 0.5 * vx, sy + 0.5 * vy, sz + 0.5 * vz
        trace += fx * A[0, k] + fy * A[1, k] + fz * A[2, k]
    sine = math.sqrt(sx * sx + sy * sy + sz * sz)
    scale = 1.0 if sine < 1e-9 else math.atan2(sine, 0.5 * (trace - 1.0)) / sine
    for k in range(3):
        E[3 + k] = scale * (sx * A[0, k] + sy * A[1, k] + sz * A[2, k])


@inlined
def _tear(p: arrays.Passages, c: int) -> None:
    """Move the puncture where the stretch exceeds the tissue's strength."""
    A, E = p.axes[c], p.stretch[c]
    rx, ry, rz = 0.0, 0.0, 0.0
    for r in range(6):
        p.mode[c, r] = FrictionMode.STICKS
        k = p.stiffness[c, r]
        if k == 0.0 or abs(k * E[r]) <= p.limit[c, r]:
            continue
        p.mode[c, r] = FrictionMode.SLIPS
        kept = p.limit[c, r] / k if E[r] > 0.0 else -p.limit[c, r] / k
        over = E[r] - kept
        E[r] = kept
        if r == 0:
            p.anchor[c] = p.depth[c] - kept
        elif r < 3:
            a, b, d = rotate_back(p.B, A[0, r], A[1, r], A[2, r])
            p.point[c, 0] += over * a
            p.point[c, 1] += over * b
            p.point[c, 2] += over * d
        else:
            rx, ry, rz = rx + over * A[0, r - 3], ry + over * A[1, r - 3], rz + over * A[2, r - 3]
    if rx != 0.0 or ry != 0.0 or rz != 0.0:
        rx, ry, rz = rotate_back(p.B, rx, ry, rz)
        _turn_frame(p.frame[c], rx, ry, rz)


@inlined
def _turn_frame(f: Array, rx: float, ry: float, rz: float) -> None:
    """Turn the columns of ``f`` (3, 3) by a rotation vector (Rodrigues), and make them a triad again."""
    angle = math.sqrt(rx * rx + ry * ry + rz * rz)
    s, v = math.sin(angle) / angle, (1.0 - math.cos(angle)) / (angle * angle)
    for k in range(2):
        ax, ay, az = cross(rx, ry, rz, f[0, k], f[1, k], f[2, k])
        bx, by, bz = cross(rx, ry, rz, ax, ay, az)
        f[0, k] += s * ax + v * bx
        f[1, k] += s * ay + v * by
        f[2, k] += s * az + v * bz
    per = 1.0 / math.sqrt(f[0, 0] ** 2 + f[1, 0] ** 2 + f[2, 0] ** 2)
    along = 0.0
    for i in range(3):
        f[i, 0] *= per
        along += f[i, 0] * f[i, 1]
    for i in range(3):
        f[i, 1] -= along * f[i, 0]
    per = 1.0 / math.sqrt(f[0, 1] ** 2 + f[1, 1] ** 2 + f[2, 1] ** 2)
    for i in range(3):
        f[i, 1] *= per
    f[0, 2], f[1, 2], f[2, 2] = cross(f[0, 0], f[1, 0], f[2, 0], f[0, 1], f[1, 1], f[2, 1])


@inlined
def _recoil(p: arrays.Passages, sites: arrays.Sites, c: int, hole: int, x: float, y: float, z: float) -> None:
    """Mobility and velocity of the hole at passage ``c``, in its axes.

    Several paths in one hole share its mass: each sees a lighter hole, so that together they do not push
    it too far (mass splitting; Tonge et al. 2012).
    """
    A, pose, v = p.axes[c], sites.pose[hole], sites.twist[hole]
    lx, ly, lz = x - pose[0], y - pose[1], z - pose[2]
    wx, wy, wz = cross(v[3], v[4], v[5], lx, ly, lz)
    J = p.J
    for k in range(3):
        ax, ay, az = A[0, k], A[1, k], A[2, k]
        p.drift[c, k] = ax * (v[0] + wx) + ay * (v[1] + wy) + az * (v[2] + wz)
        p.drift[c, 3 + k] = ax * v[3] + ay * v[4] + az * v[5]
        mx, my, mz = cross(lx, ly, lz, ax, ay, az)
        J[k, 0], J[k, 1], J[k, 2], J[k, 3], J[k, 4], J[k, 5] = ax, ay, az, mx, my, mz
        J[3 + k, 0], J[3 + k, 1], J[3 + k, 2] = 0.0, 0.0, 0.0
        J[3 + k, 3], J[3 + k, 4], J[3 + k, 5] = ax, ay, az
    p.drift[c, 4] -= p.bend[c] * p.drift[c, 0]
    for k in range(6):
        J[4, k] -= p.bend[c] * J[0, k]
    share = float(max(sites.shared[hole], 1))
    for i in range(6):
        for j in range(6):
            s = 0.0
            for k in range(6):
                s += J[i, k] * sites.recoil[hole, k, j]
            p.T[i, j] = s
    for i in range(6):
        for j in range(6):
            s = 0.0
            for k in range(6):
                s += p.T[i, k] * J[j, k]
            p.recoil[c, i, j] = share * s


@inlined
def _hole_centre(p: arrays.Passages, sites: arrays.Sites, h: int) -> tuple[float, float, float, float]:
    """World centre of a hole, and its radius; the rotation of its body goes to ``p.B``."""
    pose, o, half = sites.pose[h], sites.origin[h], sites.half[h]
    _body_rotation(pose, p.B)
    x, y, z = rotate(p.B, o[0], o[1], o[2])
    return pose[0] + x, pose[1] + y, pose[2] + z, math.sqrt(half[0] ** 2 + half[1] ** 2)


@kernel
def look_for_needles(
    passage_table: Integers, path_table: Integers, site_table: Integers, count: int, motion: Array, near: Flags,
    gaps: Array,
) -> None:  # fmt: skip
    """Find the holes that the first ``count`` paths, needles, have entered.

    ``motion`` (count + H, 13) are pose and twist of needles, then of the bodies of the holes, of which only those that
    are ``near`` (H,) are taken; ``gaps`` (L, H) receives lower bounds of distances.
    """
    p, paths, sites = open_passages(passage_table), open_paths(path_table), open_sites(site_table)
    for path in range(count):
        for a in range(7):
            paths.pose[path, a] = motion[path, a]
    for h in range(near.shape[0]):
        if near[h]:
            for a in range(7):
                sites.pose[h, a] = motion[count + h, a]
            for a in range(6):
                sites.twist[h, a] = motion[count + h, 7 + a]
    for path in range(count):
        _look_for_needle(p, paths, sites, path, gaps[path])


@inlined
def _look_for_needle(p: arrays.Passages, paths: arrays.Paths, sites: arrays.Sites, path: int, gaps: Array) -> None:
    """Find the holes that a needle has entered; ``gaps`` (H,) receives lower bounds of its distances to all."""
    pose, m = paths.pose[path], paths.centre[path]
    _body_rotation(pose, p.A)
    cx, cy, cz = rotate(p.A, m[0], m[1], m[2])
    cx, cy, cz = pose[0] + cx, pose[1] + cy, pose[2] + cz
    for h in range(gaps.shape[0]):
        x, y, z, reach = _hole_centre(p, sites, h)
        away = math.sqrt((x - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2)
        gaps[h] = abs(away - paths.radius[path]) - reach
        if gaps[h] <= 0.0:
            _enter_needle(p, paths, sites, path, h)


@kernel
def look_for_rod(
    passage_table: Integers, site_table: Integers, node_table: Integers, first: int, before: Array, path: int,
    owner: int, gaps: Array,
) -> None:  # fmt: skip
    """Find the holes that a rod has entered; ``gaps`` (H,) receives lower bounds of its distances to all.

    ``before`` (n + 1,) is the length of the rod up to each element, the first of which is node ``first``.
    """
    p, sites, nodes = open_passages(passage_table), open_sites(site_table), open_nodes(node_table)
    for h in range(gaps.shape[0]):
        x, y, z, reach = _hole_centre(p, sites, h)
        nearest = 1e30
        for e in range(before.shape[0] - 1):
            at = nodes.x[first + e]
            away = math.sqrt((at[0] - x) ** 2 + (at[1] - y) ** 2 + (at[2] - z) ** 2)
            nearest = min(nearest, away - 0.5 * (before[e + 1] - before[e]))
        gaps[h] = nearest - reach
        if gaps[h] <= 0.0:
            _enter_rod(p, sites, nodes, first, before, path, owner, h)


@kernel
def next_search(gaps: Array, near: Flags, margin: float, step: float, most: int) -> int:
    """Ticks in which no path that comes nearer by ``step`` a tick enters a hole, at most ``most``.

    ``gaps`` (L, H) are lower bounds of distances; ``near`` (H,) receives the holes that a path is within ``margin`` of.
    """
    nearest = np.inf
    for h in range(near.shape[0]):
        gap = np.inf
        for path in range(gaps.shape[0]):
            gap = min(gap, gaps[path, h])
        near[h] = gap < margin
        nearest = min(nearest, gap)
    return int(min(max(nearest, 0.0) / step, float(most)))
