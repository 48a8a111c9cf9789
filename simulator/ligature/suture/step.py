"""One step of a rod: free motion, then Newton steps on joints, contacts and friction at the step's end.

Implicit Euler in the form of XPBD (Macklin et al. 2016): with the multipliers scaled by dt², every
force law is evaluated at the end of the tick, so that stiff springs and heavy pulls stay stable at any
mass. The tension's own stiffness (Tournier et al., Stable Constrained Dynamics, 2015) is part of
the matrix: without it a light thread under load shakes itself apart. World axes, SI units.
"""

from __future__ import annotations

import math

from ligature.kernels import inlined, kernel
from ligature.rotations import (
    cross,
    left_jacobian_inverse_times,
    matrix_of,
    multiply,
    rotate,
    rotation_vector,
    turn,
)
from ligature.suture.coupled_solve import solve_coupled
from ligature.suture.coupling import add_contacts, conclude_contacts, settle_contacts
from ligature.suture.layout import Joints, Nodes, Touches, Work
from ligature.suture.passage_forces import add_passage_forces, settle_passages
from ligature.suture.passages import Passages
from ligature.suture.springs import Springs, add_springs, settle_springs

MAX_NEWTON = 8
"""Most Newton steps of a tick; one is the rule, more follow large turns and changing contacts."""

LARGE_SWING = 5e-3
"""Swing of an element in radians, in one Newton step, after which another follows."""

MAX_SWING = 0.5
"""Largest swing of a Newton step; larger ones are shortened."""


@kernel
def predict(total: int, nodes: Nodes, work: Work, dt: float, damped: bool) -> None:
    """Start poses to ``work.x``, those after free motion to ``work.xp``; ``nodes`` go on as before.

    Newton's method begins without the fall by gravity: of what lies on something, contacts take it all up, and friction
    would see the nodes slide down any slope that they fall into. Damping of a whole tick is taken off in its ``damped``
    step.
    """
    for i in range(total):
        if not nodes.met[i]:
            continue
        slow, still = (nodes.keep[i, 0], nodes.keep[i, 1]) if damped else (1.0, 1.0)
        for a in range(3):
            work.x[i, a] = nodes.x[i, a]
            fall = 0.0
            if not nodes.fixed[i]:
                nodes.v[i, a] *= slow
                nodes.w[i, a] *= still
                fall = dt * dt * nodes.gravity[i, a]
            nodes.x[i, a] += dt * nodes.v[i, a]
            work.xp[i, a] = nodes.x[i, a] + fall
        for a in range(4):
            work.q[i, a] = nodes.q[i, a]
        turn(nodes.q, i, dt * nodes.w[i, 0], dt * nodes.w[i, 1], dt * nodes.w[i, 2])
        for a in range(4):
            work.qp[i, a] = nodes.q[i, a]


@inlined
def joint_angle(nodes: Nodes, joints: Joints, j: int) -> tuple[float, float, float, float, float, float, float]:
    """Rotation vector of joint ``j`` in its own frame: the six-DOF coordinates, second-order exact."""
    ax, ay, az, aw = multiply(
        nodes.q[j, 0], nodes.q[j, 1], nodes.q[j, 2], nodes.q[j, 3],
        joints.frame[j, 0, 0], joints.frame[j, 0, 1], joints.frame[j, 0, 2], joints.frame[j, 0, 3],
    )  # fmt: skip
    bx, by, bz, bw = multiply(
        nodes.q[j + 1, 0], nodes.q[j + 1, 1], nodes.q[j + 1, 2], nodes.q[j + 1, 3],
        joints.frame[j, 1, 0], joints.frame[j, 1, 1], joints.frame[j, 1, 2], joints.frame[j, 1, 3],
    )  # fmt: skip
    dx, dy, dz, dw = multiply(-ax, -ay, -az, aw, bx, by, bz, bw)
    vx, vy, vz = rotation_vector(dx, dy, dz, dw)
    return vx, vy, vz, ax, ay, az, aw


@inlined
def _axis_row(joints: Joints, j: int, a: int, angle: float, dt: float) -> tuple[float, float]:
    """Stiffness and moment of one axis of a joint's spring, damper and stop, both times dt²."""
    k, d = joints.stiffness[j, a] * dt * dt, joints.damping[j, a] * dt
    s = k + d
    moment = k * (angle - joints.rest[j, a]) + d * (angle - joints.angle[j, a])
    low, high = joints.low[j, a], joints.high[j, a]
    if low <= high and (angle < low or angle > high):
        stop = joints.stop[j] * dt * dt
        s += stop
        moment += stop * (angle - (low if angle < low else high))
    return s, moment


