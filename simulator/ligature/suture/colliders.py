"""The convex parts of all bodies around a rod, as arrays for the compiled contact search.

Shapes stand in body frames; metres.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.mesh.distance import BOX, CAPSULE, CONE, CYLINDER, HALF_SPACE, HULL, SPHERE, hull_planes
from ligature.model.frames import matrix_pose7, pose7_matrix
from ligature.model.scene import Box, Capsule, Cone, Cylinder, Hull, Plane, Scene, Shape, Sphere
from ligature.suture.bodies import Bodies

Array = NDArray[np.float64]

REFRESH = 8
"""Ticks between looks at bodies that are far from the rod."""

NEAR = 0.05
"""Distance in metres within which a body's pose is read every tick; at 1 m/s it takes 50 ticks to cross."""

_ROUND = {Cylinder: CYLINDER, Capsule: CAPSULE, Cone: CONE}


class Colliders:
    """Convex parts of every body of a scene that is not an element of a rod."""

    def __init__(self, scene: Scene) -> None:
        parts = [
            (body.index, part) for body in scene.bodies if body.index not in scene.rod_bodies for part in body.colliders
        ]
        rows = [(index, part.T_body_shape, *_arrays(part.shape)) for index, part in parts]
        rows = [row for row in rows if row[2] >= 0]
        n = len(rows)
        self.body = np.array([row[0] for row in rows], dtype=np.int64)
        self._local = [row[1] for row in rows]
        self.kind = np.array([row[2] for row in rows], dtype=np.int64)
        self.size = np.array([row[3] for row in rows]).reshape(n, 3)
        planes = [row[4] for row in rows]
        ends = np.cumsum([0] + [len(p) for p in planes])
        self.planes = np.vstack(planes) if planes else np.zeros((0, 4))
        self.plane_range = np.column_stack([ends[:-1], ends[1:]]).astype(np.int64)
        self.bound = np.array([row[5] for row in rows])
        self.pose = np.zeros((n, 7))
        self.friction = np.array([scene.bodies[b].friction for b in self.body])
        self._members = {int(b): np.flatnonzero(self.body == b) for b in np.unique(self.body)}
        self._static = {b for b in self._members if scene.bodies[b].static}
        self._tick = 0

    def update(self, bodies: Bodies, low: Array, high: Array) -> None:
        """Bring the poses of parts near the box ``low`` … ``high`` (3,) up to date."""
        everything = self._tick % REFRESH == 0
        self._tick += 1
        if everything:
            chosen = list(self._members)
        else:
            gap = np.maximum(np.maximum(low - self.pose[:, :3], self.pose[:, :3] - high), 0.0)
            near = np.linalg.norm(gap, axis=1) < self.bound + NEAR
            chosen = [b for b in np.unique(self.body[near]).tolist() if b not in self._static]
        for body in chosen:
            T = pose7_matrix(bodies.pose7(body))
            for c in self._members[body]:
                self.pose[c] = matrix_pose7(T @ self._local[c])

    def restart(self) -> None:
        """Forget when poses were read, so that the next update reads all."""
        self._tick = 0


def _arrays(shape: Shape) -> tuple[int, Array, Array, float]:
    """Kind (-1 for shapes that rods do not touch), sizes (3,), planes (n, 4), bounding radius."""
    none = np.zeros((0, 4))
    if isinstance(shape, Box):
        return BOX, np.asarray(shape.size), none, float(np.linalg.norm(shape.size)) / 2
    if isinstance(shape, Sphere):
        return SPHERE, np.array([shape.radius, 0.0, 0.0]), none, shape.radius
    if isinstance(shape, Cylinder | Capsule | Cone):
        size = np.array([shape.radius, shape.height, 0.0])
        return _ROUND[type(shape)], size, none, float(np.hypot(shape.radius, shape.height / 2))
    if isinstance(shape, Hull):
        return (
            HULL,
            np.zeros(3),
            hull_planes(shape.vertices),
            float(np.linalg.norm(shape.vertices, axis=1).max()),
        )
    if isinstance(shape, Plane):
        return HALF_SPACE, np.zeros(3), np.append(shape.normal, shape.offset)[None], 1e6
    return -1, np.zeros(3), none, 0.0
