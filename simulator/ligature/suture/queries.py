"""Questions about threads: what rays hit, and what touches an element or is near it. World axes, metres.

Bullet does not have the elements of rods, so these stand beside `ligature.physics.queries`. Poses are those after the
last tick; pairs that the scene keeps from colliding are left out, as for other bodies.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import compiled, inlined
from ligature.model.hits import Contact, RayHits
from ligature.model.poses import compose
from ligature.rotations import matrix_of, rotate
from ligature.suture.bodies import Bodies
from ligature.suture.contacts import deepest, nearest
from ligature.suture.rod import Rod
from ligature.suture.rods import Rods

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

PARALLEL = 1e-12
"""Square of the sine below which a ray counts as parallel to an element."""


class RodQueries:
    """Answers about the elements of ``rods`` among rigid ``bodies``."""

    def __init__(self, rods: Rods, bodies: Bodies) -> None:
        self._rods, self._bodies = rods, bodies
        self._indices = [np.array(rod.description.bodies, dtype=np.int64) for rod in rods.rods]

    def cast(self, starts: Array, ends: Array, hits: RayHits) -> RayHits:
        """Of what the segments ``starts`` to ``ends`` (n, 3) hit, the nearer: ``hits`` or an element of a rod.

        A ray that begins inside an element passes out of it unhindered, as one that begins inside a body.
        """
        if not self._rods.rods:
            return hits
        body, fraction, point, normal = hits.body.copy(), hits.fraction.copy(), hits.point.copy(), hits.normal.copy()
        starts, ends = np.ascontiguousarray(starts), np.ascontiguousarray(ends)
        for rod, indices in zip(self._rods.rods, self._indices, strict=True):
            found = np.full(len(starts), -1, dtype=np.int64)
            _cast(_segments(rod), rod.description.radius, starts, ends, fraction, normal, found)
            rows = found >= 0
            body[rows] = indices[found[rows]]
            point[rows] = starts[rows] + fraction[rows, None] * (ends[rows] - starts[rows])
        return RayHits(body, fraction, point, normal)

    def contacts(self, body: int, threshold: float) -> list[Contact]:
        """Where ``body`` is at most ``threshold`` away from elements and, if it is an element itself, from bodies."""
        own = self._rods.element_of(body)
        if own is None:
            rods = range(len(self._rods.rods))
            return [contact for number in rods for contact in self._contacts_of_body(number, body, threshold)]
        number, element = own
        return [*self._contacts_of_element(number, element, threshold), *self._own_contacts(number, element, threshold)]

    def _contacts_of_body(self, number: int, body: int, threshold: float) -> list[Contact]:
        rod, indices = self._rods.rods[number], self._indices[number]
        found = self._near(number, body, np.arange(len(indices)), threshold)
        radius = rod.description.radius
        return [Contact(int(indices[e]), gap, axis - radius[e] * n, -n) for e, gap, axis, n in found]

    def _contacts_of_element(self, number: int, element: int, threshold: float) -> list[Contact]:
        radius = float(self._rods.rods[number].description.radius[element])
        return [
            Contact(body, gap, axis - (gap + radius) * n, n)
            for body in self._rods.colliders.bodies
            for _, gap, axis, n in self._near(number, body, np.array([element]), threshold)
        ]

    def _own_contacts(self, number: int, element: int, threshold: float) -> list[Contact]:
        """Contacts of an element with others of its rod."""
        rod = self._rods.rods[number]
        segments, radius = _segments(rod), rod.description.radius
        found = _room(len(segments))
        count = _near_own(segments, radius, element, rod.self_skip, threshold, *found)
        return [Contact(int(self._indices[number][e]), gap, point, n) for e, gap, point, n in _first(count, *found)]

    def _near(
        self, number: int, body: int, elements: Integers, threshold: float
    ) -> list[tuple[int, float, Array, Array]]:
        """Elements of a rod near a body: each with gap, point (3,) on its axis, and normal (3,) off the body."""
        colliders, rod = self._rods.colliders, self._rods.rods[number]
        parts = colliders.parts_of(body)
        room = (parts.stop - parts.start) * len(elements)
        if not room:
            return []
        shapes = rod.shapes
        found = _room(room)
        count = _near_parts(
            parts.start, parts.stop, self._bodies.motion(body)[0], colliders.local, shapes.kind, shapes.size,
            shapes.planes, shapes.plane_range, self._rods.never_collide(number), _segments(rod),
            rod.description.radius, elements, threshold, *found,
        )  # fmt: skip
        return _first(count, *found)


def _room(n: int) -> tuple[Integers, Array, Array, Array]:
    """Room for ``n`` pairs: elements, gaps, points and normals."""
    return np.zeros(n, np.int64), np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3))


def _first(
    count: int, elements: Integers, gaps: Array, points: Array, normals: Array
) -> list[tuple[int, float, Array, Array]]:
    """The first ``count`` pairs of `_room`."""
    return list(zip(elements[:count].tolist(), gaps[:count].tolist(), points[:count], normals[:count], strict=True))


def _segments(rod: Rod) -> Array:
    """Ends (n, 2, 3) of the axes of a rod's capsules."""
    out = np.empty((len(rod.positions), 2, 3))
    _world_segments(rod.positions, rod.orientations, rod.description.ends, out)
    return out


