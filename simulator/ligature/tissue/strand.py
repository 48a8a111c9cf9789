"""A thread's tick in tissue, compiled: where its nodes are, the springs that hold it there, and their limits.

Each node has three directions: along the thread, across it where the thread presses, and the third. With C the
compliance of the node as its thread sees it and c that of its bristle, the force of the thread on the tissue is
K (stretch + motion), K = (C + c)⁻¹, in those directions that are not at their limits. World axes, SI units.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.tables import opener
from ligature.tissue.interface import carried
from ligature.tissue.layout import Paths, Points, open_tissue
from ligature.tissue.needle import CAPTURE, LEAST_SHARE

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

OVER = 1.0 + 1e-9
"""Part of its limit up to which a force keeps to it: rounding is no slip."""

APART = 1e-7
"""Length of thread in metres between two of its nodes, at least: they keep their order."""

RIM = 1.25e-3
"""Length of thread in metres to both sides of a node that says in which direction it slips there."""

HAIRPIN = 0.1
"""Part of its length by which a thread gets on around a node, below which it turns right round there."""


class Held(NamedTuple):
    """What a thread keeps from tick to tick, by point of the interface."""

    engaged: Integers  # (N,)
    at: Array  # (N,) length from the thread's first point to the node
    anchor: Array  # (N,) the same, that friction holds
    torn: Array  # (N, 3) by which the tissue has torn since the last step
    side: Integers  # (N, 2) along and across: 0 elastic, 1 at the upper, -1 at the lower limit
    share: Array  # (N,) length of path that the node stands for
    segment: Integers  # (N,) of the thread


class Rows(NamedTuple):
    """The nodes of a tick, of which the first ``filled`` count; in the directions E of each node, and in the world."""

    filled: Integers  # (1,)
    node: Integers  # (N,)
    segment: Integers  # (N,) of the thread
    part: Array  # (N,) of the segment
    before: Array  # (N,) scratch: last place along the thread
    nearest: Array  # (N,) scratch: square of the distance from it
    along: Array  # (N,) place along the thread
    start: Array  # (N, 3) point of the thread when the tick begins
    E: Array  # (N, 3, 3)
    stretch: Array  # (N, 3) when the tick begins
    soft: Array  # (N, 3, 3) compliance
    limit: Array  # (N, 2) along and across
    K: Array  # (N, 3, 3) stiffness of the directions that are not at their limits
    push: Array  # (N, 3) force without motion
    local: Array  # (N, 3) force with it
    excess: Array  # (N, 3) stretch that the limits leave
    stiffness: Array  # (N, 3, 3) K in the world
    bias: Array  # (N, 3) -push in the world: force on the thread
    force: Array  # (N, 3) on the tissue, in the world


class Strand(NamedTuple):
    """All that a tick of a thread works on."""

    held: Held
    rows: Rows
    three: Array  # (3, 3) scratch
    friction: Array  # (1,) of the thread over that of a needle


def strand(points: int) -> Strand:
    """A thread that is outside."""
    N, z = points, np.zeros
    i = lambda *shape: np.zeros(shape, np.int64)  # noqa: E731
    rows = Rows(
        i(1), i(N), i(N), z(N), z(N), z(N), z(N), z((N, 3)), z((N, 3, 3)), z((N, 3)), z((N, 3, 3)), z((N, 2)),
        z((N, 3, 3)), z((N, 3)), z((N, 3)), z((N, 3)), z((N, 3, 3)), z((N, 3)), z((N, 3)),
    )  # fmt: skip
    held = Held(i(N), z(N), z(N), z((N, 3)), i(N, 2), z(N), i(N))
    return Strand(held, rows, z((3, 3)), z(1))


open_strand = opener(strand(1))


# --- where the nodes are ----------------------------------------------------------------------


@inlined
def _list_nodes(points: Points, held: Held, rows: Rows) -> int:
    """The nodes that hold the thread, from its first point on; how many. No node passes another on the thread."""
    n = 0
    for u in range(points.filled[0]):
        i = points.used[u]
        if held.engaged[i]:
            r = n
            while r > 0 and rows.before[r - 1] > held.at[i]:
                rows.node[r], rows.before[r] = rows.node[r - 1], rows.before[r - 1]
                r -= 1
            rows.node[r], rows.before[r] = i, held.at[i]
            n += 1
    return n


@inlined
def _find_nearest(points: Points, rows: Rows, line: Array, n: int) -> float:
    """Fill ``rows.along`` with the nearest place on the thread within `CAPTURE` of the last; the thread's length.

    A thread may pass a node more than once, and a long element may bring its nearest point from afar in one tick:
    within the window there is always a place, so that no node loses its thread but off the thread's own ends.
    """
    for r in range(n):
        rows.nearest[r], rows.along[r] = math.inf, 0.0
    begin = 0.0
    for s in range(line.shape[0] - 1):
        ex, ey, ez = line[s + 1, 0] - line[s, 0], line[s + 1, 1] - line[s, 1], line[s + 1, 2] - line[s, 2]
        square = ex * ex + ey * ey + ez * ez
        size = math.sqrt(square)
        for r in range(n):
            before = rows.before[r]
            if before + CAPTURE < begin or before - CAPTURE > begin + size:
                continue
            y = points.at[rows.node[r]]
            ax, ay, az = y[0] - line[s, 0], y[1] - line[s, 1], y[2] - line[s, 2]
            low, high = max((before - CAPTURE - begin) / size, 0.0), min((before + CAPTURE - begin) / size, 1.0)
            part = min(max((ax * ex + ay * ey + az * ez) / square, low), high)
            ax, ay, az = ax - part * ex, ay - part * ey, az - part * ez
            away = ax * ax + ay * ay + az * az
            if away < rows.nearest[r]:
                rows.nearest[r], rows.along[r] = away, begin + part * size
        begin += size
    for r in range(n):
        if rows.nearest[r] == math.inf:
            rows.along[r] = begin
    return begin


@inlined
def _keep_order(rows: Rows, n: int) -> None:
    """Bring ``rows.along`` into order with the least sum of squares: neighbours in disorder take their mean."""
    mean, count, m = rows.nearest, rows.before, 0
    for r in range(n):
        mean[m], count[m] = rows.along[r] - r * APART, 1.0
        m += 1
        while m > 1 and mean[m - 2] > mean[m - 1]:
            both = count[m - 2] + count[m - 1]
            mean[m - 2] = (count[m - 2] * mean[m - 2] + count[m - 1] * mean[m - 1]) / both
            count[m - 2] = both
            m -= 1
    r = 0
    for k in range(m):
        for _ in range(int(count[k])):
            rows.along[r] = mean[k] + r * APART
            r += 1


@inlined
def _find(points: Points, held: Held, rows: Rows, line: Array) -> None:
    """Update the places of the nodes along the thread; nodes beyond its ends are released."""
    n = _list_nodes(points, held, rows)
    length = _find_nearest(points, rows, line, n)
    _keep_order(rows, n)
    kept, s, begin, size = 0, -1, 0.0, 0.0
    for r in range(n):
        i, along = rows.node[r], rows.along[r]
        if not n * APART < along < length - n * APART:
            held.engaged[i] = 0
            points.force[i, 0], points.force[i, 1], points.force[i, 2] = 0.0, 0.0, 0.0
            continue
        while s < 0 or along > begin + size:
            begin, s = begin + size, s + 1
            ex, ey, ez = line[s + 1, 0] - line[s, 0], line[s + 1, 1] - line[s, 1], line[s + 1, 2] - line[s, 2]
            size = math.sqrt(ex * ex + ey * ey + ez * ez)
        rows.node[kept], rows.segment[kept], rows.part[kept] = i, s, (along - begin) / size
        held.at[i], held.segment[i] = along, s
        kept += 1
    rows.filled[0] = kept


@inlined
def _share_out(paths: Paths, held: Held) -> None:
    """Length of path that each node stands for."""
    for p in range(paths.count.shape[0]):
        n, last, edge = paths.count[p], -1, 0.0
        for k in range(n):
            i = paths.node[p, k]
            if not held.engaged[i]:
                continue
            # Up to the path's ends where the thread leaves, half-way to the neighbours inside.
            if last < 0:
                edge = 0.0 if k == 0 else paths.s[p, k]
            else:
                middle = 0.5 * (paths.s[p, k] + paths.s[p, last])
                held.share[paths.node[p, last]] = middle - edge
                edge = middle
            last = k
        if last < 0:
            continue
        end = paths.s[p, last]
        if last == n - 1:
            length = paths.length[p] if paths.length[p] < math.inf else paths.cut[p]
            end = max(length, end)
        held.share[paths.node[p, last]] = end - edge


# --- springs ----------------------------------------------------------------------------------


@inlined
def _gather(points: Points, strand: Strand, line: Array, fraction: float) -> None:
    """Directions, stretch, compliance and limits of the nodes when the tick begins."""
    held, rows, W = strand.held, strand.rows, strand.three
    for r in range(rows.filled[0]):
        i, s, part = rows.node[r], rows.segment[r], rows.part[r]
        E, start = rows.E[r], rows.start[r]
        ex, ey, ez = line[s + 1, 0] - line[s, 0], line[s + 1, 1] - line[s, 1], line[s + 1, 2] - line[s, 2]
        start[0], start[1], start[2] = line[s, 0] + part * ex, line[s, 1] + part * ey, line[s, 2] + part * ez
        y = points.at[i]
        tx, ty, tz = _ring_axis(line, s, part, start[0] - y[0], start[1] - y[1], start[2] - y[2])
        _sum_compliance(points, rows, i, W)
        x, y, z = _place_without(points, held, i, W, fraction)
        nx, ny, nz = start[0] - x - held.torn[i, 0], start[1] - y - held.torn[i, 1], start[2] - z - held.torn[i, 2]
        along = nx * tx + ny * ty + nz * tz
        nx, ny, nz = nx - along * tx, ny - along * ty, nz - along * tz
        across = math.sqrt(nx * nx + ny * ny + nz * nz)
        if across > 1e-9:
            nx, ny, nz = nx / across, ny / across, nz / across
        else:
            nx, ny, nz = _beside(tx, ty, tz)
            size = math.sqrt(nx * nx + ny * ny + nz * nz)
            nx, ny, nz = nx / size, ny / size, nz / size
        E[0, 0], E[0, 1], E[0, 2] = tx, ty, tz
        E[1, 0], E[1, 1], E[1, 2] = nx, ny, nz
        E[2, 0], E[2, 1], E[2, 2] = ty * nz - tz * ny, tz * nx - tx * nz, tx * ny - ty * nx
        # Along the thread its own length counts.
        slid = tx * (points.at[i, 0] - x) + ty * (points.at[i, 1] - y) + tz * (points.at[i, 2] - z)
        rows.stretch[r, 0], rows.stretch[r, 1], rows.stretch[r, 2] = held.anchor[i] - held.at[i] + slid, across, 0.0
        for a in range(3):
            for b in range(3):
                total = points.soft[i] if a == b else 0.0
                for k in range(3):
                    total += E[a, k] * (W[k, 0] * E[b, 0] + W[k, 1] * E[b, 1] + W[k, 2] * E[b, 2])
                rows.soft[r, a, b] = total
        rows.limit[r, 0] = strand.friction[0] * points.friction[i] * held.share[i]
        # The first node of a path stands for no length while the needle has the others; it tears no sooner than they.
        rows.limit[r, 1] = points.strength[i] * max(held.share[i], LEAST_SHARE)


@inlined
def _sum_compliance(points: Points, rows: Rows, i: int, W: Array) -> None:
    """Compliance ``W`` (3, 3) of node ``i`` as the thread sees it: all of its nodes move together."""
    for a in range(3):
        for b in range(3):
            W[a, b] = 0.0
            for q in range(rows.filled[0]):
                W[a, b] += points.C[i, rows.node[q], a, b]
    for a in range(3):
        for b in range(a):
            mean = 0.5 * (W[a, b] + W[b, a])
            W[a, b], W[b, a] = mean, mean


@inlined
def _place_without(points: Points, held: Held, i: int, W: Array, fraction: float) -> tuple[float, float, float]:
    """Where node ``i`` would be without the force of the thread, and with the present ones of all else."""
    x, y, z = carried(points, i, fraction)
    for b in range(3):
        f = points.mean[i, b]
        x, y, z = x - W[0, b] * f, y - W[1, b] * f, z - W[2, b] * f
    for u in range(points.filled[0]):
        j = points.used[u]
        if held.engaged[j]:
            continue
        C = points.C[i, j]
        for b in range(3):
            f = points.force[j, b] - points.mean[j, b]
            x, y, z = x + C[0, b] * f, y + C[1, b] * f, z + C[2, b] * f
    return x, y, z


@inlined
def _ring_axis(line: Array, s: int, part: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Direction in which the thread slips through a node of its path; (x, y, z) leads from the node to the thread.

    A node holds the thread like a smooth ring: of a tension T that comes in the direction t and goes in the direction
    u it bears T (u - t), which lies across t + u. So it holds also where the thread turns at the end of its path,
    over the rim, and friction apart passes its tension on. Where the thread turns right round, t + u is 0, and the
    way from the node to the thread is across.
    """
    ahead, behind = _way(line, s, part, 1), _way(line, s, part, -1)
    tx, ty, tz = ahead[0] - behind[0], ahead[1] - behind[1], ahead[2] - behind[2]
    both, away = ahead[3] + behind[3], x * x + y * y + z * z
    if tx * tx + ty * ty + tz * tz < (HAIRPIN * both) ** 2 and away > 0.0:
        along = (tx * x + ty * y + tz * z) / away
        tx, ty, tz = tx - along * x, ty - along * y, tz - along * z
        if not tx * tx + ty * ty + tz * tz > (1e-6 * both) ** 2:
            tx, ty, tz = _beside(x, y, z)
    size = math.sqrt(tx * tx + ty * ty + tz * tz)
    return tx / size, ty / size, tz / size


