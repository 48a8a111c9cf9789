"""A rigid needle in tissue: what holds it at the nodes of its paths and at its tip, solved with its own motion.

Friction along a node of a path, the hold across it, cutting at the tip and the pressure of a tip on the surface are
rows of `ligature.tissue.rows`. World axes, SI units.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.tables import opener
from ligature.tissue.interface import displaced
from ligature.tissue.layout import MOST_PATHS, MOST_POINTS, Paths, Points, open_tissue
from ligature.tissue.location import cross_surface
from ligature.tissue.rows import (
    MOST_ROWS,
    Bristles,
    expand_rows,
    reduce_rows,
    row_arrays,
    set_row,
    solve_rows,
    stretch_of,
    sum_up,
)

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Integers = NDArray[np.int64]

AXIAL, ACROSS, TIP, ENTRY, ENTRY_ACROSS, SLIDE, RUB = 0, 1, 2, 3, 4, 5, 6
"""Rows: friction along a node, hold across it, cutting at the tip, pressure of the tip on the surface along it and
across it, pressure and friction of a tip that slides over the surface."""

OUTSIDE, TOUCHES, SLIDES, CUTS, TENTS, LEAVES, OPEN = 0, 1, 2, 3, 4, 5, 6
"""Where the tip is: free, held by the surface, sliding over it, cutting, pushing out the far surface, breaking through
it, in an old path."""

HYSTERESIS = 5e-4
"""Length in metres by which a tip may stand before a node and still be held by it."""

LEFT = 5e-3
"""Force in newtons below which a tip that leaves is out, or has left a node behind that it was drawn back from."""

LEAST_SHARE = 8e-4
"""Length in metres for which a node holds across at least."""

CAPTURE = 1e-3
"""Distance in metres from an old path, or from its opening, at which a tip follows it."""

DROP = 6e-3
"""Time in seconds in which the force of a tip that got through falls to what resists it next, at least."""

RECOIL = 0.3
"""Speed in m/s with which a dent goes back then: a deep one takes longer."""

TIP_FRICTION = 0.2
"""Coulomb coefficient of a tip that slides over the surface."""


class Held(NamedTuple):
    """What a needle's passages keep from tick to tick, by point of the interface."""

    engaged: Integers  # (N,)
    left: Integers  # (N,) the tail has passed it, and no thread has taken it over yet
    anchor: Array  # (N,) length from the tip that friction holds
    sigma: Array  # (N,) length from the tip to the node
    share: Array  # (N,) length of needle that the node holds
    offset: Array  # (N, 3) by which the needle may pass beside the node without force
    torn: Array  # (N, 3) by which the tissue has torn since the last step
    side: Integers  # (N, 3) of the rows in the last tick
    across: Array  # (N, 3) direction of the last force across
    tip_side: Integers  # (3,)
    passing: Integers  # (P,) 1 for the paths that the needle is in, -1 from their exits
    tip: Integers  # (3,) where it is, its path, its point of contact
    limit: Array  # (1,) force at which the tip gets further, or slides on
    drop: Array  # (1,) time in which the force of a tip that got through falls, s
    room: Array  # (1,) length of the path at which the far surface stands
    normal: Array  # (3,) of the surface at the contact, outwards
    pressed: Array  # (1,) force of the sliding tip on it
    load: Array  # (4,) forces along the needle: of the tip, of friction; across, in all; length inside


class NeedleArrays(NamedTuple):
    """All that a tick of a needle works on."""

    held: Held
    rows: Bristles
    shape: Array  # (14,) tip, tangent, normal to the centre of its arc, curvature, length, centre of mass
    H: Array  # (6, 6) of its own equations H δ = g
    g: Array  # (6,)
    delta: Array  # (6,) its motion in the tick, that of the centre of mass first
    wrench: Array  # (6,) of the tissue on it
    way: Array  # (3,) scratch


def needle_arrays(points: int = MOST_POINTS, paths: int = MOST_PATHS, capacity: int = MOST_ROWS) -> NeedleArrays:
    """A needle that is outside, at the origin."""
    z = np.zeros
    return NeedleArrays(held(points, paths), row_arrays(points, capacity), z(14), z((6, 6)), z(6), z(6), z(6), z(3))


