"""Forces of tissue on the needles and rods that pass through it, inside the implicit solve of a tick.

Each passage is a spring in six directions between a node and its hole, with drag along, evaluated at the
end of the tick. Along the path and about it the spring is friction with a limit.
Which rows slip is found by repetition, as with contacts. The hole recoils by its own mobility,
so that a light hole and a heavy needle stay stable: with S the springs and A the hole's mobility the
node feels (S⁻¹ + dt² A)⁻¹. World axes, SI units.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.rotations import cross, matrix_of, multiply, quaternion_of, rotation_vector
from ligature.suture.chain import invert_spd6
from ligature.suture.layout import FrictionMode, Nodes, Work
from ligature.suture.passages import Passages
from ligature.suture.tracking import open_passages

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


MAX_SWITCHES = 6
"""Changes of mode in a tick after which a row yields for the rest of it."""

FLOOR = 1e-9
"""Least stiffness of a row, N/m or N m/rad."""

MAX_STEPS = 8
"""Most Newton steps of a needle without a rod."""


@inlined
def _begin_passage(p: Passages, c: int) -> None:
    """Springs of passage ``c`` as the last tick left them."""
    p.switches[c] = 0
    for r in range(6):
        _set_row(p, c, r, p.stretch[c, r])


@inlined
def _set_row(p: Passages, c: int, r: int, stretch: float) -> None:
    """Spring of row ``r`` in its mode, the row being stretched as given."""
    k, limit = p.stiffness[c, r], p.limit[c, r]
    p.secant[c, r], p.bias[c, r] = k, 0.0
    if p.mode[c, r] == FrictionMode.SLIPS:
        p.secant[c, r], p.bias[c, r] = 0.0, (limit if stretch > 0.0 else -limit)
    elif p.mode[c, r] == FrictionMode.YIELDS and abs(k * stretch) > limit:
        p.secant[c, r] = limit / abs(stretch)


@inlined
def respond(p: Passages, c: int, elapsed: float) -> None:
    """Passage ``c`` as it acts on its node: stiffness ``p.K`` and load ``p.load`` at the start of the tick."""
    T, K = p.T, p.K[c]
    for i in range(6):
        for j in range(6):
            T[i, j] = elapsed * elapsed * p.recoil[c, i, j]
        T[i, i] += 1.0 / max(p.secant[c, i] + p.damping[c, i] / elapsed, FLOOR)
    invert_spd6(T, K)
    for i in range(6):
        spring = max(p.secant[c, i] + p.damping[c, i] / elapsed, FLOOR)
        rest = p.secant[c, i] * p.stretch[c, i] + p.bias[c, i]
        p.d[i] = rest / spring - elapsed * p.drift[c, i]
    for i in range(6):
        s = 0.0
        for j in range(6):
            s += K[i, j] * p.d[j]
        p.load[c, i] = s


@inlined
def begin_passages(p: Passages, owner: int) -> None:
    """Springs of the passages of a rod as the last tick left them."""
    for c in range(p.filled[0]):
        if p.owner[c] == owner:
            _begin_passage(p, c)
            for a in range(6):
                p.impulse[c, a] = 0.0


@inlined
def restart_passages(p: Passages, owner: int) -> None:
    """Springs of the passages of a rod as they were, after a step that did not settle."""
    for c in range(p.filled[0]):
        if p.owner[c] == owner:
            _begin_passage(p, c)


@inlined
def add_passage_forces(p: Passages, owner: int, nodes: Nodes, work: Work, elapsed: float, h: float) -> None:
    """Add the passages of a rod to the matrices and loads of its nodes."""
    for c in range(p.filled[0]):
        i = p.node[c]
        if p.owner[c] == owner and nodes.fixed[i]:
            respond(p, c, elapsed)
        elif p.owner[c] == owner:
            _add_passage(p, c, nodes.x[i], nodes.q[i], work.H[i], work.g[i], elapsed, h)


@inlined
def settle_passages(p: Passages, owner: int, nodes: Nodes, elapsed: float) -> bool:
    """Forces of the passages of a rod as solved; True when a solve with other modes has to follow."""
    changed = False
    for c in range(p.filled[0]):
        i = p.node[c]
        if p.owner[c] == owner:
            changed = _settle_passage(p, c, nodes.x[i], nodes.q[i], elapsed) or changed
    return changed


@inlined
def add_passage_impulses(p: Passages, owner: int, impulse: Array, h: float) -> None:
    """Add the impulses of a rod's passages in ``h`` seconds to those (N, 6) of its nodes."""
    for c in range(p.filled[0]):
        if p.owner[c] == owner:
            _add_passage_impulse(p, c, h)
            for a in range(6):
                impulse[p.node[c], a] += h * p.d[a]


