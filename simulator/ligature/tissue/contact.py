"""Rigid bodies on the surface of tissue: where they touch it, and normal and friction forces; metres, newtons.

A body's convex parts are compared with the faces of the surface. Each part has at most one point of contact with each
face, the deepest: the best of a few, from which a search with ever smaller steps goes on. All points of a block are
solved at once by projected Gauss–Seidel on ::

    u_i = w_i + Σ D_ij f_j,   D_ij = C_ij + h² (recoil of the body + recoil of the block's own rigid body)
    f_n ≥ 0, u_n + c f_n ≥ 0, one of them zero; ‖f_t‖ ≤ μ f_n, u_t + c f_t = 0 unless it slips

with u the gap along the normal and the stretch across it at the end of the tick (Coulomb friction by bristles of
compliance c).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.mesh.distance import signed_distance

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

CAPACITY = 64
"""Most points of contact of a block with bodies."""

FACING = -0.2
"""Cosine between the surface's outward normal and a contact's above which a body is not before that face."""

COARSE = 3
"""Points along an edge of a face from the best of which the search for the deepest begins."""

LEVEL = 1e-7
"""Depth in metres by which a further place must be deeper: flat contacts keep theirs."""

SOFT = 1e-5
"""Compliance of a bristle, m/N."""


class Touching(NamedTuple):
    """K points of contact of a block; axes of the block."""

    used: Integers  # (K,)
    part: Integers  # (K,)
    face: Integers  # (K,)
    point: Integers  # (K,) of the interface
    body: Integers  # (K,) row of `Partners`
    normal: Array  # (K, 3) from the body into the tissue
    distance: Array  # (K,) between point and part when the tick begins
    anchor: Array  # (K, 3) of friction, in the inertial frame of the body
    force: Array  # (K, 3) on the tissue
    friction: Array  # (K,) Coulomb coefficient


class Solve(NamedTuple):
    """Scratch of a tick."""

    rows: Integers  # (K,)
    w: Array  # (K, 3)
    u: Array  # (K, 3)
    lever: Array  # (K, 3) from the body's centre of mass
    own: Array  # (K, 3) from the centre of mass of the block's own body
    D: Array  # (K, K, 3, 3)
    own_point: NDArray[np.bool_]  # (N,) points of the interface that are these


class Partners(NamedTuple):
    """B bodies, in the axes of the block; row 0 is the block's own rigid body."""

    pose: Array  # (B, 7) of the inertial frame
    twist: Array  # (B, 6) relative to the block, linear part at the centre of mass
    light: Array  # (B,) 1 / kg; 0 for what no force moves
    spin: Array  # (B, 3, 3) inverse of the inertia


class Parts(NamedTuple):
    """P convex parts of bodies."""

    body: Integers  # (P,) row of `Partners`
    local: Array  # (P, 4, 4) in the inertial frame of the body
    kind: Integers  # (P,) as in `ligature.mesh.distance`
    size: Array  # (P, 3)
    planes: Array  # (Q, 4)
    plane_range: Integers  # (P, 2)
    corners: Array  # (P, 2, 3) box in its own frame
    live: NDArray[np.bool_]  # (P,) looked at in this tick


def touching(capacity: int = CAPACITY) -> Touching:
    """Room for ``capacity`` points of contact, none yet."""
    K, z = capacity, np.zeros
    i = lambda: np.zeros(K, np.int64)  # noqa: E731
    return Touching(i(), i(), i(), i(), i(), z((K, 3)), z(K), z((K, 3)), z((K, 3)), z(K))


def scratch(points: int, capacity: int = CAPACITY) -> Solve:
    """Scratch for ``capacity`` points of contact among ``points`` of the interface."""
    K, z = capacity, np.zeros
    return Solve(
        np.zeros(K, np.int64), z((K, 3)), z((K, 3)), z((K, 3)), z((K, 3)), z((K, K, 3, 3)), np.zeros(points, np.bool_)
    )


def face_weights(u: float, v: float) -> Array:
    """Weights (4,) of a face's corners at a place of it, both 0 … 1."""
    return np.array([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])


