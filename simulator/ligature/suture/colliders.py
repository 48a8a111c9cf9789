"""The convex parts of all bodies around rods, as arrays for the compiled contact search.

Shapes stand in body frames; metres. Triangle meshes are touched as their convex hulls.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.mesh.distance import BOX, CAPSULE, CONE, CYLINDER, HALF_SPACE, HULL, SPHERE, hull_planes
from ligature.model.frames import inverse, matrix_pose7
from ligature.model.scene import Scene
from ligature.model.shapes import Box, Capsule, Cone, Cylinder, Hull, Plane, Shape, Sphere, TriMesh
from ligature.model.subsystem import kept, put_back
from ligature.suture.bodies import Bodies
from ligature.suture.layout import Shapes
from ligature.suture.placing import survey

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
    holds pose of the inertial frame and twist as they were last read.
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
        self._local = np.array([matrix_pose7(part[1]) for part in parts]).reshape(n, 7)
        self._extent = np.array([part[5] for part in parts]).reshape(n, 2, 3)
        planes = [part[4] for part in parts]
        ends = np.cumsum([0] + [len(p) for p in planes])
        self.bodies = sorted(set(body.tolist()))
        self._ranges = np.array([[*np.flatnonzero(body == b)[[0, -1]]] for b in self.bodies], dtype=np.int64)
        self._ranges = self._ranges.reshape(-1, 2) + np.array([0, 1])
        self._slices = {b: slice(*r) for b, r in zip(self.bodies, self._ranges.tolist(), strict=True)}
        self.row_of = {b: k for k, b in enumerate(self.bodies)}
        self._static = [scene.bodies[b].static for b in self.bodies]
        self._still = list(self._static)
        self._common = {
            "kind": np.array([part[2] for part in parts], dtype=np.int64),
            "size": np.array([part[3] for part in parts]).reshape(n, 3),
            "planes": np.vstack(planes) if planes else np.zeros((0, 4)),
            "plane_range": np.column_stack([ends[:-1], ends[1:]]).astype(np.int64),
            "pose": np.zeros((n, 7)),
            "box": np.zeros((n, 2, 3)),
            "sweep": np.zeros(n),
            "friction": np.array([scene.bodies[b].friction for b in body]),
        }
        self._near, self._due, self._placed = np.zeros((3, len(self.bodies)), dtype=np.bool_)
        self._watched: list[int] = []
        self._nearby: list[int] = []
        self.motion = np.zeros((len(self.bodies), 13))
        self._R = np.zeros((3, 3))
        self._turn = -1

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
        n = len(self.bodies)
        if self._turn < 0:
            fresh = list(range(n))
            self._placed[:] = False
        else:
            fresh = [k for k in self._watched if not self._still[k]]
            fresh += [k for k in ((self._turn + i) % n for i in range(min(LOOKS, n))) if k not in fresh]
        self._turn = (self._turn + LOOKS) % n if n and self._turn >= 0 else 0
        for k in fresh:
            self._read(bodies, k)
        if self._survey(corners):
            self._watched = np.flatnonzero(self._near).tolist()
            self._nearby = [self.bodies[k] for k in self._watched]
            late = [k for k in self._watched if k not in fresh and not self._still[k]]
            for k in late:
                self._read(bodies, k)
            if late:
                self._survey(corners)
                self._near[self._watched] = True
        return self._nearby

    def _survey(self, corners: Array) -> bool:
        common = self._common
        changed: bool = survey(
            self._due, self._ranges, self._local, self._extent, self.motion, self._dt, common["pose"], common["box"],
            common["sweep"], corners, NEAR, self._near, self._R,
        )  # fmt: skip
        return changed

    def _read(self, bodies: Bodies, k: int) -> None:
        pose, twist = bodies.motion(self.bodies[k])
        motion = self.motion[k]
        if self._static[k]:
            # A body without mass moves by commands alone; while it does, it is read every tick.
            self._still[k] = not self._placed[k] or bool((motion[:7] == pose).all())
            if self._placed[k] and self._still[k]:
                return
        motion[:7], motion[7:] = pose, twist
        self._due[k] = self._placed[k] = True

    def restart(self) -> None:
        """Read all poses in the next update."""
        self._turn = -1

    def reset(self) -> None:
        """As at the start: nothing was read."""
        self.restart()
        self._still[:] = self._static
        self._watched, self._nearby = [], []
        for array in (self._near, self._due, self._placed, self.motion, *(self._common[name] for name in _PLACED)):
            array[:] = 0

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick: what is near, and when and where it was read."""
        return {**kept(self, _KEPT), "parts": {name: self._common[name] for name in _PLACED}}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        put_back(self, {name: snapshot[name] for name in _KEPT})
        for name in _PLACED:
            self._common[name][:] = snapshot["parts"][name]


_KEPT = ("_turn", "_still", "_near", "_due", "_placed", "_watched", "_nearby", "motion")
"""Attributes of `Colliders` that last from tick to tick."""

_PLACED = ("pose", "box", "sweep")
"""Arrays of all parts that follow their bodies."""


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