@inlined
def _way(line: Array, s: int, part: float, sense: int) -> tuple[float, float, float, float]:
    """Vector from a place on the thread to one `RIM` further along it (back for -1), and the arc length to it."""
    x, y, z, left, share = 0.0, 0.0, 0.0, RIM, 1.0 - part if sense > 0 else part
    while left > 0.0 and 0 <= s < line.shape[0] - 1:
        ex, ey, ez = line[s + 1, 0] - line[s, 0], line[s + 1, 1] - line[s, 1], line[s + 1, 2] - line[s, 2]
        size = math.sqrt(ex * ex + ey * ey + ez * ez)
        here = min(share, left / size)
        x, y, z, left = x + sense * here * ex, y + sense * here * ey, z + sense * here * ez, left - here * size
        if here < share:
            break
        s, share = s + sense, 1.0
    return x, y, z, RIM - left


@inlined
def _beside(x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector perpendicular to (x, y, z)."""
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax <= ay and ax <= az:
        return 0.0, z, -y
    if ay <= az:
        return -z, 0.0, x
    return y, -x, 0.0


@inlined
def _apply_law(held: Held, rows: Rows) -> None:
    """Stiffness and force without motion of all nodes for the limits as they are, in their directions and the world."""
    for r in range(rows.filled[0]):
        i, S, K, f, E = rows.node[r], rows.soft[r], rows.K[r], rows.push[r], rows.E[r]
        along, across = held.side[i, 0], held.side[i, 1]
        _invert_free(S, along == 0, across == 0, K)
        f[0], f[1], f[2] = along * rows.limit[r, 0], across * rows.limit[r, 1], 0.0
        fx, fy = f[0], f[1]
        px = rows.stretch[r, 0] - (S[0, 0] * fx + S[0, 1] * fy)
        py = rows.stretch[r, 1] - (S[1, 0] * fx + S[1, 1] * fy)
        pz = rows.stretch[r, 2] - (S[2, 0] * fx + S[2, 1] * fy)
        for a in range(3):
            f[a] += K[a, 0] * px + K[a, 1] * py + K[a, 2] * pz
        for a in range(3):
            rows.bias[r, a] = -(E[0, a] * f[0] + E[1, a] * f[1] + E[2, a] * f[2])
            for b in range(3):
                total = 0.0
                for k in range(3):
                    total += E[k, a] * (K[k, 0] * E[0, b] + K[k, 1] * E[1, b] + K[k, 2] * E[2, b])
                rows.stiffness[r, a, b] = total


@inlined
def _invert_free(S: Array, first: bool, second: bool, K: Array) -> None:
    """K = the inverse of the symmetric S (3, 3) in the directions that are free, 0 in the others; the third is."""
    a, b, c = (S[0, 0] if first else 1.0), (S[1, 1] if second else 1.0), S[2, 2]
    d = S[0, 1] if first and second else 0.0
    e = S[0, 2] if first else 0.0
    g = S[1, 2] if second else 0.0
    scale = 1.0 / (a * (b * c - g * g) - d * (d * c - g * e) + e * (d * g - b * e))
    K[0, 0], K[1, 1], K[2, 2] = scale * (b * c - g * g), scale * (a * c - e * e), scale * (a * b - d * d)
    K[0, 1], K[0, 2], K[1, 2] = scale * (e * g - d * c), scale * (d * g - b * e), scale * (d * e - a * g)
    if not first:
        K[0, 0], K[0, 1], K[0, 2] = 0.0, 0.0, 0.0
    if not second:
        K[1, 1], K[0, 1], K[1, 2] = 0.0, 0.0, 0.0
    K[1, 0], K[2, 0], K[2, 1] = K[0, 1], K[0, 2], K[1, 2]


@inlined
def prepare(points: Points, paths: Paths, strand: Strand, line: Array, fraction: float) -> None:
    """Find the springs of a tick that begins with the thread's points at ``line`` (n, 3)."""
    _find(points, strand.held, strand.rows, line)
    _share_out(paths, strand.held)
    _gather(points, strand, line, fraction)
    _apply_law(strand.held, strand.rows)


@kernel
def find_springs(tissue: Integers, thread: Integers, line: Array) -> None:
    """`prepare` for Python."""
    t = open_tissue(tissue)
    prepare(t.points, t.paths, open_strand(thread), line, (t.field.clock[0] + 1) / t.field.clock[1])


# --- the end of a tick ------------------------------------------------------------------------


@inlined
def _motion(rows: Rows, r: int, line: Array) -> tuple[float, float, float]:
    """Displacement of the thread at a node, in the node's directions."""
    s, part, E = rows.segment[r], rows.part[r], rows.E[r]
    x = line[s, 0] + part * (line[s + 1, 0] - line[s, 0]) - rows.start[r, 0]
    y = line[s, 1] + part * (line[s + 1, 1] - line[s, 1]) - rows.start[r, 1]
    z = line[s, 2] + part * (line[s + 1, 2] - line[s, 2]) - rows.start[r, 2]
    return (
        E[0, 0] * x + E[0, 1] * y + E[0, 2] * z,
        E[1, 0] * x + E[1, 1] * y + E[1, 2] * z,
        E[2, 0] * x + E[2, 1] * y + E[2, 2] * z,
    )


@inlined
def _find_excess(rows: Rows, r: int, x: float, y: float, z: float) -> None:
    """Elongation of the bristle alone after the motion (x, y, z) with the force ``local``."""
    S, f = rows.soft[r], rows.local[r]
    rows.excess[r, 0] = rows.stretch[r, 0] + x - (S[0, 0] * f[0] + S[0, 1] * f[1] + S[0, 2] * f[2])
    rows.excess[r, 1] = rows.stretch[r, 1] + y - (S[1, 0] * f[0] + S[1, 1] * f[1] + S[1, 2] * f[2])
    rows.excess[r, 2] = rows.stretch[r, 2] + z - (S[2, 0] * f[0] + S[2, 1] * f[1] + S[2, 2] * f[2])


@inlined
def _change_sides(held: Held, rows: Rows, back: bool) -> bool:
    """Update which rows are at their limits after a solve, with ``back`` also which no longer are; True on a change."""
    changed = False
    for r in range(rows.filled[0]):
        for a in range(2):
            side, force = held.side[rows.node[r], a], rows.local[r, a]
            now = side
            if side == 0 and abs(force) > rows.limit[r, a] * OVER:
                now = 1 if force > 0.0 else -1
            elif side != 0 and back and side * rows.excess[r, a] < 0.0:
                now = 0
            held.side[rows.node[r], a] = now
            changed = changed or now != side
    return changed


@inlined
def _follow_limits(held: Held, rows: Rows) -> None:
    """Move anchors that slip, and add up tearing."""
    for r in range(rows.filled[0]):
        i = rows.node[r]
        if held.side[i, 0] != 0:
            held.anchor[i] -= rows.excess[r, 0]
        if held.side[i, 1] != 0:
            for a in range(3):
                held.torn[i, a] += rows.excess[r, 1] * rows.E[r, 1, a]


@kernel
def settle(tissue: Integers, thread: Integers, line: Array, back: bool, again: bool) -> bool:
    """Take the thread's points as solved with the springs; True where limits were mistaken, with new springs.

    ``back`` allows rows to leave their limits, ``again`` another repetition. After False the forces stand.
    """
    t, strand = open_tissue(tissue), open_strand(thread)
    held, rows, points = strand.held, strand.rows, t.points
    for r in range(rows.filled[0]):
        x, y, z = _motion(rows, r, line)
        K = rows.K[r]
        for a in range(3):
            rows.local[r, a] = rows.push[r, a] + K[a, 0] * x + K[a, 1] * y + K[a, 2] * z
        _find_excess(rows, r, x, y, z)
    if _change_sides(held, rows, back) and again:
        _apply_law(held, rows)
        return True
    for r in range(rows.filled[0]):
        f, E = rows.local[r], rows.E[r]
        for a in range(3):
            points.force[rows.node[r], a] = E[0, a] * f[0] + E[1, a] * f[1] + E[2, a] * f[2]
    _follow_limits(held, rows)
    return False


@inlined
def finish(points: Points, strand: Strand, line: Array) -> None:
    """End a tick whose springs another solver took as they were, with the forces ``rows.force``."""
    held, rows = strand.held, strand.rows
    for r in range(rows.filled[0]):
        x, y, z = _motion(rows, r, line)
        f, E = rows.force[r], rows.E[r]
        for a in range(3):
            rows.local[r, a] = E[a, 0] * f[0] + E[a, 1] * f[1] + E[a, 2] * f[2]
            points.force[rows.node[r], a] = f[a]
        _find_excess(rows, r, x, y, z)
    _follow_limits(held, rows)
    _change_sides(held, rows, True)


@kernel
def conclude(tissue: Integers, thread: Integers, line: Array) -> None:
    """`finish` for Python."""
    finish(open_tissue(tissue).points, open_strand(thread), line)
