"""Where rigid bodies are nearest to the surface of tissue: its deepest points for each convex part; metres.

Nodes of the surface are met by themselves; edges at their deepest point, where that is deeper than their nodes; faces
at theirs, where it is deeper than their edges. So what is flat bears on all nodes that it covers and on all edges that
its rim crosses, and these points stay where they are in the material. With one point a face, corners would bulge past
the body, and the point would go from end to end of a rim that crosses the face. The deepest point is the best of a few,
from which a search with ever smaller steps goes on.
Faces that are held stop bodies that come from inside a little before they reach them: what presses tissue flat does not
turn its cells inside out.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.mesh.distance import signed_distance
from ligature.tissue.contact_arrays import Partners, Parts, Solve, Touching
from ligature.tissue.dense import times, times_transposed
from ligature.tissue.layout import GROUP, Field, Points

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

FACING = -0.2
"""Cosine between the surface's outward normal and a contact's above which a body is not before that face."""

COARSE = 3
"""Points along an edge of a face from the best of which the search for the deepest begins."""

FINE = 0.1e-3
"""How exact the place of a point of contact is found, m."""

LEVEL = 1e-7
"""Depth in metres by which a further place must be deeper: flat contacts keep theirs."""

REACH = 1.5e-3
"""Distance in metres at which a point of contact is let go."""

BULGE = 2e-5
"""Metres by which a face must be deeper than its edges, and an edge than its nodes."""

KEEP = 1.0
"""What stands for the distance, in metres, of what is not: it keeps its point of contact, if it has one."""


@inlined
def place_part(parts: Parts, partners: Partners, c: int) -> bool:
    """Where part ``c`` is in this tick; whether it was elsewhere before."""
    T, Q, o, b = parts.local[c], parts.R[c], parts.centre[c], parts.body[c]
    R, moved = partners.R[b], False
    for k in range(3):
        for m in range(3):
            turned = R[k, 0] * T[0, m] + R[k, 1] * T[1, m] + R[k, 2] * T[2, m]
            moved = moved or Q[k, m] != turned
            Q[k, m] = turned
        at = partners.centre[b, k] + R[k, 0] * T[0, 3] + R[k, 1] * T[1, 3] + R[k, 2] * T[2, 3]
        moved = moved or o[k] != at
        o[k] = at
    return moved


@inlined
def _distance_to(parts: Parts, c: int, p: Array, a: Array, b: Array, normal: Array) -> float:
    """Signed distance of ``p`` (3,) to part ``c``, and its outward ``normal`` there; a, b are scratch."""
    R, o = parts.R[c], parts.centre[c]
    for k in range(3):
        b[k] = p[k] - o[k]
    times_transposed(R, b, a)
    first, last = parts.plane_range[c, 0], parts.plane_range[c, 1]
    d = signed_distance(parts.kind[c], parts.size[c], parts.planes[first:last], a, b)
    times(R, b, normal)
    return d


@inlined
def _at(x: Array, faces: Integers, q: int, u: float, v: float, p: Array) -> None:
    """Point of face ``q`` at u, v to p (3,)."""
    i, j, k, h = faces[q, 0], faces[q, 1], faces[q, 2], faces[q, 3]
    for m in range(3):
        low = x[i, m] + u * (x[j, m] - x[i, m])
        high = x[h, m] + u * (x[k, m] - x[h, m])
        p[m] = low + v * (high - low)


@inlined
def _search_face(field: Field, parts: Parts, work: Solve, c: int, q: int, count: int) -> int:
    """Add the deepest point of face ``q`` for part ``c``, if it is near, to the places found; returns their number."""
    x, faces, vectors = field.x, field.faces, work.vectors
    p, a, b, normal, best_normal = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4]
    best, u, v, core = math.inf, 0.5, 0.5, field.core[q]
    i, j, k, h = faces[q, 0], faces[q, 1], faces[q, 2], faces[q, 3]
    for m in range(3):
        a[m], b[m] = x[k, m] - x[i, m], x[h, m] - x[j, m]
    nx, ny, nz = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    edge = math.sqrt(size)
    if core > 0.0:
        _at(x, faces, q, 0.5, 0.5, p)
        _distance_to(parts, c, p, a, b, normal)
        if nx * normal[0] + ny * normal[1] + nz * normal[2] <= -FACING * size:
            return count
    _at(x, faces, q, 0.5, 0.5, p)
    half = 0.0
    for s in range(4):
        node = faces[q, s]
        half = max(half, (x[node, 0] - p[0]) ** 2 + (x[node, 1] - p[1]) ** 2 + (x[node, 2] - p[2]) ** 2)
    if _distance_to(parts, c, p, a, b, normal) - core - math.sqrt(half) > REACH:  # no point of it is nearer
        return count
    opposed = math.inf
    for s in range(COARSE * COARSE):
        su, sv = (s % COARSE + 0.5) / COARSE, (s // COARSE + 0.5) / COARSE
        _at(x, faces, q, su, sv, p)
        d = _distance_to(parts, c, p, a, b, normal) - core
        opposed = min(opposed, nx * normal[0] + ny * normal[1] + nz * normal[2])
        if d < best:
            best, u, v = d, su, sv
            best_normal[0], best_normal[1], best_normal[2] = normal[0], normal[1], normal[2]
    # What tissue stands on is large and flat: no point of a face beside it faces it if none of these does.
    if best > REACH + edge / COARSE or (parts.still[c] and core == 0.0 and opposed > 0.5 * FACING * size):
        return count
    step = 0.5 / COARSE
    while step * edge > FINE:
        moved = False
        for way in range(4):
            su = min(max(u + (step if way == 0 else -step if way == 1 else 0.0), 0.0), 1.0)
            sv = min(max(v + (step if way == 2 else -step if way == 3 else 0.0), 0.0), 1.0)
            _at(x, faces, q, su, sv, p)
            d = _distance_to(parts, c, p, a, b, normal) - core
            if d < best - LEVEL:
                best, u, v, moved = d, su, sv, True
                best_normal[0], best_normal[1], best_normal[2] = normal[0], normal[1], normal[2]
        if not moved:
            step *= 0.5
    facing = nx * best_normal[0] + ny * best_normal[1] + nz * best_normal[2]
    if best > REACH or (facing > FACING * size if core == 0.0 else facing < -FACING * size):
        return count
    if core == 0.0:
        for way in range(4):
            first, second = faces[q, way], faces[q, (way + 1) % 4]
            if field.row[first] < 0 and field.row[second] < 0:
                continue
            su, sv = u if way % 2 == 0 else (1.0 if way == 1 else 0.0), v if way % 2 == 1 else 0.5 * way
            _at(x, faces, q, su, sv, p)
            if _distance_to(parts, c, p, a, b, normal) < best + BULGE:
                if parts.still[c]:
                    return count
                best = KEEP
                break
    return _note(work, c, q, best, u, v, best_normal, count)


@inlined
def _note(work: Solve, c: int, q: int, depth: float, u: float, v: float, normal: Array, count: int) -> int:
    """Append a place to those found; returns their number."""
    work.found[count, 0], work.found[count, 1] = c, q
    work.values[count, 0], work.values[count, 4], work.values[count, 5] = depth, u, v
    for m in range(3):
        work.values[count, 1 + m] = normal[m]
    return count + 1


@inlined
def _search_site(field: Field, parts: Parts, work: Solve, c: int, q: int, count: int) -> int:
    """Add the deepest point of an edge, or a node, if part ``c`` is near it and before the faces around it."""
    x, faces, vectors = field.x, field.faces, work.vectors
    p, a, b, normal, best_normal = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4]
    i, j = faces[q, 0], faces[q, 1]
    edge = math.sqrt((x[j, 0] - x[i, 0]) ** 2 + (x[j, 1] - x[i, 1]) ** 2 + (x[j, 2] - x[i, 2]) ** 2)
    _at(x, faces, q, 0.5, 0.0, p)
    if _distance_to(parts, c, p, a, b, normal) - 0.5 * edge > REACH:
        return count
    best, u, step = math.inf, 0.0, 0.5 / COARSE
    for s in range(COARSE if i != j else 1):
        su = (s + 0.5) / COARSE if i != j else 0.0
        _at(x, faces, q, su, 0.0, p)
        d = _distance_to(parts, c, p, a, b, normal)
        if d < best:
            best, u = d, su
            best_normal[0], best_normal[1], best_normal[2] = normal[0], normal[1], normal[2]
    if best > REACH + edge / COARSE:
        return count
    while step * edge > FINE:
        moved = False
        for way in range(2):
            su = min(max(u + (step if way == 0 else -step), 0.0), 1.0)
            _at(x, faces, q, su, 0.0, p)
            d = _distance_to(parts, c, p, a, b, normal)
            if d < best - LEVEL:
                best, u, moved = d, su, True
                best_normal[0], best_normal[1], best_normal[2] = normal[0], normal[1], normal[2]
        if not moved:
            step *= 0.5
    if best > REACH:
        return count
    nx, ny, nz = 0.0, 0.0, 0.0
    beside = field.around[q - faces.shape[0] + field.around.shape[0]]
    for s in range(beside.shape[0]):
        if beside[s] >= 0:
            k, m, n, h = faces[beside[s], 0], faces[beside[s], 1], faces[beside[s], 2], faces[beside[s], 3]
            for e in range(3):
                a[e], b[e] = x[n, e] - x[k, e], x[h, e] - x[m, e]
            nx, ny, nz = nx + a[1] * b[2] - a[2] * b[1], ny + a[2] * b[0] - a[0] * b[2], nz + a[0] * b[1] - a[1] * b[0]
    facing = nx * best_normal[0] + ny * best_normal[1] + nz * best_normal[2]
    if facing > FACING * math.sqrt(nx * nx + ny * ny + nz * nz):
        return count
    for end in range(2 if i != j else 0):
        node = faces[q, end]
        if field.row[node] >= 0:
            p[0], p[1], p[2] = x[node, 0], x[node, 1], x[node, 2]
            if _distance_to(parts, c, p, a, b, normal) < best + BULGE:
                if parts.still[c]:
                    return count
                best = KEEP
                break
    return _note(work, c, q, best, u, 0.0, best_normal, count)


@kernel
def find_contacts(field: Field, parts: Parts, partners: Partners, work: Solve) -> int:
    """Deepest point of each face for each part that is near; returns how many there are in ``work``.

    Faces move once in a tissue step: what was found of parts that stand counts until then.
    """
    stands = work.standing[1] == field.found[0]
    for c in range(parts.kind.shape[0]):
        moved = place_part(parts, partners, c) if parts.live[c] else False
        if parts.still[c]:
            stands = stands and not moved and parts.live[c] == parts.known[c]
            parts.known[c] = parts.live[c]
    if not stands:
        work.standing[0], work.standing[1] = _find(field, parts, work, True, 0), field.found[0]
    return _find(field, parts, work, False, work.standing[0])


@inlined
def _find(field: Field, parts: Parts, work: Solve, still: bool, count: int) -> int:
    """Add the places near the ``still`` parts, or near the others, to the ``count`` found; returns their number."""
    low, high = work.vectors[0], work.vectors[1]
    for c in range(parts.kind.shape[0]):
        if not parts.live[c] or parts.still[c] != still:
            continue
        R, o = parts.R[c], parts.centre[c]
        outside = False
        for m in range(3):
            middle, reach = o[m], REACH
            for k in range(3):
                middle += R[m, k] * parts.middle[c, k]
                reach += abs(R[m, k]) * parts.half[c, k]
            low[m], high[m] = middle - reach, middle + reach
            outside = outside or low[m] > field.box[1, m] or high[m] < field.box[0, m]
        if outside:
            continue
        lx, ly, lz, hx, hy, hz = low[0], low[1], low[2], high[0], high[1], high[2]
        for g in range(field.group_box.shape[0]):
            box = field.group_box[g]
            if box[0, 0] > hx or box[1, 0] < lx or box[0, 1] > hy or box[1, 1] < ly or box[0, 2] > hz or box[1, 2] < lz:
                continue
            for q in range(g * GROUP, min(field.faces.shape[0], (g + 1) * GROUP)):
                box = field.face_box[q]
                beside = box[0, 0] > hx or box[1, 0] < lx or box[0, 1] > hy or box[1, 1] < ly
                if beside or box[0, 2] > hz or box[1, 2] < lz or count == work.found.shape[0]:
                    continue
                if q < field.faces.shape[0] - field.around.shape[0]:
                    count = _search_face(field, parts, work, c, q, count)
                else:
                    count = _search_site(field, parts, work, c, q, count)
    return count


@kernel
def measure_contacts(
    field: Field, touching: Touching, points: Points, parts: Parts, partners: Partners, vectors: Array
) -> None:
    """Distance and normal of every point of contact as the tick begins."""
    a, b = vectors[0], vectors[1]
    for r in range(touching.used.shape[0]):
        if touching.used[r] and touching.part[r] >= 0:
            c, at = touching.part[r], points.at[touching.point[r]]
            if not parts.live[c]:
                place_part(parts, partners, c)
            touching.distance[r] = _distance_to(parts, c, at, a, b, touching.normal[r]) - field.core[touching.face[r]]
