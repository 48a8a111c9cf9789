"""A thread that lies on a body of tissue: each element touches the surface at most once, below its middle; SI units.

With y the place of the tissue below an element at the end of the tick if nothing of the thread pressed it, W the
compliance of the tissue there when all elements that touch it press alike, n the normal and g the gap to the element's
skin, the tissue pushes with ::

    f = -(g + n · d) / (n · W n + c) ≥ 0

along n for the element's motion d, and across it with Coulomb friction by bristles of compliance c; its force goes on
from that of the last tick. The rod's own solve has both as springs (`ligature.suture.springs`): which of them press and
which slip is what the motion of the last tick says.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.rotations import rotate_back
from ligature.soft.frame import Frame, FrameArrays, into, open_frame, turn_six, velocity_at
from ligature.soft.thread import SceneThread
from ligature.suture.layout import Nodes
from ligature.suture.rod import Rod
from ligature.suture.springs import Springs, open_springs
from ligature.suture.tracking import open_nodes
from ligature.tables import opener, table_of
from ligature.tissue.block import TissueBlock
from ligature.tissue.contact import RESERVED, SOFT
from ligature.tissue.interface import add_point, carried, place_point, settle_point
from ligature.tissue.layout import GROUP, LEAVING, MOST_POINTS, Field, Points, Tissue, open_tissue
from ligature.tissue.strand import Strand, open_strand, strand

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Integers = NDArray[np.int64]
Tables = tuple[Integers, Integers, Integers, Integers, Integers, Integers]
"""Of the tissue, what lies on it, the thread in its paths, the rod's nodes and springs, and the frame."""

MOST = 60
"""Most elements that touch a body of tissue."""

MEET, LEAVE = 0.2e-3, 0.6e-3
"""Gap in metres at which an element meets the surface, beside what it moves in a tick, and at which it leaves it."""

DEEP, DEEPEST = 1e-3, 3e-3
"""Metres around an element in which the surface is looked for, beside what it moves in a tick; and depth below which an
element that touches the surface leaves it: it is inside."""

MOVED = 0.3e-3
"""Metres that an element slides on before it is below another place of the tissue."""

AROUND, NEAR = 3, 2.5e-3
"""Elements beside one in a path, and metres around the ends of paths, that do not touch: there the path holds."""

START = 5e-6
"""Most metres that are added to the motion of a tick for an element that begins to slip."""

ROUNDS = 4
"""Steps of the search for the nearest place of a face."""


class Lying(NamedTuple):
    """What lies: M places for n elements of a rod."""

    used: Integers  # (M,)
    element: Integers  # (M,)
    point: Integers  # (M,) of the interface
    force: Array  # (M, 3) on the thread in the last tick, in B
    spring: Integers  # (M,) of the rod, -1 for none
    normal: Array  # (M, 3) scratch, and so on
    gap: Array  # (M,)
    row: Integers  # (n,) where an element is among those that touch, -1 for none
    inside: Integers  # (n,) whether it is in a path or beside one
    mine: Integers  # (N,) of the points that the thread presses
    friction: Array  # (n,) of both sides
    wall: NDArray[np.bool_]  # (q,) faces that are met by nothing: the walls of wounds
    first: Integers  # (2,) node of the first element, and 1 where the needle is at the last
    found: Array  # (2, 3) nearest place and normal
    corner: Array  # (4,) weights of the corners
    at: Array  # (2, 3) an element's middle and motion in the tick, in B
    W: Array  # (3, 3)
    K: Array  # (6, 6)


def _lying(elements: int, faces: int, first: int, turned: bool) -> Lying:
    z, M = np.zeros, MOST
    i = lambda n: np.zeros(n, np.int64)  # noqa: E731
    return Lying(
        i(M), i(M), i(M), z((M, 3)), i(M), z((M, 3)), z(M), i(elements), i(elements), i(MOST_POINTS), z(elements),
        np.zeros(faces, np.bool_), np.array([first, int(turned)]), z((2, 3)), z(4), z((2, 3)), z((3, 3)), z((6, 6)),
    )  # fmt: skip


open_lying = opener(_lying(1, 1, 0, False))