@compiled
def _world_segments(x: Array, q: Array, ends: Array, out: Array) -> None:
    R = np.empty((3, 3))
    for e in range(x.shape[0]):
        matrix_of(q[e, 0], q[e, 1], q[e, 2], q[e, 3], R)
        for s in range(2):
            dx, dy, dz = rotate(R, ends[e, s, 0], ends[e, s, 1], ends[e, s, 2])
            out[e, s, 0], out[e, s, 1], out[e, s, 2] = x[e, 0] + dx, x[e, 1] + dy, x[e, 2] + dz


@compiled
def _cast(
    segments: Array, radius: Array, starts: Array, ends: Array, fraction: Array, normal: Array, found: Integers
) -> None:
    """For each ray that hits an element before ``fraction``: the element, the fraction there, and the normal."""
    d = np.empty(3)
    for r in range(starts.shape[0]):
        for a in range(3):
            d[a] = ends[r, a] - starts[r, a]
        for e in range(segments.shape[0]):
            t = _enter(segments[e], radius[e], starts[r], d)
            if 0.0 <= t < fraction[r]:
                fraction[r], found[r] = t, e
        if found[r] >= 0:
            _normal_at(segments[found[r]], starts[r], d, fraction[r], normal[r])


@inlined
def _dot(a: Array, b: Array) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def _enter(segment: Array, radius: float, o: Array, d: Array) -> float:
    """Where the line o + t d enters a capsule, as t; infinite where it does not.

    The infinite cylinder about the axis comes first, and where the line enters it beyond an end, the ball there.
    """
    a, b = segment[0], segment[1]
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    wx, wy, wz = o[0] - a[0], o[1] - a[1], o[2] - a[2]
    uu, dd = ux * ux + uy * uy + uz * uz, _dot(d, d)
    ud, uw = ux * d[0] + uy * d[1] + uz * d[2], ux * wx + uy * wy + uz * wz
    dw, ww = d[0] * wx + d[1] * wy + d[2] * wz, wx * wx + wy * wy + wz * wz
    # |w + t d|² less its part along the axis is the radius squared, times |u|²
    square, half, rest = uu * dd - ud * ud, uu * dw - ud * uw, uu * (ww - radius * radius) - uw * uw
    if square > PARALLEL * uu * dd:
        root = half * half - square * rest
        if root < 0.0:
            return math.inf
        t = (-half - math.sqrt(root)) / square
        along = uw + t * ud
        if 0.0 <= along <= uu:
            return t
        beyond = along > uu
    else:
        if rest > 0.0:
            return math.inf
        beyond = ud < 0.0
    if beyond:
        wx, wy, wz = wx - ux, wy - uy, wz - uz
    dw, ww = d[0] * wx + d[1] * wy + d[2] * wz, wx * wx + wy * wy + wz * wz
    root = dw * dw - dd * (ww - radius * radius)
    if root < 0.0 or dd == 0.0:
        return math.inf
    return (-dw - math.sqrt(root)) / dd


