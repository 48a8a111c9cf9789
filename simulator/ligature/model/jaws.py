"""Finds the jaws of a scene: two fingers that turn about one axis at the end of a tool.

Frames: I is a body's inertial frame (`ligature.model.scene`); metres, radians.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import inverse
from ligature.model.scene import ArmDescription, Body, Jaw, Joint, JointType
from ligature.model.shapes import Box, Collider, Hull, Plane, Sphere, TriMesh

Array = NDArray[np.float64]

SAME_PLACE = 0.005
"""Distance in metres within which the pivots of two fingers count as one."""

PARALLEL = 0.95
"""Cosine from which two axes count as parallel."""

PAD = 0.5
"""Share of a finger's length from which on it is pad."""


def find_jaws(bodies: Sequence[Body], joints: Sequence[Joint], arms: Sequence[ArmDescription]) -> tuple[Jaw, ...]:
    """The jaws of a scene: any two bodies with shapes at the end of a tree whose revolute joints share an axis."""
    inner = Counter(joint.parent for joint in joints)
    names = {arm.tip: arm.name for arm in arms}
    by_palm: dict[int, list[Joint]] = {}
    for joint in joints:
        finger = bodies[joint.child]
        if joint.type is JointType.REVOLUTE and not inner[joint.child] and finger.colliders and not finger.static:
            by_palm.setdefault(joint.parent, []).append(joint)
    found = []
    for palm, pair in by_palm.items():
        if len(pair) == 2 and _share_axis(*pair):
            name = names.get(palm, bodies[palm].identity.identifier)
            found.append(_jaw(bodies, name, palm, pair[0], pair[1]))
    return tuple(found)


def _share_axis(one: Joint, two: Joint) -> bool:
    apart = np.linalg.norm(one.T_parent_a[:3, 3] - two.T_parent_a[:3, 3])
    return bool(apart < SAME_PLACE and abs(one.T_parent_a[:3, 2] @ two.T_parent_a[:3, 2]) > PARALLEL)


def _jaw(bodies: Sequence[Body], name: str, palm: int, one: Joint, two: Joint) -> Jaw:
    axis, pivot = one.T_parent_a[:3, 2], one.T_parent_a[:3, 3]
    shapes = [_points(bodies, joint) for joint in (one, two)]
    directions = [_direction(points, axis, pivot) for points in shapes]
    reach = max(float(np.linalg.norm(_across(points, axis, pivot), axis=1).max()) for points in shapes)
    first = float(np.sign(np.cross(directions[1], directions[0]) @ axis))
    if first == 0.0:
        first = 1.0 if _opens_upwards(one) else -1.0
    same = float(np.sign(one.T_parent_a[:3, 2] @ two.T_parent_a[:3, 2]))
    width = min(_pad_width(points, axis, pivot) for points in shapes)
    return Jaw(
        name, palm, (one.child, two.child), (one.index, two.index), (first, -first * same),
        axis, pivot, 0.5 * width, reach,
    )  # fmt: skip


def _points(bodies: Sequence[Body], joint: Joint) -> Array:
    """Corners (n, 3) of a finger's shapes in the holder's I, at joint position zero."""
    body = bodies[joint.child]
    to_palm = joint.T_parent_a @ inverse(joint.T_child_b) @ inverse(body.T_body_inertial)
    points = np.vstack([_corners(part) for part in body.colliders])
    return np.asarray(points @ to_palm[:3, :3].T + to_palm[:3, 3])


def _corners(part: Collider) -> Array:
    """Vertices of a mesh, or corners of the box around a primitive, (n, 3) in B."""
    shape = part.shape
    if isinstance(shape, Hull | TriMesh):
        points: Array = shape.vertices
    else:
        half = np.zeros(3)
        if isinstance(shape, Box):
            half = 0.5 * shape.size
        elif isinstance(shape, Sphere):
            half = np.full(3, shape.radius)
        elif not isinstance(shape, Plane):
            half = np.array([shape.radius, shape.radius, 0.5 * shape.height])
        points = half * np.array(list(product((-1.0, 1.0), repeat=3)))
    return np.asarray(points @ part.T_body_shape[:3, :3].T + part.T_body_shape[:3, 3])


def _across(points: Array, axis: Array, pivot: Array) -> Array:
    """Points (n, 3) as seen from the axis, square to it."""
    off = points - pivot
    return np.asarray(off - np.outer(off @ axis, axis))


def _direction(points: Array, axis: Array, pivot: Array) -> Array:
    """Where a finger's pad lies as seen from the axis."""
    off = _across(points, axis, pivot)
    length = np.linalg.norm(off, axis=1)
    mean = off[length > PAD * length.max()].mean(axis=0)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-12))


def _pad_width(points: Array, axis: Array, pivot: Array) -> float:
    length = np.linalg.norm(_across(points, axis, pivot), axis=1)
    return float(np.ptp(points[length > PAD * length.max()] @ axis))


def _opens_upwards(joint: Joint) -> bool:
    low, high = joint.low or 0.0, joint.high or 0.0
    return high >= -low
