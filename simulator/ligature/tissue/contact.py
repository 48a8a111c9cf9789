"""Rigid bodies on the surface of tissue: where they touch it, and normal and friction forces; metres, newtons.

Each convex part of a body has at most one point of contact with each face of the surface, the deepest
(`ligature.tissue.contact_search`). All points of a block are solved at once by projected Gauss–Seidel on ::

    u_i = w_i + Σ D_ij f_j,   D_ij = C_ij + h² (recoil of the body + recoil of the block's own rigid body)
    f_n ≥ 0, u_n + c f_n ≥ 0, one of them zero; ‖f_t‖ ≤ μ f_n, u_t + c f_t = 0 unless it slips

with u the gap along the normal and the stretch across it at the end of the tick (Coulomb friction by bristles of
compliance c). A face that is held has points of contact for bodies that come from inside, so that what presses the
tissue flat does not turn its cells inside out. A pin holds a point at a place of the world by all three components of
its force. Axes are those of the block.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.mesh.distance import SPHERE
from ligature.tissue.contact_arrays import Contacts, Solve, Touching
from ligature.tissue.contact_search import find_contacts, measure_contacts
from ligature.tissue.dense import times, times_transposed
from ligature.tissue.interface import add_point, displaced, place_point, settle_point
from ligature.tissue.layout import LEAVING, Field, Points

Array = NDArray[np.float64]

RESERVED = 40
"""Points that needles find unused at least, as far as ways that nothing is in can be closed for them."""

MEET = 0.5e-3
"""Distance in metres at which one begins, beside what the body moves in a tick."""

DEEPER = 0.2e-3
"""Depth in metres by which another place of a face must be deeper for the point of contact to move there."""

DEEPER_BALL = 5e-6
"""The same for balls, and on faces that are held, m.

A ball of 8 mm is as deep elsewhere when it has rolled by 0.3 mm, the lever of `ROLLING`: so it does not roll off by
itself over a point that stays behind.
"""

RECOVERY = 4e-5
"""Depth in metres out of which a body is pushed in a tick."""

SWEEPS = 12
"""Sweeps of projected Gauss–Seidel in a tick, from the forces of the last one."""

SWEEPS_FREE, SETTLED = 60, 1e-6
"""The same at most for tissue that recoils, and the change over the largest force at which they end."""

SOFT = 1e-5
"""Compliance of a bristle, m/N."""

HARD = 1e-6
"""Compliance of tissue that is pressed flat, m/N."""

ROLLING = 0.3e-3
"""Lever in metres by which the tissue's push on a body that rolls lies before its middle."""

TIP = 4e-3
"""Length of a needle from its tip, m, that does not touch the surface as a body, for it punctures it."""


# --- which contacts there are -----------------------------------------------------------------


@inlined
def _sort(work: Solve, count: int) -> None:
    """Sort the places found by distance, nearest first: an insertion sort, stable and fast for a few."""
    for n in range(count):
        k = n
        while k > 0 and work.values[work.order[k - 1], 0] > work.values[n, 0]:
            work.order[k] = work.order[k - 1]
            k -= 1
        work.order[k] = n


@inlined
def _anchor(contacts: Contacts, points: Points, r: int, found: int) -> None:
    """Set the anchor of friction so that its force at the present place of the point stays the same."""
    t, partners, value = contacts.touching, contacts.partners, contacts.solve.values[found]
    t.distance[r] = value[0]
    n, f = t.normal[r], t.force[r]
    n[0], n[1], n[2] = value[1], value[2], value[3]
    along = f[0] * n[0] + f[1] * n[1] + f[2] * n[2]
    away = contacts.solve.vectors[0]
    for k in range(3):
        away[k] = points.at[t.point[r], k] + SOFT * (f[k] - along * n[k]) - partners.centre[t.body[r], k]
    times_transposed(partners.R[t.body[r]], away, t.anchor[r])


