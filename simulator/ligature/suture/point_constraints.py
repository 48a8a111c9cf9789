"""Point constraints and thread grasps, as contacts that act whatever their gap.

A point constraint holds points of two nodes together: three of them attach an element to a body. A thread grasp holds
whatever element passes between two pads, rigidly across them and along them by friction up to a given limit. World
axes, SI units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined
from ligature.rotations import matrix_of, rotate, rotate_back
from ligature.suture.layout import FrictionMode, Nodes, Touches, Work

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


FIRST_GRASP_KEY = -2
"""Key of the first grasp; the next ones have lower keys."""


@inlined
def _find(old: Touches, key: int, i: int, k: int) -> int:
    """Row of the last step that held nodes i and k together with this key, or the end of the rows of constraints."""
    o = 0
    while o < old.count[0] and old.bilateral[o]:
        if old.key[o] == key and old.node[o, 0] == i and old.node[o, 1] == k:
            return o
        o += 1
    return old.count[0]


@inlined
def _constrain(
    nodes: Nodes, work: Work, old: Touches, touches: Touches, i: int, k: int, points: Array, stiffness: float,
    share: float,
) -> None:  # fmt: skip
    """Add point constraints that hold ``points`` (m, 2, 3) together this tick.

    The points are given in the frames of nodes i and k. See `add_point_constraints` for ``stiffness`` and ``share``.
    """
    before = _find(old, -1, i, k) if share < 1.0 else 0
    for node in (i, k):
        matrix_of(nodes.q[node, 0], nodes.q[node, 1], nodes.q[node, 2], nodes.q[node, 3], work.R[node])
    for m in range(points.shape[0]):
        c = touches.count[0]
        if c == touches.node.shape[0]:
            return
        touches.count[0] = c + 1
        touches.key[c] = -1
        touches.node[c, 0], touches.node[c, 1] = i, k
        touches.bilateral[c], touches.closed[c] = True, True
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
        for a in range(3):
            off = touches.start[c, 0, a] - touches.start[c, 1, a]
            if share < 1.0:
                borne = old.force[before + m, a] if before + m < old.count[0] else 0.0
                off -= (1.0 - share) * (off + borne / stiffness)
            if a == 0:
                touches.gap[c], touches.slip[c, 0] = off, 0.0
            else:
                touches.slip[c, a] = off


@inlined
def _grasp(
    nodes: Nodes, work: Work, old: Touches, touches: Touches, g: int, i: int, k: int, points: Array, stiffness: float,
    share: float,
) -> None:  # fmt: skip
    """Add thread grasp number ``g`` of the element at node i by the pads of node k.

    ``points[0, 1]`` is the middle of the pads and ``points[1, 1]`` their normal, in the frame of node k;
    ``points[2, 0, 0]`` is the largest force along the pads. See `add_point_constraints` for the last two.
    """
    c = touches.count[0]
    if c == touches.node.shape[0]:
        return
    touches.count[0] = c + 1
    for node in (i, k):
        matrix_of(nodes.q[node, 0], nodes.q[node, 1], nodes.q[node, 2], nodes.q[node, 3], work.R[node])
    start, local, normal, slip = touches.start[c], touches.local[c], touches.normal[c], touches.slip[c]
    rx, ry, rz = rotate(work.R[k], points[0, 1, 0], points[0, 1, 1], points[0, 1, 2])
    start[1, 0], start[1, 1], start[1, 2] = nodes.x[k, 0] + rx, nodes.x[k, 1] + ry, nodes.x[k, 2] + rz
    normal[0], normal[1], normal[2] = rotate(work.R[k], points[1, 1, 0], points[1, 1, 1], points[1, 1, 2])
    a, b = nodes.axis[i, 0], nodes.axis[i, 1]
    px, py, pz = rotate_back(
        work.R[i], start[1, 0] - nodes.x[i, 0], start[1, 1] - nodes.x[i, 1], start[1, 2] - nodes.x[i, 2]
    )
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    s = ((px - a[0]) * ux + (py - a[1]) * uy + (pz - a[2]) * uz) / (ux * ux + uy * uy + uz * uz)
    s = min(max(s, 0.0), 1.0)
    local[0, 0], local[0, 1], local[0, 2] = a[0] + s * ux, a[1] + s * uy, a[2] + s * uz
    rx, ry, rz = rotate(work.R[i], local[0, 0], local[0, 1], local[0, 2])
    start[0, 0], start[0, 1], start[0, 2] = nodes.x[i, 0] + rx, nodes.x[i, 1] + ry, nodes.x[i, 2] + rz
    gap = 0.0
    for m in range(3):
        local[1, m] = points[0, 1, m]
        gap += (start[0, m] - start[1, m]) * normal[m]
        slip[m] = 0.0
    touches.target[c] = 0.0
    touches.node[c, 0], touches.node[c, 1], touches.key[c] = i, k, FIRST_GRASP_KEY - g
    touches.arm[c, 0], touches.arm[c, 1] = 0.0, 0.0
    touches.bilateral[c], touches.closed[c] = True, True
    touches.friction[c], touches.press[c] = 1.0, points[2, 0, 0]
    touches.mode[c], touches.switches[c] = FrictionMode.SLIPS, 0
    borne = 0.0
    for o in range(old.count[0]):
        if not old.bilateral[o]:
            break
        if old.key[o] == FIRST_GRASP_KEY - g:
            along = old.slip[o, 0] * normal[0] + old.slip[o, 1] * normal[1] + old.slip[o, 2] * normal[2]
            for m in range(3):
                slip[m] = old.slip[o, m] - along * normal[m]
                borne += old.force[o, m] * normal[m]
            touches.mode[c] = old.mode[o]
    # Along the pads nothing is off: the slip is what the last step left.
    touches.gap[c] = gap if share == 1.0 else gap - (1.0 - share) * (gap + borne / stiffness)


@inlined
def add_point_constraints(
    nodes: Nodes, work: Work, old: Touches, touches: Touches, constraints: Integers, points: Array, stiffness: float,
    share: float,
) -> None:  # fmt: skip
    """Add all ``constraints`` (g, 3), each two nodes and whether it is a grasp, with ``points`` (g, m, 2, 3).

    ``old`` are the contacts of the last step, which have ``stiffness`` (N/m). This one takes off a ``share`` of how far
    each is from where its load holds it: see `ligature.suture.substeps` for why.
    """
    for g in range(constraints.shape[0]):
        if constraints[g, 2]:
            _grasp(nodes, work, old, touches, g, constraints[g, 0], constraints[g, 1], points[g], stiffness, share)
        else:
            _constrain(nodes, work, old, touches, constraints[g, 0], constraints[g, 1], points[g], stiffness, share)
