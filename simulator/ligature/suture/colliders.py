"""The convex parts of all bodies around rods, as arrays for the compiled contact search.

Shapes stand in body frames; metres. Triangle meshes are touched as their convex hulls.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.mesh.distance import BOX, CAPSULE, CONE, CYLINDER, HALF_SPACE, HULL, SPHERE
from ligature.mesh.hulls import hull_planes
from ligature.model.frames import inverse, matrix_pose7
from ligature.model.scene import Scene
from ligature.model.shapes import Box, Capsule, Cone, Cylinder, Hull, Plane, Shape, Sphere, TriMesh
from ligature.suture.bodies import Bodies
from ligature.suture.layout import Shapes
from ligature.suture.placing import look, watch
from ligature.tables import table_of

Array = NDArray[np.float64]

LOOKS = 1
"""Bodies far from every rod whose poses are read in a tick, in turn."""

NEAR = 0.02
"""Distance in metres within which a moving body's pose is read every tick.

Among 30 bodies the turn of each comes every 30 ticks; a body must not come nearer than this in between.
"""

UNBOUNDED = 1e6
"""Half size in metres of the box around a half space."""

_ROUND = {Cylinder: CYLINDER, Capsule: CAPSULE, Cone: CONE}


class Colliders:
    """Convex parts of every body of a scene that is not an element of a rod.

    ``bodies`` are those that have parts, in order, and ``row_of`` where each stands among them; ``motion`` (b, 13)
    holds pose of the inertial frame and twist as they were last read, ``local`` (n, 7) the poses of the parts in the
    inertial frames of their bodies. Compiled code takes ``table`` of a `Watch` and ``indices`` (b,) of the bodies.
    """

    def __init__(self, scene: Scene, dt: float) -> None:
        parts = [
            (body.index, inverse(body.T_body_inertial) @ part.T_body_shape, *shape_arrays(part.shape))
            for body in scene.bodies
            if body.index not in scene.rod_bodies
            for part in body.colliders
        ]
        n = len(parts)
        body = np.array([part[0] for part in parts], dtype=np.int64)
        self._dt = dt
        self.bodies = sorted(set(body.tolist()))
        self.indices = np.array(self.bodies, dtype=np.int64)
        own = self._watch = watch(len(self.bodies), n)
        own.local[:] = np.array([matrix_pose7(part[1]) for part in parts]).reshape(n, 7)
        own.extent[:] = np.array([part[5] for part in parts]).reshape(n, 2, 3)
        for k, b in enumerate(self.bodies):
            own.ranges[k] = np.flatnonzero(body == b)[[0, -1]] + [0, 1]
        own.static[:] = own.still[:] = [scene.bodies[b].static for b in self.bodies]
        self.table = table_of(own)
        planes = [part[4] for part in parts]
        ends = np.cumsum([0] + [len(p) for p in planes])
        self._slices = {b: slice(*r) for b, r in zip(self.bodies, own.ranges.tolist(), strict=True)}
        self.row_of = {b: k for k, b in enumerate(self.bodies)}
        self._common = {
            "kind": np.array([part[2] for part in parts], dtype=np.int64),
            "size": np.array([part[3] for part in parts]).reshape(n, 3),
            "planes": np.vstack(planes) if planes else np.zeros((0, 4)),
            "plane_range": np.column_stack([ends[:-1], ends[1:]]).astype(np.int64),
            "pose": own.pose,
            "box": own.box,
            "sweep": own.sweep,
            "friction": np.array([scene.bodies[b].friction for b in body]),
        }
        self._nearby: list[int] = []
        self._looked = False
        """Whether bodies were read ahead of `update`."""
        self.motion, self.local = own.motion, own.local

    def shapes(self, elements: int) -> Shapes:
        """The parts as a rod of ``elements`` elements sees them; all rods share poses."""
        n = len(self._common["kind"])
        far = np.full(n, -1, dtype=np.int64)
        return Shapes(node=far, skip=np.zeros((n, elements), dtype=np.bool_), **self._common)

    def parts_of(self, body: int) -> slice:
        """The rows of a body's parts in `shapes`; empty for a body without any."""
        return self._slices.get(body, slice(0, 0))

    def body_of(self, part: int) -> int:
        """The body of a row in `shapes`."""
        return next(body for body, rows in self._slices.items() if rows.start <= part < rows.stop)

    def update(self, bodies: Bodies, corners: Array) -> list[int]:
        """Bring the motion of bodies near the box ``corners`` (2, 3) up to date; returns those bodies.

        The list is another one as soon as it holds other bodies.
        """
        if self.bodies and not self._looked:
            bodies.read_motions(self.indices, self._watch.seen)
            if look(self.table, corners, self._dt, LOOKS, NEAR):
                self._list_near()
        self._looked = False
        return self._nearby

    @property
    def nearby(self) -> list[int]:
        """The bodies that are near the rods, as `update` returned them."""
        return self._nearby

    def look_ahead(self) -> None:
        """Compiled code has read the bodies for the coming `update`, and others are near."""
        self._looked = True
        self._list_near()

    def restart(self) -> None:
        """Read all poses in the next update."""
        self._watch.turn[0] = -1

    def reset(self) -> None:
        """As at the start: nothing was read."""
        self._nearby = []
        for name in _KEPT:
            getattr(self._watch, name)[:] = 0
        self._watch.still[:] = self._watch.static
        self.restart()

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick: what is near, and when and where it was read."""
        return {name: getattr(self._watch, name) for name in _KEPT}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        for name, values in snapshot.items():
            getattr(self._watch, name)[:] = values
        self._list_near()

    def _list_near(self) -> None:
        """List the bodies that are near, anew."""
        self._nearby = [self.bodies[k] for k in np.flatnonzero(self._watch.near).tolist()]


_KEPT = ("turn", "still", "near", "due", "placed", "motion", "pose", "box", "sweep")
"""Arrays of `Watch` that last from tick to tick."""


def shape_arrays(shape: Shape) -> tuple[int, Array, Array, Array]:
    """Kind, sizes (3,), planes (n, 4) and box (2, 3) of a shape in its own frame."""
    none = np.zeros((0, 4))
    if isinstance(shape, Box):
        half = 0.5 * np.asarray(shape.size)
        return BOX, np.asarray(shape.size), none, np.array([-half, half])
    if isinstance(shape, Sphere):
        return SPHERE, np.array([shape.radius, 0.0, 0.0]), none, np.array([[-shape.radius] * 3, [shape.radius] * 3])
    if isinstance(shape, Cylinder | Capsule | Cone):
        half = np.array([shape.radius, shape.radius, 0.5 * shape.height])
        return _ROUND[type(shape)], np.array([shape.radius, shape.height, 0.0]), none, np.array([-half, half])
    if isinstance(shape, Plane):
        everything = np.array([[-UNBOUNDED] * 3, [UNBOUNDED] * 3])
        return HALF_SPACE, np.zeros(3), np.append(shape.normal, shape.offset)[None], everything
    assert isinstance(shape, Hull | TriMesh)
    box = np.array([shape.vertices.min(axis=0), shape.vertices.max(axis=0)])
    return HULL, np.zeros(3), hull_planes(shape.vertices), box