@inlined
def move(p: Passages, c: int, x: Array, q: Array) -> None:
    """Write the motion of passage ``c`` with its node, now at ``x`` (3,) and ``q`` (4,), to ``p.d`` in its axes."""
    b, lever, A, d = p.q[c], p.lever[c], p.axes[c], p.d
    tx, ty, tz, tw = multiply(q[0], q[1], q[2], q[3], -b[0], -b[1], -b[2], b[3])
    rx, ry, rz = rotation_vector(tx, ty, tz, tw)
    ux, uy, uz = cross(rx, ry, rz, lever[0], lever[1], lever[2])
    ux, uy, uz = ux + x[0] - p.x[c, 0], uy + x[1] - p.x[c, 1], uz + x[2] - p.x[c, 2]
    for k in range(3):
        d[k] = A[0, k] * ux + A[1, k] * uy + A[2, k] * uz
        d[3 + k] = A[0, k] * rx + A[1, k] * ry + A[2, k] * rz
    d[4] -= p.bend[c] * d[0]


@inlined
def _press(p: Passages, c: int) -> None:
    """Force of passage ``c`` on its path for the motion in ``p.d``."""
    for i in range(6):
        s = p.load[c, i]
        for j in range(6):
            s += p.K[c, i, j] * p.d[j]
        p.force[c, i] = -s


@inlined
def _fill_jacobian(p: Passages, c: int) -> None:
    """Motion at passage ``c``, in its axes, for one of the node, in world axes: ``p.J``."""
    A, lever, J = p.axes[c], p.lever[c], p.J
    for k in range(3):
        ax, ay, az = A[0, k], A[1, k], A[2, k]
        mx, my, mz = cross(lever[0], lever[1], lever[2], ax, ay, az)
        J[k, 0], J[k, 1], J[k, 2], J[k, 3], J[k, 4], J[k, 5] = ax, ay, az, mx, my, mz
        J[3 + k, 0], J[3 + k, 1], J[3 + k, 2] = 0.0, 0.0, 0.0
        J[3 + k, 3], J[3 + k, 4], J[3 + k, 5] = ax, ay, az
    for k in range(6):
        J[4, k] -= p.bend[c] * J[0, k]


@inlined
def _add_passage(p: Passages, c: int, x: Array, q: Array, H: Array, g: Array, elapsed: float, h: float) -> None:
    """Add passage ``c`` to the matrix ``H`` (6, 6) and the load ``g`` (6,) of its node, both times h²."""
    respond(p, c, elapsed)
    move(p, c, x, q)
    _press(p, c)
    _fill_jacobian(p, c)
    J, T, h2 = p.J, p.T, h * h
    for i in range(6):
        for j in range(6):
            s = 0.0
            for k in range(6):
                s += p.K[c, i, k] * J[k, j]
            T[i, j] = s
    for i in range(6):
        for j in range(6):
            s = 0.0
            for k in range(6):
                s += J[k, i] * T[k, j]
            H[i, j] += h2 * s
        s = 0.0
        for k in range(6):
            s += J[k, i] * p.force[c, k]
        g[i] += h2 * s


@inlined
def _settle_passage(p: Passages, c: int, x: Array, q: Array, elapsed: float) -> bool:
    """Force of passage ``c`` with its node as solved; True when a row sticks or slips other than the solve assumed."""
    move(p, c, x, q)
    _press(p, c)
    changed = False
    for r in range(6):
        k, limit = p.stiffness[c, r], p.limit[c, r]
        if k == 0.0:
            continue
        recoil = 0.0
        for j in range(6):
            recoil += p.recoil[c, r, j] * p.force[c, j]
        stretch = p.stretch[c, r] + p.d[r] - elapsed * p.drift[c, r] + elapsed * elapsed * recoil
        before = p.mode[c, r]
        if before == FrictionMode.YIELDS:
            continue
        now = FrictionMode.SLIPS if abs(k * stretch) > limit else FrictionMode.STICKS
        onward = p.bias[c, r] * stretch >= 0.0
        if now == before and (now == FrictionMode.STICKS or onward):
            continue
        p.switches[c] += 1
        p.mode[c, r] = now if p.switches[c] < MAX_SWITCHES else FrictionMode.YIELDS
        _set_row(p, c, r, stretch)
        changed = True
    return changed


