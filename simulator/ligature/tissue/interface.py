"""Points of tissue that something pushes: coupled every tick through the compliance of the tissue's step.

Within a tissue step of m ticks a point is at

    y = p + s u + C (λ - λ̄),   s = tick / m,

with p its place at the start, u where the step would take it under the forces λ̄, the mean of the last step, and C the
compliance of the step. At the end of the step the mean of the ticks' forces moves the nodes. So impulses balance, and a
force that lasts moves a point in a tick as far as in a step.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.model.material import TissueMaterial
from ligature.tables import table_of
from ligature.tissue import layout
from ligature.tissue.elastic import ElasticGrid
from ligature.tissue.factorisation import solve_in_place
from ligature.tissue.layout import (
    CUTTING,
    EXIT,
    FRICTION,
    GROUP,
    LEAVING,
    MOST_POINTS,
    PUNCTURE,
    SHEAR,
    STRENGTH,
    UNUSED,
    USED,
    Field,
    Paths,
    Points,
    Tissue,
    open_tissue,
)

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

SPACING = 1.6e-3
"""Length of a path between its nodes, m."""

HARD = 1e-5
"""Least compliance of a bristle, m/N."""

CORE = 0.3
"""Part of the cell behind a held face that nothing presses together."""


class Interface:
    """The points of one grid.

    Parameters
    ----------
    elastic
        The tissue.
    ticks
        Ticks of a step.

    Attributes
    ----------
    table
        The grid, its points and ``paths`` for compiled code, see `ligature.tissue.layout.open_tissue`.
    """

    def __init__(self, elastic: ElasticGrid, ticks: int, paths: Paths) -> None:
        self.elastic, self.ticks = elastic, ticks
        self.points = layout.points()
        self.field = _field(elastic, ticks)
        self._tissue = Tissue(self.field, self.points, paths)
        self.table = table_of(self._tissue)

    @property
    def tick(self) -> int:
        """Ticks of this step that are over."""
        return int(self.field.clock[0])

    @property
    def fraction(self) -> float:
        """Share of the step that has passed when this tick ends."""
        return (self.tick + 1) / self.ticks

    @property
    def unused(self) -> int:
        """Points that are left."""
        return MOST_POINTS - int(self.points.filled[0])

    # --- points -------------------------------------------------------------------------------

    def add(self, nodes: Integers, weights: Array) -> int:
        """Couple the mean of ``nodes`` (k ≤ 8,) with ``weights`` (k,); returns the index of the point.

        Raises
        ------
        RuntimeError
            When all points are in use.
        """
        i = int(add(self.table, nodes, weights))
        if i < 0:
            raise RuntimeError(f"all {MOST_POINTS} points of contact with tissue are in use")
        return i

    def place(self, i: int, nodes: Integers, weights: Array) -> None:
        """Move a point to another place in the material."""
        place(self.table, i, nodes, weights)

    def release(self, i: int) -> None:
        """Let a point go when this tick ends; what it pushed in this step still counts."""
        self.points.status[i] = LEAVING

    def equip(self, i: int, cell: int, radius: float) -> None:
        """Give a point the strength of its cell's material, for a needle or thread of ``radius`` metres."""
        equip(self.table, i, cell, radius)

    def material_of(self, i: int) -> TissueMaterial:
        """What the tissue around a point is made of."""
        return self.elastic.materials[int(self.field.layer[self.points.cell[i]])]

    # --- the tick -----------------------------------------------------------------------------

    def count(self) -> bool:
        """End a tick: add its forces up; True when the step is complete."""
        return bool(end_tick(self.table))

    def push(self, d: Array) -> None:
        """Add to a step's displacements ``d`` (n, 3) what the points' mean forces do, and forget those that left."""
        push(self.table, d)

    def begin(self) -> None:
        """Begin a step, whose forces `ElasticGrid.begin` has found."""
        begin(self.table)

    # --- state --------------------------------------------------------------------------------

    def reset(self) -> None:
        """Let all points go."""
        for array in self.points:
            array[:] = 0
        self.field.clock[0] = 0

    def snapshot(self) -> dict[str, Array]:
        """Everything that lasts from tick to tick."""
        return {
            "tick": np.array([self.tick]),
            **{name: array.copy() for name, array in zip(self.points._fields, self.points, strict=True)},
        }

    def restore(self, snapshot: dict[str, Array]) -> None:
        """Continue from `snapshot`."""
        self.field.clock[0] = snapshot["tick"][0]
        for name, array in zip(self.points._fields, self.points, strict=True):
            array[:] = snapshot[name]
        refresh(self.table)


