"""Draws the elements of a rod gently out of bodies that they were put into.

A contact holds an element out of a body with whatever force that takes. Elements that start in a body, on both sides of
its middle, would stretch the rod between them until it snaps through. So what starts inside moves as in thick honey
instead: with n the outward normal of the nearest face, m the mass of an element, v its velocity against the body ::

    f = m LIFT (n - v / RECOVERY)

which drives it out at `RECOVERY` at most and never bears more than a few times its weight. World axes, SI units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.mesh.distance import signed_distance
from ligature.rotations import cross, matrix_of, rotate, rotate_back
from ligature.suture.contacts import RECOVERY
from ligature.suture.layout import RodArrays
from ligature.suture.springs import open_springs
from ligature.suture.substeps import open_rod

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

LIFT = 30.0
"""Acceleration in m/s² with which an element is pushed out at rest."""

SHALLOW = 0.5
"""Distance of an element's axis from the surface of a body, in radii, above which it is not in it."""

TOO_DEEP = 1e-3
"""Depth of an element's axis in metres from which one that was put into a body does not collide with it.

Only what was put somewhere is asked: contacts over sharp edges sink by 2 mm, and hold.
"""

HALFWAY = 0.5
"""Depth of an element's axis over that of a part's middle which counts as `TOO_DEEP` too: in a thin part nothing is."""

BESIDE = 3
"""Elements beside one that is inside a body that do not collide with it either: they would hold back what leaves."""

SAMPLES = 3
"""Places along an element at which its depth is measured."""


@inlined
def _depth(rod: RodArrays, c: int, e: int, normal: Array) -> float:
    """How deep the axis of element ``e`` is in part ``c``, below 0 outside; fills ``normal`` (3,) in world axes."""
    nodes, shapes, work = rod.nodes, rod.shapes, rod.work
    i, pose = rod.constants.first[0] + e, shapes.pose[c]
    R, turned, p, out = work.R[i], work.R[nodes.x.shape[0]], work.three[0], work.three[1]
    matrix_of(nodes.q[i, 0], nodes.q[i, 1], nodes.q[i, 2], nodes.q[i, 3], R)
    matrix_of(pose[3], pose[4], pose[5], pose[6], turned)
    planes = shapes.planes[shapes.plane_range[c, 0] : shapes.plane_range[c, 1]]
    deepest = -1e300
    for k in range(SAMPLES):
        s, a, b = k / (SAMPLES - 1), nodes.axis[i, 0], nodes.axis[i, 1]
        x, y, z = rotate(R, a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2]))
        x, y, z = nodes.x[i, 0] + x - pose[0], nodes.x[i, 1] + y - pose[1], nodes.x[i, 2] + z - pose[2]
        p[0], p[1], p[2] = rotate_back(turned, x, y, z)
        depth = -signed_distance(shapes.kind[c], shapes.size[c], planes, p, out)
        if depth > deepest:
            deepest = depth
            normal[0], normal[1], normal[2] = rotate(turned, out[0], out[1], out[2])
    return deepest


@inlined
def _depth_if_near(rod: RodArrays, c: int, e: int, normal: Array) -> float:
    """`_depth` of an element that is near a part, else a large negative number."""
    nodes, box, i = rod.nodes, rod.shapes.box[c], rod.constants.first[0] + e
    arm, apart = nodes.radius[i], False
    for a in range(3):
        arm += max(abs(nodes.axis[i, 0, a]), abs(nodes.axis[i, 1, a]))
    for a in range(3):
        apart = apart or nodes.x[i, a] < box[0, a] - arm or nodes.x[i, a] > box[1, a] + arm
    return -1e300 if apart else _depth(rod, c, e, normal)


@inlined
def _is_inside(rod: RodArrays, c: int, e: int, normal: Array) -> bool:
    """Whether element ``e`` is in part ``c``, deeper than one that lies on it."""
    return _depth_if_near(rod, c, e, normal) > -SHALLOW * rod.nodes.radius[rod.constants.first[0] + e]


