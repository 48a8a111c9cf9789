"""A step that converges where many contacts of a light thread open and close at once.

Newton's method with an active set may then circle for ever. With the friction limits given (Tresca's law), a linearised
step is the minimum of a convex energy: of the motion, of joints, and of the springs and bristles of contacts. Newton's
method with an exact line search finds it, mostly in two to seven steps. Coulomb's law follows by repetition: each
minimum has pressures, and so the friction limits of the next one (Panagiotopoulos 1975). Taken in full, the limits of
contacts that lift each other off may alternate; taken by half, they converge. World axes, SI units.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.rotations import cross, rotate
from ligature.suture.coupled_solve import solve_coupled
from ligature.suture.coupling import add_closed, conclude_contacts, open_contacts, rigid
from ligature.suture.layout import Joints, Nodes, Touches, Work
from ligature.suture.passage_forces import add_passage_forces, settle_passages
from ligature.suture.passages import Passages
from ligature.suture.springs import Springs, add_springs, settle_springs
from ligature.suture.step import LARGE_SWING, assemble, correct, finish, linearise, predict
from ligature.tables import copy_into

Array = NDArray[np.float64]


MAX_LINEARISATIONS, MAX_SOLVES = 8, 150
"""Most times that the geometry is linearised in a careful step, and most solves in all."""

BALANCED = 1e-4
"""Error of a contact force, as a share of the largest, up to which the energy counts as least."""

UNCHANGED, UNFELT = 0.02, 5e-4
"""Error of a friction limit, as a share of its own, up to which Coulomb's law counts as met; and as one of the largest,
which counts for nothing."""

NOTHING = 1e-12
"""Depth of a contact, metres, by whose force errors count where the largest is less, 0.13 µN for a thread of 0.3 mm:
nothing is small against the force of contacts that have all lifted off."""

RELAXATION = 0.5
"""Share of the way to the friction limits that a minimum asks for, by which the next one's go."""

MAX_CG, CG_TOLERANCE = 120, 1e-12
"""Iterations of the coupling, and the residual energy at which it is solved, relative to the first."""

NEAR, HALVINGS = 0.1, 30
"""Slope of the energy, as a share of the first, at which the line search ends; and the most halvings until then."""


@inlined
def _slip(touches: Touches, c: int, ux: float, uy: float, uz: float) -> tuple[float, float, float, float]:
    """Gap beyond the target, or of a bilateral contact, and slip (3) of contact ``c`` after the displacement u."""
    n, begun = touches.normal[c], touches.begun[c]
    un = ux * n[0] + uy * n[1] + uz * n[2]
    room = touches.room[c] + un
    if touches.bilateral[c]:
        room += touches.target[c]
    return room, begun[0] + ux - un * n[0], begun[1] + uy - un * n[1], begun[2] + uz - un * n[2]


@inlined
def _springs_of(
    touches: Touches, work: Work, c: int, stiffness: float, room: float, size: float
) -> tuple[float, float]:
    """Stiffness along the normal, and force by slip, of contact ``c`` with a slip of ``size``; N/m."""
    if rigid(touches, c):
        return stiffness, stiffness
    normal = stiffness if room < 0.0 or touches.bilateral[c] else 0.0
    limit = work.limit[c]
    if size * stiffness < limit:
        return normal, stiffness
    return normal, limit / size if size > 0.0 else 0.0


@inlined
def _force(
    touches: Touches, work: Work, c: int, ux: float, uy: float, uz: float, stiffness: float
) -> tuple[float, float, float]:
    """Force of contact ``c`` on its element, N, after the displacement u, with the friction limit ``work.limit``."""
    n = touches.normal[c]
    room, wx, wy, wz = _slip(touches, c, ux, uy, uz)
    normal, s = _springs_of(touches, work, c, stiffness, room, math.sqrt(wx * wx + wy * wy + wz * wz))
    press = -normal * room
    return press * n[0] - s * wx, press * n[1] - s * wy, press * n[2] - s * wz


@kernel
def add_tangents(nodes: Nodes, touches: Touches, work: Work, stiffness: float, dt: float) -> None:
    """Add all contacts to ``work.H`` and ``work.g``, linear about the displacements ``work.moved``."""
    dt2 = dt * dt
    for c in range(touches.count[0]):
        K, f, begun, n = work.K[c], touches.push[c], touches.begun[c], touches.normal[c]
        u, w = work.moved[c], touches.ended[c]
        room, wx, wy, wz = _slip(touches, c, u[0], u[1], u[2])
        square = wx * wx + wy * wy + wz * wz
        normal, s = _springs_of(touches, work, c, stiffness, room, math.sqrt(square))
        touches.closed[c] = normal > 0.0 or s > 0.0
        slips = s < stiffness and square > 0.0
        # Where it slips, the force turns with the slip but does not grow with it.
        turn = dt2 * s / square if slips else 0.0
        onward = turn * (wx * begun[0] + wy * begun[1] + wz * begun[2]) - (dt2 * s if slips else 0.0)
        press = -dt2 * normal * (room - (u[0] * n[0] + u[1] * n[1] + u[2] * n[2]))
        w[0], w[1], w[2] = wx, wy, wz
        for a in range(3):
            for b in range(3):
                K[a, b] = dt2 * (normal - s) * n[a] * n[b] - turn * w[a] * w[b]
            K[a, a] += dt2 * s
            f[a] = press * n[a] - dt2 * s * begun[a] + onward * w[a]
        if touches.closed[c]:
            add_closed(nodes, touches, work, c)


