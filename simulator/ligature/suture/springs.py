"""Springs that something beside the rods hands to a rod's own solve: what soft tissue does to its nodes.

A spring acts on one node with the force and moment F = load - K d about the node's centre, where d (6,) is the node's
motion since the tick began. World axes, SI units.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.rotations import multiply, rotation_vector
from ligature.suture.layout import Nodes, Work
from ligature.tables import opener

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

CAPACITY = 96
"""Most springs of a rod."""


class Springs(NamedTuple):
    """S springs, of which the first ``filled`` count."""

    filled: Integers  # (1,)
    node: Integers  # (S,)
    K: Array  # (S, 6, 6)
    load: Array  # (S, 6)
    x: Array  # (S, 3) of the node when the tick began
    q: Array  # (S, 4)
    force: Array  # (S, 6) as solved
    impulse: Array  # (S, 6) of the tick


def springs(capacity: int = CAPACITY) -> Springs:
    """Arrays for ``capacity`` springs, none yet."""
    S, z = capacity, np.zeros
    return Springs(
        np.zeros(1, np.int64),
        np.zeros(S, np.int64),
        z((S, 6, 6)),
        z((S, 6)),
        z((S, 3)),
        z((S, 4)),
        z((S, 6)),
        z((S, 6)),
    )


open_springs = opener(springs(1))


@inlined
def begin_springs(s: Springs, nodes: Nodes) -> None:
    """Keep where the nodes are as the tick begins."""
    for c in range(s.filled[0]):
        i = s.node[c]
        for a in range(3):
            s.x[c, a] = nodes.x[i, a]
        for a in range(4):
            s.q[c, a] = nodes.q[i, a]
        for a in range(6):
            s.impulse[c, a] = 0.0


@inlined
def settle_springs(s: Springs, nodes: Nodes) -> None:
    """Forces of the springs with the nodes where they are."""
    for c in range(s.filled[0]):
        i, q, b = s.node[c], nodes.q[s.node[c]], s.q[c]
        tx, ty, tz, tw = multiply(q[0], q[1], q[2], q[3], -b[0], -b[1], -b[2], b[3])
        rx, ry, rz = rotation_vector(tx, ty, tz, tw)
        dx, dy, dz = nodes.x[i, 0] - s.x[c, 0], nodes.x[i, 1] - s.x[c, 1], nodes.x[i, 2] - s.x[c, 2]
        for a in range(6):
            K = s.K[c, a]
            s.force[c, a] = s.load[c, a] - (K[0] * dx + K[1] * dy + K[2] * dz + K[3] * rx + K[4] * ry + K[5] * rz)


@inlined
def add_springs(s: Springs, nodes: Nodes, work: Work, h: float) -> None:
    """Add the springs to the matrices and loads of their nodes, both times h²."""
    settle_springs(s, nodes)
    for c in range(s.filled[0]):
        i = s.node[c]
        if not nodes.fixed[i]:
            for a in range(6):
                work.g[i, a] += h * h * s.force[c, a]
                for b in range(6):
                    work.H[i, a, b] += h * h * s.K[c, a, b]


@inlined
def add_spring_impulses(s: Springs, impulse: Array, h: float) -> None:
    """Add the impulses of the springs in ``h`` seconds to those (N, 6) of the nodes."""
    for c in range(s.filled[0]):
        for a in range(6):
            s.impulse[c, a] += h * s.force[c, a]
            impulse[s.node[c], a] += h * s.force[c, a]


@kernel
def read_other_loads(table: Integers, node: int, impulse: Array, dt: float, out: Array) -> None:
    """Fill ``out`` (6,) with what moved a node by ``impulse`` (6,) in a tick of ``dt`` s besides its springs."""
    s = open_springs(table)
    for a in range(6):
        own = 0.0
        for c in range(s.filled[0]):
            if s.node[c] == node:
                own += s.impulse[c, a]
        out[a] = (impulse[a] - own) / dt