def held(capacity: int, paths: int) -> Held:
    """A needle that is outside."""
    N, z = capacity, np.zeros
    i = lambda *shape: np.zeros(shape, np.int64)  # noqa: E731
    return Held(
        i(N), i(N), z(N), z(N), z(N), z((N, 3)), z((N, 3)), i(N, 3), z((N, 3)), i(3), i(paths),
        np.array([OUTSIDE, -1, -1]), z(1), np.full(1, DROP), z(1), z(3), z(1), z(4),
    )  # fmt: skip


open_needle = opener(needle_arrays(1, 1, 1))


@inlined
def _along(shape: Array, sigma: float) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Point, tangent towards the tip and normal of the needle, ``sigma`` behind its tip: nine numbers.

    ``shape`` is that of `NeedleArrays`.
    """
    k = shape[9]
    angle = k * sigma
    s, c = math.sin(angle), math.cos(angle)
    if abs(angle) < 1e-4:
        back, aside = sigma * (1.0 - angle * angle / 6.0), 0.5 * sigma * angle
    else:
        back, aside = s / k, (1.0 - c) / k
    return (
        shape[0] - shape[3] * back + shape[6] * aside,
        shape[1] - shape[4] * back + shape[7] * aside,
        shape[2] - shape[5] * back + shape[8] * aside,
        shape[3] * c - shape[6] * s, shape[4] * c - shape[7] * s, shape[5] * c - shape[8] * s,
        shape[6] * c + shape[3] * s, shape[7] * c + shape[4] * s, shape[8] * c + shape[5] * s,
    )  # fmt: skip


@inlined
def _behind(shape: Array, x: float, y: float, z: float) -> float:
    """Length from the tip back to the point of the needle nearest to (x, y, z)."""
    k = shape[9]
    rx, ry, rz = x - shape[0], y - shape[1], z - shape[2]
    back = -(rx * shape[3] + ry * shape[4] + rz * shape[5])
    aside = rx * shape[6] + ry * shape[7] + rz * shape[8]
    if k < 1e-6:
        return back
    angle = math.atan2(back, 1.0 / k - aside)
    # More than half a turn lies behind the tip rather than before it.
    if angle < -0.25 * math.pi and 2.0 * math.pi + angle < k * shape[10] + 0.25 * math.pi:
        angle += 2.0 * math.pi
    return angle / k


@inlined
def _fades(held: Held, i: int, sigma: float) -> bool:
    """Whether a tip ``sigma`` beyond node ``i`` was drawn back from it, which still holds it across."""
    f = held.across[i]
    return sigma < -HYSTERESIS and f[0] * f[0] + f[1] * f[1] + f[2] * f[2] > LEFT * LEFT


@kernel
def engage(points: Points, paths: Paths, held: Held, shape: Array) -> None:
    """Which nodes of its paths hold the needle, and for how much of its length."""
    inside = 0.0
    for p in range(paths.count.shape[0]):
        sense = held.passing[p]
        if sense == 0:
            continue
        count = paths.count[p]
        first, last = -1, -1
        for k in range(count):
            i = paths.node[p, k]
            y = points.at[i]
            sigma = _behind(shape, y[0], y[1], y[2])
            margin = HYSTERESIS if held.engaged[i] else 0.0
            within = -margin <= sigma <= shape[10] + margin or (held.engaged[i] == 1 and _fades(held, i, sigma))
            if within and not held.engaged[i]:
                qx, qy, qz, tx, ty, tz, nx, ny, nz = _along(shape, sigma)
                dx, dy, dz = qx - y[0], qy - y[1], qz - y[2]
                within = dx * dx + dy * dy + dz * dz < CAPTURE * CAPTURE
                if within:
                    held.anchor[i] = sigma
                    held.offset[i, 0], held.offset[i, 1], held.offset[i, 2] = dx, dy, dz
                    for a in range(3):
                        held.side[i, a], held.torn[i, a], held.across[i, a] = 0, 0.0, 0.0
            if held.engaged[i] and sigma > shape[10] + margin:
                held.left[i] = 1
            held.engaged[i] = 1 if within else 0
            held.sigma[i] = sigma
            if not within:
                for a in range(3):
                    points.force[i, a] = 0.0
            elif sigma >= -HYSTERESIS:
                first = k if first < 0 else first
                last = k
        for k in range(count):
            i = paths.node[p, k]
            if not held.engaged[i]:
                continue
            s, sigma = paths.s[p, k], held.sigma[i]
            if sigma < -HYSTERESIS:
                held.share[i] = 0.0
                continue
            tail = shape[10] - sigma
            before = min(s, tail if sense > 0 else sigma)
            after = min(paths.length[p] - s, sigma if sense > 0 else tail)
            if k > first:
                before = 0.5 * (s - paths.s[p, k - 1])
            if k < last:
                after = 0.5 * (paths.s[p, k + 1] - s)
            held.share[i] = max(before, 0.0) + max(after, 0.0)
            inside += held.share[i]
    held.load[3] = inside


@inlined
def _end_of(paths: Paths, held: Held, p: int) -> int:
    """Node of a path that the needle's tip passes last."""
    return paths.node[p, paths.count[p] - 1 if held.passing[p] > 0 else 0]


