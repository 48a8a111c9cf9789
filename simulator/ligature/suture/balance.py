"""What keeps a step whose contacts do not settle from adding energy to a rod.

Implicit Euler minimises an energy: of the motion against the free motion, of joints, and of the springs of contacts.
Newton's method with an active set of contacts may circle about its minimum for ever, and where many contacts of a
light thread open and close, each iterate may lie far above it: a step that ends there throws the thread. So a
careful step begins where the thread is, and follows each Newton step only as far as this energy falls (an exact line
search). However early it ends, the energy is not above that at its start. Between two solutions of the linear system
all but contacts is in balance, so that the slope of the energy is a sum over contacts. World axes, SI units.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.suture.coupling import opening, push, rigid
from ligature.suture.layout import Joints, Nodes, Touches, Work
from ligature.suture.reactions import joint_load

Array = NDArray[np.float64]

BALANCED = 0.1
"""Slope of the energy at the end of a Newton step, as a share of that at its begin, up to which it is taken in full."""

HALVINGS = 8
"""Of the Newton step, in the search for the least energy along it."""


@kernel
def return_to_start(total: int, nodes: Nodes, touches: Touches, work: Work) -> None:
    """Put what can move back to where the step starts, where no joint is stretched by the free motion."""
    for i in range(total):
        if nodes.fixed[i] or not nodes.met[i]:
            continue
        for a in range(3):
            nodes.x[i, a] = work.x[i, a]
        for a in range(4):
            nodes.q[i, a] = work.q[i, a]
    for c in range(touches.count[0]):
        for a in range(3):
            touches.force[c, a] = 0.0


@kernel
def find_imbalance(n: int, total: int, nodes: Nodes, joints: Joints, touches: Touches, work: Work) -> None:
    """Loads on all nodes but those of contacts, at the poses of ``work.g``, to ``work.unbalanced``.

    ``joints.load`` receives those of the joints there.
    """
    for j in range(n - 1):
        for a in range(6):
            joints.load[j, a] = -work.c[j, a] / work.compliance[j, a]
    for i in range(total):
        load = work.unbalanced[i]
        for a in range(6):
            load[a] = work.g[i, a] if nodes.met[i] and not nodes.fixed[i] else 0.0
        if i < n:
            joint_load(n, work, joints, i, work.sum6)
            for a in range(6):
                load[a] += work.sum6[a]
    for c in range(touches.count[0]):
        if not touches.closed[c]:
            continue
        f, arms = touches.push[c], work.arms[c]
        for s in range(2):
            sign = -1.0 if s == 0 else 1.0
            push(work.unbalanced[touches.node[c, s]], sign, f[0], f[1], f[2], arms[s, 0], arms[s, 1], arms[s, 2])


@inlined
def _pull(total: int, nodes: Nodes, work: Work, dt: float) -> float:
    """Slope of the energy without contacts along the correction ``work.d``, at the start of the step; N m."""
    s = 0.0
    for i in range(total):
        if nodes.fixed[i] or not nodes.met[i]:
            continue
        for a in range(6):
            s -= work.unbalanced[i, a] * work.d[i, a]
    return s / (dt * dt)


@inlined
def _work_along(touches: Touches, c: int, u: Array, share: float, stiffness: float) -> float:
    """Work of the force of contact ``c``, after a ``share`` of its displacement ``u`` (3,), along all of it."""
    n, begun = touches.normal[c], touches.begun[c]
    un = u[0] * n[0] + u[1] * n[1] + u[2] * n[2]
    wx, wy, wz = u[0] - un * n[0], u[1] - un * n[1], u[2] - un * n[2]
    tx, ty, tz = begun[0] + share * wx, begun[1] + share * wy, begun[2] + share * wz
    room = touches.room[c] + share * un
    if touches.bilateral[c]:
        room += touches.target[c]
    elif room > 0.0:
        room = 0.0
    bristle = 0.0
    if rigid(touches, c):
        bristle = stiffness
    elif touches.closed[c]:
        size = math.sqrt(tx * tx + ty * ty + tz * tz)
        limit = touches.friction[c] * touches.press[c]
        bristle = stiffness if size * stiffness <= limit else limit / size
    return -stiffness * room * un - bristle * (wx * tx + wy * ty + wz * tz)


@inlined
def _slope(touches: Touches, work: Work, stiffness: float, share: float, pull: float) -> float:
    """Slope of the energy along a Newton step, after a ``share`` of it.

    Where it begins, `Touches.force` balances all but contacts and the ``pull``; where it ends, ``work.solved`` does.
    """
    slope = (1.0 - share) * pull
    for c in range(touches.count[0]):
        u, held, solved = work.moved[c], touches.force[c], work.solved[c]
        for a in range(3):
            slope += u[a] * ((1.0 - share) * held[a] + share * solved[a])
        slope -= _work_along(touches, c, u, share, stiffness)
    return slope


@kernel
def balanced_share(
    total: int, nodes: Nodes, touches: Touches, work: Work, stiffness: float, dt: float, left: float
) -> float:
    """Share of the Newton step ``work.d`` at which the energy is least.

    ``left`` is the share of ``work.unbalanced`` that the Newton steps before have left.
    """
    pull = left * _pull(total, nodes, work, dt) if left > 0.0 else 0.0
    begin = _slope(touches, work, stiffness, 0.0, pull)
    if begin >= 0.0:
        return 0.0
    if _slope(touches, work, stiffness, 1.0, pull) <= -BALANCED * begin:
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        share = 0.5 * (low + high)
        if _slope(touches, work, stiffness, share, pull) < 0.0:
            low = share
        else:
            high = share
    return 0.5 * (low + high)


@kernel
def energy_of_contacts(touches: Touches, stiffness: float) -> float:
    """Energy in joules that the springs of contacts can give back in a step, from the last one."""
    s = 0.0
    for c in range(touches.count[0]):
        slip = touches.slip[c]
        if not touches.bilateral[c]:
            s += 0.25 * touches.press[c] ** 2 / stiffness
            s += 0.25 * stiffness * (slip[0] ** 2 + slip[1] ** 2 + slip[2] ** 2)
    return s


@kernel
def work_of_contacts(nodes: Nodes, touches: Touches, work: Work, stiffness: float) -> float:
    """Energy in joules that contacts gave to what they touch in a step, with that of the overlaps that it left."""
    given = 0.0
    for c in range(touches.count[0]):
        if touches.bilateral[c]:
            continue
        n, f, slip = touches.normal[c], touches.force[c], touches.slip[c]
        gap, wx, wy, wz, _ax, _ay, _az, _bx, _by, _bz = opening(nodes, work, touches, c)
        press, room = f[0] * n[0] + f[1] * n[1] + f[2] * n[2], gap - touches.target[c]
        given += press * (gap - touches.gap[c])
        given += f[0] * (wx - slip[0]) + f[1] * (wy - slip[1]) + f[2] * (wz - slip[2])
        if press == 0.0 and room < 0.0:
            given += 0.5 * stiffness * room * room
    return given