@inlined
def _set_weights(work: Solve, found: int) -> None:
    """Weights of a face's corners at a place that was found."""
    u, v = work.values[found, 4], work.values[found, 5]
    w = work.weights
    w[0], w[1], w[2], w[3] = (1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v


@inlined
def _begin(field: Field, points: Points, contacts: Contacts, found: int) -> None:
    """Begin a contact of a body and the tissue at another point, if there is room."""
    t, work, partners = contacts.touching, contacts.solve, contacts.partners
    part, q = work.found[found, 0], work.found[found, 1]
    body = contacts.parts.body[part]
    _set_weights(work, found)
    away = 0.0
    for k in range(3):
        at = 0.0
        for c in range(4):
            at += work.weights[c] * field.x[field.faces[q, c], k]
        away += (at - partners.tip[body, k]) ** 2
    if away < TIP * TIP:
        return
    r = 0
    while r < t.used.shape[0] and t.used[r]:
        r += 1
    if r == t.used.shape[0] or points.status.shape[0] - points.filled[0] <= RESERVED:
        contacts.overflow[0] += 1
        return
    t.used[r], t.part[r], t.face[r], t.body[r] = 1, part, q, body
    t.point[r] = add_point(field, points, field.faces[q], work.weights)
    t.force[r, 0], t.force[r, 1], t.force[r, 2] = 0.0, 0.0, 0.0
    t.friction[r] = partners.friction[body]
    t.soft[r] = HARD if field.core[q] > 0.0 else SOFT
    _anchor(contacts, points, r, found)


@kernel
def match_contacts(field: Field, points: Points, contacts: Contacts, count: int, dt: float) -> None:
    """Keep, begin, move and end points of contact after the ``count`` that were found."""
    t, work, partners = contacts.touching, contacts.solve, contacts.partners
    for r in range(t.used.shape[0]):
        work.known[r] = t.used[r] != 0 and t.part[r] >= 0
    _sort(work, count)
    for n in range(count):
        f = work.order[n]
        part, q, value = work.found[f, 0], work.found[f, 1], work.values[f]
        row = -1
        for r in range(t.used.shape[0]):
            if work.known[r] and t.part[r] == part and t.face[r] == q:
                row = r
        if row >= 0:
            work.known[row] = False
            rolls = contacts.parts.kind[part] == SPHERE or field.core[q] > 0.0
            if value[0] < t.distance[row] - (DEEPER_BALL if rolls else DEEPER):
                _set_weights(work, f)
                place_point(field, points, t.point[row], field.faces[q], work.weights)
                settle_point(field, points, t.point[row])
                _anchor(contacts, points, row, f)
            continue
        twist = partners.twist[contacts.parts.body[part]]
        closing = value[1] * twist[0] + value[2] * twist[1] + value[3] * twist[2]
        if value[0] <= MEET + max(closing, 0.0) * dt:
            _begin(field, points, contacts, f)
    for r in range(t.used.shape[0]):
        if work.known[r]:
            points.status[t.point[r]] = LEAVING
            t.used[r] = 0
            t.force[r, 0], t.force[r, 1], t.force[r, 2] = 0.0, 0.0, 0.0


# --- forces -----------------------------------------------------------------------------------


@inlined
def _add_recoil(D: Array, light: float, spin: Array, first: Array, second: Array, h2: float) -> None:
    """Add to D (3, 3) the motion of a body at a lever ``first`` for a force at ``second``, times h²."""
    for b in range(3):
        ex, ey, ez = (1.0 if b == 0 else 0.0), (1.0 if b == 1 else 0.0), (1.0 if b == 2 else 0.0)
        mx = second[1] * ez - second[2] * ey
        my = second[2] * ex - second[0] * ez
        mz = second[0] * ey - second[1] * ex
        wx = spin[0, 0] * mx + spin[0, 1] * my + spin[0, 2] * mz
        wy = spin[1, 0] * mx + spin[1, 1] * my + spin[1, 2] * mz
        wz = spin[2, 0] * mx + spin[2, 1] * my + spin[2, 2] * mz
        D[b, b] += h2 * light
        D[0, b] += h2 * (wy * first[2] - wz * first[1])
        D[1, b] += h2 * (wz * first[0] - wx * first[2])
        D[2, b] += h2 * (wx * first[1] - wy * first[0])


@inlined
def _gather(touching: Touching, points: Points, work: Solve) -> int:
    """List the points of contact, and by what the forces of all other points differ from the last step's means."""
    n, used = 0, points.filled[0]
    for r in range(touching.used.shape[0]):
        if touching.used[r]:
            work.rows[n] = r
            n += 1
    if n == 0:
        return 0
    for k in range(used):
        work.own_point[points.used[k]] = False
    for a in range(n):
        work.own_point[touching.point[work.rows[a]]] = True
    for k in range(used):
        j = points.used[k]
        for m in range(3):
            work.change[j, m] = (0.0 if work.own_point[j] else points.force[j, m]) - points.mean[j, m]
    return n


@inlined
def _find_gap(contacts: Contacts, points: Points, a: int, s: float, dt: float) -> None:
    """Gap along the normal and stretch across it of a point without forces of contact, into ``work.w``; its levers."""
    touching, work, partners = contacts.touching, contacts.solve, contacts.partners
    r = work.rows[a]
    i, b = touching.point[r], touching.body[r]
    centre, twist, normal = partners.centre[b], partners.twist[b], touching.normal[r]
    at, u, w, arm = points.at[i], work.u[a], work.w[a], work.lever[a]
    for k in range(3):
        arm[k] = at[k] - centre[k]
        work.own[a, k] = at[k] - partners.centre[0, k]
    # Where friction anchors, at the end of the tick.
    times(partners.R[b], touching.anchor[r], u)
    lx, ly, lz = u[0], u[1], u[2]
    u[0] += centre[0] + dt * (twist[0] + twist[4] * lz - twist[5] * ly)
    u[1] += centre[1] + dt * (twist[1] + twist[5] * lx - twist[3] * lz)
    u[2] += centre[2] + dt * (twist[2] + twist[3] * ly - twist[4] * lx)
    x, y, z = displaced(points, i, s, work.change)
    w[0], w[1], w[2] = x - u[0], y - u[1], z - u[2]
    along = w[0] * normal[0] + w[1] * normal[1] + w[2] * normal[2]
    vx = dt * (twist[0] + twist[4] * arm[2] - twist[5] * arm[1])
    vy = dt * (twist[1] + twist[5] * arm[0] - twist[3] * arm[2])
    vz = dt * (twist[2] + twist[3] * arm[1] - twist[4] * arm[0])
    gap = max(touching.distance[r], -RECOVERY)
    gap += normal[0] * (x - at[0] - vx) + normal[1] * (y - at[1] - vy) + normal[2] * (z - at[2] - vz)
    for k in range(3):
        w[k] += (gap - along) * normal[k]


@inlined
def _fill_compliance(contacts: Contacts, points: Points, a: int, n: int, dt: float) -> None:
    """How point ``a`` moves by a force at each of the ``n`` points: tissue and recoil, into ``work.D``."""
    touching, work, partners = contacts.touching, contacts.solve, contacts.partners
    i, b = touching.point[work.rows[a]], touching.body[work.rows[a]]
    for c in range(n):
        j = touching.point[work.rows[c]]
        D = work.D[a, c]
        for k in range(3):
            for m in range(3):
                D[k, m] = points.C[i, j, k, m]
        if partners.light[0] > 0.0:
            _add_recoil(D, partners.light[0], partners.spin[0], work.own[a], work.own[c], dt * dt)
        if partners.light[b] > 0.0 and touching.body[work.rows[c]] == b:
            _add_recoil(D, partners.light[b], partners.spin[b], work.lever[a], work.lever[c], dt * dt)


@inlined
def _relax_all(touching: Touching, work: Solve, n: int, recoils: bool) -> None:
    """Solve the forces of the ``n`` points by projected Gauss–Seidel, from those of the last tick."""
    for a in range(n):
        for k in range(3):
            work.u[a, k] = work.w[a, k]
            for c in range(n):
                f = touching.force[work.rows[c]]
                D = work.D[a, c]
                work.u[a, k] += D[k, 0] * f[0] + D[k, 1] * f[1] + D[k, 2] * f[2]
    for _ in range(SWEEPS_FREE if recoils else SWEEPS):
        change, most = 0.0, 0.0
        for a in range(n):
            change = max(change, _relax(touching, work, n, a))
            f = touching.force[work.rows[a]]
            most = max(most, f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
        if recoils and change <= SETTLED * SETTLED * most:
            break


@inlined
def _conclude(contacts: Contacts, points: Points, a: int) -> None:
    """Pass the force of a point to the tissue, and move the anchor of friction on by what the bristle does not hold."""
    touching, work, partners = contacts.touching, contacts.solve, contacts.partners
    r = work.rows[a]
    f, normal, u = touching.force[r], touching.normal[r], work.u[a]
    for k in range(3):
        points.force[touching.point[r], k] = f[k]
    if touching.part[r] < 0:
        return
    along_f = f[0] * normal[0] + f[1] * normal[1] + f[2] * normal[2]
    along_u = u[0] * normal[0] + u[1] * normal[1] + u[2] * normal[2]
    for k in range(3):
        work.w[a, k] = u[k] - along_u * normal[k] + SOFT * (f[k] - along_f * normal[k])
    times_transposed(partners.R[touching.body[r]], work.w[a], work.u[a])
    for k in range(3):
        touching.anchor[r, k] += work.u[a, k]


@kernel
def press(contacts: Contacts, points: Points, s: float, dt: float) -> int:
    """Forces of all points of contact in this tick, and where friction anchors; returns how many there are."""
    n = _gather(contacts.touching, points, contacts.solve)
    for a in range(n):
        _find_gap(contacts, points, a, s, dt)
    for a in range(n):
        _fill_compliance(contacts, points, a, n, dt)
    _relax_all(contacts.touching, contacts.solve, n, contacts.partners.light[0] > 0.0)
    for a in range(n):
        _conclude(contacts, points, a)
    return n


@inlined
def _relax(touching: Touching, work: Solve, n: int, a: int) -> float:
    """Update one point: its normal force, then friction within the cone; returns the squared change of its force."""
    r = work.rows[a]
    f, normal, D, u, soft = touching.force[r], touching.normal[r], work.D[a, a], work.u[a], touching.soft[work.rows[a]]
    if touching.part[r] < 0:
        total = 0.0
        for k in range(3):
            change = -(u[k] + soft * f[k]) / (D[k, k] + soft)
            f[k] += change
            for c in range(n):
                E, v = work.D[a, c], work.u[c]
                v[0], v[1], v[2] = v[0] + E[k, 0] * change, v[1] + E[k, 1] * change, v[2] + E[k, 2] * change
            total += change * change
        return total
    stiff, trace, gap, before = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        trace += D[k, k]
        gap += normal[k] * u[k]
        before += normal[k] * f[k]
        for m in range(3):
            stiff += normal[k] * D[k, m] * normal[m]
    pressed = before - (gap + soft * before) / (stiff + soft)
    pressed = pressed if pressed > 0.0 else 0.0
    across = max(trace - stiff, 0.5 * trace) + SOFT
    tx, ty, tz, size = 0.0, 0.0, 0.0, 0.0
    limit = touching.friction[r] * pressed
    tx = f[0] - before * normal[0] - (u[0] - gap * normal[0] + SOFT * (f[0] - before * normal[0])) / across
    ty = f[1] - before * normal[1] - (u[1] - gap * normal[1] + SOFT * (f[1] - before * normal[1])) / across
    tz = f[2] - before * normal[2] - (u[2] - gap * normal[2] + SOFT * (f[2] - before * normal[2])) / across
    size = math.sqrt(tx * tx + ty * ty + tz * tz)
    scale = limit / size if size > limit else 1.0
    cx = pressed * normal[0] + scale * tx - f[0]
    cy = pressed * normal[1] + scale * ty - f[1]
    cz = pressed * normal[2] + scale * tz - f[2]
    if cx == 0.0 and cy == 0.0 and cz == 0.0:
        return 0.0
    f[0], f[1], f[2] = f[0] + cx, f[1] + cy, f[2] + cz
    for c in range(n):  # D is symmetric, and its row lies together in memory
        E, v = work.D[a, c], work.u[c]
        v[0] += E[0, 0] * cx + E[1, 0] * cy + E[2, 0] * cz
        v[1] += E[0, 1] * cx + E[1, 1] * cy + E[2, 1] * cz
        v[2] += E[0, 2] * cx + E[1, 2] * cy + E[2, 2] * cz
    return cx * cx + cy * cy + cz * cz


@kernel
def touch(field: Field, points: Points, contacts: Contacts, dt: float) -> bool:
    """A tick of all bodies whose parts are ``live``: True where any touches the tissue, with `Partners.push` then."""
    t, parts, partners, work = contacts.touching, contacts.parts, contacts.partners, contacts.solve
    count = find_contacts(field, parts, partners, work)
    measure_contacts(field, t, points, parts, partners, work.vectors)
    match_contacts(field, points, contacts, count, dt)
    n = press(contacts, points, (field.clock[0] + 1) / field.clock[1], dt)
    for b in range(partners.push.shape[0]):
        for k in range(6):
            partners.push[b, k] = 0.0
    for a in range(n):
        r = work.rows[a]
        f, at, push, centre = t.force[r], points.at[t.point[r]], partners.push[t.body[r]], partners.centre[t.body[r]]
        x, y, z = at[0] - centre[0], at[1] - centre[1], at[2] - centre[2]
        push[0], push[1], push[2] = push[0] - f[0], push[1] - f[1], push[2] - f[2]
        push[3] -= y * f[2] - z * f[1]
        push[4] -= z * f[0] - x * f[2]
        push[5] -= x * f[1] - y * f[0]
    if n > 0:
        _resist_rolling(contacts, n, dt)
    return n > 0


@inlined
def _resist_rolling(contacts: Contacts, n: int, dt: float) -> None:
    """Apply rolling resistance to bodies that turn on the tissue, at most `ROLLING` times the force that presses them.

    What turns slowly is braked in proportion, so that a tick never turns it back.
    """
    t, partners, work = contacts.touching, contacts.partners, contacts.solve
    for b in range(1, partners.push.shape[0]):
        if partners.light[b] == 0.0:
            continue
        pressed = 0.0
        for a in range(n):
            r = work.rows[a]
            if t.body[r] == b:
                f, m = t.force[r], t.normal[r]
                pressed += f[0] * m[0] + f[1] * m[1] + f[2] * m[2]
        if pressed <= 0.0:
            continue
        w, spin = partners.twist[b, 3:6], partners.spin[b]
        speed = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        limit = ROLLING * pressed
        slow = limit * dt * (spin[0, 0] + spin[1, 1] + spin[2, 2])
        for k in range(3):
            moment = limit * w[k] / max(speed, slow)
            partners.push[b, 3 + k] -= moment
            partners.push[0, 3 + k] += moment