@inlined
def _add_passage_impulse(p: Passages, c: int, h: float) -> None:
    """Add the impulse of passage ``c`` on its path in ``h`` seconds to ``p.impulse``; ``p.d`` gets force and moment.

    Both are about the node's centre, in world axes.
    """
    _fill_jacobian(p, c)
    for i in range(6):
        s = 0.0
        for k in range(6):
            s += p.J[k, i] * p.force[c, k]
        p.d[i] = s
        p.impulse[c, i] += h * s


@kernel
def solve_needle(
    passage_table: Integers, path: int, pose: Array, twist: Array, mass: float, inertia: Array, pull: Array, H: Array,
    Y: Array, g: Array, dt: float,
) -> None:  # fmt: skip
    """Impulses in this tick of all passages of a needle that is not attached to a rod.

    ``pose`` (7,) and ``twist`` (6,) are those of the needle, ``pull`` (6,) the other force and moment
    on it; ``H``, ``Y`` (6, 6) and ``g`` (6,) are scratch.
    """
    p = open_passages(passage_table)
    for c in range(p.filled[0]):
        if p.path[c] == path:
            _begin_passage(p, c)
    R, x, q = p.B, pose[0:3], pose[3:7]
    matrix_of(q[0], q[1], q[2], q[3], R)
    for a in range(3):
        for b in range(3):
            p.A[a, b] = R[a, 0] * inertia[0] * R[b, 0] + R[a, 1] * inertia[1] * R[b, 1] + R[a, 2] * inertia[2] * R[b, 2]
    # Momentum that the free motion has, which the solve starts from.
    for a in range(3):
        g[a] = dt * (mass * twist[a] + dt * pull[a])
        g[3 + a] = dt * (p.A[a, 0] * twist[3] + p.A[a, 1] * twist[4] + p.A[a, 2] * twist[5] + dt * pull[3 + a])
    free = (g[0], g[1], g[2], g[3], g[4], g[5])
    mx, my, mz = 0.0, 0.0, 0.0
    rx, ry, rz = 0.0, 0.0, 0.0
    for _ in range(MAX_STEPS):
        for a in range(6):
            for b in range(6):
                H[a, b] = 0.0
        for a in range(3):
            H[a, a] = mass
            for b in range(3):
                H[3 + a, 3 + b] = p.A[a, b]
            moment = p.A[a, 0] * rx + p.A[a, 1] * ry + p.A[a, 2] * rz
            g[a] = free[a] - mass * (mx if a == 0 else (my if a == 1 else mz))
            g[3 + a] = free[3 + a] - moment
        for c in range(p.filled[0]):
            if p.path[c] == path:
                _add_passage(p, c, x, q, H, g, dt, dt)
        invert_spd6(H, Y)
        for a in range(6):
            s = 0.0
            for b in range(6):
                s += Y[a, b] * g[b]
            H[0, a] = s
        d = H[0]
        mx, my, mz, rx, ry, rz = mx + d[0], my + d[1], mz + d[2], rx + d[3], ry + d[4], rz + d[5]
        for a in range(3):
            x[a] += d[a]
        _turn_row(q, d[3], d[4], d[5])
        changed = False
        for c in range(p.filled[0]):
            if p.path[c] == path:
                changed = _settle_passage(p, c, x, q, dt) or changed
        if not changed:
            break
    for c in range(p.filled[0]):
        if p.path[c] == path:
            _add_passage_impulse(p, c, dt)


@inlined
def _turn_row(q: Array, vx: float, vy: float, vz: float) -> None:
    """Turn the quaternion ``q`` (4,) by a rotation vector."""
    ex, ey, ez, ew = quaternion_of(vx, vy, vz)
    x, y, z, w = multiply(ex, ey, ez, ew, q[0], q[1], q[2], q[3])
    s = 1.0 / math.sqrt(x * x + y * y + z * z + w * w)
    q[0], q[1], q[2], q[3] = s * x, s * y, s * z, s * w


@kernel
def react(passage_table: Integers, site_pose: Array, c: int, out: Array) -> float:
    """Impulse and moment (6,) of passage ``c`` on its hole's body, about that body's centre, to ``out``."""
    p = open_passages(passage_table)
    pose, x, i = site_pose[p.hole[c]], p.x[c], p.impulse[c]
    mx, my, mz = cross(x[0] - pose[0], x[1] - pose[1], x[2] - pose[2], i[0], i[1], i[2])
    out[0], out[1], out[2] = -i[0], -i[1], -i[2]
    out[3], out[4], out[5] = -i[3] - mx, -i[4] - my, -i[5] - mz
    return math.sqrt(i[0] * i[0] + i[1] * i[1] + i[2] * i[2])
