"""A whole tick in one call, and what it gives back: impulses on bodies, tension of elements.

World axes, SI units.
"""

from __future__ import annotations

import math

from ligature.suture.chain import add_joint_force
from ligature.suture.compiled import inlined, kernel
from ligature.suture.contacts import detect
from ligature.suture.coupling import lever_of
from ligature.suture.rotations import cross, matrix_of, rotate
from ligature.suture.tick import advance


@kernel
def bond(nodes, work, touches, i, k, points):
    """Add bonds that hold ``points`` (m, 2, 3), given in the frames of nodes i and k, together this tick."""
    for node in (i, k):
        matrix_of(nodes.q[node, 0], nodes.q[node, 1], nodes.q[node, 2], nodes.q[node, 3], work.R[node])
    for m in range(points.shape[0]):
        c = touches.count[0]
        if c == touches.node.shape[0]:
            return
        touches.count[0] = c + 1
        touches.key[c] = -1
        touches.node[c, 0], touches.node[c, 1] = i, k
        touches.bond[c], touches.closed[c] = True, True
        touches.target[c], touches.friction[c], touches.press[c] = 0.0, 0.0, 0.0
        for s in range(2):
            node = touches.node[c, s]
            rx, ry, rz = rotate(work.R[node], points[m, s, 0], points[m, s, 1], points[m, s, 2])
            touches.arm[c, s] = 0.0
            touches.start[c, s, 0] = nodes.x[node, 0] + rx
            touches.start[c, s, 1] = nodes.x[node, 1] + ry
            touches.start[c, s, 2] = nodes.x[node, 2] + rz
            for a in range(3):
                touches.local[c, s, a] = points[m, s, a]
        touches.normal[c, 0], touches.normal[c, 1], touches.normal[c, 2] = 1.0, 0.0, 0.0
        touches.gap[c] = touches.start[c, 0, 0] - touches.start[c, 1, 0]
        touches.slip[c, 0] = 0.0
        for a in range(1, 3):
            touches.slip[c, a] = touches.start[c, 0, a] - touches.start[c, 1, a]


@inlined
def _joint_load(n, work, joints, i, out):
    """Total force and moment (6,) of the joints on the centre of chain node ``i``, times dt²."""
    for a in range(6):
        out[a] = 0.0
    if i < n - 1:
        add_joint_force(joints.load[i], work.lever[i, 0], work.B[i], 1.0, out)
    if i > 0:
        add_joint_force(joints.load[i - 1], work.lever[i - 1, 1], work.B[i - 1], -1.0, out)


@inlined
def _react(n, total, nodes, joints, touches, work, impulse, dt):
    """Impulse (N s) and its moment about the centre of mass on every node, from joints and contacts."""
    for i in range(total):
        if i < n:
            _joint_load(n, work, joints, i, impulse[i])
            for a in range(6):
                impulse[i, a] /= dt
        else:
            for a in range(6):
                impulse[i, a] = 0.0
    for c in range(touches.count[0]):
        if not touches.closed[c]:
            continue
        f = touches.force[c]
        for s in range(2):
            i = touches.node[c, s]
            sign = dt if s == 0 else -dt
            rx, ry, rz = lever_of(work, touches, c, s)
            mx, my, mz = cross(rx, ry, rz, f[0], f[1], f[2])
            impulse[i, 0] += sign * f[0]
            impulse[i, 1] += sign * f[1]
            impulse[i, 2] += sign * f[2]
            impulse[i, 3] += sign * mx
            impulse[i, 4] += sign * my
            impulse[i, 5] += sign * mz


@inlined
def _pull(first, n, joints, work, tension, dt):
    """Tension of each element in newtons: the mean pull of its joints along it, positive when taut."""
    for e in range(tension.shape[0]):
        i = first + e
        near = work.lever[i - 1, 1] if i > 0 else work.lever[i, 0]
        far = work.lever[i, 0] if i < n - 1 else work.lever[i - 1, 1]
        ux, uy, uz = far[0] - near[0], far[1] - near[1], far[2] - near[2]
        if i == 0:
            ux, uy, uz = far[0], far[1], far[2]
        elif i == n - 1:
            ux, uy, uz = -near[0], -near[1], -near[2]
        pull, joined = 0.0, 0
        for j in (i - 1, i):
            if 0 <= j < n - 1:
                joined += 1
                f = joints.load[j]
                pull += f[0] * ux + f[1] * uy + f[2] * uz
        tension[e] = pull / (joined * math.sqrt(ux * ux + uy * uy + uz * uz) * dt * dt)


@kernel
def run_tick(
    first, n, total, nodes, joints, shapes, old, new, work, counts, self_skip, stiffness, impulse, tension, dt
):
    """One tick of a rod of ``len(tension)`` elements from node ``first`` on; returns the Newton steps taken."""
    detect(first, tension.shape[0], nodes, shapes, old, new, work, counts, self_skip, dt)
    steps = advance(n, total, nodes, joints, new, work, stiffness, dt)
    _react(n, total, nodes, joints, new, work, impulse, dt)
    _pull(first, n, joints, work, tension, dt)
    return steps
