"""Ghost objects: which bodies and rod elements overlap a volume that follows its parent.

World axes, metres. A body overlaps a ghost when one of its contact distances to it is below zero
(ADF specification §16, revision B).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ligature.model.frames import matrix_pose7
from ligature.model.scene import Box, Capsule, Collider, Cylinder, Hull, Scene, Shape, Sphere
from ligature.sensing.attachments import compose
from ligature.sensing.queries import Queries

Array = NDArray[np.float64]

SAMPLES = 5
"""Points along a rod element that are tested; neighbours are closer than the element's diameter."""

BOX, SPHERE, CYLINDER, CAPSULE, CONE, HULL = range(6)


@njit(cache=True)
def _inside(kind: int, size: Array, planes: Array, p: Array, radius: float) -> bool:
    """Whether a ball of ``radius`` at ``p`` (3,) in the shape's frame touches the shape."""
    if kind == SPHERE:
        return p[0] ** 2 + p[1] ** 2 + p[2] ** 2 <= (size[0] + radius) ** 2
    if kind == CAPSULE:
        half = max(0.5 * size[1] - size[0], 0.0)
        dz = p[2] - min(max(p[2], -half), half)
        return p[0] ** 2 + p[1] ** 2 + dz * dz <= (size[0] + radius) ** 2
    if kind == BOX:
        square = 0.0
        for i in range(3):
            d = max(abs(p[i]) - 0.5 * size[i], 0.0)
            square += d * d
        return square <= radius * radius
    if kind == CYLINDER:
        radial = max((p[0] ** 2 + p[1] ** 2) ** 0.5 - size[0], 0.0)
        axial = max(abs(p[2]) - 0.5 * size[1], 0.0)
        return radial**2 + axial**2 <= radius * radius
    if kind == CONE:
        slope = size[0] / size[1]
        radial = (p[0] ** 2 + p[1] ** 2) ** 0.5 - slope * (0.5 * size[1] - p[2])
        return radial / (1.0 + slope * slope) ** 0.5 <= radius and abs(p[2]) <= 0.5 * size[1] + radius
    for i in range(planes.shape[0]):
        if planes[i, 0] * p[0] + planes[i, 1] * p[1] + planes[i, 2] * p[2] - planes[i, 3] > radius:
            return False
    return planes.shape[0] > 0


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
    inverse = np.empty(7)
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
            if _inside(kind, size, planes, local, radii[i]):
                hit[i] = True
                break


def _shape_arrays(shape: Shape) -> tuple[int, Array, Array, float]:
    """Kind, sizes (3,), hull planes (n, 4) as normal and offset, and bounding radius of a shape."""
    none = np.zeros((0, 4))
    if isinstance(shape, Box):
        return BOX, np.asarray(shape.size, dtype=float), none, float(np.linalg.norm(shape.size)) / 2
    if isinstance(shape, Sphere):
        return SPHERE, np.array([shape.radius, 0.0, 0.0]), none, shape.radius
    if isinstance(shape, Hull):
        from scipy.spatial import ConvexHull

        equations = ConvexHull(shape.vertices).equations
        planes = np.column_stack([equations[:, :3], -equations[:, 3]])
        return HULL, np.zeros(3), planes, float(np.linalg.norm(shape.vertices, axis=1).max())
    kind = {Cylinder: CYLINDER, Capsule: CAPSULE}.get(type(shape), CONE)
    radius, height = float(shape.radius), float(shape.height)  # type: ignore[union-attr]
    return kind, np.array([radius, height, 0.0]), none, float(np.hypot(radius, height / 2))


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
            [_Volume(c) for c in g.colliders if isinstance(c.shape, Box | Sphere | Cylinder | Capsule | Hull)]
            for g in scene.ghosts
        ]
        self._elements = np.array(sorted(scene.rod_bodies), dtype=np.int64)
        lengths = {b: length for rod in scene.rods for b, length in zip(rod.bodies, rod.lengths, strict=True)}
        radii = {b: rod.radius for rod in scene.rods for b in rod.bodies}
        self._half_lengths = np.array([lengths[b] / 2 for b in self._elements], dtype=float)
        self._radii = np.array([radii[b] for b in self._elements], dtype=float)
        self.sensed = np.zeros((len(scene.ghosts), len(scene.bodies)), dtype=bool)

    def update(self, ghost_world: Array, body_pose: Array) -> None:
        """Sense again; ``ghost_world`` (ghosts, 7) and ``body_pose`` (bodies, 7) in world axes."""
        self.sensed[:] = False
        elements = body_pose[self._elements]
        for ghost, probe in enumerate(self._probes):
            self.sensed[ghost, self._queries.probe_overlaps(probe, ghost_world[ghost])] = True
            if len(elements):
                hit = np.zeros(len(elements), dtype=bool)
                for volume in self._volumes[ghost]:
                    compose(ghost_world[ghost], volume.local, volume.world)
                    _elements_inside(
                        volume.kind, volume.size, volume.planes, volume.world, volume.bound,
                        elements, self._half_lengths, self._radii, hit,
                    )  # fmt: skip
                self.sensed[ghost, self._elements[hit]] = True

    def sensed_bodies(self, ghost: int) -> Iterable[int]:
        """Indices of the bodies that overlap ``ghost``, in scene order."""
        return np.flatnonzero(self.sensed[ghost]).tolist()