@kernel
def linearise(n: int, total: int, nodes: Nodes, joints: Joints, work: Work, dt: float) -> None:
    """Levers, axes and rows of all joints at the present poses, but for the errors that are `Work.left`."""
    per_dt2 = 1.0 / (dt * dt)
    for i in range(total):
        if nodes.met[i]:
            matrix_of(nodes.q[i, 0], nodes.q[i, 1], nodes.q[i, 2], nodes.q[i, 3], work.R[i])
    for j in range(n - 1):
        for side in range(2):
            px, py, pz = joints.pivot[j, side, 0], joints.pivot[j, side, 1], joints.pivot[j, side, 2]
            rx, ry, rz = rotate(work.R[j + side], px, py, pz)
            work.lever[j, side, 0], work.lever[j, side, 1], work.lever[j, side, 2] = rx, ry, rz
        for a in range(3):
            work.c[j, a] = nodes.x[j, a] + work.lever[j, 0, a] - nodes.x[j + 1, a] - work.lever[j, 1, a]
            work.compliance[j, a] = joints.compliance[j] * per_dt2
        vx, vy, vz, ax, ay, az, aw = joint_angle(nodes, joints, j)
        B = work.B[j]
        matrix_of(-ax, -ay, -az, aw, B)
        for a in range(3):
            B[0, a], B[1, a], B[2, a] = left_jacobian_inverse_times(vx, vy, vz, B[0, a], B[1, a], B[2, a])
        for a in range(3):
            s, moment = _axis_row(joints, j, a, vx if a == 0 else (vy if a == 1 else vz), dt)
            s = max(s, 1e-30)
            work.compliance[j, 3 + a] = 1.0 / s
            work.c[j, 3 + a] = moment / s
    if n > 1:
        for a in range(6):
            work.c[0, a] -= work.left[0, a]
            work.c[n - 2, a] -= work.left[1, a]


@kernel
def assemble(n: int, total: int, nodes: Nodes, joints: Joints, work: Work) -> None:
    """Node matrices H (inertia, stiffness of the tension) and loads g (of the free motion)."""
    for i in range(total):
        if not nodes.met[i]:
            continue
        H, R = work.H[i], work.R[i]
        m = nodes.mass[i]
        for a in range(6):
            for b in range(6):
                H[a, b] = 0.0
            work.g[i, a] = 0.0
        if nodes.fixed[i]:
            continue
        i0, i1, i2 = nodes.inertia[i, 0], nodes.inertia[i, 1], nodes.inertia[i, 2]
        for a in range(3):
            H[a, a] = m
            for b in range(3):
                H[3 + a, 3 + b] = R[a, 0] * i0 * R[b, 0] + R[a, 1] * i1 * R[b, 1] + R[a, 2] * i2 * R[b, 2]
        x, y, z, w = multiply(
            nodes.q[i, 0], nodes.q[i, 1], nodes.q[i, 2], nodes.q[i, 3],
            -work.qp[i, 0], -work.qp[i, 1], -work.qp[i, 2], work.qp[i, 3],
        )  # fmt: skip
        ex, ey, ez = rotation_vector(x, y, z, w)
        for a in range(3):
            work.g[i, a] = -m * (nodes.x[i, a] - work.xp[i, a])
            work.g[i, 3 + a] = -(H[3 + a, 3] * ex + H[3 + a, 4] * ey + H[3 + a, 5] * ez)
        if i < n:
            _stiffen_by_tension(n, joints, work, i)


@inlined
def _stiffen_by_tension(n: int, joints: Joints, work: Work, i: int) -> None:
    """Add the resistance to turning that the forces at a node's pivots bring, as far as it is positive."""
    lever, load = work.lever, joints.load
    g, ux, uy, uz = 0.0, 0.0, 0.0, 0.0
    if i < n - 1:
        ux, uy, uz = lever[i, 0, 0], lever[i, 0, 1], lever[i, 0, 2]
        g = ux * load[i, 0] + uy * load[i, 1] + uz * load[i, 2]
    if i > 0:
        rx, ry, rz = lever[i - 1, 1, 0], lever[i - 1, 1, 1], lever[i - 1, 1, 2]
        g -= rx * load[i - 1, 0] + ry * load[i - 1, 1] + rz * load[i - 1, 2]
        ux, uy, uz = ux - rx, uy - ry, uz - rz
    square = ux * ux + uy * uy + uz * uz
    if g > 0.0 and square > 0.0:
        s = g / square
        H = work.H
        H[i, 3, 3] += g - s * ux * ux
        H[i, 4, 4] += g - s * uy * uy
        H[i, 5, 5] += g - s * uz * uz
        H[i, 4, 3] -= s * ux * uy
        H[i, 5, 3] -= s * ux * uz
        H[i, 5, 4] -= s * uy * uz
        H[i, 3, 4], H[i, 3, 5], H[i, 4, 5] = H[i, 4, 3], H[i, 5, 3], H[i, 5, 4]


