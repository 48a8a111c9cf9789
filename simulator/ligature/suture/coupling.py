"""Contact points and Coulomb friction inside the implicit solve, between elements, and with bodies.

A contact is a stiff spring along its normal and a bristle across it (an elastic stick up to the
friction limit, then slip), both evaluated at the end of the tick. What each contact does to its two
nodes apart goes into their matrices; what ties the nodes together is solved by conjugate gradients,
with the chain's direct solver as preconditioner, to rounding. World axes, SI units.
"""

from __future__ import annotations

import math

from ligature.suture.chain import invert_spd6, solve
from ligature.suture.compiled import inlined, kernel
from ligature.suture.rotations import cross, matrix_of, rotate

MAX_CG = 40
CG_TOLERANCE = 1e-12
"""Residual energy, relative to the first, at which the coupling is solved."""


@inlined
def _point(nodes, work, touches, c, side):
    """Present position of contact ``c`` on its node ``side``, and its lever from the node's centre."""
    i = touches.node[c, side]
    p = touches.local[c, side]
    rx, ry, rz = rotate(work.R[i], p[0], p[1], p[2])
    return nodes.x[i, 0] + rx, nodes.x[i, 1] + ry, nodes.x[i, 2] + rz, rx, ry, rz


@inlined
def _opening(nodes, work, touches, c):
    """Gap of contact ``c`` now, the slip its friction resists (3), and its levers on both nodes (6)."""
    px, py, pz, ax, ay, az = _point(nodes, work, touches, c, 0)
    sx, sy, sz, bx, by, bz = _point(nodes, work, touches, c, 1)
    start, n, slip = touches.start[c], touches.normal[c], touches.slip[c]
    ux = (px - start[0, 0]) - (sx - start[1, 0])
    uy = (py - start[0, 1]) - (sy - start[1, 1])
    uz = (pz - start[0, 2]) - (sz - start[1, 2])
    un = ux * n[0] + uy * n[1] + uz * n[2]
    wx = slip[0] + ux - un * n[0]
    wy = slip[1] + uy - un * n[1]
    wz = slip[2] + uz - un * n[2]
    return touches.gap[c] + un, wx, wy, wz, ax, ay, az, bx, by, bz


@inlined
def _add_spring(K, rx, ry, rz, H):
    """H += Jᵀ K J for a spring K (3, 3) at the lever r, J = [1, -[r]]."""
    for i in range(3):
        # Row of -K [r] = (r x K_i) with the sign of the transposed product.
        ex = -(K[i, 1] * rz - K[i, 2] * ry)
        ey = -(K[i, 2] * rx - K[i, 0] * rz)
        ez = -(K[i, 0] * ry - K[i, 1] * rx)
        for j in range(3):
            H[i, j] += K[i, j]
        H[i, 3] += ex
        H[i, 4] += ey
        H[i, 5] += ez
        H[3, i] += ex
        H[4, i] += ey
        H[5, i] += ez
        # [r] E, row by row of E: the row i of E contributes the column i of [r].
        if i == 0:
            cx, cy, cz = 0.0, rz, -ry
        elif i == 1:
            cx, cy, cz = -rz, 0.0, rx
        else:
            cx, cy, cz = ry, -rx, 0.0
        H[3, 3] += cx * ex
        H[3, 4] += cx * ey
        H[3, 5] += cx * ez
        H[4, 3] += cy * ex
        H[4, 4] += cy * ey
        H[4, 5] += cy * ez
        H[5, 3] += cz * ex
        H[5, 4] += cz * ey
        H[5, 5] += cz * ez


@inlined
def _push(g, sign, fx, fy, fz, rx, ry, rz):
    """g += sign (f, r x f)."""
    mx, my, mz = cross(rx, ry, rz, fx, fy, fz)
    g[0] += sign * fx
    g[1] += sign * fy
    g[2] += sign * fz
    g[3] += sign * mx
    g[4] += sign * my
    g[5] += sign * mz


@inlined
def _bristle(touches, c, wx, wy, wz, stiffness):
    """Secant stiffness of the friction of contact ``c``: elastic below the limit, constant force above."""
    limit = touches.friction[c] * touches.press[c]
    size = math.sqrt(wx * wx + wy * wy + wz * wz)
    if size * stiffness > limit:
        return limit / size
    return stiffness


