"""Ghost objects: which bodies and rod elements overlap a volume that follows its parent.

World axes, metres. A body overlaps a ghost when one of its contact distances to it is below zero
(ADF specification §16, revision B).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ligature.mesh.distance import BOX, CAPSULE, CONE, CYLINDER, HULL, SPHERE, hull_planes, signed_distance
from ligature.model.frames import matrix_pose7
from ligature.model.poses import compose
from ligature.model.scene import Box, Capsule, Collider, Cone, Cylinder, Hull, Scene, Shape, Sphere, TriMesh
from ligature.sensing.queries import Queries

Array = NDArray[np.float64]

SAMPLES = 5
"""Points along a rod element that are tested; neighbours are closer than the element's diameter."""

STILL = 1e-6
"""Change of a pose (metres, quaternion) below which a pair is not asked about again."""


@njit(cache=True)
def _elements_inside(
    kind: int,
    size: Array,
    planes: Array,
    shape_pose: Array,
    bound: float,
    elements: Array,
    half_lengths: Array,
    radii: Array,
    hit: NDArray[np.bool_],
) -> None:
    """Set ``hit[i]`` for every element (pose row of ``elements``, axis local Z) that touches the shape."""
    inverse, normal = np.empty(7), np.empty(3)
    conjugate = np.array([0.0, 0.0, 0.0, -shape_pose[3], -shape_pose[4], -shape_pose[5], shape_pose[6]])
    origin = np.zeros(7)
    origin[0:3] = -shape_pose[0:3]
    origin[6] = 1.0
    compose(conjugate, origin, inverse)
    point, local = np.zeros(7), np.empty(7)
    point[6] = 1.0
    for i in range(elements.shape[0]):
        dx = elements[i, 0] - shape_pose[0]
        dy = elements[i, 1] - shape_pose[1]
        dz = elements[i, 2] - shape_pose[2]
        reach = bound + half_lengths[i] + radii[i]
        if hit[i] or dx * dx + dy * dy + dz * dz > reach * reach:
            continue
        x, y, z, w = elements[i, 3], elements[i, 4], elements[i, 5], elements[i, 6]
        ax, ay, az = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
        for k in range(SAMPLES):
            s = half_lengths[i] * (2.0 * k / (SAMPLES - 1) - 1.0)
            point[0] = elements[i, 0] + s * ax
            point[1] = elements[i, 1] + s * ay
            point[2] = elements[i, 2] + s * az
            compose(inverse, point, local)
            if signed_distance(kind, size, planes, local, normal) <= radii[i]:
                hit[i] = True
                break


def _shape_arrays(shape: Shape) -> tuple[int, Array, Array, float]:
    """Kind, sizes (3,), hull planes (n, 4) and bounding radius of a convex shape."""
    none = np.zeros((0, 4))
    if isinstance(shape, Box):
        return BOX, np.asarray(shape.size, dtype=float), none, float(np.linalg.norm(shape.size)) / 2
    if isinstance(shape, Sphere):
        return SPHERE, np.array([shape.radius, 0.0, 0.0]), none, shape.radius
    if isinstance(shape, Hull):
        bound = float(np.linalg.norm(shape.vertices, axis=1).max())
        return HULL, np.zeros(3), hull_planes(shape.vertices), bound
    assert isinstance(shape, Cylinder | Capsule | Cone)
    kind = {Cylinder: CYLINDER, Capsule: CAPSULE, Cone: CONE}[type(shape)]
    return (
        kind,
        np.array([shape.radius, shape.height, 0.0]),
        none,
        float(np.hypot(shape.radius, shape.height / 2)),
    )


class _Volume:
    """One convex piece of a ghost, ready for the test against rod elements."""

    def __init__(self, collider: Collider) -> None:
        self.kind, self.size, self.planes, self.bound = _shape_arrays(collider.shape)
        self.local = matrix_pose7(collider.T_body_shape)
        self.world = np.empty(7)


