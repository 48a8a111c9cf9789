"""Ghost objects: which bodies and rod elements overlap a volume that follows its parent.

World axes, metres. A body overlaps a ghost when one of its contact distances to it is below zero
(as in AMBF since August 2024).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import compiled
from ligature.mesh.distance import BOX, CAPSULE, CONE, CYLINDER, HULL, SPHERE, signed_distance
from ligature.mesh.hulls import hull_planes
from ligature.model.frames import matrix_pose7
from ligature.model.poses import compose
from ligature.model.scene import Scene
from ligature.model.shapes import Box, Capsule, Collider, Cone, Cylinder, Hull, Shape, Sphere, TriMesh
from ligature.model.state import FieldViews, StateRecord
from ligature.model.subsystem import Subsystem
from ligature.sensing.queries import Queries
from ligature.tables import opener, table_of

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

SAMPLES = 5
"""Points along a rod element that are tested; neighbours are closer than the element's diameter."""

CONVEX = (Box, Sphere, Cylinder, Capsule, Cone, Hull)
"""Shapes that rod elements are tested against."""

BAND = 20e-3
"""Distance in metres within which the surfaces of a ghost and a body are measured.

A pair is measured again only after the two may have moved by the distance between their surfaces, so that the result
does not depend on the rate of reading.
"""

CONFIDENCE = 0.5
"""Share of a measured distance to rely on; the engine's distances are not exact."""


class GhostArrays(NamedTuple):
    """Ghosts and what they may sense: g ghosts of v convex pieces, n bodies with shapes, e elements of rods."""

    kinds: Integers  # (v,) of the pieces
    sizes: Array  # (v, 3)
    planes: Array  # (p, 4) of all hulls
    plane_range: Integers  # (v, 2)
    local: Array  # (v, 7) in the ghost's frame
    bounds: Array  # (v,) radius of the ball around a piece
    owner: Integers  # (v,) its ghost
    elements: Integers  # (e,) bodies that are elements of rods
    half_lengths: Array  # (e,)
    radii: Array  # (e,)
    solid: Integers  # (n,) other bodies
    ghost_reach: Array  # (g,) radius of the ball around a ghost
    reach: Array  # (n,) and around a body
    apart: Array  # (g, n, 7) pose of the smaller of a pair in the frame of the larger one now
    measured: Array  # (g, n, 7) and as the pair was measured last
    room: Array  # (g, n) how far the two may move until they have to be measured again
    inside: Flags  # (g, n)
    due: Flags  # (g, n) whether a pair has to be measured
    seen: Array  # (g + n, 7) poses of ghosts and bodies as they were last
    moved: Flags  # (g + n,) scratch: whether they are others now


_open_ghosts = opener(
    GhostArrays(
        *(
            np.zeros((1,) * rank, kind)
            for rank, kind in [
                (1, np.int64), (2, float), (2, float), (2, np.int64), (2, float), (1, float), (1, np.int64),
                (1, np.int64), (1, float), (1, float), (1, np.int64), (1, float), (1, float), (3, float), (3, float),
                (2, float), (2, np.bool_), (2, np.bool_), (2, float), (1, np.bool_),
            ]
        )
    )
)  # fmt: skip


@compiled
def _look(table: Integers, ghost_world: Array, body_pose: Array, sensed: Flags) -> bool:
    """Flag the pairs to measure; whether there are any. Without any, fill ``sensed`` as `_find_inside` does."""
    found = _pairs_to_measure(table, ghost_world, body_pose)
    if not found:
        _find_inside(table, ghost_world, body_pose, sensed)
    return found


@compiled
def _find_inside(table: Integers, ghost_world: Array, body_pose: Array, sensed: Flags) -> None:
    """Fill ``sensed`` (g, b): the bodies inside as they were measured, and the elements that touch a piece."""
    g = _open_ghosts(table)
    for i in range(g.solid.shape[0]):
        for k in range(sensed.shape[0]):
            sensed[k, g.solid[i]] = g.inside[k, i]
    if g.elements.shape[0] > 0:
        _elements_inside(
            g.kinds, g.sizes, g.planes, g.plane_range, g.local, g.bounds, g.owner, ghost_world, body_pose, g.elements,
            g.half_lengths, g.radii, sensed,
        )  # fmt: skip