@kernel
def add_contacts(nodes, touches, work, stiffness, dt):
    """Add all closed contacts to ``work.H`` and ``work.g``; returns whether any ties two movable nodes."""
    coupled = False
    scale = stiffness * dt * dt
    for c in range(touches.count[0]):
        K = work.K[c]
        for a in range(3):
            for b in range(3):
                K[a, b] = 0.0
        if not touches.closed[c]:
            continue
        i, k = touches.node[c, 0], touches.node[c, 1]
        gap, wx, wy, wz, ax, ay, az, bx, by, bz = _opening(nodes, work, touches, c)
        n = touches.normal[c]
        if touches.bond[c]:
            wx, wy, wz = wx + gap * n[0], wy + gap * n[1], wz + gap * n[2]
            kt, press = scale, 0.0
        else:
            kt = _bristle(touches, c, wx, wy, wz, stiffness) * dt * dt
            press = scale * (touches.target[c] - gap)
        for a in range(3):
            for b in range(3):
                K[a, b] = (scale - kt) * n[a] * n[b]
            K[a, a] += kt
        fx, fy, fz = press * n[0] - kt * wx, press * n[1] - kt * wy, press * n[2] - kt * wz
        if not nodes.fixed[i]:
            _add_spring(K, ax, ay, az, work.H[i])
            _push(work.g[i], 1.0, fx, fy, fz, ax, ay, az)
        if not nodes.fixed[k]:
            _add_spring(K, bx, by, bz, work.H[k])
            _push(work.g[k], -1.0, fx, fy, fz, bx, by, bz)
            coupled = coupled or not nodes.fixed[i]
    return coupled


@inlined
def _apply_ties(total, nodes, touches, work, p, out):
    """out = E p: what each movable node of a contact feels of the other's motion."""
    for i in range(total):
        for a in range(6):
            out[i, a] = 0.0
    for c in range(touches.count[0]):
        i, k = touches.node[c, 0], touches.node[c, 1]
        if not touches.closed[c] or nodes.fixed[i] or nodes.fixed[k]:
            continue
        K = work.K[c]
        a, b = touches.local[c, 0], touches.local[c, 1]
        ax, ay, az = rotate(work.R[i], a[0], a[1], a[2])
        bx, by, bz = rotate(work.R[k], b[0], b[1], b[2])
        ux, uy, uz = cross(p[i, 3], p[i, 4], p[i, 5], ax, ay, az)
        vx, vy, vz = cross(p[k, 3], p[k, 4], p[k, 5], bx, by, bz)
        fx, fy, fz = rotate(K, p[k, 0] + vx, p[k, 1] + vy, p[k, 2] + vz)
        _push(out[i], -1.0, fx, fy, fz, ax, ay, az)
        fx, fy, fz = rotate(K, p[i, 0] + ux, p[i, 1] + uy, p[i, 2] + uz)
        _push(out[k], -1.0, fx, fy, fz, bx, by, bz)


@inlined
def _precondition(n, total, nodes, work, g, d, load):
    """d = S⁻¹ g: the chain by its direct solver, every other body alone."""
    solve(n, work.lever[:, 0], work.lever[:, 1], work.B, work.Y, work.Z, work.zero, g, d, load, work.six)
    _move_bodies(n, total, nodes, work, g, d)


@inlined
def _move_bodies(n, total, nodes, work, g, d):
    for i in range(n, total):
        for a in range(6):
            s = 0.0
            if not nodes.fixed[i]:
                for b in range(6):
                    s += work.Y[i, a, b] * g[i, b]
            d[i, a] = s


@inlined
def _dot(total, a, b):
    s = 0.0
    for i in range(total):
        for k in range(6):
            s += a[i, k] * b[i, k]
    return s


@kernel
def factor_bodies(n, total, nodes, work):
    """Admittance of the bodies behind the chain."""
    for i in range(n, total):
        if not nodes.fixed[i]:
            invert_spd6(work.H[i], work.Y[i])