class Ghosts:
    """All ghosts of a scene; `update` fills ``sensed`` (ghosts, bodies)."""

    def __init__(self, scene: Scene, queries: Queries) -> None:
        self._queries = queries
        self._probes = [queries.add_probe(g.colliders, g.collision_margin) for g in scene.ghosts]
        self._volumes = [
            [_Volume(c) for c in g.colliders if isinstance(c.shape, Box | Sphere | Cylinder | Capsule | Cone | Hull)]
            for g in scene.ghosts
        ]
        self._elements = np.array(sorted(scene.rod_bodies), dtype=np.int64)
        lengths = {b: length for rod in scene.rods for b, length in zip(rod.bodies, rod.lengths, strict=True)}
        radii = {b: rod.radius for rod in scene.rods for b in rod.bodies}
        self._half_lengths = np.array([lengths[b] / 2 for b in self._elements], dtype=float)
        self._radii = np.array([radii[b] for b in self._elements], dtype=float)
        self._solid = np.array(
            [b.index for b in scene.bodies if b.colliders and b.index not in scene.rod_bodies], dtype=np.int64
        )
        self._reach = np.array([_reach(scene.bodies[b].colliders) for b in self._solid])
        self._ghost_reach = np.array([_reach(g.colliders) for g in scene.ghosts])
        self.sensed = np.zeros((len(scene.ghosts), len(scene.bodies)), dtype=bool)
        self.forget()

    def forget(self) -> None:
        """Ask again about every pair at the next update."""
        shape = (len(self._probes), len(self._solid), 7)
        self._seen_ghost, self._seen_body = np.full(shape, np.nan), np.full(shape, np.nan)
        self._known = np.zeros(shape[:2], dtype=bool)

    def update(self, ghost_world: Array, body_pose: Array) -> None:
        """Sense again; ``ghost_world`` (ghosts, 7) and ``body_pose`` (bodies, 7) in world axes."""
        if not self._probes:
            return
        self._update_bodies(ghost_world, body_pose[self._solid])
        self.sensed[:, self._solid] = self._known
        if len(self._elements):
            self._update_elements(ghost_world, body_pose[self._elements])

    def _update_bodies(self, ghost_world: Array, bodies: Array) -> None:
        """Ask about the pairs that are near each other and moved since they were asked about."""
        gap = np.linalg.norm(ghost_world[:, None, :3] - bodies[None, :, :3], axis=2)
        near = gap <= self._ghost_reach[:, None] + self._reach[None, :]
        self._known &= near
        moved = np.abs(self._seen_ghost - ghost_world[:, None]) <= STILL
        still = moved.all(axis=2) & (np.abs(self._seen_body - bodies[None]) <= STILL).all(axis=2)
        for ghost in np.flatnonzero((near & ~still).any(axis=1)):
            asked = np.flatnonzero(near[ghost] & ~still[ghost])
            found = self._queries.probe_overlaps(self._probes[ghost], ghost_world[ghost], self._solid[asked].tolist())
            self._known[ghost, asked] = np.isin(self._solid[asked], found)
            self._seen_ghost[ghost, asked] = ghost_world[ghost]
            self._seen_body[ghost, asked] = bodies[asked]

    def _update_elements(self, ghost_world: Array, elements: Array) -> None:
        for ghost, volumes in enumerate(self._volumes):
            hit = np.zeros(len(elements), dtype=bool)
            for volume in volumes:
                compose(ghost_world[ghost], volume.local, volume.world)
                _elements_inside(
                    volume.kind, volume.size, volume.planes, volume.world, volume.bound,
                    elements, self._half_lengths, self._radii, hit,
                )  # fmt: skip
            self.sensed[ghost, self._elements] = hit


def _reach(colliders: tuple[Collider, ...]) -> float:
    """Radius of the ball about the body's origin that holds all its shapes; infinite for planes."""
    reach = 0.0
    for part in colliders:
        if isinstance(part.shape, Box | Sphere | Cylinder | Capsule | Cone | Hull):
            bound = _shape_arrays(part.shape)[3]
        elif isinstance(part.shape, TriMesh):
            bound = float(np.linalg.norm(part.shape.vertices, axis=1).max())
        else:
            bound = np.inf
        reach = max(reach, float(np.linalg.norm(part.T_body_shape[:3, 3])) + bound)
    return reach