@kernel
def follow_tip(points: Points, paths: Paths, held: Held, dt: float) -> int:
    """Where the tip is after `engage`, and the force at which it gets further; the path that it has left, or -1."""
    for p in range(paths.count.shape[0]):
        if held.passing[p] == 0:
            continue
        inside = False
        for k in range(paths.count[p]):
            inside = inside or held.engaged[paths.node[p, k]] == 1
        if not inside:
            held.passing[p] = 0
            if held.tip[1] == p:
                held.tip[0], held.tip[1] = OUTSIDE, -1
    if held.tip[1] < 0:
        # Of the paths that the needle is still in, the tip left last the one that it has got least beyond.
        best = math.inf
        for p in range(paths.count.shape[0]):
            if held.passing[p] != 0:
                sigma = held.sigma[_end_of(paths, held, p)]
                if 0.0 <= sigma < best:
                    held.tip[1], best = p, sigma
    p, where = held.tip[1], held.tip[0]
    if where == TOUCHES:
        held.limit[0] = points.puncture[held.tip[2]]
    elif where == SLIDES:
        # What is left of a tip that has stuck until now: it begins to slide without a leap.
        held.limit[0] *= math.exp(-dt / held.drop[0])
    if p < 0 or held.passing[p] == 0 or where in (TOUCHES, SLIDES):
        return -1
    if where in (CUTS, TENTS):
        front = paths.node[p, paths.count[p] - 1]
        if paths.cut[p] >= held.room[0]:
            held.tip[0] = TENTS
        resists = points.cutting[front] + (points.exit[front] if held.tip[0] == TENTS else 0.0)
        # Or what is left of what the tip has just broken.
        held.limit[0] = max(resists, held.limit[0] * math.exp(-dt / held.drop[0]))
    elif where == LEAVES:
        held.limit[0] *= math.exp(-dt / held.drop[0])
        if held.limit[0] < LEFT:
            held.tip[0] = OUTSIDE
            return p
    elif paths.length[p] < math.inf:
        end = _end_of(paths, held, p)
        held.tip[0] = OUTSIDE if held.engaged[end] and held.sigma[end] >= 0.0 else OPEN
    return -1


@inlined
def _find_bases(points: Points, held: Held, rows: Bristles, s: float) -> None:
    """Positions of the needle's points at the end of this tick without its own forces."""
    contact = held.tip[2]
    for u in range(points.filled[0]):
        j = points.used[u]
        mine = held.engaged[j] == 1 or j == contact
        for b in range(3):
            rows.change[j, b] = -points.mean[j, b] if mine else points.force[j, b] - points.mean[j, b]
    for u in range(points.filled[0]):
        i = points.used[u]
        if held.engaged[i] == 1 or i == contact:
            rows.base[i, 0], rows.base[i, 1], rows.base[i, 2] = displaced(points, i, s, rows.change)


