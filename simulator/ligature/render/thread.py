"""The thread as one smooth tube: a spline through the elements of a rod, and rings around it. World axes, metres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ligature.model.scene import RodChain, Scene
from ligature.render.geometry import Triangles

Array = NDArray[np.float64]

POINTS_PER_ELEMENT = 4
SIDES = 10


class Tube:
    """The drawn surface of one rod, fed with the poses of its elements.

    The spline is C2 and linear in its knots, the joint pivots and the two ends, whose spacing is the
    rod's rest length: points and tangents are one matrix product. Rings start at one of the elements'
    own axes, so that a twisted thread looks twisted. ``points`` a spline has for each element, ``sides`` a ring.
    """

    def __init__(self, scene: Scene, rod: RodChain, points: int = POINTS_PER_ELEMENT, sides: int = SIDES) -> None:
        self._radius = rod.radius
        self._bodies = list(rod.bodies)
        self._carriers, self._knots = _knots(scene, rod)
        lengths = np.asarray(rod.lengths, dtype=float)
        knots = np.concatenate([[0.0], np.cumsum(lengths)])
        fine = np.linspace(0.0, knots[-1], points * len(knots))
        spline = CubicSpline(knots, np.eye(len(knots)))
        self._points, self._tangents = spline(fine), spline(fine, 1)
        self._across: int | None = None
        angles = np.linspace(0, 2 * np.pi, sides + 1)
        self._cos, self._sin = np.cos(angles)[None, :, None], np.sin(angles)[None, :, None]
        self.faces, self._uvs = _rings(fine[[0, *range(len(fine)), -1]] / (2 * np.pi * rod.radius), sides)

    def triangles(self, T_world_body: Array) -> Triangles:
        """The tube when the scene's bodies stand at ``T_world_body`` (n, 4, 4)."""
        T = T_world_body[self._carriers]
        knots = np.einsum("nij,nj->ni", T[:, :3, :3], self._knots) + T[:, :3, 3]
        axes = T_world_body[self._bodies][:, :3, :3]
        if self._across is None:
            chords = _unit(np.diff(knots, axis=0))
            self._across = int(np.abs(np.einsum("nik,ni->nk", axes, chords)).mean(axis=0).argmin())
        return self._around(self._points @ knots, self._tangents @ knots, axes[:, :, self._across])

    def _around(self, points: Array, tangents: Array, sides: Array) -> Triangles:
        """Rings about ``points``, each starting towards the blended ``sides`` (n, 3) of the elements."""
        place = np.linspace(0.0, len(sides) - 1.0, len(points))
        low = np.minimum(place.astype(int), max(len(sides) - 2, 0))
        weight = (place - low)[:, None]
        side = (1.0 - weight) * sides[low] + weight * sides[np.minimum(low + 1, len(sides) - 1)]
        tangents = _unit(tangents)
        side = _unit(side - tangents * np.einsum("ij,ij->i", side, tangents)[:, None])
        up = np.cross(tangents, side)
        normals = self._cos * side[:, None] + self._sin * up[:, None]
        positions = points[:, None] + self._radius * normals
        ends = np.broadcast_to(points[[0, -1], None], normals[[0, -1]].shape)
        caps = np.broadcast_to((tangents[[0, -1]] * [[-1.0], [1.0]])[:, None], ends.shape)
        positions = np.concatenate([ends[:1], positions, ends[1:]])
        normals = np.concatenate([caps[:1], normals, caps[1:]])
        return Triangles(positions.reshape(-1, 3), normals.reshape(-1, 3), self._uvs, self.faces)


def _knots(scene: Scene, rod: RodChain) -> tuple[NDArray[np.int64], Array]:
    """The rod's ends and joint pivots (n + 1, 3), each in the frame of the body that carries it, and those bodies.

    An end is where an anchor holds it; a free end lies as far from the last pivot as its element is long.
    """
    carriers, places = [], []
    for index in rod.joints:
        joint = scene.joints[index]
        carriers.append(joint.parent)
        places.append(scene.bodies[joint.parent].T_body_inertial @ joint.T_parent_a[:, 3])
    anchors = {
        body: scene.bodies[body].T_body_inertial @ (joint.T_parent_a if body == joint.parent else joint.T_child_b)[:, 3]
        for joint in map(scene.joints.__getitem__, rod.anchors)
        for body in (joint.parent, joint.child)
    }
    pivots = [scene.bodies[c].T_world_body @ p for c, p in zip(carriers, places, strict=True)]
    for end, near, inner in ((0, 0, 1), (-1, -1, -2)):
        body = rod.bodies[end]
        place = anchors.get(body)
        if place is None:
            T = scene.bodies[body].T_world_body
            if len(pivots) > 1:
                away = pivots[near] - pivots[inner]
            else:
                away = T[:, 3] - pivots[0] if pivots else T[:, 2] * (1 if end else -1)
            start = pivots[near] if pivots else T[:, 3] - T[:, 2] * rod.lengths[0] / 2 * (1 if end else -1)
            place = np.linalg.solve(T, start + _unit(away[None])[0] * rod.lengths[end])
        where = 0 if end == 0 else len(carriers)
        carriers.insert(where, body)
        places.insert(where, place)
    return np.array(carriers), np.array(places)[:, :3]


def _rings(along: Array, sides: int) -> tuple[NDArray[np.int32], Array]:
    """Faces and texture coordinates of rings at the places ``along`` (n,), u around and v along the tube."""
    index = np.arange(len(along) * (sides + 1)).reshape(len(along), sides + 1)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    uvs = np.stack(np.meshgrid(np.linspace(0, 1, sides + 1), along), -1).reshape(-1, 2)
    return faces.astype(np.int32), uvs


def _unit(vectors: Array) -> Array:
    unit: Array = vectors / (np.linalg.norm(vectors, axis=-1, keepdims=True) + 1e-30)
    return unit