class LyingThread:
    """One rod on one body of tissue in its ``frame``.

    Parameters
    ----------
    friction
        Coulomb coefficient of the tissue's surface; that of a contact is the product of both sides'.
    inside
        The same thread in the tissue's paths, if it can be in them.
    """

    def __init__(
        self, rod: Rod, block: TissueBlock, frame: Frame, friction: float, inside: SceneThread | None = None
    ) -> None:
        field, elements = block.interface.field, len(rod.description.mass)
        self._lying = _lying(elements, len(field.faces), rod.first, inside is not None and inside.turned)
        self._lying.friction[:] = friction * rod.description.friction
        walls = np.zeros(len(field.x), np.bool_)
        walls[block.lips.pairs.reshape(-1)] = True
        self._lying.wall[:] = walls[field.faces].all(axis=1)
        self._none = strand(MOST_POINTS)
        in_paths = table_of(self._none) if inside is None else inside.inside.table
        self._tables = (
            block.interface.table, table_of(self._lying), in_paths, table_of(rod.nodes), rod.spring_table,
            frame.table,
        )  # fmt: skip
        self._holds = False

    def begin(self, dt: float) -> None:
        """Hand the rod what the tissue below it does to it."""
        self._holds = bool(lie(self._tables, dt))

    def end(self, dt: float) -> None:
        """Conclude with the forces that the rod's solve found."""
        if self._holds:
            let_rest(self._tables, dt)

    @property
    def forces(self) -> list[tuple[int, Array]]:
        """Elements that touch the tissue, and the force (3,) of the tissue on each in B."""
        lying = self._lying
        return [(int(lying.element[r]), lying.force[r]) for r in np.flatnonzero(lying.used)]

    def reset(self) -> None:
        """As at the start: nothing touches the tissue."""
        for name in _KEPT:
            getattr(self._lying, name)[:] = 0

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        return {name: getattr(self._lying, name).copy() for name in _KEPT}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        for name in _KEPT:
            getattr(self._lying, name)[:] = snapshot[name]


_KEPT = ("used", "element", "point", "force")


@inlined
def _open(tables: Tables) -> tuple[Tissue, Lying, Strand, Nodes, Springs, FrameArrays]:
    return (
        open_tissue(tables[0]), open_lying(tables[1]), open_strand(tables[2]), open_nodes(tables[3]),
        open_springs(tables[4]), open_frame(tables[5]),
    )  # fmt: skip


# --- which elements touch -----------------------------------------------------------------------


@inlined
def _place(lying: Lying, nodes: Nodes, f: FrameArrays, e: int, dt: float) -> None:
    """Fill ``lying.at`` with the middle of an element and its motion in a tick as it moved in the last, in B."""
    i, at = lying.first[0] + e, lying.at
    x, v = nodes.x[i], nodes.v[i]
    x_, y_, z_ = into(f, x[0], x[1], x[2])
    vx, vy, vz = rotate_back(f.R, v[0], v[1], v[2])
    fx, fy, fz = velocity_at(f, x_, y_, z_)
    at[0, 0], at[0, 1], at[0, 2] = x_, y_, z_
    at[1, 0], at[1, 1], at[1, 2] = dt * (vx - fx), dt * (vy - fy), dt * (vz - fz)


@inlined
def _mark_inside(t: Tissue, lying: Lying, held: Strand, nodes: Nodes, f: FrameArrays) -> None:
    """Mark the elements that a path holds, or that are near the end of one."""
    inside, n = lying.inside, lying.inside.shape[0]
    for e in range(n):
        inside[e] = 0
    for u in range(t.points.filled[0]):
        i = t.points.used[u]
        if held.held.engaged[i]:
            middle = n - 1 - held.held.segment[i] if lying.first[1] else held.held.segment[i]
            for e in range(max(middle - AROUND, 0), min(middle + AROUND + 1, n)):
                inside[e] = 1
    for p in range(t.paths.count.shape[0]):
        if t.paths.count[p] == 0:
            continue
        for side in range(2):
            y = t.points.at[t.paths.node[p, side * (t.paths.count[p] - 1)]]
            for e in range(n):
                x = nodes.x[lying.first[0] + e]
                bx, by, bz = into(f, x[0], x[1], x[2])
                if (bx - y[0]) ** 2 + (by - y[1]) ** 2 + (bz - y[2]) ** 2 < NEAR * NEAR:
                    inside[e] = 1


