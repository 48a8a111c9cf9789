"""Keeps a rod from passing through itself, whatever its step has come to.

A contact is a plane between two elements, found before the step. Where a loop snaps over more than its thickness, or
the solver stops before contacts have settled, two strands may end the step on each other's far side. So each step is
checked as a motion: from start to end every element moves straight and turns evenly, and conservative advancement
(Mirtich, Impulse-based Dynamic Simulation of Rigid Body Systems, 1996) finds the share of the step within which no two
axes come nearer than half their distance. No strand crosses another within that share, so a knot stays the same knot.
World axes, SI units.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.rotations import cross, multiply, rotation_vector, turn
from ligature.suture.contacts import GROUP, nearest, overlap
from ligature.suture.layout import Nodes, Touches, Work

Array = NDArray[np.float64]


NEAREST = 0.5
"""Distance that two axes keep in a step, as a share of what it was, or of the sum of the radii where that is less."""

STRAY = 0.25
"""Distance, in radii, from its free motion up to which an element meets only elements that the search has found."""

ENOUGH, MAX_ADVANCES = 1.02, 64
"""Distance, over the least, that counts as reached; and the most advances until then."""


@inlined
def _arm(nodes: Nodes, i: int) -> float:
    """Distance of an element's farther end from its centre."""
    a, b = nodes.axis[i, 0], nodes.axis[i, 1]
    return math.sqrt(max(a[0] * a[0] + a[1] * a[1] + a[2] * a[2], b[0] * b[0] + b[1] * b[1] + b[2] * b[2]))


@inlined
def _turned(q: Array, since: Array, i: int) -> float:
    """Angle of a turn, from above: of quaternions ``q[i]`` against ``since[i]``."""
    x, y, z, w = q[i, 0] - since[i, 0], q[i, 1] - since[i, 1], q[i, 2] - since[i, 2], q[i, 3] - since[i, 3]
    chord = math.sqrt(x * x + y * y + z * z + w * w)
    return 2.3 * chord if chord < 0.75 else 2.0 * math.pi


@inlined
def _strays(first: int, n: int, nodes: Nodes, work: Work) -> bool:
    """Whether an element left its free motion, which the contact search has covered, or turned far."""
    for i in range(first, first + n):
        x, y, z = nodes.x[i, 0] - work.xp[i, 0], nodes.x[i, 1] - work.xp[i, 1], nodes.x[i, 2] - work.xp[i, 2]
        most, arm = STRAY * nodes.radius[i], _arm(nodes, i)
        if math.sqrt(x * x + y * y + z * z) + arm * _turned(nodes.q, work.qp, i) > most:
            return True
        if arm * _turned(nodes.q, work.q, i) > most:
            return True
    return False


@inlined
def _turn_of(nodes: Nodes, work: Work, i: int, out: Array) -> float:
    """Fill ``out`` (3,) with the rotation vector of a node in the step; returns its length."""
    q, p = nodes.q, work.q
    x, y, z, w = multiply(q[i, 0], q[i, 1], q[i, 2], q[i, 3], -p[i, 0], -p[i, 1], -p[i, 2], p[i, 3])
    out[0], out[1], out[2] = rotation_vector(x, y, z, w)
    return math.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])


@inlined
def _swing(nodes: Nodes, work: Work, i: int, e: int, v: Array, angle: float, share: float, out: Array) -> None:
    """Fill ``out`` (2, 3) with the ends of element ``e``, node ``i``, at a share of a step that turns it by ``v``."""
    c, s, per = math.cos(share * angle), math.sin(share * angle), 1.0 / max(angle, 1e-30)
    ux, uy, uz = per * v[0], per * v[1], per * v[2]
    for k in range(2):
        p = work.segment[e, k]
        rx, ry, rz = p[0] - work.x[i, 0], p[1] - work.x[i, 1], p[2] - work.x[i, 2]
        along = (1.0 - c) * (ux * rx + uy * ry + uz * rz)
        wx, wy, wz = cross(ux, uy, uz, rx, ry, rz)
        out[k, 0] = work.x[i, 0] + share * (nodes.x[i, 0] - work.x[i, 0]) + c * rx + s * wx + along * ux
        out[k, 1] = work.x[i, 1] + share * (nodes.x[i, 1] - work.x[i, 1]) + c * ry + s * wy + along * uy
        out[k, 2] = work.x[i, 2] + share * (nodes.x[i, 2] - work.x[i, 2]) + c * rz + s * wz + along * uz


@inlined
def _apart(a: Array, b: Array) -> float:
    """Distance of two segments (2, 3)."""
    s, t = nearest(a, b)
    x = a[0, 0] + s * (a[1, 0] - a[0, 0]) - b[0, 0] - t * (b[1, 0] - b[0, 0])
    y = a[0, 1] + s * (a[1, 1] - a[0, 1]) - b[0, 1] - t * (b[1, 1] - b[0, 1])
    z = a[0, 2] + s * (a[1, 2] - a[0, 2]) - b[0, 2] - t * (b[1, 2] - b[0, 2])
    return math.sqrt(x * x + y * y + z * z)