def _field(elastic: ElasticGrid, ticks: int) -> Field:
    grid, n = elastic.grid, len(elastic.x)
    material = np.zeros((len(elastic.materials), 6))
    for row, m in zip(material, elastic.materials, strict=True):
        row[FRICTION], row[STRENGTH], row[SHEAR] = m.friction, m.strength, m.shear
        row[PUNCTURE], row[CUTTING], row[EXIT] = m.puncture_force, m.cutting_force, m.exit_force
    sites, around = _sites(grid.faces, elastic.row)
    faces = np.vstack([grid.faces, sites])
    face_cell = np.concatenate([grid.face_cell, grid.face_cell[around[:, 0]]])
    cells, layers, faces, face_cell = (
        np.ascontiguousarray(a, dtype=np.int64) for a in (grid.cells, grid.layer, faces, face_cell)
    )
    core = np.concatenate([_core(elastic), np.zeros(len(sites))])
    return Field(
        elastic.x, elastic.force, cells, layers, faces, face_cell, around, core, np.zeros((len(faces), 2, 3)),
        np.zeros((-(-len(faces) // GROUP), 2, 3)), np.zeros((2, 3)), elastic.free, elastic.row, elastic.responses,
        elastic.factor, np.zeros(3 * len(elastic.free)),
        np.zeros((MOST_POINTS, 3)), np.zeros((MOST_POINTS, 3, n, 3)), elastic.modes, material, np.array([0, ticks]),
        np.zeros(1, np.int64),
    )  # fmt: skip


def _sites(faces: Integers, row: Integers) -> tuple[Integers, Integers]:
    """Edges i, j, j, i and nodes i, i, i, i (k, 4) of the surface that move, and the faces around each, (k, 8), or -1.

    Nodes of a ``row`` below 0 are held.
    """
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    found = [_shared(corners) for corners in (ends, np.repeat(faces.reshape(-1, 1), 2, axis=1))]
    ends, around = (np.concatenate(both) for both in zip(*found, strict=True))
    moves = (row[ends] >= 0).any(axis=1)
    return ends[moves][:, [0, 1, 1, 0]], around[moves]


def _shared(ends: Integers) -> tuple[Integers, Integers]:
    """Of four pairs of nodes a face, (4 f, 2): each pair once, and the first 8 faces that have it, or -1."""
    pairs, place, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(place.reshape(-1), kind="stable")
    rank = np.arange(len(ends)) - np.repeat(np.cumsum(count) - count, count)
    around = np.full((len(pairs), 8), -1)
    kept = rank < 8
    around[np.repeat(np.arange(len(pairs)), count)[kept], rank[kept]] = order[kept] // 4
    return pairs, around


def _core(elastic: ElasticGrid) -> Array:
    """`Field.core`: the share `CORE` of the depth of the cell behind each face whose nodes are all fixed; else 0."""
    grid = elastic.grid
    corners = grid.nodes[grid.faces]
    across = np.abs(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])).argmax(axis=1)
    depth = grid.sizes[grid.face_cell, across]
    return np.where((elastic.row[grid.faces] < 0).all(axis=1), CORE * depth, 0.0)


# --- points -----------------------------------------------------------------------------------


@inlined
def _list_used(points: Points) -> None:
    n = 0
    for i in range(points.status.shape[0]):
        if points.status[i] != UNUSED:
            points.used[n] = i
            n += 1
    points.filled[0] = n


@kernel
def respond(field: Field, points: Points, i: int) -> None:
    """Fill ``field.response[i]`` with the displacements of all nodes for unit forces on the point."""
    R, n = field.response[i], field.x.shape[0]
    for a in range(3):
        for k in range(n):
            R[a, k, 0], R[a, k, 1], R[a, k, 2] = 0.0, 0.0, 0.0
    if field.table.shape[0] == 0:
        for a in range(3):
            for k in range(field.load.shape[0]):
                field.load[k] = 0.0
            for c in range(8):
                node = field.row[points.nodes[i, c]]
                if node >= 0:
                    field.load[3 * node + a] += points.weights[i, c]
            solve_in_place(field.factor, field.load)
            for k in range(field.free.shape[0]):
                for b in range(3):
                    R[a, field.free[k], b] = field.load[3 * k + b]
            for mode in range(field.modes.shape[0]):
                Z, share = field.modes[mode], 0.0
                for c in range(8):
                    share += points.weights[i, c] * Z[points.nodes[i, c], a]
                for k in range(n):
                    for b in range(3):
                        R[a, k, b] -= share * Z[k, b]
        return
    for c in range(8):
        node, weight = field.row[points.nodes[i, c]], points.weights[i, c]
        if node >= 0 and weight != 0.0:
            T = field.table[node]
            for a in range(3):
                for k in range(n):
                    R[a, k, 0] += weight * T[a, k, 0]
                    R[a, k, 1] += weight * T[a, k, 1]
                    R[a, k, 2] += weight * T[a, k, 2]


@inlined
def _couple(field: Field, points: Points, i: int) -> None:
    """Compute the compliance between a point and all others."""
    R = field.response[i]
    for u in range(points.filled[0]):
        j = points.used[u]
        for b in range(3):
            for a in range(3):
                moved = 0.0
                for c in range(8):
                    moved += points.weights[j, c] * R[b, points.nodes[j, c], a]
                points.C[j, i, a, b] = moved
                points.C[i, j, b, a] = moved


@kernel
def place_point(field: Field, points: Points, i: int, nodes: Integers, weights: Array) -> None:
    """Move a point to the mean of ``nodes`` (k ≤ 8,) with ``weights`` (k,)."""
    for c in range(8):
        inside = c < nodes.shape[0]
        points.nodes[i, c], points.weights[i, c] = nodes[c] if inside else nodes[0], weights[c] if inside else 0.0
    respond(field, points, i)
    _couple(field, points, i)
    _locate_point(field, points, i)


@inlined
def _locate_point(field: Field, points: Points, i: int) -> None:
    """Place of a point at the start of the step, and where it would go under the last step's forces.

    How the nodes move is known when the step ends; the point's response, which is symmetric, tells earlier of itself.
    """
    R, f = field.response[i], field.force
    for a in range(3):
        p = 0.0
        for c in range(8):
            p += points.weights[i, c] * field.x[points.nodes[i, c], a]
        points.start[i, a] = p
        S, u, v, w = R[a], 0.0, 0.0, 0.0
        for k in range(f.shape[0]):
            u, v, w = u + S[k, 0] * f[k, 0], v + S[k, 1] * f[k, 1], w + S[k, 2] * f[k, 2]
        points.move[i, a] = u + v + w
    for k in range(points.filled[0]):
        j = points.used[k]
        for a in range(3):
            for b in range(3):
                points.move[i, a] += points.C[i, j, a, b] * points.mean[j, b]


@kernel
def add_point(field: Field, points: Points, nodes: Integers, weights: Array) -> int:
    """Use one more point; -1 when there is none."""
    i = 0
    while i < points.status.shape[0] and points.status[i] != UNUSED:
        i += 1
    if i == points.status.shape[0]:
        return -1
    points.status[i] = USED
    _list_used(points)
    for a in range(3):
        points.force[i, a], points.mean[i, a], points.total[i, a] = 0.0, 0.0, 0.0
    place_point(field, points, i, nodes, weights)
    settle_point(field, points, i)
    return i


@inlined
def settle_point(field: Field, points: Points, i: int) -> None:
    """Let a point that was placed anew stand where it is at this time of the step."""
    s = field.clock[0] / field.clock[1]
    points.at[i, 0], points.at[i, 1], points.at[i, 2] = carried(points, i, s)


@inlined
def carried(points: Points, i: int, s: float) -> tuple[float, float, float]:
    """p + s u: where a point is at the part ``s`` of a step in which all forces are the means of the last one."""
    p, u = points.start[i], points.move[i]
    return p[0] + s * u[0], p[1] + s * u[1], p[2] + s * u[2]


@inlined
def displaced(points: Points, i: int, s: float, change: Array) -> tuple[float, float, float]:
    """p + s u + C (λ - λ̄): where a point is with forces that differ by ``change`` (N, 3) from those means."""
    x, y, z = carried(points, i, s)
    for k in range(points.filled[0]):
        j = points.used[k]
        C = points.C[i, j]
        for b in range(3):
            f = change[j, b]
            x, y, z = x + C[0, b] * f, y + C[1, b] * f, z + C[2, b] * f
    return x, y, z


@kernel
def equip_point(field: Field, points: Points, i: int, cell: int, radius: float) -> None:
    """Give a point the strength of its cell's material, for a needle or thread of ``radius`` metres.

    Around a slender inclusion of radius r tissue yields by (ln(d / r) + 0.19) / (4 π G d) under a force on a length d,
    Kelvin's solution integrated along it; the grid has a part of it, the bristle has the rest.
    """
    points.cell[i] = cell
    m = field.material[field.layer[cell]]
    points.friction[i], points.strength[i] = m[FRICTION], m[STRENGTH]
    points.puncture[i], points.cutting[i], points.exit[i] = m[PUNCTURE], m[CUTTING], m[EXIT]
    target = (math.log(SPACING / radius) + 0.19) / (4.0 * math.pi * m[SHEAR] * SPACING)
    C = points.C[i, i]
    points.soft[i] = max(target - (C[0, 0] + C[1, 1] + C[2, 2]) / 3.0, HARD)


@kernel
def add(table: Integers, nodes: Integers, weights: Array) -> int:
    """`add_point` for Python."""
    t = open_tissue(table)
    return add_point(t.field, t.points, nodes, weights)


@kernel
def place(table: Integers, i: int, nodes: Integers, weights: Array) -> None:
    """`place_point` for Python."""
    t = open_tissue(table)
    place_point(t.field, t.points, i, nodes, weights)


@kernel
def equip(table: Integers, i: int, cell: int, radius: float) -> None:
    """`equip_point` for Python."""
    t = open_tissue(table)
    equip_point(t.field, t.points, i, cell, radius)


# --- the tick ---------------------------------------------------------------------------------


@kernel
def end_tick(table: Integers) -> bool:
    """Where all points are when a tick ends, and the sums of their forces; True when the step is complete."""
    t = open_tissue(table)
    points, clock, change = t.points, t.field.clock, t.field.change
    s, n = (clock[0] + 1) / clock[1], points.filled[0]
    for k in range(n):
        i = points.used[k]
        for a in range(3):
            change[i, a] = points.force[i, a] - points.mean[i, a]
            points.total[i, a] += points.force[i, a]
    for k in range(n):
        i = points.used[k]
        points.at[i, 0], points.at[i, 1], points.at[i, 2] = displaced(points, i, s, change)
    for k in range(n):
        i = points.used[k]
        if points.status[i] == LEAVING:
            points.force[i, 0], points.force[i, 1], points.force[i, 2] = 0.0, 0.0, 0.0
    clock[0] += 1
    return clock[0] == clock[1]


@kernel
def push(table: Integers, d: Array) -> None:
    """d (n, 3) += what the mean forces of the points do in the step, which ends; points that left are unused again."""
    t = open_tissue(table)
    field, points = t.field, t.points
    scale = 1.0 / field.clock[1]
    for u in range(points.filled[0]):
        i = points.used[u]
        for a in range(3):
            f = scale * points.total[i, a]
            if f != 0.0:
                R = field.response[i, a]
                for k in range(d.shape[0]):
                    d[k, 0] += f * R[k, 0]
                    d[k, 1] += f * R[k, 1]
                    d[k, 2] += f * R[k, 2]
    for u in range(points.filled[0]):
        i = points.used[u]
        left = points.status[i] == LEAVING
        for a in range(3):
            points.mean[i, a] = 0.0 if left else points.total[i, a] / field.clock[1]
            points.total[i, a] = 0.0
        if left:
            points.status[i] = UNUSED
    _list_used(points)
    field.clock[0] = 0


@kernel
def begin(table: Integers) -> None:
    """Where all points are at the start of a step, and the boxes around faces and nodes."""
    t = open_tissue(table)
    field, points = t.field, t.points
    for k in range(points.filled[0]):
        _locate_point(field, points, points.used[k])
    _box(field)


@kernel
def refresh(table: Integers) -> None:
    """Find again what follows from a restored state."""
    t = open_tissue(table)
    for k in range(t.points.filled[0]):
        respond(t.field, t.points, t.points.used[k])
    _box(t.field)


@inlined
def _box(field: Field) -> None:
    x = field.x
    field.found[0] += 1
    for a in range(3):
        field.box[0, a], field.box[1, a] = math.inf, -math.inf
    for k in range(x.shape[0]):
        for a in range(3):
            field.box[0, a], field.box[1, a] = min(field.box[0, a], x[k, a]), max(field.box[1, a], x[k, a])
    for q in range(field.faces.shape[0]):
        i, j, k, h = field.faces[q, 0], field.faces[q, 1], field.faces[q, 2], field.faces[q, 3]
        for a in range(3):
            field.face_box[q, 0, a] = min(x[i, a], x[j, a], x[k, a], x[h, a]) - field.core[q]
            field.face_box[q, 1, a] = max(x[i, a], x[j, a], x[k, a], x[h, a]) + field.core[q]
    for g in range(field.group_box.shape[0]):
        box = field.group_box[g]
        for a in range(3):
            box[0, a], box[1, a] = math.inf, -math.inf
        for q in range(g * GROUP, min(field.faces.shape[0], (g + 1) * GROUP)):
            for a in range(3):
                box[0, a] = min(box[0, a], field.face_box[q, 0, a])
                box[1, a] = max(box[1, a], field.face_box[q, 1, a])