@inlined
def _on_face(field: Field, q: int, p: Array, found: Array, corner: Array) -> float:
    """Nearest place of face ``q`` to ``p``: fills place and normal, and weights; returns the signed gap."""
    x, i, j, k, h = field.x, field.faces[q, 0], field.faces[q, 1], field.faces[q, 2], field.faces[q, 3]
    u, v, y = 0.5, 0.5, found[0]
    nx, ny, nz = 0.0, 0.0, 0.0
    for _ in range(ROUNDS):
        ax, ay, az = _edge(x, i, j, h, k, v)
        bx, by, bz = _edge(x, i, h, j, k, u)
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        corner[0], corner[1], corner[2], corner[3] = (1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v
        for m in range(3):
            y[m] = corner[0] * x[i, m] + corner[1] * x[j, m] + corner[2] * x[k, m] + corner[3] * x[h, m]
        dx, dy, dz = p[0] - y[0], p[1] - y[1], p[2] - y[2]
        aa, bb, ab = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz, ax * bx + ay * by + az * bz
        da, db = ax * dx + ay * dy + az * dz, bx * dx + by * dy + bz * dz
        below = aa * bb - ab * ab
        if not below > 0.0:
            break
        u = min(max(u + (da * bb - db * ab) / below, 0.0), 1.0)
        v = min(max(v + (db * aa - da * ab) / below, 0.0), 1.0)
    size = max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-18)
    nx, ny, nz = nx / size, ny / size, nz / size
    dx, dy, dz = p[0] - y[0], p[1] - y[1], p[2] - y[2]
    gap = nx * dx + ny * dy + nz * dz
    if gap > 0.0:  # beyond an edge the surface is round
        gap = math.sqrt(dx * dx + dy * dy + dz * dz)
        nx, ny, nz = dx / gap, dy / gap, dz / gap
    found[1, 0], found[1, 1], found[1, 2] = nx, ny, nz
    return gap


@inlined
def _edge(x: Array, i: int, j: int, h: int, k: int, share: float) -> Vector:
    """The vector from node i to j, blended by ``share`` with that from h to k."""
    return (
        (1 - share) * (x[j, 0] - x[i, 0]) + share * (x[k, 0] - x[h, 0]),
        (1 - share) * (x[j, 1] - x[i, 1]) + share * (x[k, 1] - x[h, 1]),
        (1 - share) * (x[j, 2] - x[i, 2]) + share * (x[k, 2] - x[h, 2]),
    )


@inlined
def _nearest(field: Field, lying: Lying, reach: float) -> int:
    """Face of the surface nearest to ``lying.at[0]`` within ``reach``, -1 for none."""
    p, best, face = lying.at[0], reach * reach, -1
    for g in range(field.group_box.shape[0]):
        if _outside(field.group_box[g], p, reach):
            continue
        for q in range(g * GROUP, min(field.faces.shape[0] - field.around.shape[0], (g + 1) * GROUP)):
            if lying.wall[q] or field.core[q] > 0.0 or _outside(field.face_box[q], p, reach):
                continue
            _on_face(field, q, p, lying.found, lying.corner)
            y = lying.found[0]
            away = (p[0] - y[0]) ** 2 + (p[1] - y[1]) ** 2 + (p[2] - y[2]) ** 2
            if away < best:
                best, face = away, q
    return face


@inlined
def _outside(box: Array, p: Array, reach: float) -> bool:
    outside = False
    for m in range(3):
        outside = outside or p[m] + reach < box[0, m] or p[m] - reach > box[1, m]
    return outside


@inlined
def _let_go(points: Points, lying: Lying, r: int) -> None:
    """Remove the contact of an element."""
    i, f = lying.point[r], lying.force[r]
    lying.used[r], points.status[i] = 0, LEAVING
    for a in range(3):
        f[a], points.force[i, a] = 0.0, 0.0


@inlined
def _meet(field: Field, points: Points, lying: Lying, e: int, radius: float) -> None:
    """Keep, begin, move or end the contact of the element whose middle is at ``lying.at``."""
    r, p, d = lying.row[e], lying.at[0], lying.at[1]
    reach = radius + (DEEPEST if r >= 0 else max(DEEP, math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])))
    q = -1 if lying.inside[e] or _outside(field.box, p, reach) else _nearest(field, lying, reach)
    if q < 0:
        if r >= 0:
            _let_go(points, lying, r)
        return
    gap, y, n = _on_face(field, q, p, lying.found, lying.corner) - radius, lying.found[0], lying.found[1]
    if r < 0:
        closing = -(n[0] * d[0] + n[1] * d[1] + n[2] * d[2])
        # What is deeper than it can have come by itself was put there: pushed out at once, it would tear at the thread.
        if abs(gap) > MEET + 2.0 * max(closing, 0.0) or points.status.shape[0] - points.filled[0] <= RESERVED:
            return
        r = 0
        while r < MOST and lying.used[r]:
            r += 1
        if r == MOST:
            return
        lying.used[r], lying.element[r] = 1, e
        lying.point[r] = add_point(field, points, field.faces[q], lying.corner)
        lying.force[r, 0], lying.force[r, 1], lying.force[r, 2] = 0.0, 0.0, 0.0
    elif gap > LEAVE:
        _let_go(points, lying, r)
        return
    else:
        i, away = lying.point[r], 0.0
        for m in range(3):
            now = 0.0
            for c in range(4):
                now += points.weights[i, c] * field.x[points.nodes[i, c], m]
            away += (now - y[m]) ** 2
        if away > MOVED * MOVED:
            place_point(field, points, i, field.faces[q], lying.corner)
            settle_point(field, points, i)
    lying.gap[r] = gap
    for m in range(3):
        lying.normal[r, m] = n[m]


