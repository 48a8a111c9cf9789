"""Contacts of rod elements with the convex parts of other bodies: detection and projection, compiled.

A contact is found before the tick, from outside, with the plane that the point must not cross
during it, so that nothing tunnels. Friction is Coulomb's on positions. World axes, SI units.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ligature.mesh.distance import signed_distance
from ligature.suture.solver import rotate, turn

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MAX_CONTACTS = 4096


@njit(cache=True)
def detect(
    x: Array, q: Array, speed: Array, point_element: Indices, point_local: Array, radius: float,
    collider_body: Indices, kind: Indices, size: Array, planes: Array, plane_range: Indices,
    collider_pose: Array, bound: Array, skip: NDArray[np.bool_], dt: float,
    element: Indices, local: Array, normal: Array, offset: Array, body: Indices,
) -> int:  # fmt: skip
    """Find contacts of the points of a rod; fills the last five arrays and returns their number.

    ``point_element`` (p,) and ``point_local`` (p, 3) are the rod's contact points, ``speed`` (n,) the
    elements' speeds. Collider c belongs to ``collider_body[c]``, stands at ``collider_pose[c]`` and
    fits into a ball of ``bound[c]``; ``skip[c, i]`` switches pairs off. A contact demands
    ``normal · p >= offset``.
    """
    count = 0
    p, r, local_p, n_local, n = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    inverse = np.empty(4)
    for c in range(collider_body.shape[0]):
        inverse[0], inverse[1], inverse[2] = -collider_pose[c, 3], -collider_pose[c, 4], -collider_pose[c, 5]
        inverse[3] = collider_pose[c, 6]
        hull = planes[plane_range[c, 0] : plane_range[c, 1]]
        for k in range(point_element.shape[0]):
            i = point_element[k]
            reach = radius + (speed[i] + 0.2) * dt
            dx = x[i, 0] - collider_pose[c, 0]
            dy = x[i, 1] - collider_pose[c, 1]
            dz = x[i, 2] - collider_pose[c, 2]
            far = bound[c] + reach + 0.01
            if dx * dx + dy * dy + dz * dz > far * far or skip[c, i]:
                continue
            rotate(q[i], point_local[k], r)
            for a in range(3):
                p[a] = x[i, a] + r[a]
                n_local[a] = p[a] - collider_pose[c, a]
            rotate(inverse, n_local, local_p)
            d = signed_distance(kind[c], size[c], hull, local_p, n_local)
            if d > reach or count == MAX_CONTACTS:
                continue
            rotate(collider_pose[c, 3:7], n_local, n)
            element[count] = i
            body[count] = collider_body[c]
            for a in range(3):
                local[count, a] = point_local[k, a]
                normal[count, a] = n[a]
            offset[count] = n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - d + radius
            count += 1
    return count


@njit(cache=True)
def project(
    x: Array, q: Array, x_old: Array, q_old: Array, inverse_mass: Array, inverse_inertia: Array,
    count: int, element: Indices, local: Array, normal: Array, offset: Array, carried: Array,
    friction: Array, pressed: Array, pulled: Array,
) -> None:  # fmt: skip
    """Push points out of bodies and hold them by friction; one pass over all contacts.

    ``carried`` (c, 3) is how far the surface moves during the tick. ``pressed`` (c,) and ``pulled``
    (c, 3) accumulate the normal and tangential multipliers (N·s²).
    """
    r, r_old, n = np.empty(3), np.empty(3), np.empty(3)
    for c in range(count):
        i = element[c]
        rotate(q[i], local[c], r)
        n[:] = normal[c]
        depth = offset[c] - (n[0] * (x[i, 0] + r[0]) + n[1] * (x[i, 1] + r[1]) + n[2] * (x[i, 2] + r[2]))
        depth += n[0] * carried[c, 0] + n[1] * carried[c, 1] + n[2] * carried[c, 2]
        weight = _weight(r, n, inverse_mass[i], inverse_inertia[i], q[i])
        if weight == 0.0:
            continue
        push = max(depth / weight, -pressed[c])
        pressed[c] += push
        if push != 0.0:
            _impulse(x[i], q[i], r, n, push, inverse_mass[i], inverse_inertia[i])
        if pressed[c] <= 0.0:
            continue
        rotate(q[i], local[c], r)
        rotate(q_old[i], local[c], r_old)
        along = 0.0
        for a in range(3):
            r_old[a] = x[i, a] + r[a] - x_old[i, a] - r_old[a] - carried[c, a]
            along += r_old[a] * n[a]
        length = 0.0
        for a in range(3):
            r_old[a] -= along * n[a]
            length += r_old[a] * r_old[a]
        length = length**0.5
        if length < 1e-12:
            continue
        for a in range(3):
            n[a] = -r_old[a] / length
        weight = _weight(r, n, inverse_mass[i], inverse_inertia[i], q[i])
        _hold(
            x[i],
            q[i],
            r,
            n,
            length / weight,
            friction[c] * pressed[c],
            inverse_mass[i],
            inverse_inertia[i],
            pulled[c],
        )


@njit(cache=True)
def _hold(
    x: Array, q: Array, r: Array, n: Array, want: float, limit: float, inverse_mass: float, inverse_inertia: Array,
    pulled: Array,
) -> None:  # fmt: skip
    """Pull the point back along ``n`` by the multiplier ``want``, the sum staying within ``limit``."""
    total = np.empty(3)
    for a in range(3):
        total[a] = pulled[a] + want * n[a]
    length = (total[0] ** 2 + total[1] ** 2 + total[2] ** 2) ** 0.5
    scale = 1.0 if length <= limit else limit / length
    square = 0.0
    for a in range(3):
        total[a] = scale * total[a] - pulled[a]
        pulled[a] += total[a]
        square += total[a] ** 2
    if square > 0.0:
        size = square**0.5
        for a in range(3):
            total[a] /= size
        _impulse(x, q, r, total, size, inverse_mass, inverse_inertia)


@njit(cache=True)
def _turned(v: Array, q: Array, inverse_inertia: Array, out: Array) -> None:
    """Write I^-1 v (3,) in world axes for principal inverses (3,) of an element turned by ``q``."""
    conjugate = np.array([-q[0], -q[1], -q[2], q[3]])
    local = np.empty(3)
    rotate(conjugate, v, local)
    for a in range(3):
        local[a] *= inverse_inertia[a]
    rotate(q, local, out)


@njit(cache=True)
def _weight(r: Array, n: Array, inverse_mass: float, inverse_inertia: Array, q: Array) -> float:
    """Displacement along ``n`` of the point at ``r`` for a unit multiplier along ``n``."""
    t, w = np.empty(3), np.empty(3)
    t[0], t[1], t[2] = r[1] * n[2] - r[2] * n[1], r[2] * n[0] - r[0] * n[2], r[0] * n[1] - r[1] * n[0]
    _turned(t, q, inverse_inertia, w)
    return inverse_mass + t[0] * w[0] + t[1] * w[1] + t[2] * w[2]


@njit(cache=True)
def _impulse(x: Array, q: Array, r: Array, n: Array, size: float, inverse_mass: float, inverse_inertia: Array) -> None:
    """Move an element by the multiplier ``size`` along ``n`` at the arm ``r``."""
    t, w = np.empty(3), np.empty(3)
    t[0], t[1], t[2] = r[1] * n[2] - r[2] * n[1], r[2] * n[0] - r[0] * n[2], r[0] * n[1] - r[1] * n[0]
    _turned(t, q, inverse_inertia, w)
    for a in range(3):
        x[a] += size * inverse_mass * n[a]
    turn(q, size * w[0], size * w[1], size * w[2])
