"""Bonds: points of two nodes that stay together, for ties in the middle of a rod and for grips.

World axes, SI units.
"""

from __future__ import annotations

from ligature.suture.compiled import inlined
from ligature.suture.rotations import matrix_of, rotate


@inlined
def _bond(nodes, work, touches, i, k, points):
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
def place_bonds(nodes, work, touches, grips, points):
    """Add the bonds of all ``grips`` (g, 2), pairs of nodes, with their ``points`` (g, m, 2, 3)."""
    for g in range(grips.shape[0]):
        _bond(nodes, work, touches, grips[g, 0], grips[g, 1], points[g])
