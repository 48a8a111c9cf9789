"""Kernels of the friction law: impulses of one tick of several pairs of pads on the body that they hold together.

World axes and SI units; quantities of a patch are in its own axes, z normal to the pads. Rows of a
patch are force along x, y, z and moment about x, y, z. Friction bounds rows 0, 1 and 5 by an ellipsoid, the
force between the fingers bounds row 2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.rotations import cross, matrix_of, multiply, rotate, rotate_back, rotation_vector
from ligature.suture.chain import invert_spd6
from ligature.tables import opener

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

SWEEPS = 20
"""Gauss-Seidel sweeps over the grasps of one body and the rows that slip."""

MAX_NEWTON = 50

STIFFNESS, DAMPING = 2e4, 60.0
"""Stiffness and damping of pads in translation, N/m and N s/m: two tools off by 0.1 mm pull with 1 N."""

CATCH_UP = 0.02
"""Time constant in seconds in which a body makes up for its holder's change of velocity within a tick."""

TURN_STIFFNESS, TURN_DAMPING = 2.0, 5e-3
"""Stiffness and damping of pads in rotation, N m/rad and N m s/rad: 1 N at the tip of a needle turns it by half a
degree."""

LINE_ARM = 0.5
"""Mean arm of friction on an evenly pressed line, in halves of its length: a wire across a pad."""

LEAST_FORCE = 1e-9
"""Least normal force in newtons, which keeps the limits positive."""


@inlined
def friction_limits(friction: float, half_width: float, normal_force: float) -> tuple[float, float, float]:
    """Largest tangential force (N), moment about the normal (N m) and normal force of both pads of a patch together."""
    press = max(normal_force, LEAST_FORCE)
    force = 2.0 * friction * press
    return force, force * LINE_ARM * half_width, press


@inlined
def _spring(row: int, dt: float) -> tuple[float, float]:
    """Bias per metre or radian and softness of an implicit spring and damper (Catto, Soft Constraints, 2011)."""
    k, c = (STIFFNESS, DAMPING) if row < 3 else (TURN_STIFFNESS, TURN_DAMPING)
    return k / (c + dt * k), 1.0 / (dt * (c + dt * k))


class GraspArrays(NamedTuple):
    """The g grasps of one body."""

    patch: Array  # (g, 7) pose of the patch in the inertial frame of the jaw's holder
    held: Array  # (g, 7) pose of the body's inertial frame in the patch, as held
    pads: Array  # (g, 3) friction and half width of the pads, and the force between the fingers
    load: Array  # (g, 6) on the body, in patch axes: N, N m
    slid: Array  # (g, 2) slip of the body: m, rad
    pace: Array  # (g, 6) velocity of the holder at the patch in the last tick, in patch axes
    lag: Array  # (g, 6) displacement that the body lags behind the holder, in patch axes
    slides: Flags  # (g, 2) whether the body slips along the pads, and pulls them apart


class Motions(NamedTuple):
    """The body and the holders of its g grasps at the start of a tick, inertial frames, world axes."""

    bodies: Integers  # (1 + g,) indices of the body and the holders in the scene
    pushable: Flags  # (1 + g,) whether impulses move them
    body_pose: Array  # (7,)
    body_twist: Array  # (6,) after the tick without the grasps
    inverse: Array  # (4,) inverse of the body's mass and principal moments
    palm_pose: Array  # (g, 7)
    palm_twist: Array  # (g, 6)
    ride: Array  # (g, 6) velocity of the holders at the body's centre in the last tick
    pending: Array  # (6,) impulse and moment already applied to the body in this tick
    attached_load: Array  # (6,) force and moment that accelerate the mass added to the body
    impulse: Array  # (1 + g, 6) on the body, and on the holders


class Scratch(NamedTuple):
    """Scratch of one tick of g grasps; nothing in it outlives the tick."""

    at: Array  # (g, 3) patches in the world
    R: Array  # (g, 3, 3)
    limits: Array  # (g, 3) see `friction_limits`
    error: Array  # (g, 6) of the body off its held pose
    drift: Array  # (g, 6) velocity of the holders there, in patch axes
    Y: Array  # (g, 6, 6) impulse for a unit of velocity
    twist: Array  # (6,) of the body
    W: Array  # (3, 3) its inverse inertia
    S: Array  # (3, 3)
    K: Array  # (6, 6)
    ask: Array  # (6,)
    step: Array  # (6,)
    scale3: Array  # (3,) and so on
    x3: Array
    y3: Array