# --- forces -------------------------------------------------------------------------------------


@inlined
def _let_move(t: Tissue, lying: Lying, i: int) -> Vector:
    """Where point ``i`` comes to by all forces but the thread's; fills ``lying.W``, its compliance to the latter."""
    points, W = t.points, lying.W
    for a in range(3):
        for b in range(3):
            W[a, b] = 0.0
    x, y, z = carried(points, i, (t.field.clock[0] + 1) / t.field.clock[1])
    for u in range(points.filled[0]):
        j = points.used[u]
        C = points.C[i, j]
        for b in range(3):
            change = points.force[j, b] - points.mean[j, b]
            for a in range(3):
                if lying.mine[j]:
                    W[a, b] += C[a, b]
            if not lying.mine[j]:
                x, y, z = x + C[0, b] * change, y + C[1, b] * change, z + C[2, b] * change
    return x, y, z


@inlined
def _compliance(W: Array, own: Array, n: Array) -> tuple[float, float]:
    """Compliance in m/N along ``n`` and across it: that of ``W`` (3, 3), and at least that of ``own`` (3, 3)."""
    normal, least, trace = 0.0, 0.0, W[0, 0] + W[1, 1] + W[2, 2]
    for a in range(3):
        for b in range(3):
            normal += n[a] * W[a, b] * n[b]
            least += n[a] * own[a, b] * n[b]
    normal = max(normal, least)
    return normal, max(0.5 * (trace - normal), 0.5 * (own[0, 0] + own[1, 1] + own[2, 2] - least))


@inlined
def _rub(
    lying: Lying, r: int, tissue: Vector, at: Array, normal: float, beside: float, limit: float, mass: float, dt: float
) -> float:
    """Fill ``lying.found[0]`` with the friction on an element of ``mass``, within ``limit``; returns its stiffness.

    ``tissue`` is where the point that began the step at ``at`` comes to; ``normal`` and ``beside`` are compliances.
    """
    n, F, d, tried, across = lying.normal[r], lying.force[r], lying.at[1], lying.found[0], lying.found[1]
    kt, along = 1.0 / (beside + SOFT), 0.0
    fn = F[0] * n[0] + F[1] * n[1] + F[2] * n[2]
    moved = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
    for a in range(3):
        across[a] = F[a] - fn * n[a]
    size = math.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
    share = min(limit / size, 1.0) if size > 0.0 else 1.0
    # The excess of the last tick's friction over its limit lets the element move on faster in this one.
    faster = min(size * (1.0 - share) * dt * dt / mass, START)
    for a in range(3):
        # The tissue's own motion under the force of the last tick.
        held = tissue[a] - beside * across[a] - normal * fn * n[a] - at[a]
        tried[a] = share * across[a] + kt * held
        along += tried[a] * n[a]
        d[a] -= moved * n[a] + (faster / size * across[a] if faster > 0.0 else 0.0)
    size = 0.0
    for a in range(3):
        tried[a] -= along * n[a]
        size += (tried[a] - kt * d[a]) ** 2
    size = math.sqrt(size)
    if size > limit:
        # The secant of the law at that motion: there the force is the limit.
        kt *= limit / size
        for a in range(3):
            tried[a] *= limit / size
    return kt


@inlined
def _set_spring(lying: Lying, s: Springs, f: FrameArrays, r: int, force: float, k: float, kt: float, dt: float) -> None:
    """Give the rod a spring: ``force`` and stiffness ``k`` along the normal, friction and ``kt`` across it."""
    K, n, p, tried, start = lying.K, lying.normal[r], lying.at[0], lying.found[0], lying.found[1]
    for a in range(6):
        for b in range(6):
            K[a, b] = 0.0
    for a in range(3):
        for b in range(3):
            K[a, b] = (k - kt) * n[a] * n[b] + (kt if a == b else 0.0)
    vx, vy, vz = velocity_at(f, p[0], p[1], p[2])
    row = s.filled[0]
    s.filled[0], s.node[row], lying.spring[r] = row + 1, lying.first[0] + lying.element[r], row
    turn_six(f.R, K, s.K[row])
    load = s.load[row]
    for a in range(3):
        start[a] = force * n[a] + tried[a] + dt * (K[a, 0] * vx + K[a, 1] * vy + K[a, 2] * vz)
    for a in range(3):
        load[a] = f.R[a, 0] * start[0] + f.R[a, 1] * start[1] + f.R[a, 2] * start[2]
        load[3 + a] = 0.0