@inlined
def _hold_across(
    rows: Bristles, m: int, kind: int, i: int, t: Vector, n: Vector, arm: Vector, away: Vector, limit: float,
    soft: float, side: Integers,
) -> int:  # fmt: skip
    """Hold point ``i`` across ``t``, along ``n`` first, within ``limit``; returns the number of the next row.

    ``arm`` is from the centre of mass, ``away`` the stretch, ``side`` (3,) ends with the limits of the last tick.
    """
    nx, ny, nz = n
    for turn in range(2):
        if turn == 1:
            nx, ny, nz = t[1] * nz - t[2] * ny, t[2] * nx - t[0] * nz, t[0] * ny - t[1] * nx
        set_row(rows, m, kind, i, nx, ny, nz, arm[0], arm[1], arm[2])
        rows.rest[m] = nx * away[0] + ny * away[1] + nz * away[2]
        rows.low[m], rows.high[m], rows.soft[m], rows.side[m] = -limit, limit, soft, side[1 + turn]
        m += 1
    return m


@inlined
def _hold_node(points: Points, held: Held, rows: Bristles, shape: Array, i: int, m: int, dt: float) -> int:
    """Rows of a node that the needle passes: friction along it, the hold across; returns the number of the next row."""
    # A node that the tip was drawn back from still holds it for a while, but no needle is there.
    qx, qy, qz, tx, ty, tz, nx, ny, nz = _along(shape, max(held.sigma[i], -HYSTERESIS))
    rx, ry, rz = qx - shape[11], qy - shape[12], qz - shape[13]
    bx, by, bz = rows.base[i, 0], rows.base[i, 1], rows.base[i, 2]
    # Along: what friction holds, and how the tissue moves by itself.
    at = points.at[i]
    slid = tx * (at[0] - bx) + ty * (at[1] - by) + tz * (at[2] - bz)
    set_row(rows, m, AXIAL, i, tx, ty, tz, rx, ry, rz)
    rows.rest[m] = held.sigma[i] - held.anchor[i] + slid
    limit = points.friction[i] * held.share[i]
    rows.low[m], rows.high[m], rows.soft[m], rows.side[m] = -limit, limit, points.soft[i], held.side[i, 0]
    # Across: the first direction is that of the last force, so that its limit is that of the whole.
    fx, fy, fz = held.across[i, 0], held.across[i, 1], held.across[i, 2]
    along = fx * tx + fy * ty + fz * tz
    fx, fy, fz = fx - along * tx, fy - along * ty, fz - along * tz
    pressed = math.sqrt(fx * fx + fy * fy + fz * fz)
    if pressed > 1e-9:
        nx, ny, nz = fx / pressed, fy / pressed, fz / pressed
    offset, torn = held.offset[i], held.torn[i]
    ox, oy, oz = offset[0] + torn[0], offset[1] + torn[1], offset[2] + torn[2]
    away = (qx - bx - ox, qy - by - oy, qz - bz - oz)
    # A node that has just been passed stands for no length yet; it tears no sooner than half of the others.
    limit = points.strength[i] * max(held.share[i], LEAST_SHARE)
    if held.sigma[i] < -HYSTERESIS:
        limit = min(limit, pressed * math.exp(-dt / DROP))
    t, n, arm = (tx, ty, tz), (nx, ny, nz), (rx, ry, rz)
    return _hold_across(rows, m + 1, ACROSS, i, t, n, arm, away, limit, points.soft[i], held.side[i])


@inlined
def _cut_ahead(points: Points, paths: Paths, held: Held, rows: Bristles, shape: Array, m: int) -> int:
    """The row of a tip that cuts its path, or breaks through its end; returns the number of the next row."""
    path, front = held.tip[1], -1
    for k in range(paths.count[path]):
        if held.engaged[paths.node[path, k]]:
            front = k
    if front < 0:
        return m
    i = paths.node[path, front]
    rx, ry, rz = shape[0] - shape[11], shape[1] - shape[12], shape[2] - shape[13]
    set_row(rows, m, TIP, i, shape[3], shape[4], shape[5], rx, ry, rz)
    slid = 0.0
    for a in range(3):
        slid += shape[3 + a] * (points.at[i, a] - rows.base[i, a])
    rows.rest[m] = paths.s[path, front] + held.sigma[i] - paths.cut[path] + slid
    rows.low[m], rows.high[m], rows.soft[m], rows.side[m] = 0.0, held.limit[0], points.soft[i], held.tip_side[0]
    return m + 1