@kernel
def find_displacements(nodes: Nodes, touches: Touches, work: Work, dt: float) -> None:
    """Displacements ``work.aim`` and forces ``work.solved`` (N) of the contacts, by the last solve."""
    per_dt2 = 1.0 / (dt * dt)
    for c in range(touches.count[0]):
        u, f, solved = work.aim[c], touches.push[c], work.solved[c]
        for a in range(3):
            u[a] = 0.0
        for s in range(2):
            i, r, sign = touches.node[c, s], work.arms[c, s], 1.0 if s == 0 else -1.0
            if nodes.fixed[i]:
                continue
            d = work.d[i]
            rx, ry, rz = cross(d[3], d[4], d[5], r[0], r[1], r[2])
            u[0], u[1], u[2] = u[0] + sign * (d[0] + rx), u[1] + sign * (d[1] + ry), u[2] + sign * (d[2] + rz)
        kx, ky, kz = rotate(work.K[c], u[0], u[1], u[2])
        solved[0], solved[1], solved[2] = per_dt2 * (f[0] - kx), per_dt2 * (f[1] - ky), per_dt2 * (f[2] - kz)


@inlined
def _slope(touches: Touches, work: Work, stiffness: float, share: float) -> float:
    """Slope of the energy after a ``share`` of the way from ``work.moved`` to ``work.aim``, N m.

    All but contacts is linear, and in balance with ``touches.force`` at one end and ``work.solved`` at the other.
    """
    slope = 0.0
    for c in range(touches.count[0]):
        u, v, held, solved = work.moved[c], work.aim[c], touches.force[c], work.solved[c]
        x, y, z = v[0] - u[0], v[1] - u[1], v[2] - u[2]
        fx, fy, fz = _force(touches, work, c, u[0] + share * x, u[1] + share * y, u[2] + share * z, stiffness)
        slope += x * (held[0] + share * (solved[0] - held[0]) - fx)
        slope += y * (held[1] + share * (solved[1] - held[1]) - fy)
        slope += z * (held[2] + share * (solved[2] - held[2]) - fz)
    return slope


@kernel
def least_share(touches: Touches, work: Work, stiffness: float) -> float:
    """Share of the way from ``work.moved`` to ``work.aim`` at which the energy is least."""
    begin = _slope(touches, work, stiffness, 0.0)
    # Newton's direction leads down; where rounding hides it, the end is as good.
    if begin >= 0.0 or _slope(touches, work, stiffness, 1.0) <= -NEAR * begin:
        return 1.0
    low, high, share = 0.0, 1.0, 0.5
    for _ in range(HALVINGS):
        share = 0.5 * (low + high)
        slope = _slope(touches, work, stiffness, share)
        if abs(slope) <= -NEAR * begin:
            break
        if slope < 0.0:
            low = share
        else:
            high = share
    return share


@inlined
def _towards(a: float, b: float, share: float) -> float:
    """A ``share`` of the way from ``a`` to ``b``; at the end ``b`` to the bit, even where ``a`` is of another tick."""
    return b if share == 1.0 else a + share * (b - a)


@kernel
def go(n: int, total: int, nodes: Nodes, joints: Joints, touches: Touches, work: Work, share: float) -> None:
    """Take displacements, forces, loads and corrections by a ``share`` to what was solved."""
    for c in range(touches.count[0]):
        for a in range(3):
            work.moved[c, a] = _towards(work.moved[c, a], work.aim[c, a], share)
            touches.force[c, a] = _towards(touches.force[c, a], work.solved[c, a], share)
    for i in range(total):
        if nodes.met[i]:
            for a in range(6):
                work.taken[i, a] = _towards(work.taken[i, a], work.d[i, a], share)
    for j in range(n - 1):
        for a in range(6):
            joints.load[j, a] = _towards(joints.load[j, a], work.load[j, a], share)


