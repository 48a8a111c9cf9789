"""Results of a step: impulses on bodies and the tension of elements; world axes, SI units."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined
from ligature.rotations import cross
from ligature.suture.coupling import lever_of
from ligature.suture.layout import Joints, Touches, Work

Array = NDArray[np.float64]


@inlined
def _add_joint_force(load: Array, r: Array, B: Array, sign: float, out: Array) -> None:
    """out += sign Xᵀ load: force and moment of a joint on a node's centre."""
    fx, fy, fz = sign * load[0], sign * load[1], sign * load[2]
    out[0] += fx
    out[1] += fy
    out[2] += fz
    out[3] += r[1] * fz - r[2] * fy
    out[4] += r[2] * fx - r[0] * fz
    out[5] += r[0] * fy - r[1] * fx
    for j in range(3):
        out[3 + j] -= sign * (B[0, j] * load[3] + B[1, j] * load[4] + B[2, j] * load[5])


@inlined
def _joint_load(n: int, work: Work, joints: Joints, i: int, out: Array) -> None:
    """Total force and moment (6,) of the joints on the centre of chain node ``i``, times dt²."""
    for a in range(6):
        out[a] = 0.0
    if i < n - 1:
        _add_joint_force(joints.load[i], work.lever[i, 0], work.B[i], 1.0, out)
    if i > 0:
        _add_joint_force(joints.load[i - 1], work.lever[i - 1, 1], work.B[i - 1], -1.0, out)


@inlined
def add_reactions(n: int, joints: Joints, touches: Touches, work: Work, impulse: Array, dt: float) -> None:
    """Add the impulses of joints and contacts on every node to ``impulse``.

    In N s, with the moment about the node's centre.
    """
    for i in range(n):
        _joint_load(n, work, joints, i, work.sum6)
        for a in range(6):
            impulse[i, a] += work.sum6[a] / dt
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
def find_tension(first: int, n: int, joints: Joints, work: Work, tension: Array, dt: float) -> None:
    """Tension of each element in newtons: the mean pull of its joints along it, positive when taut.

    0 for an element whose joints are in one place, which has no direction.
    """
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
        length = math.sqrt(ux * ux + uy * uy + uz * uz)
        tension[e] = pull / (joined * length * dt * dt) if length > 0.0 else 0.0