def motions(g: int) -> Motions:
    """Arrays for the motion of a body and ``g`` holders."""
    z = np.zeros
    bodies, pushable = np.zeros(1 + g, dtype=np.int64), np.zeros(1 + g, np.bool_)
    return Motions(bodies, pushable, z(7), z(6), z(4), z((g, 7)), z((g, 6)), z((g, 6)), z(6), z(6), z((1 + g, 6)))


def grasp_arrays(g: int) -> GraspArrays:
    """Arrays for ``g`` grasps."""
    z = np.zeros
    return GraspArrays(
        z((g, 7)), z((g, 7)), z((g, 3)), z((g, 6)), z((g, 2)), z((g, 6)), z((g, 6)), np.zeros((g, 2), np.bool_)
    )


def scratch(g: int) -> Scratch:
    """Scratch for ``g`` grasps."""
    z = np.zeros
    return Scratch(
        z((g, 3)), z((g, 3, 3)), z((g, 3)), z((g, 6)), z((g, 6)), z((g, 6, 6)), z(6), z((3, 3)), z((3, 3)), z((6, 6)),
        z(6), z(6), z(3), z(3), z(3),
    )  # fmt: skip


open_motions, open_grasps, open_scratch = opener(motions(1)), opener(grasp_arrays(1)), opener(scratch(1))


@inlined
def _place(g: int, body_pose: Array, palm_pose: Array, grasps: GraspArrays, room: Scratch) -> None:
    """Pose of patch ``g`` in the world, and the error of the body's pose against its held pose."""
    h, p, b, held, R, S, at = palm_pose[g], grasps.patch[g], body_pose, grasps.held[g], room.R[g], room.S, room.at[g]
    matrix_of(h[3], h[4], h[5], h[6], S)
    x, y, z = rotate(S, p[0], p[1], p[2])
    at[0], at[1], at[2] = h[0] + x, h[1] + y, h[2] + z
    qx, qy, qz, qw = multiply(h[3], h[4], h[5], h[6], p[3], p[4], p[5], p[6])
    matrix_of(qx, qy, qz, qw, R)
    qx, qy, qz, qw = multiply(-qx, -qy, -qz, qw, b[3], b[4], b[5], b[6])
    ex, ey, ez, ew = multiply(qx, qy, qz, qw, -held[3], -held[4], -held[5], held[6])
    matrix_of(ex, ey, ez, ew, S)
    hx, hy, hz = rotate(S, held[0], held[1], held[2])
    x, y, z = rotate_back(R, b[0] - at[0], b[1] - at[1], b[2] - at[2])
    error = room.error[g]
    error[0], error[1], error[2] = x - hx, y - hy, z - hz
    error[3], error[4], error[5] = rotation_vector(ex, ey, ez, ew)


@inlined
def _inverse_inertia(q: Array, moments: Array, S: Array, W: Array) -> None:
    """W (3, 3): inverse inertia in world axes of a body with principal inverse ``moments``."""
    matrix_of(q[3], q[4], q[5], q[6], S)
    for i in range(3):
        for k in range(3):
            W[i, k] = S[i, 0] * moments[0] * S[k, 0] + S[i, 1] * moments[1] * S[k, 1] + S[i, 2] * moments[2] * S[k, 2]


@inlined
def _velocity(R: Array, twist: Array, rx: float, ry: float, rz: float, out: Array) -> None:
    """Velocity (6,) in patch axes of a body's material at the lever r."""
    vx, vy, vz = cross(twist[3], twist[4], twist[5], rx, ry, rz)
    out[0], out[1], out[2] = rotate_back(R, twist[0] + vx, twist[1] + vy, twist[2] + vz)
    out[3], out[4], out[5] = rotate_back(R, twist[3], twist[4], twist[5])


@inlined
def _push(
    twist: Array, inverse_mass: float, W: Array, R: Array, rx: float, ry: float, rz: float, impulse: Array
) -> None:
    """Change a body's twist (6,) by an ``impulse`` (6,) in patch axes at the lever r."""
    fx, fy, fz = rotate(R, impulse[0], impulse[1], impulse[2])
    mx, my, mz = rotate(R, impulse[3], impulse[4], impulse[5])
    ax, ay, az = cross(rx, ry, rz, fx, fy, fz)
    wx, wy, wz = rotate(W, mx + ax, my + ay, mz + az)
    twist[0], twist[1], twist[2] = (
        twist[0] + inverse_mass * fx,
        twist[1] + inverse_mass * fy,
        twist[2] + inverse_mass * fz,
    )
    twist[3], twist[4], twist[5] = twist[3] + wx, twist[4] + wy, twist[5] + wz