@compiled
def _elements_inside(
    kinds: Integers, sizes: Array, planes: Array, plane_range: Integers, local: Array, bounds: Array, owner: Integers,
    ghost_world: Array, body_pose: Array, elements: Integers, half_lengths: Array, radii: Array, sensed: Flags,
) -> None:  # fmt: skip
    """Set ``sensed[g, b]`` for every element b (axis local Z) that touches a piece of ghost g, clear it for others."""
    for g in range(sensed.shape[0]):
        for b in elements:
            sensed[g, b] = False
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(elements.shape[0]):
        for a in range(3):
            at, reach = body_pose[elements[i], a], half_lengths[i] + radii[i]
            low[a], high[a] = min(low[a], at - reach), max(high[a], at + reach)
    shape, back, normal = np.empty(7), np.empty(7), np.empty(3)
    point, there = np.zeros(7), np.empty(7)
    point[6] = 1.0
    for v in range(kinds.shape[0]):
        hit = sensed[owner[v]]
        compose(ghost_world[owner[v]], local[v], shape)
        if not _meets(shape, bounds[v], low, high):
            continue
        _invert(shape, back)
        own = planes[plane_range[v, 0] : plane_range[v, 1]]
        for i in range(elements.shape[0]):
            pose = body_pose[elements[i]]
            dx, dy, dz = pose[0] - shape[0], pose[1] - shape[1], pose[2] - shape[2]
            reach = bounds[v] + half_lengths[i] + radii[i]
            if hit[elements[i]] or dx * dx + dy * dy + dz * dz > reach * reach:
                continue
            x, y, z, w = pose[3], pose[4], pose[5], pose[6]
            ax, ay, az = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
            for k in range(SAMPLES):
                s = half_lengths[i] * (2.0 * k / (SAMPLES - 1) - 1.0)
                point[0], point[1], point[2] = pose[0] + s * ax, pose[1] + s * ay, pose[2] + s * az
                compose(back, point, there)
                if signed_distance(kinds[v], sizes[v], own, there, normal) <= radii[i]:
                    hit[elements[i]] = True
                    break


@compiled
def _meets(centre: Array, radius: float, low: Array, high: Array) -> bool:
    """Whether the box around a ball may meet the box from ``low`` to ``high`` (3,)."""
    meets = True
    for a in range(3):
        meets = meets and low[a] - radius <= centre[a] <= high[a] + radius
    return meets


@compiled
def _invert(pose: Array, out: Array) -> None:
    """The inverse of a pose (7,)."""
    turn_back, origin = np.zeros(7), np.zeros(7)
    turn_back[3], turn_back[4], turn_back[5], turn_back[6] = -pose[3], -pose[4], -pose[5], pose[6]
    origin[0], origin[1], origin[2], origin[6] = -pose[0], -pose[1], -pose[2], 1.0
    compose(turn_back, origin, out)


@compiled
def _pairs_to_measure(table: Integers, ghost_world: Array, body_pose: Array) -> bool:
    """Flag as due the pairs that are near each other and may have met or parted since their last measurement.

    Pairs far from each other are not inside, and have no room left.
    """
    ghosts = _open_ghosts(table)
    due, inside, room, solid = ghosts.due, ghosts.inside, ghosts.room, ghosts.solid
    ghost_reach, reach = ghosts.ghost_reach, ghosts.reach
    apart, measured = ghosts.apart, ghosts.measured
    back, found, count = np.empty(7), False, due.shape[0]
    for g in range(count):
        ghosts.moved[g] = _replace(ghosts.seen[g], ghost_world[g])
    for i in range(solid.shape[0]):
        ghosts.moved[count + i] = _replace(ghosts.seen[count + i], body_pose[solid[i]])
    for g in range(count):
        for i in range(due.shape[1]):
            if not (ghosts.moved[g] or ghosts.moved[count + i] or due[g, i]):
                continue
            square, ghost, body = 0.0, ghost_world[g], body_pose[solid[i]]
            for a in range(3):
                square += (ghost[a] - body[a]) ** 2
            if square > (ghost_reach[g] + reach[i]) ** 2:
                inside[g, i] = due[g, i] = False
                room[g, i] = -1.0
                continue
            # a ghost that moves along with the body, like that of a finger, is measured once
            if ghost_reach[g] <= reach[i]:
                _invert(body, back)
                compose(back, ghost, apart[g, i])
            else:
                _invert(ghost, back)
                compose(back, body, apart[g, i])
            moved = _moved(measured[g, i], apart[g, i], min(ghost_reach[g], reach[i]))
            due[g, i] = not moved <= room[g, i]
            found = found or due[g, i]
    return found


@compiled
def _replace(seen: Array, pose: Array) -> bool:
    """Put a ``pose`` (7,) into ``seen``; whether it is another one."""
    other = False
    for a in range(7):
        other = other or seen[a] != pose[a]
        seen[a] = pose[a]
    return other