@kernel
def _share_of_pair(first: int, nodes: Nodes, work: Work, e: int, f: int, distance: float) -> float:
    """Share of the step within which elements ``e`` and ``f`` keep their distance.

    ``distance`` is a lower bound of theirs at the start; below 0 it is not known.
    """
    i, k = first + e, first + f
    both = nodes.radius[i] + nodes.radius[k]
    x = (nodes.x[i, 0] - work.x[i, 0]) - (nodes.x[k, 0] - work.x[k, 0])
    y = (nodes.x[i, 1] - work.x[i, 1]) - (nodes.x[k, 1] - work.x[k, 1])
    z = (nodes.x[i, 2] - work.x[i, 2]) - (nodes.x[k, 2] - work.x[k, 2])
    straight, arm, other = math.sqrt(x * x + y * y + z * z), _arm(nodes, i), _arm(nodes, k)
    moved = straight + arm * _turned(nodes.q, work.q, i) + other * _turned(nodes.q, work.q, k)
    if distance - moved > NEAREST * min(distance, both):
        return 1.0
    v, w, pair = work.three[0], work.three[1], work.pair
    angle, turned = _turn_of(nodes, work, i, v), _turn_of(nodes, work, k, w)
    moved = straight + arm * angle + other * turned
    apart = _apart(work.segment[e], work.segment[f])
    least = NEAREST * min(apart, both)
    if apart < 1e-9 or apart - moved > least:
        return 1.0
    share = 0.0
    for _ in range(MAX_ADVANCES):
        share += (apart - least) / moved
        if share >= 1.0:
            return 1.0
        _swing(nodes, work, i, e, v, angle, share, pair[0])
        _swing(nodes, work, k, f, w, turned, share, pair[1])
        apart = _apart(pair[0], pair[1])
        if apart <= ENOUGH * least:
            break
    return share


@inlined
def _sweep(first: int, n: int, nodes: Nodes, work: Work) -> None:
    """Boxes around what elements, and groups of them, passed through in the step."""
    v, ends = work.three[0], work.pair[0]
    for g in range((n + GROUP - 1) // GROUP):
        group = work.group_box[g]
        for a in range(3):
            group[0, a], group[1, a] = 1e300, -1e300
        for e in range(g * GROUP, min(n, (g + 1) * GROUP)):
            i, box, p = first + e, work.box[e], work.segment[e]
            angle = _turn_of(nodes, work, i, v)
            _swing(nodes, work, i, e, v, angle, 1.0, ends)
            # An end that turns bulges off its chord by an eighth of the square of the angle.
            size = nodes.radius[i] + 0.125 * _arm(nodes, i) * angle * angle
            for a in range(3):
                box[0, a] = min(p[0, a], p[1, a], ends[0, a], ends[1, a]) - size
                box[1, a] = max(p[0, a], p[1, a], ends[0, a], ends[1, a]) + size
                group[0, a], group[1, a] = min(group[0, a], box[0, a]), max(group[1, a], box[1, a])


@kernel
def free_share(first: int, n: int, nodes: Nodes, touches: Touches, work: Work, missed: int) -> float:
    """Share of a step within which no strand of elements ``first`` … ``first + n - 1`` crosses another; 1 as a rule.

    ``touches`` were found at the start of the step, with ``missed`` that found no room. Elements too near to each other
    along the rod for contact count too: a third strand may lie in the bend between them.
    """
    share = 1.0
    if missed == 0 and not _strays(first, n, nodes, work):
        for c in range(touches.count[0]):
            i, k = touches.node[c, 0], touches.node[c, 1]
            if first <= k < first + n and not touches.bilateral[c]:
                apart = touches.gap[c] + nodes.radius[i] + nodes.radius[k]
                share = min(share, _share_of_pair(first, nodes, work, i - first, k - first, apart))
        return share
    _sweep(first, n, nodes, work)
    groups = (n + GROUP - 1) // GROUP
    for g in range(groups):
        for h in range(g, groups):
            if not overlap(work.group_box[g], work.group_box[h]):
                continue
            for e in range(g * GROUP, min(n, (g + 1) * GROUP)):
                for f in range(max(e + 2, h * GROUP), min(n, (h + 1) * GROUP)):
                    if overlap(work.box[e], work.box[f]):
                        share = min(share, _share_of_pair(first, nodes, work, e, f, -1.0))
    return share


@kernel
def shorten(total: int, nodes: Nodes, work: Work, share: float) -> None:
    """Take all movable nodes back to a share of their step."""
    v = work.three[0]
    for i in range(total):
        if nodes.fixed[i] or not nodes.met[i]:
            continue
        _turn_of(nodes, work, i, v)
        for a in range(3):
            nodes.x[i, a] = work.x[i, a] + share * (nodes.x[i, a] - work.x[i, a])
        for a in range(4):
            nodes.q[i, a] = work.q[i, a]
        turn(nodes.q, i, share * v[0], share * v[1], share * v[2])