@inlined
def _fill_impedance(g: int, inverse_mass: float, rx: float, ry: float, rz: float, room: Scratch, dt: float) -> None:
    """Impulse of patch ``g`` for a unit of velocity, the compliance of its pads included."""
    ask, step, K = room.ask, room.step, room.K
    for row in range(6):
        for k in range(6):
            ask[k], step[k] = 0.0, 0.0
        step[row] = 1.0
        _push(ask, inverse_mass, room.W, room.R[g], rx, ry, rz, step)
        _velocity(room.R[g], ask, rx, ry, rz, step)
        for k in range(6):
            K[k, row] = step[k]
    for row in range(6):
        _, soft = _spring(row, dt)
        K[row, row] += soft
    invert_spd6(K, room.Y[g])


@inlined
def _solve3(B: Array, more: float, u: Array, out: Array) -> None:
    """out = (1 + more B)⁻¹ u for a symmetric B (3, 3), by Cramer's rule."""
    a, b, c = 1.0 + more * B[0, 0], more * B[0, 1], more * B[0, 2]
    d, e, f = 1.0 + more * B[1, 1], more * B[1, 2], 1.0 + more * B[2, 2]
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    per = 1.0 / (a * p + b * q + c * r)
    out[0] = per * (p * u[0] + q * u[1] + r * u[2])
    out[1] = per * (q * u[0] + (a * f - c * c) * u[1] + (b * c - a * e) * u[2])
    out[2] = per * (r * u[0] + (b * c - a * e) * u[1] + (a * d - b * b) * u[2])


@inlined
def _slide(row: Array, Y: Array, force: float, moment: float, room: Scratch) -> None:
    """Project the impulse ``row`` (6,) onto the ellipsoid of friction, so that the body slips against it.

    Of all impulses within, the one of largest dissipation: the slip is normal to the ellipsoid (Goyal, Ruina
    and Papadopoulos, Planar sliding with dry friction, 1991). With rows scaled to a unit ball, u is the
    solution of (1 + m B) u = u* with |u| = 1; m is found by Newton's method on 1 / |u|.
    """
    B, u, v, w = room.S, room.ask[0:3], room.ask[3:6], room.scale3
    for a in range(3):
        i = a if a < 2 else 5
        w[a] = 1.0 / force if a < 2 else 1.0 / moment
        u[a] = row[i] * w[a]
    for a in range(3):
        for b in range(3):
            B[a, b] = w[a] * Y[a if a < 2 else 5, b if b < 2 else 5] * w[b]
    more = 0.0
    for _ in range(MAX_NEWTON):
        _solve3(B, more, u, v)
        size = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        if abs(size - 1.0) < 1e-12:
            break
        room.x3[0] = B[0, 0] * v[0] + B[0, 1] * v[1] + B[0, 2] * v[2]
        room.x3[1] = B[1, 0] * v[0] + B[1, 1] * v[1] + B[1, 2] * v[2]
        room.x3[2] = B[2, 0] * v[0] + B[2, 1] * v[1] + B[2, 2] * v[2]
        _solve3(B, more, room.x3, room.y3)
        slope = v[0] * room.y3[0] + v[1] * room.y3[1] + v[2] * room.y3[2]
        more = max(more + size * size * (size - 1.0) / slope, 0.0)
    row[0], row[1], row[5] = v[0] / w[0], v[1] / w[1], v[2] / w[2]
    for i in range(2, 5):
        row[i] -= more * (Y[i, 0] * w[0] * v[0] + Y[i, 1] * w[1] * v[1] + Y[i, 5] * w[2] * v[2])


@inlined
def _bound(row: Array, Y: Array, limits: Array, room: Scratch, dt: float) -> tuple[bool, bool]:
    """Clip an impulse (6,) to the limits of the pads.

    Returns whether the body slips and whether it pulls them apart.
    """
    force, moment, press = dt * limits[0], dt * limits[1], dt * limits[2]
    slides = (row[0] / force) ** 2 + (row[1] / force) ** 2 + (row[5] / moment) ** 2 > 1.0
    if slides:
        _slide(row, Y, force, moment, room)
    pulls_apart = abs(row[2]) > press
    row[2] = min(max(row[2], -press), press)
    return slides, pulls_apart