@inlined
def _middle(rod: RodArrays, c: int, normal: Array) -> float:
    """How deep the middle of part ``c`` is in it."""
    shapes, work = rod.shapes, rod.work
    box, pose, turned, p = shapes.box[c], shapes.pose[c], work.R[rod.nodes.x.shape[0]], work.three[0]
    matrix_of(pose[3], pose[4], pose[5], pose[6], turned)
    p[0], p[1], p[2] = rotate_back(
        turned,
        0.5 * (box[0, 0] + box[1, 0]) - pose[0],
        0.5 * (box[0, 1] + box[1, 1]) - pose[1],
        0.5 * (box[0, 2] + box[1, 2]) - pose[2],
    )
    planes = shapes.planes[shapes.plane_range[c, 0] : shapes.plane_range[c, 1]]
    return -signed_distance(shapes.kind[c], shapes.size[c], planes, p, normal)


@inlined
def _beside(inside: Flags, c: int, e: int) -> bool:
    """Whether element ``e`` is beside one that is inside part ``c``."""
    beside = False
    for k in range(max(e - BESIDE, 0), min(e + BESIDE + 1, inside.shape[1])):
        beside = beside or inside[c, k]
    return beside


@kernel
def find_inside(rod_table: Integers, parts: Flags, inside: Flags) -> None:
    """Flag in ``inside`` (S, n) the elements in those of the ``parts`` (S,) that one of them is too deep in."""
    rod = open_rod(rod_table)
    shapes, normal = rod.shapes, rod.work.three[2]
    for c in range(parts.shape[0]):
        deep = False
        if parts[c] and shapes.node[c] >= 0:
            middle = _middle(rod, c, normal)
            limit = min(TOO_DEEP, HALFWAY * middle) if middle > 0.0 else TOO_DEEP
            for e in range(inside.shape[1]):
                deep = deep or (not shapes.skip[c, e] and _depth_if_near(rod, c, e, normal) > limit)
        if deep:
            for e in range(inside.shape[1]):
                inside[c, e] = inside[c, e] or (not shapes.skip[c, e] and _is_inside(rod, c, e, normal))


@kernel
def depth_of(rod_table: Integers, part: int, element: int) -> float:
    """How deep the axis of an element is in a part, m; below 0 outside."""
    rod = open_rod(rod_table)
    return _depth(rod, part, element, rod.work.three[2])


@kernel
def draw_out(rod_table: Integers, spring_table: Integers, never: Flags, inside: Flags, dt: float) -> bool:
    """Push elements out of the parts that they are ``inside`` (S, n), and flag those that come into one beside them.

    What has left is not flagged any more. Pairs in ``never`` (S, n) do not collide. Returns whether any flag changed.
    """
    rod, s = open_rod(rod_table), open_springs(spring_table)
    shapes, changed = rod.shapes, False
    nodes, first, normal = rod.nodes, rod.constants.first[0], rod.work.three[2]
    any_ = False
    for c in range(inside.shape[0]):
        for e in range(inside.shape[1]):
            any_ = any_ or inside[c, e]
    if not any_:
        return changed
    for e in range(inside.shape[1]):
        i, row, begun, elsewhere = first + e, s.filled[0], False, False
        for b in range(inside.shape[0]):
            elsewhere = elsewhere or inside[b, e]
        for c in range(inside.shape[0]):
            if not inside[c, e]:
                if shapes.node[c] < 0 or never[c, e] or not (elsewhere or _beside(inside, c, e)):
                    continue
                if not _is_inside(rod, c, e, normal):
                    continue
                inside[c, e], elsewhere, changed = True, True, True
            elif shapes.node[c] < 0 or _depth(rod, c, e, normal) < -nodes.radius[i]:
                inside[c, e], changed = False, True
                continue
            if row == s.node.shape[0]:
                continue
            if not begun:
                begun = True
                s.node[row] = i
                for a in range(6):
                    s.load[row, a] = 0.0
                    for b in range(6):
                        s.K[row, a, b] = 0.0
            k = shapes.node[c]
            w, x, y = nodes.w[k], nodes.x[i], nodes.x[k]
            ux, uy, uz = cross(w[0], w[1], w[2], x[0] - y[0], x[1] - y[1], x[2] - y[2])
            push, v = nodes.mass[i] * LIFT, nodes.v[k]
            s.load[row, 0] += push * (normal[0] + (v[0] + ux) / RECOVERY)
            s.load[row, 1] += push * (normal[1] + (v[1] + uy) / RECOVERY)
            s.load[row, 2] += push * (normal[2] + (v[2] + uz) / RECOVERY)
            for a in range(3):
                s.K[row, a, a] += push / (RECOVERY * dt)
        if begun:
            s.filled[0] = row + 1
    return changed