@kernel
def correct(n: int, total: int, nodes: Nodes, work: Work) -> float:
    """Move all nodes by the correction ``work.d``; returns the largest swing of a lever.

    Rolling about the line between its pivots moves no pivot, and does not count.
    """
    largest = 0.0
    for i in range(n):
        if nodes.fixed[i]:
            continue
        d = work.d[i]
        j, side = (i, 0) if i < n - 1 else (i - 1, 1)
        rx, ry, rz = work.lever[j, side, 0], work.lever[j, side, 1], work.lever[j, side, 2]
        sx, sy, sz = cross(d[3], d[4], d[5], rx, ry, rz)
        arm = rx * rx + ry * ry + rz * rz
        if arm > 0.0:
            largest = max(largest, (sx * sx + sy * sy + sz * sz) / arm)
    largest = math.sqrt(largest)
    scale = 1.0 if largest < MAX_SWING else MAX_SWING / largest
    for i in range(total):
        if nodes.fixed[i] or not nodes.met[i]:
            continue
        for a in range(3):
            nodes.x[i, a] += scale * work.d[i, a]
        turn(nodes.q, i, scale * work.d[i, 3], scale * work.d[i, 4], scale * work.d[i, 5])
    return largest


@kernel
def finish(n: int, total: int, nodes: Nodes, joints: Joints, work: Work, dt: float) -> None:
    """Velocities from the motion of the tick, and the joint angles that damping starts from next."""
    for i in range(total):
        if nodes.fixed[i] or not nodes.met[i]:
            continue
        x, y, z, w = multiply(
            nodes.q[i, 0], nodes.q[i, 1], nodes.q[i, 2], nodes.q[i, 3],
            -work.q[i, 0], -work.q[i, 1], -work.q[i, 2], work.q[i, 3],
        )  # fmt: skip
        ex, ey, ez = rotation_vector(x, y, z, w)
        nodes.w[i, 0], nodes.w[i, 1], nodes.w[i, 2] = ex / dt, ey / dt, ez / dt
        for a in range(3):
            nodes.v[i, a] = (nodes.x[i, a] - work.x[i, a]) / dt
    for j in range(n - 1):
        vx, vy, vz, _ax, _ay, _az, _aw = joint_angle(nodes, joints, j)
        joints.angle[j, 0], joints.angle[j, 1], joints.angle[j, 2] = vx, vy, vz


@kernel
def advance(
    n: int, total: int, nodes: Nodes, joints: Joints, touches: Touches, work: Work, passages: Passages, owner: int,
    springs: Springs, stiffness: float, dt: float, damped: bool, elapsed: float,
) -> tuple[int, bool]:  # fmt: skip
    """One step of ``total`` nodes, the first ``n`` of them a chain.

    It ends ``elapsed`` seconds after the tick began. ``passages`` are those of all rods; this one is ``owner``, with
    ``springs`` of its own.

    Returns the Newton steps taken and whether contacts and shape settled. Contacts in ``touches`` were
    found at the poses of the step's start; ``stiffness`` is theirs (N/m).
    """
    predict(total, nodes, work, dt, damped)
    steps, settled = 0, False
    while steps < MAX_NEWTON and not settled:
        steps += 1
        linearise(n, total, nodes, joints, work, dt)
        assemble(n, total, nodes, joints, work)
        add_contacts(nodes, touches, work, stiffness, dt)
        add_passage_forces(passages, owner, nodes, work, elapsed, dt)
        add_springs(springs, nodes, work, dt)
        solve_coupled(n, total, nodes, touches, work)
        changed = settle_contacts(nodes, touches, work, stiffness, dt)
        largest = correct(n, total, nodes, work)
        changed = settle_passages(passages, owner, nodes, elapsed) or changed
        for j in range(n - 1):
            for a in range(6):
                joints.load[j, a] = work.load[j, a]
        settled = largest < LARGE_SWING and not changed
    settle_springs(springs, nodes)
    conclude_contacts(touches, stiffness)
    finish(n, total, nodes, joints, work, dt)
    return steps, settled