@inlined
def _press(t: Tissue, lying: Lying, nodes: Nodes, s: Springs, f: FrameArrays, r: int, dt: float) -> None:
    """Make a spring of one element's contact, if it is under pressure."""
    points, e, i, n, F = t.points, lying.element[r], lying.point[r], lying.normal[r], lying.force[r]
    node, mean = lying.first[0] + e, points.mean[i]
    _place(lying, nodes, f, e, dt)
    p, d = lying.at[0], lying.at[1]
    x, y, z = _let_move(t, lying, i)
    normal, beside = _compliance(lying.W, points.C[i, i], n)
    # Along the normal W is a multiple of it, and across: so forces and motions do not mix.
    mean_n = mean[0] * n[0] + mean[1] * n[1] + mean[2] * n[2]
    x -= normal * mean_n * n[0] + beside * (mean[0] - mean_n * n[0])
    y -= normal * mean_n * n[1] + beside * (mean[1] - mean_n * n[1])
    z -= normal * mean_n * n[2] + beside * (mean[2] - mean_n * n[2])
    gap = n[0] * (p[0] - x) + n[1] * (p[1] - y) + n[2] * (p[2] - z) - nodes.radius[node]
    moved = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
    lying.spring[r] = -1
    fn = F[0] * n[0] + F[1] * n[1] + F[2] * n[2]
    # A contact that pressed stays until it pulls: gravity and tension would begin it anew in every second tick.
    if not (fn > 0.0 or gap + moved < 0.0) or s.filled[0] == s.node.shape[0]:
        for a in range(3):
            F[a], points.force[i, a] = 0.0, 0.0
        return
    k = 1.0 / (normal + SOFT)
    limit = lying.friction[e] * max(-k * (gap + moved), 0.0)
    kt = _rub(lying, r, (x, y, z), points.at[i], normal, beside, limit, nodes.mass[node], dt)
    _set_spring(lying, s, f, r, -k * gap, k, kt, dt)


@kernel
def lie(tables: Tables, dt: float) -> bool:
    """Find the elements that touch the surface as a tick begins, and make springs of them; whether there are any."""
    t, lying, held, nodes, s, f = _open(tables)
    field, points = t.field, t.points
    n, any_ = lying.row.shape[0], False
    for e in range(n):
        lying.row[e] = -1
    for r in range(MOST):
        if lying.used[r]:
            lying.row[lying.element[r]], any_ = r, True
    for e in range(n):
        _place(lying, nodes, f, e, dt)
        any_ = any_ or not _outside(field.box, lying.at[0], DEEP)
    if not any_:
        return False
    _mark_inside(t, lying, held, nodes, f)
    for e in range(n):
        _place(lying, nodes, f, e, dt)
        _meet(field, points, lying, e, nodes.radius[lying.first[0] + e])
    for i in range(lying.mine.shape[0]):
        lying.mine[i] = 0
    any_ = False
    for r in range(MOST):
        if lying.used[r]:
            F, m, any_ = lying.force[r], lying.normal[r], True
            _place(lying, nodes, f, lying.element[r], dt)
            d = lying.at[1]
            presses = F[0] != 0.0 or F[1] != 0.0 or F[2] != 0.0
            if presses or lying.gap[r] + m[0] * d[0] + m[1] * d[1] + m[2] * d[2] < 0.0:
                lying.mine[lying.point[r]] = 1
    for r in range(MOST):
        if lying.used[r]:
            _press(t, lying, nodes, s, f, r, dt)
    return any_


@kernel
def let_rest(tables: Tables, dt: float) -> None:
    """End a tick with the forces of the springs as the rod's solve found them."""
    t, lying, _, _, s, f = _open(tables)
    for r in range(MOST):
        if lying.used[r] and lying.spring[r] >= 0:
            push, F, i = s.impulse[lying.spring[r]], lying.force[r], lying.point[r]
            x, y, z = rotate_back(f.R, push[0], push[1], push[2])
            F[0], F[1], F[2] = x / dt, y / dt, z / dt
            for a in range(3):
                t.points.force[i, a] = -F[a]