@inlined
def _touch_surface(points: Points, held: Held, rows: Bristles, shape: Array, m: int) -> int:
    """Rows of a tip on the surface, which holds it or lets it slide; returns the number of the next row."""
    i = held.tip[2]
    tx, ty, tz, nx, ny, nz = shape[3], shape[4], shape[5], shape[6], shape[7], shape[8]
    kind, across, high, bound = ENTRY, ENTRY_ACROSS, held.limit[0], held.limit[0]
    if held.tip[0] == SLIDES:
        kind, across = SLIDE, RUB
        tx, ty, tz = -held.normal[0], -held.normal[1], -held.normal[2]
        high, bound = 1e9, max(TIP_FRICTION * held.pressed[0], held.limit[0])
        # Across the normal: along the tip's direction, and the third.
        along = shape[3] * tx + shape[4] * ty + shape[5] * tz
        nx, ny, nz = shape[3] - along * tx, shape[4] - along * ty, shape[5] - along * tz
        size = math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx / size, ny / size, nz / size
    dx, dy, dz = shape[0] - rows.base[i, 0], shape[1] - rows.base[i, 1], shape[2] - rows.base[i, 2]
    dx, dy, dz = dx - held.offset[i, 0], dy - held.offset[i, 1], dz - held.offset[i, 2]
    t, n, arm = (tx, ty, tz), (nx, ny, nz), (shape[0] - shape[11], shape[1] - shape[12], shape[2] - shape[13])
    set_row(rows, m, kind, i, tx, ty, tz, arm[0], arm[1], arm[2])
    rows.rest[m] = tx * dx + ty * dy + tz * dz
    rows.low[m], rows.high[m], rows.soft[m], rows.side[m] = 0.0, high, points.soft[i], held.tip_side[0]
    return _hold_across(rows, m + 1, across, i, t, n, arm, (dx, dy, dz), bound, points.soft[i], held.tip_side)


@inlined
def _fill_compliance(points: Points, rows: Bristles, m: int) -> None:
    """The tissue's compliance between the first ``m`` rows, into ``rows.C``."""
    for a in range(m):
        e = rows.e[a]
        for b in range(a + 1):
            C, f = points.C[rows.point[a], rows.point[b]], rows.e[b]
            value = 0.0
            for i in range(3):
                value += e[i] * (C[i, 0] * f[0] + C[i, 1] * f[1] + C[i, 2] * f[2])
            rows.C[a, b] = value
            rows.C[b, a] = value


@kernel
def gather(points: Points, paths: Paths, held: Held, rows: Bristles, shape: Array, s: float, dt: float) -> int:
    """Make the rows of a tick of ``dt`` seconds; returns how many."""
    m = 0
    _find_bases(points, held, rows, s)
    for u in range(points.filled[0]):
        i = points.used[u]
        if held.engaged[i] != 0:
            m = _hold_node(points, held, rows, shape, i, m, dt)
    where = held.tip[0]
    if where in (CUTS, TENTS, LEAVES):
        m = _cut_ahead(points, paths, held, rows, shape, m)
    elif where in (TOUCHES, SLIDES):
        m = _touch_surface(points, held, rows, shape, m)
    _fill_compliance(points, rows, m)
    return m


@kernel
def conclude(points: Points, paths: Paths, held: Held, rows: Bristles, m: int, delta: Array, clip: bool) -> bool:
    """Keep what the rows leave: forces on the tissue, anchors, tears, what was cut; True if the tip got through."""
    through = False
    held.load[0], held.load[1], held.load[2] = 0.0, 0.0, 0.0
    for u in range(points.filled[0]):
        i = points.used[u]
        if held.engaged[i] or i == held.tip[2]:
            for a in range(3):
                points.force[i, a], held.across[i, a] = 0.0, 0.0
    done = -1
    turn = 0
    for a in range(m):
        i, kind, force = rows.point[a], rows.kind[a], rows.force[a]
        if clip:
            rows.force[a] = min(max(force, rows.low[a]), rows.high[a])
        force = rows.force[a]
        excess = 0.0
        if rows.side[a] != 0:
            excess = stretch_of(rows, m, a, delta) - force * rows.soft[a]
        for b in range(3):
            points.force[i, b] += force * rows.e[a, b]
        turn = 0 if i != done or kind == AXIAL else turn + 1
        done = i
        if kind == AXIAL:
            held.anchor[i] += excess
            held.side[i, 0] = rows.side[a]
            held.load[1] += force
            turn = 0
        elif kind == ACROSS:
            held.side[i, turn] = rows.side[a]
            held.load[2] += abs(force)
            # What fades where the tip was drawn back tears nothing.
            beyond = held.offset if held.sigma[i] < -HYSTERESIS else held.torn
            for b in range(3):
                held.across[i, b] += force * rows.e[a, b]
                beyond[i, b] += excess * rows.e[a, b]
        elif kind == TIP:
            held.tip_side[0] = rows.side[a]
            held.load[0] = force
            if rows.side[a] > 0:
                paths.cut[held.tip[1]] += excess
                through = True
        elif kind in (ENTRY, SLIDE):
            turn = 0
            held.tip_side[0] = rows.side[a]
            held.load[0] = force
            held.pressed[0] = force
            through = kind == ENTRY and rows.side[a] > 0
        else:
            held.tip_side[turn] = rows.side[a]
            for b in range(3):
                held.offset[i, b] += excess * rows.e[a, b]
    return through


