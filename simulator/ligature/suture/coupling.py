"""Contact points and Coulomb friction inside the implicit solve, between elements, and with bodies.

A contact is a stiff spring along its normal and a bristle across it: elastic while it sticks, of
constant force against the motion while it slips, all evaluated at the end of the tick. Which contacts
touch and which stick is found by repetition (an active-set Newton method), starting from the last
tick. The stiffness that a contact adds to each of its two nodes goes into their matrices; the coupling between
the nodes is solved in `ligature.suture.coupled_solve`. World axes, SI units; `Touches.push` and the matrices K
are times dt².
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.rotations import cross, multiply, rotate, rotation_vector
from ligature.suture.layout import FrictionMode, Nodes, Touches, Work

Array = NDArray[np.float64]


MAX_SWITCHES = 3
"""Switches between stick and slip after which a contact yields for the rest of the tick."""

TOLERANCE = 0.02
"""Share of the friction limit by which a solve may miss Coulomb's law: sticking above the limit, slipping below it.

Contacts of a thread that creeps are all near their limits, and would take turns in sticking and slipping for ever."""

PRESSURE = 0.1
"""Change of the normal force, as a share of it, that a solve with the old friction limit may leave."""


@inlined
def lever_of(work: Work, touches: Touches, c: int, side: int) -> tuple[float, float, float]:
    """Lever of contact ``c`` from the centre of its node ``side``: along the capsule's axis, then to its skin."""
    p, n = touches.local[c, side], touches.normal[c]
    rx, ry, rz = rotate(work.R[touches.node[c, side]], p[0], p[1], p[2])
    arm = touches.arm[c, side]
    return rx + arm * n[0], ry + arm * n[1], rz + arm * n[2]


@inlined
def _travel(
    nodes: Nodes, work: Work, touches: Touches, c: int, side: int
) -> tuple[float, float, float, float, float, float]:
    """How far contact ``c`` has moved with its node ``side`` in this tick, and its lever.

    A capsule that rolls moves its skin but not its axis, so that pressure alone never rolls it; a point
    of the skin under pressure would topple like a pencil on its tip.
    """
    i = touches.node[c, side]
    n, start, arm = touches.normal[c], touches.start[c], touches.arm[c, side]
    rx, ry, rz = lever_of(work, touches, c, side)
    ux = nodes.x[i, 0] + rx - arm * n[0] - start[side, 0]
    uy = nodes.x[i, 1] + ry - arm * n[1] - start[side, 1]
    uz = nodes.x[i, 2] + rz - arm * n[2] - start[side, 2]
    if arm != 0.0:
        q, p = nodes.q, work.q
        x, y, z, w = multiply(q[i, 0], q[i, 1], q[i, 2], q[i, 3], -p[i, 0], -p[i, 1], -p[i, 2], p[i, 3])
        tx, ty, tz = rotation_vector(x, y, z, w)
        vx, vy, vz = cross(tx, ty, tz, n[0], n[1], n[2])
        ux, uy, uz = ux + arm * vx, uy + arm * vy, uz + arm * vz
    return ux, uy, uz, rx, ry, rz