@inlined
def _follow(
    g: int, error: Array, velocity: Array, load: Array, held: Array, slid: Array, slides: bool, pulls_apart: bool,
    dt: float,
) -> None:  # fmt: skip
    """Move the held pose of a patch that slips, so that its springs carry the limits of the pads."""
    sx, sy, sz, turned = 0.0, 0.0, 0.0, 0.0
    if slides:
        sx = error[0] + dt * velocity[0] + load[0] / STIFFNESS
        sy = error[1] + dt * velocity[1] + load[1] / STIFFNESS
        turned = error[5] + dt * velocity[5] + load[5] / TURN_STIFFNESS
    if pulls_apart:
        sz = error[2] + dt * velocity[2] + load[2] / STIFFNESS
    h, c, s = held[g], math.cos(turned), math.sin(turned)
    h[0], h[1], h[2] = c * h[0] - s * h[1] + sx, s * h[0] + c * h[1] + sy, h[2] + sz
    h[3], h[4], h[5], h[6] = multiply(0.0, 0.0, math.sin(0.5 * turned), math.cos(0.5 * turned), h[3], h[4], h[5], h[6])
    slid[g, 0] += math.sqrt(sx * sx + sy * sy + sz * sz)
    slid[g, 1] += abs(turned)


@inlined
def _sweep(g: int, body_pose: Array, inverse_mass: float, grasps: GraspArrays, room: Scratch, dt: float) -> bool:
    """Update the impulse of one patch, kept in its load, by the law of its springs; returns whether it was clipped."""
    at, load, ask, step = room.at[g], grasps.load[g], room.ask, room.step
    rx, ry, rz = at[0] - body_pose[0], at[1] - body_pose[1], at[2] - body_pose[2]
    _velocity(room.R[g], room.twist, rx, ry, rz, ask)
    for row in range(6):
        stiff, soft = _spring(row, dt)
        ask[row] += stiff * room.error[g, row] - room.drift[g, row] + soft * load[row]
    for row in range(6):
        step[row] = -load[row]
    for row in range(6):
        change = 0.0
        for k in range(6):
            change += room.Y[g, row, k] * ask[k]
        load[row] -= change
    slides, pulls_apart = _bound(load, room.Y[g], room.limits[g], room, dt)
    for row in range(6):
        step[row] += load[row]
    _push(room.twist, inverse_mass, room.W, room.R[g], rx, ry, rz, step)
    grasps.slides[g, 0], grasps.slides[g, 1] = slides, pulls_apart
    return slides or pulls_apart


@kernel
def predict_free(motion_table: Integers, room_table: Integers, own_mass: float, gravity: Array, dt: float) -> None:
    """Advance `Motions.body_twist` from the start of a tick to its end, as if all grasps released the body.

    The mass and inertia added to its ``own_mass`` move with the palms, by the mean change of `Motions.ride`, which is
    updated. ``gravity`` (3,) acts on the own mass alone.
    """
    moves, room = open_motions(motion_table), open_scratch(room_table)
    pose, twist, inverse = moves.body_pose, moves.body_twist, moves.inverse
    attached_load, pending = moves.attached_load, moves.pending
    n, own = moves.ride.shape[0], own_mass * inverse[0]
    for k in range(6):
        attached_load[k], room.step[k] = 0.0, 0.0
    for g in range(n):
        h, t, now, ride = moves.palm_pose[g], moves.palm_twist[g], room.ask, moves.ride[g]
        vx, vy, vz = cross(t[3], t[4], t[5], pose[0] - h[0], pose[1] - h[1], pose[2] - h[2])
        now[0], now[1], now[2], now[3], now[4], now[5] = t[0] + vx, t[1] + vy, t[2] + vz, t[3], t[4], t[5]
        for k in range(6):
            attached_load[k] += (now[k] - ride[k]) / n
            ride[k] = now[k]
    for k in range(6):
        twist[k] += (1.0 - own) * attached_load[k]
    matrix_of(pose[3], pose[4], pose[5], pose[6], room.S)
    ax, ay, az = rotate_back(room.S, attached_load[3], attached_load[4], attached_load[5])
    attached_load[3], attached_load[4], attached_load[5] = rotate(
        room.S, ax / inverse[1], ay / inverse[2], az / inverse[3]
    )
    wx, wy, wz = rotate_back(room.S, pending[3], pending[4], pending[5])
    wx, wy, wz = rotate(room.S, wx * inverse[1], wy * inverse[2], wz * inverse[3])
    twist[3], twist[4], twist[5] = twist[3] + wx, twist[4] + wy, twist[5] + wz
    for k in range(3):
        twist[k] += pending[k] * inverse[0] + dt * own * gravity[k]
        attached_load[k] /= inverse[0]
    for k in range(6):
        attached_load[k] *= (1.0 - own) / dt