@inlined
def _normal_at(segment: Array, o: Array, d: Array, t: float, out: Array) -> None:
    """Outward normal of a capsule at the point o + t d of its skin."""
    a, b = segment[0], segment[1]
    square, along = 0.0, 0.0
    for k in range(3):
        square += (b[k] - a[k]) ** 2
        along += (b[k] - a[k]) * (o[k] + t * d[k] - a[k])
    s, length = min(max(along / square, 0.0), 1.0), 0.0
    for k in range(3):
        out[k] = o[k] + t * d[k] - a[k] - s * (b[k] - a[k])
        length += out[k] ** 2
    per = 1.0 / math.sqrt(length) if length > 0.0 else 0.0
    for k in range(3):
        out[k] *= per


@compiled
def _near_parts(
    begin: int, end: int, body: Array, local: Array, kind: Integers, size: Array, planes: Array, plane_range: Integers,
    never: Flags, segments: Array, radius: Array, elements: Integers, threshold: float, element: Integers, gap: Array,
    axis: Array, normal: Array,
) -> int:  # fmt: skip
    """Pairs of the parts ``begin`` … ``end`` of a body, its inertial frame at ``body`` (7,), and ``elements``.

    The last four arrays receive those at most ``threshold`` apart; returns how many.
    """
    pose, R, p, n, count = np.empty(7), np.empty((3, 3)), np.empty(3), np.empty(3), 0
    for c in range(begin, end):
        compose(body, local[c], pose)
        matrix_of(pose[3], pose[4], pose[5], pose[6], R)
        own = planes[plane_range[c, 0] : plane_range[c, 1]]
        for e in elements:
            if never[c, e]:
                continue
            s, d = deepest(kind[c], size[c], own, pose, R, segments[e], radius[e] + threshold, radius[e], p, n)
            if d - radius[e] > threshold:
                continue
            element[count], gap[count] = e, d - radius[e]
            normal[count, 0], normal[count, 1], normal[count, 2] = rotate(R, n[0], n[1], n[2])
            for a in range(3):
                axis[count, a] = segments[e, 0, a] + s * (segments[e, 1, a] - segments[e, 0, a])
            count += 1
    return count


@compiled
def _near_own(
    segments: Array, radius: Array, element: int, skip: int, threshold: float, other: Integers, gap: Array,
    point: Array, normal: Array,
) -> int:  # fmt: skip
    """Elements more than ``skip`` places away along the rod that are at most ``threshold`` away; returns how many.

    ``point`` and ``normal`` are on the other element, towards ``element``.
    """
    count, way = 0, np.empty(3)
    for j in range(segments.shape[0]):
        if abs(j - element) <= skip:
            continue
        s, t = nearest(segments[element], segments[j])
        square = 0.0
        for a in range(3):
            one = segments[element, 0, a] + s * (segments[element, 1, a] - segments[element, 0, a])
            point[count, a] = segments[j, 0, a] + t * (segments[j, 1, a] - segments[j, 0, a])
            way[a] = one - point[count, a]
            square += way[a] ** 2
        length = math.sqrt(square)
        distance = length - radius[element] - radius[j]
        if distance > threshold or length == 0.0:
            continue
        other[count], gap[count] = j, distance
        for a in range(3):
            normal[count, a] = way[a] / length
            point[count, a] += radius[j] * normal[count, a]
        count += 1
    return count