@inlined
def _opening(
    nodes: Nodes, work: Work, touches: Touches, c: int
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Gap of contact ``c`` now, the slip its friction resists (3), and its levers on both nodes (6)."""
    px, py, pz, ax, ay, az = _travel(nodes, work, touches, c, 0)
    sx, sy, sz, bx, by, bz = _travel(nodes, work, touches, c, 1)
    n, slip = touches.normal[c], touches.slip[c]
    ux, uy, uz = px - sx, py - sy, pz - sz
    un = ux * n[0] + uy * n[1] + uz * n[2]
    wx = slip[0] + ux - un * n[0]
    wy = slip[1] + uy - un * n[1]
    wz = slip[2] + uz - un * n[2]
    return touches.gap[c] + un, wx, wy, wz, ax, ay, az, bx, by, bz


@inlined
def _add_spring(K: Array, rx: float, ry: float, rz: float, H: Array) -> None:
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
def push(g: Array, sign: float, fx: float, fy: float, fz: float, rx: float, ry: float, rz: float) -> None:
    """g += sign (f, r x f)."""
    mx, my, mz = cross(rx, ry, rz, fx, fy, fz)
    g[0] += sign * fx
    g[1] += sign * fy
    g[2] += sign * fz
    g[3] += sign * mx
    g[4] += sign * my
    g[5] += sign * mz


@inlined
def _friction(
    touches: Touches, c: int, wx: float, wy: float, wz: float, scale: float, dt: float
) -> tuple[float, float, float]:
    """Stiffness of the bristle of contact ``c`` across its motion and along it, and the factor of its force."""
    limit = touches.friction[c] * touches.press[c] * dt * dt
    size = math.sqrt(wx * wx + wy * wy + wz * wz)
    if touches.mode[c] == FrictionMode.STICKS or size * scale <= limit:
        return scale, scale, scale
    s = limit / size
    return s, (s if touches.mode[c] == FrictionMode.YIELDS else 0.0), s


@inlined
def rigid(touches: Touches, c: int) -> bool:
    """Whether ``c`` is a point constraint.

    A bilateral contact with friction is a grasp, whose `Touches.press` is given.
    """
    return touches.bilateral[c] and touches.friction[c] == 0.0


@inlined
def add_closed(nodes: Nodes, touches: Touches, work: Work, c: int) -> None:
    """Add contact ``c``, as ``work.K`` and `Touches.push` state it, to ``work.H`` and ``work.g``."""
    K, f, arms = work.K[c], touches.push[c], work.arms[c]
    i, k = touches.node[c, 0], touches.node[c, 1]
    ax, ay, az, bx, by, bz = arms[0, 0], arms[0, 1], arms[0, 2], arms[1, 0], arms[1, 1], arms[1, 2]
    if not nodes.fixed[i]:
        _add_spring(K, ax, ay, az, work.H[i])
        push(work.g[i], 1.0, f[0], f[1], f[2], ax, ay, az)
    if not nodes.fixed[k]:
        _add_spring(K, bx, by, bz, work.H[k])
        push(work.g[k], -1.0, f[0], f[1], f[2], bx, by, bz)


@kernel
def open_contacts(nodes: Nodes, touches: Touches, work: Work) -> None:
    """Gaps, slips and levers of all contacts at the present poses."""
    for c in range(touches.count[0]):
        begun, arms = touches.begun[c], work.arms[c]
        gap, wx, wy, wz, ax, ay, az, bx, by, bz = _opening(nodes, work, touches, c)
        touches.room[c] = gap - touches.target[c]
        begun[0], begun[1], begun[2] = wx, wy, wz
        arms[0, 0], arms[0, 1], arms[0, 2] = ax, ay, az
        arms[1, 0], arms[1, 1], arms[1, 2] = bx, by, bz


@kernel
def add_contacts(nodes: Nodes, touches: Touches, work: Work, stiffness: float, dt: float) -> None:
    """Add all closed contacts to ``work.H`` and ``work.g``."""
    scale = stiffness * dt * dt
    for c in range(touches.count[0]):
        K, f, begun, n = work.K[c], touches.push[c], touches.begun[c], touches.normal[c]
        gap, wx, wy, wz, ax, ay, az, bx, by, bz = _opening(nodes, work, touches, c)
        begun[0], begun[1], begun[2] = wx, wy, wz
        room = gap - touches.target[c]
        touches.room[c] = room
        across, along, s, normal = 0.0, 0.0, 0.0, 0.0
        if touches.bilateral[c]:
            room = gap
        if rigid(touches, c):
            across, along, s, normal = scale, scale, scale, scale
        elif touches.closed[c]:
            across, along, s = _friction(touches, c, wx, wy, wz, scale, dt)
            normal = scale
        size = wx * wx + wy * wy + wz * wz
        turn = (along - across) / size if size > 0.0 else 0.0
        for a in range(3):
            for b in range(3):
                K[a, b] = (normal - across) * n[a] * n[b] + turn * begun[a] * begun[b]
            K[a, a] += across
            f[a] = -normal * room * n[a] - s * begun[a]
        if not touches.closed[c]:
            continue
        arms = work.arms[c]
        arms[0, 0], arms[0, 1], arms[0, 2] = ax, ay, az
        arms[1, 0], arms[1, 1], arms[1, 2] = bx, by, bz
        add_closed(nodes, touches, work, c)


@inlined
def _moved(nodes: Nodes, work: Work, touches: Touches, c: int, side: int) -> tuple[float, float, float]:
    """Displacement of the point of contact ``c`` on a node by the solved correction."""
    i = touches.node[c, side]
    if nodes.fixed[i]:
        return 0.0, 0.0, 0.0
    d = work.d[i]
    rx, ry, rz = lever_of(work, touches, c, side)
    ux, uy, uz = cross(d[3], d[4], d[5], rx, ry, rz)
    return d[0] + ux, d[1] + uy, d[2] + uz


@kernel
def settle_contacts(nodes: Nodes, touches: Touches, work: Work, stiffness: float, dt: float) -> bool:
    """Forces of the contacts as solved, and which of them touch and stick; True if the solve assumed otherwise."""
    changed = False
    per_dt2 = 1.0 / (dt * dt)
    for c in range(touches.count[0]):
        n, force, w, f = touches.normal[c], touches.force[c], touches.ended[c], touches.push[c]
        ax, ay, az = _moved(nodes, work, touches, c, 0)
        bx, by, bz = _moved(nodes, work, touches, c, 1)
        ux, uy, uz = ax - bx, ay - by, az - bz
        kx, ky, kz = rotate(work.K[c], ux, uy, uz)
        force[0], force[1], force[2] = per_dt2 * (f[0] - kx), per_dt2 * (f[1] - ky), per_dt2 * (f[2] - kz)
        if rigid(touches, c):
            continue
        un = ux * n[0] + uy * n[1] + uz * n[2]
        begun = touches.begun[c]
        w[0], w[1], w[2] = begun[0] + ux - un * n[0], begun[1] + uy - un * n[1], begun[2] + uz - un * n[2]
        press = force[0] * n[0] + force[1] * n[1] + force[2] * n[2]
        if touches.bilateral[c]:
            press = touches.press[c]
        if touches.closed[c] and press >= 0.0:
            changed = _settle_friction(touches, c, w, press, stiffness) or changed
        elif touches.closed[c]:
            touches.closed[c] = False
            touches.press[c] = 0.0
            changed = True
        elif touches.room[c] + un < 0.0:
            # The next solve finds its normal force; until then it slides freely.
            touches.closed[c] = True
            touches.press[c] = 0.0
            touches.mode[c] = FrictionMode.SLIPS
            changed = True
    return changed


@inlined
def _settle_friction(touches: Touches, c: int, w: Array, press: float, stiffness: float) -> bool:
    """Whether contact ``c`` sticks or slips after a solve; True if the solve assumed otherwise."""
    limit = touches.friction[c] * press
    before = touches.friction[c] * touches.press[c]
    touches.press[c] = press
    size = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    force = size * stiffness
    if touches.mode[c] == FrictionMode.STICKS:
        if force <= (1.0 + TOLERANCE) * limit:
            return False
        touches.switches[c] += 1
        touches.mode[c] = FrictionMode.SLIPS if touches.switches[c] < MAX_SWITCHES else FrictionMode.YIELDS
        return True
    begun = touches.begun[c]
    first = math.sqrt(begun[0] ** 2 + begun[1] ** 2 + begun[2] ** 2)
    onward = (begun[0] * w[0] + begun[1] * w[1] + begun[2] * w[2]) / first if first > 0.0 else 0.0
    if touches.mode[c] == FrictionMode.SLIPS and onward * stiffness < (1.0 - TOLERANCE) * limit:
        touches.switches[c] += 1
        touches.mode[c] = FrictionMode.STICKS if touches.switches[c] < MAX_SWITCHES else FrictionMode.YIELDS
        return True
    return onward < (1.0 - TOLERANCE) * size or abs(limit - before) > PRESSURE * limit


@kernel
def conclude_contacts(touches: Touches, stiffness: float) -> None:
    """The slip that the next tick's friction starts from."""
    for c in range(touches.count[0]):
        slip, w = touches.slip[c], touches.ended[c]
        if not touches.closed[c] or rigid(touches, c):
            touches.press[c] = 0.0
            touches.mode[c] = FrictionMode.SLIPS
            for a in range(3):
                slip[a] = 0.0
            continue
        size = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        limit = touches.friction[c] * touches.press[c] / stiffness
        touches.mode[c] = FrictionMode.SLIPS if size > limit else FrictionMode.STICKS
        scale = limit / size if size > limit else 1.0
        slip[0], slip[1], slip[2] = scale * w[0], scale * w[1], scale * w[2]