@kernel
def solve(motion_table: Integers, grasp_table: Integers, room_table: Integers, dt: float) -> None:
    """Fill `Motions.impulse` for one tick: row 0 acts on the body, row 1 + g on the holder of grasp g.

    All are about the centres of mass, in world axes. Holders keep their velocity within the tick; their acceleration
    appears in the next tick as a lag of the body, which decays without force. The grasps are updated.
    """
    moves, grasps, room = open_motions(motion_table), open_grasps(grasp_table), open_scratch(room_table)
    body_pose, body_twist, impulse = moves.body_pose, moves.body_twist, moves.impulse
    inverse_mass, n = moves.inverse[0], grasps.patch.shape[0]
    _inverse_inertia(body_pose, moves.inverse[1:], room.S, room.W)
    for k in range(6):
        room.twist[k] = body_twist[k]
    for g in range(n):
        _begin(g, moves, grasps, room, dt)
    for _ in range(SWEEPS):
        bounded = False
        for g in range(n):
            bounded = _sweep(g, body_pose, inverse_mass, grasps, room, dt) or bounded
        if n == 1 and not bounded:
            break
    for k in range(6):
        impulse[0, k] = 0.0
    for g in range(n):
        _conclude(g, moves, grasps, room, dt)


@inlined
def _begin(g: int, moves: Motions, grasps: GraspArrays, room: Scratch, dt: float) -> None:
    """Equations of grasp ``g`` in this tick: its place, limits and impedance, and the errors that it takes off."""
    body_pose, palm_pose = moves.body_pose, moves.palm_pose
    _place(g, body_pose, palm_pose, grasps, room)
    at, h, pads, limits = room.at[g], palm_pose[g], grasps.pads[g], room.limits[g]
    limits[0], limits[1], limits[2] = friction_limits(pads[0], pads[1], pads[2])
    _velocity(room.R[g], moves.palm_twist[g], at[0] - h[0], at[1] - h[1], at[2] - h[2], room.drift[g])
    _fill_impedance(g, moves.inverse[0], at[0] - body_pose[0], at[1] - body_pose[1], at[2] - body_pose[2], room, dt)
    for row in range(6):
        change = room.drift[g, row] - grasps.pace[g, row]
        grasps.pace[g, row] = room.drift[g, row]
        grasps.lag[g, row] = (1.0 - dt / CATCH_UP) * grasps.lag[g, row] - dt * change
        room.error[g, row] -= grasps.lag[g, row]
        grasps.load[g, row] = 0.0


@inlined
def _conclude(g: int, moves: Motions, grasps: GraspArrays, room: Scratch, dt: float) -> None:
    """Impulses of grasp ``g`` on body and holder; its loads become forces, and what exceeds its limits slips."""
    body_pose, impulse = moves.body_pose, moves.impulse
    at, h, load, total = room.at[g], moves.palm_pose[g], grasps.load[g], room.step
    fx, fy, fz = rotate(room.R[g], load[0], load[1], load[2])
    mx, my, mz = rotate(room.R[g], load[3], load[4], load[5])
    for side in range(2):
        i, c, sign = (0, body_pose, 1.0) if side == 0 else (1 + g, h, -1.0)
        ax, ay, az = cross(at[0] - c[0], at[1] - c[1], at[2] - c[2], fx, fy, fz)
        total[0], total[1], total[2], total[3], total[4], total[5] = fx, fy, fz, mx + ax, my + ay, mz + az
        for k in range(6):
            impulse[i, k] = sign * total[k] + (impulse[0, k] if side == 0 else 0.0)
    for row in range(6):
        load[row] /= dt
    rx, ry, rz = at[0] - body_pose[0], at[1] - body_pose[1], at[2] - body_pose[2]
    _velocity(room.R[g], room.twist, rx, ry, rz, room.ask)
    for row in range(6):
        room.ask[row] -= room.drift[g, row]
    _follow(g, room.error[g], room.ask, load, grasps.held, grasps.slid, grasps.slides[g, 0], grasps.slides[g, 1], dt)