@kernel
def couple(tissue: Integers, needle: Integers, dt: float) -> tuple[int, int]:
    """A needle's tick: (path that the tip has left or -1, what became of it: 1 got through, 0 stayed, -1 failed)."""
    t, n = open_tissue(tissue), open_needle(needle)
    points, paths, held, rows = t.points, t.paths, n.held, n.rows
    engage(points, paths, held, n.shape)
    left = follow_tip(points, paths, held, dt)
    m = gather(points, paths, held, rows, n.shape, (t.field.clock[0] + 1) / t.field.clock[1], dt)
    if solve_rows(rows, m, n.H, n.g, n.delta) < 0:
        return left, -1
    through = conclude(points, paths, held, rows, m, n.delta, True)
    sum_up(rows, m, n.wrench)
    return left, (1 if through else 0)


@kernel
def begin_coupling(tissue: Integers, needle: Integers, dt: float) -> tuple[int, int]:
    """A tick of a needle whose motion another solver finds: (path that the tip has left or -1, rows or -1).

    The needle's equations are as far as they are known before; they decide which rows are at their limits.
    ``rows.K`` and ``rows.load`` are then what that solver is to include.
    """
    t, n = open_tissue(tissue), open_needle(needle)
    points, paths, held, rows = t.points, t.paths, n.held, n.rows
    engage(points, paths, held, n.shape)
    left = follow_tip(points, paths, held, dt)
    m = gather(points, paths, held, rows, n.shape, (t.field.clock[0] + 1) / t.field.clock[1], dt)
    found = solve_rows(rows, m, n.H, n.g, n.delta)
    if found < 0 or (found == 0 and reduce_rows(rows, m) < 0):
        return left, -1
    return left, m


@kernel
def end_coupling(tissue: Integers, needle: Integers, m: int) -> bool:
    """End what `begin_coupling` began, the needle having moved by ``delta``: True if the tip got through.

    Rows keep to the limits that it assumed: where a force goes beyond its limit, it does so for this tick alone.
    """
    t, n = open_tissue(tissue), open_needle(needle)
    elastic = 0
    for a in range(m):
        if n.rows.side[a] == 0:
            elastic += 1
    expand_rows(n.rows, elastic, n.delta)
    through = conclude(t.points, t.paths, n.held, n.rows, m, n.delta, False)
    sum_up(n.rows, m, n.wrench)
    return through


@kernel
def look_for_surface(tissue: Integers, needle: Integers, before: Array, weights: Array, normal: Array) -> int:
    """Face that the tip has come through since it was ``before`` (3,), or -1; see `cross_surface` for what it fills."""
    field, n = open_tissue(tissue).field, open_needle(needle)
    shape, way = n.shape, n.way
    x, y, z = shape[0] - before[0], shape[1] - before[1], shape[2] - before[2]
    size = math.sqrt(x * x + y * y + z * z)
    if not (size > 0.0 and x * shape[3] + y * shape[4] + z * shape[5] > 0.0):
        return -1
    way[0], way[1], way[2] = x / size, y / size, z / size
    face, _ = cross_surface(field.x, field.faces, before, way, size, -1.0, weights, normal)
    return face