@compiled
def _moved(before: Array, now: Array, reach: float) -> float:
    """Bound of the displacement of any point within ``reach`` of the origin between two poses (7,)."""
    way, turn = 0.0, 0.0
    for a in range(3):
        way += (now[a] - before[a]) ** 2
    for a in range(3, 7):
        turn += (now[a] - before[a]) ** 2
    # |q − q'| = 2 sin(θ/4) for unit quaternions, and a point at r goes 2 r sin(θ/2) at most
    return np.sqrt(way) + (2.0 * np.sqrt(turn) * reach if turn > 0.0 else 0.0)


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


class Ghosts(Subsystem):
    """All ghosts of a scene; `update` fills ``sensed`` (ghosts, bodies)."""

    def __init__(self, scene: Scene, queries: Queries) -> None:
        self._queries = queries
        self._probes = [queries.add_probe(g.colliders, g.collision_margin) for g in scene.ghosts]
        self._fields = FieldViews("ghost_world", "body_pose", "ghost_sensed")
        self._lay_out_volumes(scene)
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
        shape = (len(self._probes), len(self._solid))
        self._apart, self._measured = np.zeros((*shape, 7)), np.zeros((*shape, 7))
        self._room = np.full(shape, -1.0)
        self._inside, self._due = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
        self._seen, self._moved = np.full((sum(shape), 7), np.nan), np.zeros(sum(shape), dtype=bool)
        self._arrays = GhostArrays(*(np.ascontiguousarray(getattr(self, f"_{name}")) for name in GhostArrays._fields))
        self._table = table_of(self._arrays)

    def _lay_out_volumes(self, scene: Scene) -> None:
        """The convex pieces of all ghosts, as arrays for the test against rod elements."""
        pieces = [
            (g, c) for g, ghost in enumerate(scene.ghosts) for c in ghost.colliders if isinstance(c.shape, CONVEX)
        ]
        arrays = [_shape_arrays(piece.shape) for _, piece in pieces]
        self._owner = np.array([g for g, _ in pieces], dtype=np.int64)
        self._local = np.array([matrix_pose7(piece.T_body_shape) for _, piece in pieces]).reshape(-1, 7)
        self._kinds = np.array([kind for kind, *_ in arrays], dtype=np.int64)
        self._sizes = np.array([size for _, size, _, _ in arrays]).reshape(-1, 3)
        self._bounds = np.array([bound for *_, bound in arrays])
        ends = np.cumsum([0, *(len(planes) for _, _, planes, _ in arrays)])
        self._plane_range = np.column_stack([ends[:-1], ends[1:]]).astype(np.int64)
        self._planes = np.vstack([np.zeros((0, 4)), *(planes for _, _, planes, _ in arrays)])

    def sense(self, state: StateRecord) -> None:
        """Find the bodies in the ghosts, and write them."""
        if self._probes:
            ghost_world, body_pose, sensed = self._fields.of(state)
            self.update(ghost_world, body_pose)
            sensed[:] = self.sensed

    def reset(self) -> None:
        """Nothing: overlaps follow from the poses."""

    def snapshot(self) -> None:
        """Nothing: overlaps follow from the poses."""

    def restore(self, snapshot: None) -> None:
        """Nothing: overlaps follow from the poses."""

    def update(self, ghost_world: Array, body_pose: Array) -> None:
        """Update ``sensed``; ``ghost_world`` (ghosts, 7) and ``body_pose`` (bodies, 7) in world axes."""
        if not self._probes:
            return
        if _look(self._table, ghost_world, body_pose, self.sensed):
            self._measure_pairs(ghost_world)
            _find_inside(self._table, ghost_world, body_pose, self.sensed)

    def _measure_pairs(self, ghost_world: Array) -> None:
        due: dict[int, list[int]] = {}
        for pair in self._due.ravel().nonzero()[0].tolist():
            ghost, row = divmod(pair, len(self._solid))
            due.setdefault(ghost, []).append(row)
        for ghost, rows in due.items():
            candidates = self._solid[rows].tolist()
            gaps = self._queries.probe_gaps(self._probes[ghost], ghost_world[ghost], candidates, BAND)
            for row, gap in zip(rows, gaps, strict=True):  # one by one: they are few, and rows of arrays take longer
                self._inside[ghost, row] = gap <= 0.0
                self._room[ghost, row] = CONFIDENCE * min(abs(gap), BAND)
                self._measured[ghost, row] = self._apart[ghost, row]


def _reach(colliders: tuple[Collider, ...]) -> float:
    """Radius of the ball about the body's origin that holds all its shapes; infinite for planes."""
    reach = 0.0
    for part in colliders:
        if isinstance(part.shape, CONVEX):
            bound = _shape_arrays(part.shape)[3]
        elif isinstance(part.shape, TriMesh):
            bound = float(np.linalg.norm(part.shape.vertices, axis=1).max())
        else:
            bound = np.inf
        reach = max(reach, float(np.linalg.norm(part.T_body_shape[:3, 3])) + bound)
    return reach