@kernel
def in_balance(touches: Touches, work: Work, stiffness: float) -> bool:
    """Whether the contacts have the forces that the balance of all else asks for."""
    error, largest = 0.0, 0.0
    for c in range(touches.count[0]):
        u, held = work.moved[c], touches.force[c]
        fx, fy, fz = _force(touches, work, c, u[0], u[1], u[2], stiffness)
        error = max(error, abs(fx - held[0]), abs(fy - held[1]), abs(fz - held[2]))
        largest = max(largest, abs(fx), abs(fy), abs(fz))
    return error <= BALANCED * max(largest, NOTHING * stiffness)


@kernel
def settle_limits(touches: Touches, work: Work, stiffness: float) -> bool:
    """Pressures of the contacts, and whether they bear out the friction limits; if not, the next ones."""
    largest, error = 0.0, 0.0
    for c in range(touches.count[0]):
        if touches.bilateral[c]:
            continue
        u = work.moved[c]
        room, _x, _y, _z = _slip(touches, c, u[0], u[1], u[2])
        touches.press[c] = max(-stiffness * room, 0.0)
        limit = touches.friction[c] * touches.press[c]
        error, largest = max(error, abs(limit - work.limit[c]) - UNCHANGED * limit), max(largest, limit)
    none = NOTHING * stiffness
    if error <= UNFELT * max(largest, none):
        return True
    # Where nothing presses any more the limits go at once: halved, they would count for many solves.
    share = RELAXATION if largest > none else 1.0
    for c in range(touches.count[0]):
        if not touches.bilateral[c]:
            limit = touches.friction[c] * touches.press[c]
            work.limit[c] += share * (limit - work.limit[c])
    return False


@inlined
def _solve_linearised(
    n: int, total: int, nodes: Nodes, joints: Joints, touches: Touches, work: Work, stiffness: float, dt: float,
    most: int,
) -> tuple[int, bool]:  # fmt: skip
    """Correction ``work.d`` of the linearised step whose equations without contacts are kept in ``work``.

    Returns the solves, ``most`` at most, and whether they converged.
    """
    for c in range(touches.count[0]):
        for a in range(3):
            work.moved[c, a] = 0.0
    solves, settled = 0, False
    while solves < most and not settled:
        copy_into(work.H, work.own_matrix)
        copy_into(work.g, work.own_load)
        add_tangents(nodes, touches, work, stiffness, dt)
        solve_coupled(n, total, nodes, touches, work, MAX_CG, CG_TOLERANCE)
        find_displacements(nodes, touches, work, dt)
        # Where it begins nothing is in balance, so that the first solve counts in full.
        go(n, total, nodes, joints, touches, work, 1.0 if solves == 0 else least_share(touches, work, stiffness))
        solves += 1
        if in_balance(touches, work, stiffness):
            settled = settle_limits(touches, work, stiffness)
    copy_into(work.d, work.taken)
    return solves, settled


@inlined
def _conclude_forces(touches: Touches, work: Work) -> None:
    """Pressures of the contacts and slips at the end, and which are closed: those with a force."""
    for c in range(touches.count[0]):
        u, w, f, n = work.moved[c], touches.ended[c], touches.force[c], touches.normal[c]
        _room, w[0], w[1], w[2] = _slip(touches, c, u[0], u[1], u[2])
        if not touches.bilateral[c]:
            touches.closed[c] = f[0] != 0.0 or f[1] != 0.0 or f[2] != 0.0
            touches.press[c] = max(f[0] * n[0] + f[1] * n[1] + f[2] * n[2], 0.0)


@kernel
def advance_carefully(
    n: int, total: int, nodes: Nodes, joints: Joints, touches: Touches, work: Work, passages: Passages, owner: int,
    springs: Springs, stiffness: float, dt: float, damped: bool, elapsed: float,
) -> tuple[int, bool]:  # fmt: skip
    """Like `ligature.suture.step.advance`, for a step that does not settle there."""
    predict(total, nodes, work, dt, damped)
    for c in range(touches.count[0]):
        work.limit[c] = touches.friction[c] * touches.press[c]
    solves, settled, rounds = 0, False, 0
    while rounds < MAX_LINEARISATIONS and solves < MAX_SOLVES and not settled:
        rounds += 1
        linearise(n, total, nodes, joints, work, dt)
        assemble(n, total, nodes, joints, work)
        add_passage_forces(passages, owner, nodes, work, elapsed, dt)
        add_springs(springs, nodes, work, dt)
        copy_into(work.own_matrix, work.H)
        copy_into(work.own_load, work.g)
        open_contacts(nodes, touches, work)
        more, settled = _solve_linearised(n, total, nodes, joints, touches, work, stiffness, dt, MAX_SOLVES - solves)
        solves += more
        largest = correct(n, total, nodes, work)
        changed = settle_passages(passages, owner, nodes, elapsed)
        settled = settled and largest < LARGE_SWING and not changed
    _conclude_forces(touches, work)
    settle_springs(springs, nodes)
    conclude_contacts(touches, stiffness)
    finish(n, total, nodes, joints, work, dt)
    return solves, settled