@kernel
def couple(n, total, nodes, touches, work):
    """Complete ``work.d`` and ``work.load`` by what contacts between movable nodes carry across."""
    p, r, z, s = work.cg[0], work.cg[1], work.cg[2], work.cg[3]
    p_load, z_load = work.cg_load[0], work.cg_load[1]
    factor_bodies(n, total, nodes, work)
    _move_bodies(n, total, nodes, work, work.g, work.d)
    _apply_ties(total, nodes, touches, work, work.d, r)
    for i in range(total):
        for a in range(6):
            r[i, a] = -r[i, a]
    _precondition(n, total, nodes, work, r, z, z_load)
    energy = _dot(total, r, z)
    first = energy
    if energy <= 0.0:
        return 0
    # s keeps S p by recurrence, so that S itself is never applied.
    for i in range(total):
        for a in range(6):
            p[i, a], s[i, a] = z[i, a], r[i, a]
    for j in range(n - 1):
        for a in range(6):
            p_load[j, a] = z_load[j, a]
    iterations = 0
    for _ in range(MAX_CG):
        iterations += 1
        q = z
        _apply_ties(total, nodes, touches, work, p, q)
        for i in range(total):
            for a in range(6):
                q[i, a] += s[i, a]
        curvature = _dot(total, p, q)
        if curvature <= 0.0:
            break
        step = energy / curvature
        for i in range(total):
            for a in range(6):
                work.d[i, a] += step * p[i, a]
                r[i, a] -= step * q[i, a]
        for j in range(n - 1):
            for a in range(6):
                work.load[j, a] += step * p_load[j, a]
        _precondition(n, total, nodes, work, r, z, z_load)
        fresh = _dot(total, r, z)
        if fresh <= CG_TOLERANCE * first:
            break
        beta = fresh / energy
        energy = fresh
        for i in range(total):
            for a in range(6):
                p[i, a] = z[i, a] + beta * p[i, a]
                s[i, a] = r[i, a] + beta * s[i, a]
        for j in range(n - 1):
            for a in range(6):
                p_load[j, a] = z_load[j, a] + beta * p_load[j, a]
    return iterations


@kernel
def settle_contacts(total, nodes, touches, work, stiffness):
    """Open and close contacts by where the nodes now are; returns whether the tick must be solved again."""
    changed = False
    if touches.count[0] == 0:
        return changed
    for i in range(total):
        matrix_of(nodes.q[i, 0], nodes.q[i, 1], nodes.q[i, 2], nodes.q[i, 3], work.R[i])
    for c in range(touches.count[0]):
        if touches.bond[c]:
            continue
        gap, wx, wy, wz, _ax, _ay, _az, _bx, _by, _bz = _opening(nodes, work, touches, c)
        depth = touches.target[c] - gap
        size = math.sqrt(wx * wx + wy * wy + wz * wz)
        if touches.closed[c]:
            grip = _bristle(touches, c, wx, wy, wz, stiffness) * size
            press = stiffness * max(depth, 0.0)
            changed = changed or depth < 0.0 or grip > 1.2 * touches.friction[c] * press
            touches.press[c] = press
            touches.closed[c] = depth >= 0.0
        elif depth > 0.0:
            touches.closed[c] = True
            touches.press[c] = 0.0
            changed = True
    return changed


@kernel
def conclude_contacts(nodes, touches, work, stiffness, dt):
    """Contact forces of the tick, and the slip that the next tick's friction starts from."""
    for c in range(touches.count[0]):
        n, K = touches.normal[c], work.K[c]
        if not touches.closed[c]:
            touches.press[c] = 0.0
            for a in range(3):
                touches.force[c, a] = 0.0
                touches.slip[c, a] = 0.0
            continue
        gap, wx, wy, wz, _ax, _ay, _az, _bx, _by, _bz = _opening(nodes, work, touches, c)
        if touches.bond[c]:
            for a in range(3):
                w = wx if a == 0 else (wy if a == 1 else wz)
                touches.force[c, a] = -stiffness * (w + gap * n[a])
            continue
        fx, fy, fz = rotate(K, wx, wy, wz)
        press = touches.press[c]
        per_dt2 = 1.0 / (dt * dt)
        touches.force[c, 0] = press * n[0] - per_dt2 * fx
        touches.force[c, 1] = press * n[1] - per_dt2 * fy
        touches.force[c, 2] = press * n[2] - per_dt2 * fz
        size = math.sqrt(wx * wx + wy * wy + wz * wz)
        limit = touches.friction[c] * press / stiffness
        scale = limit / size if size > limit else 1.0
        touches.slip[c, 0] = scale * wx
        touches.slip[c, 1] = scale * wy
        touches.slip[c, 2] = scale * wz