@inlined
def _turn(q, v, out):
    """out = rotation of the quaternion ``q`` (4,) times v (3,)."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    tx = 2.0 * (y * v[2] - z * v[1])
    ty = 2.0 * (z * v[0] - x * v[2])
    tz = 2.0 * (x * v[1] - y * v[0])
    out[0] = v[0] + w * tx + y * tz - z * ty
    out[1] = v[1] + w * ty + z * tx - x * tz
    out[2] = v[2] + w * tz + x * ty - y * tx


@inlined
def _turn_back(q, v, out):
    x, y, z, w = -q[0], -q[1], -q[2], q[3]
    tx = 2.0 * (y * v[2] - z * v[1])
    ty = 2.0 * (z * v[0] - x * v[2])
    tz = 2.0 * (x * v[1] - y * v[0])
    out[0] = v[0] + w * tx + y * tz - z * ty
    out[1] = v[1] + w * ty + z * tx - x * tz
    out[2] = v[2] + w * tz + x * ty - y * tx


@inlined
def _distance_to(parts, partners, c, p, a, b, normal):
    """Signed distance of ``p`` (3,) to part ``c``, outward ``normal`` in the axes of the block; a, b are scratch."""
    pose = partners.pose[parts.body[c]]
    for k in range(3):
        a[k] = p[k] - pose[k]
    _turn_back(pose[3:7], a, b)
    T = parts.local[c]
    for k in range(3):
        a[k] = 0.0
        for m in range(3):
            a[k] += T[m, k] * (b[m] - T[m, 3])
    first, last = parts.plane_range[c, 0], parts.plane_range[c, 1]
    d = signed_distance(parts.kind[c], parts.size[c], parts.planes[first:last], a, b)
    for k in range(3):
        a[k] = T[k, 0] * b[0] + T[k, 1] * b[1] + T[k, 2] * b[2]
    _turn(pose[3:7], a, normal)
    return d


@inlined
def _at(x, faces, q, u, v, p):
    """Point of face ``q`` at u, v to p (3,)."""
    i, j, k, h = faces[q, 0], faces[q, 1], faces[q, 2], faces[q, 3]
    for m in range(3):
        low = x[i, m] + u * (x[j, m] - x[i, m])
        high = x[h, m] + u * (x[k, m] - x[h, m])
        p[m] = low + v * (high - low)


@kernel
def find_contacts(x, faces, looked_at, parts, partners, reach, fine, found, values, scratch3):
    """Deepest point of each face for each part nearer than ``reach``, to ``fine`` metres; returns how many.

    ``found`` (F, 2) receives part and face, ``values`` (F, 6) distance, normal towards the tissue, and place.
    """
    count = 0
    corners, low, high = scratch3[0:8], scratch3[8], scratch3[9]
    p, a, b, normal, best_normal = scratch3[10], scratch3[11], scratch3[12], scratch3[13], scratch3[14]
    for c in range(parts.kind.shape[0]):
        if not parts.live[c]:
            continue
        pose, T, box = partners.pose[parts.body[c]], parts.local[c], parts.corners[c]
        for k in range(8):
            for m in range(3):
                p[m] = box[k >> m & 1, m]
            for m in range(3):
                a[m] = T[m, 3] + T[m, 0] * p[0] + T[m, 1] * p[1] + T[m, 2] * p[2]
            _turn(pose[3:7], a, corners[k])
        for m in range(3):
            low[m], high[m] = math.inf, -math.inf
            for k in range(8):
                low[m] = min(low[m], corners[k, m] + pose[m] - reach)
                high[m] = max(high[m], corners[k, m] + pose[m] + reach)
        for q in range(faces.shape[0]):
            if not looked_at[q] or count == found.shape[0]:
                continue
            i, j, k, h = faces[q, 0], faces[q, 1], faces[q, 2], faces[q, 3]
            outside = False
            for m in range(3):
                least = min(x[i, m], x[j, m], x[k, m], x[h, m])
                most = max(x[i, m], x[j, m], x[k, m], x[h, m])
                outside = outside or least > high[m] or most < low[m]
            if outside:
                continue
            best, u, v = math.inf, 0.5, 0.5
            for s in range(COARSE * COARSE):
                su, sv = (s % COARSE + 0.5) / COARSE, (s // COARSE + 0.5) / COARSE
                _at(x, faces, q, su, sv, p)
                d = _distance_to(parts, partners, c, p, a, b, normal)
                if d < best:
                    best, u, v = d, su, sv
                    best_normal[0], best_normal[1], best_normal[2] = normal[0], normal[1], normal[2]
            for m in range(3):
                a[m], b[m] = x[k, m] - x[i, m], x[h, m] - x[j, m]
            nx, ny, nz = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
            size = math.sqrt(nx * nx + ny * ny + nz * nz)
            edge = math.sqrt(size)
            if best > reach + edge / COARSE:
                continue
            step = 0.5 / COARSE
            while step * edge > fine:
                moved = False
                for way in range(4):
                    su = min(max(u + (step if way == 0 else -step if way == 1 else 0.0), 0.0), 1.0)
                    sv = min(max(v + (step if way == 2 else -step if way == 3 else 0.0), 0.0), 1.0)
                    _at(x, faces, q, su, sv, p)
                    d = _distance_to(parts, partners, c, p, a, b, normal)
                    if d < best - LEVEL:
                        best, u, v, moved = d, su, sv, True
                        best_normal[0], best_normal[1], best_normal[2] = normal[0], normal[1], normal[2]
                if not moved:
                    step *= 0.5
            facing = nx * best_normal[0] + ny * best_normal[1] + nz * best_normal[2]
            if best > reach or facing > FACING * size:
                continue
            found[count, 0], found[count, 1] = c, q
            values[count, 0], values[count, 4], values[count, 5] = best, u, v
            for m in range(3):
                values[count, 1 + m] = best_normal[m]
            count += 1
    return count


@kernel
def measure_contacts(touching, points, parts, partners, scratch3):
    """Distance and normal of every point of contact as the tick begins."""
    a, b, normal = scratch3[0], scratch3[1], scratch3[2]
    for r in range(touching.used.shape[0]):
        if touching.used[r]:
            at = points.at[touching.point[r]]
            touching.distance[r] = _distance_to(parts, partners, touching.part[r], at, a, b, normal)
            for m in range(3):
                touching.normal[r, m] = normal[m]


@inlined
def _add_recoil(D, light, spin, first, second, h2):
    """Add to D (3, 3) the motion of a body at a lever ``first`` for a force at ``second``, times h²."""
    for b in range(3):
        ex, ey, ez = (1.0 if b == 0 else 0.0), (1.0 if b == 1 else 0.0), (1.0 if b == 2 else 0.0)
        mx = second[1] * ez - second[2] * ey
        my = second[2] * ex - second[0] * ez
        mz = second[0] * ey - second[1] * ex
        wx = spin[0, 0] * mx + spin[0, 1] * my + spin[0, 2] * mz
        wy = spin[1, 0] * mx + spin[1, 1] * my + spin[1, 2] * mz
        wz = spin[2, 0] * mx + spin[2, 1] * my + spin[2, 2] * mz
        D[b, b] += h2 * light
        D[0, b] += h2 * (wy * first[2] - wz * first[1])
        D[1, b] += h2 * (wz * first[0] - wx * first[2])
        D[2, b] += h2 * (wx * first[1] - wy * first[0])


@kernel
def press(touching, work, points, partners, s, dt, sweeps, recovery):
    """Forces of all points of contact in this tick, and where friction anchors; returns how many there are."""
    n = 0
    for r in range(touching.used.shape[0]):
        if touching.used[r]:
            work.rows[n] = r
            n += 1
    N = points.status.shape[0]
    for j in range(N):
        work.own_point[j] = False
    for a in range(n):
        work.own_point[touching.point[work.rows[a]]] = True
    for a in range(n):
        r = work.rows[a]
        i, b = touching.point[r], touching.body[r]
        pose, twist, normal = partners.pose[b], partners.twist[b], touching.normal[r]
        at, u, w = points.at[i], work.u[a], work.w[a]
        for k in range(3):
            work.lever[a, k] = at[k] - pose[k]
            work.own[a, k] = at[k] - partners.pose[0, k]
        # Where friction anchors, at the end of the tick.
        _turn(pose[3:7], touching.anchor[r], u)
        lx, ly, lz = u[0], u[1], u[2]
        u[0] += pose[0] + dt * (twist[0] + twist[4] * lz - twist[5] * ly)
        u[1] += pose[1] + dt * (twist[1] + twist[5] * lx - twist[3] * lz)
        u[2] += pose[2] + dt * (twist[2] + twist[3] * ly - twist[4] * lx)
        along, moved = 0.0, 0.0
        arm = work.lever[a]
        vx = dt * (twist[0] + twist[4] * arm[2] - twist[5] * arm[1])
        vy = dt * (twist[1] + twist[5] * arm[0] - twist[3] * arm[2])
        vz = dt * (twist[2] + twist[3] * arm[1] - twist[4] * arm[0])
        for k in range(3):
            y = points.start[i, k] + s * points.move[i, k]
            for j in range(N):
                if points.status[j] == 0:
                    continue
                for m in range(3):
                    f = -points.mean[j, m] if work.own_point[j] else points.force[j, m] - points.mean[j, m]
                    y += points.C[i, j, k, m] * f
            w[k] = y - u[k]
            along += w[k] * normal[k]
            moved += normal[k] * (y - at[k] - (vx if k == 0 else (vy if k == 1 else vz)))
        gap = touching.distance[r]
        if gap < -recovery:
            gap = -recovery
        gap += moved
        for k in range(3):
            w[k] += (gap - along) * normal[k]
    for a in range(n):
        i, b = touching.point[work.rows[a]], touching.body[work.rows[a]]
        for c in range(n):
            j = touching.point[work.rows[c]]
            D = work.D[a, c]
            for k in range(3):
                for m in range(3):
                    D[k, m] = points.C[i, j, k, m]
            _add_recoil(D, partners.light[0], partners.spin[0], work.own[a], work.own[c], dt * dt)
            if touching.body[work.rows[c]] == b:
                _add_recoil(D, partners.light[b], partners.spin[b], work.lever[a], work.lever[c], dt * dt)
    for a in range(n):
        for k in range(3):
            work.u[a, k] = work.w[a, k]
            for c in range(n):
                f = touching.force[work.rows[c]]
                D = work.D[a, c]
                work.u[a, k] += D[k, 0] * f[0] + D[k, 1] * f[1] + D[k, 2] * f[2]
    for _ in range(sweeps):
        for a in range(n):
            _relax(touching, work, n, a)
    for a in range(n):
        r = work.rows[a]
        f, normal, u = touching.force[r], touching.normal[r], work.u[a]
        i = touching.point[r]
        along_f = f[0] * normal[0] + f[1] * normal[1] + f[2] * normal[2]
        along_u = u[0] * normal[0] + u[1] * normal[1] + u[2] * normal[2]
        # What the bristle does not hold moves its anchor on.
        for k in range(3):
            points.force[i, k] = f[k]
            work.w[a, k] = u[k] - along_u * normal[k] + SOFT * (f[k] - along_f * normal[k])
        pose = partners.pose[touching.body[r]]
        _turn_back(pose[3:7], work.w[a], work.u[a])
        for k in range(3):
            touching.anchor[r, k] += work.u[a, k]
    return n


@inlined
def _relax(touching, work, n, a):
    """One point: its normal force, then friction within the cone."""
    r = work.rows[a]
    f, normal, D, u = touching.force[r], touching.normal[r], work.D[a, a], work.u[a]
    stiff, trace, gap, before = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        trace += D[k, k]
        gap += normal[k] * u[k]
        before += normal[k] * f[k]
        for m in range(3):
            stiff += normal[k] * D[k, m] * normal[m]
    pressed = before - (gap + SOFT * before) / (stiff + SOFT)
    pressed = pressed if pressed > 0.0 else 0.0
    across = max(trace - stiff, 0.5 * trace) + SOFT
    tx, ty, tz, size = 0.0, 0.0, 0.0, 0.0
    limit = touching.friction[r] * pressed
    tx = f[0] - before * normal[0] - (u[0] - gap * normal[0] + SOFT * (f[0] - before * normal[0])) / across
    ty = f[1] - before * normal[1] - (u[1] - gap * normal[1] + SOFT * (f[1] - before * normal[1])) / across
    tz = f[2] - before * normal[2] - (u[2] - gap * normal[2] + SOFT * (f[2] - before * normal[2])) / across
    size = math.sqrt(tx * tx + ty * ty + tz * tz)
    scale = limit / size if size > limit else 1.0
    cx = pressed * normal[0] + scale * tx - f[0]
    cy = pressed * normal[1] + scale * ty - f[1]
    cz = pressed * normal[2] + scale * tz - f[2]
    if cx == 0.0 and cy == 0.0 and cz == 0.0:
        return
    f[0], f[1], f[2] = f[0] + cx, f[1] + cy, f[2] + cz
    for c in range(n):
        E, v = work.D[c, a], work.u[c]
        v[0] += E[0, 0] * cx + E[0, 1] * cy + E[0, 2] * cz
        v[1] += E[1, 0] * cx + E[1, 1] * cy + E[1, 2] * cz
        v[2] += E[2, 0] * cx + E[2, 1] * cy + E[2, 2] * cz
