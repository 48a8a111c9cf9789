"""Closes loops after every tick: mechanisms go back to the nearest place, and motion, that their loops allow.

Bullet solves loops iteratively, along linearised constraints. Where grams hold kilograms that does not converge, and
a link that turns by 0.1 rad in a tick leaves the linearisation. So each mechanism is projected in joint space, with all
of its loops at once,

    q ← q − M⁻¹Jᵀ (J M⁻¹Jᵀ)⁻¹ φ(q),    v ← v − M⁻¹Jᵀ (J M⁻¹Jᵀ)⁻¹ J v,

φ being the gaps, J their derivative, M the mass matrix: the nearest place and motion in the metric of kinetic energy,
as impulses of the constraints would bring them about. v loses kinetic energy, or none; it never gains any. Momentum
stays, for the impulses act between bodies. Bullet's own impulses Jᵀλ drop out of the result, so that it does not depend
on how far Bullet got, contacts, motors and limits aside. (Sources: R. Featherstone, Rigid Body Dynamics Algorithms,
2008, §6.2 and §8; U. Ascher, H. Chin, L. Petzold, S. Reich, Stabilization of constrained mechanical systems, 1995.)

Coordinates are the six of each free base (of the centre of mass, then about it, world axes), then the axes of its tree.
Spatial vectors are linear, then angular, world axes, of the point that passes `Loops.origin`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.model.poses import compose
from ligature.physics.bullet import (
    init_motion,
    set_angular_velocity,
    set_joint_positions,
    set_joint_velocities,
    set_linear_velocity,
    set_orientation,
    set_position,
    submit,
)
from ligature.physics.trees import SLIDES, Trees, follow, open_trees, read_tree, turned
from ligature.tables import opener

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

CLOSED = 1e-6
"""Gap (m, rad) up to which a loop is left to Bullet: what rests stays as it is."""

DONE = 1e-10
"""Gap (m, rad) at which a projection ends: in a flat place a thousandth of a millimetre turns the way on by radians."""

PROGRESS, HELD_TWICE = 0.5, 1e-5
"""A step that leaves more than this share of a gap is the last below this one (m, rad), by which joints disagree."""

PLAY = 1e-4
"""Gap (m, rad) up to which a mechanism in a flat place stays where the tick found it, instead of being thrown back."""

THROWN = 3e-5
"""Way (m, rad) of a coordinate up to which a projection may go further than the speeds had led to."""

FLAT = 100.0
"""Way of a coordinate per gap that is closed, above which a place is flat; rows below it are firm."""

TORN = 0.02
"""Gap (m, rad) from which on a loop closes at a pace: what turns by 0.2 rad in a tick opens it by less."""

STEPS = 8
"""Gauss-Newton steps of a projection at most, and as many along flat ways; one or two are usual."""

CURVED = 1e-4
"""Change of a coordinate (m, rad) from which on mass matrix and Jacobian are computed anew."""

REDUNDANT = 1e-4
"""Motion of a loop's ends, per motion of its mechanism, both relative to its size, below which no place is corrected.

The other joints hold it as well then, up to roundings: frames of joints are corrected to 1e-6 or better.
"""

WEAK = 1e-12
"""The same for rows in the metric of mass, squared: links of grams that hold kilograms leave 1e-6 of a row."""

STRIDE = 0.2
"""Largest change (m, rad) of a coordinate in one Gauss-Newton step."""

AT_LIMIT = 1e-6
"""Distance (m, rad) from its limit at which an axis does not move on."""

SLACK = 1e-6
"""Share of the maximum speed that is not worth another round."""

SWEEPS = 3
"""Rounds in which axes are found that would pass limits."""

MAX_SPEED = 100.0
"""Speed in m/s or rad/s of a coordinate at most, as Bullet has it; but what it moves slows down with it."""


UNMOVED, MOVED, FAILED = 0, 1, 2
"""What was done with a mechanism; one without an inverse of its mass matrix, or with speeds beyond numbers, fails."""


class Loops(NamedTuple):
    """Mechanisms with loops: m mechanisms of t trees and c closures; r rows and a axes of all trees.

    At most n coordinates and k = 6 c + n rows of constraints in a mechanism.
    """

    tree: Integers  # (t,) the trees of each mechanism
    tree_begin: Integers  # (m + 1,) the first of them, and the end
    begin: Integers  # (m + 1,) first closure of each mechanism, and the end
    size: Integers  # (m,) coordinates
    extent: Array  # (m,) size in metres
    column: Integers  # (r,) the first coordinate of each row's own joint in its mechanism
    width: Integers  # (r,) their number: 0, 1, or 6 for a free base
    end_row: Integers  # (c, 2) the rows that a closure joins
    end_frame: Array  # (c, 2, 7) the frames that meet, in the inertial frames of the rows
    point: Flags  # (c,) whether it holds a point only
    low: Array  # (a,) limits of axes
    high: Array
    gap: Array  # (c,) metres by which closures are open
    moved: Integers  # (m,) what the last call did with a mechanism: `UNMOVED`, `MOVED` or `FAILED`
    end: Array  # (2, 7) scratch from here: poses of the frames
    error: Array  # (k,) gaps of all rows
    inertia: Array  # (r, 10) of each row and what it carries: mass, first moments, second moments xx yy zz xy xz yz
    axis: Array  # (n, 6) spatial vectors of the coordinates
    first: Integers  # (n,) first coordinate of the tree of each
    linear: Flags  # (n,) whether it is in metres
    M: Array  # (n, n) mass matrix, then its factor
    J: Array  # (k, n)
    row_of: Integers  # (k,) the rows of J that count
    rank: Integers  # (1,) how many of them belong to closures; rows of single coordinates follow
    firm: Integers  # (1,) how many of these, the first ones, a way of less than `FLAT` times their gap closes
    B: Array  # (k, n) these rows times the inverse factor, each divided by `scale`
    scale: Array  # (k,)
    A: Array  # (k, k) B Bᵀ and its factor
    multiplier: Array  # (k,)
    step: Array  # (n,)
    shift: Array  # (n,) what the projection changed of the coordinates so far
    place: Array  # (n,) coordinates of axes
    bound: Array  # (n, 2) limits of coordinates
    speed: Array  # (n,)
    wanted: Array  # (13 + 2 n,) what is on its way to Bullet
    wanted_at: Integers  # (1,) its address


def loops(mechanisms: int, trees: int, closures: int, rows: int, axes: int, most: tuple[int, int]) -> Loops:
    """Arrays for this number of mechanisms, of ``most`` (coordinates, closures) each."""
    z, whole, no, n = np.zeros, np.int64, np.bool_, most[0]
    k = 6 * most[1] + n
    wanted = z(13 + 2 * n)
    return Loops(
        tree=z(trees, whole), tree_begin=z(mechanisms + 1, whole), begin=z(mechanisms + 1, whole),
        size=z(mechanisms, whole), extent=z(mechanisms), column=z(rows, whole), width=z(rows, whole),
        end_row=z((closures, 2), whole), end_frame=z((closures, 2, 7)), point=z(closures, no), low=z(axes),
        high=z(axes), gap=z(closures), moved=z(mechanisms, whole), end=z((2, 7)), error=z(k), inertia=z((rows, 10)),
        axis=z((n, 6)), first=z(n, whole), linear=z(n, no), M=z((n, n)), J=z((k, n)), row_of=z(k, whole),
        rank=z(1, whole), firm=z(1, whole), B=z((k, n)), scale=z(k), A=z((k, k)), multiplier=z(k), step=z(n),
        shift=z(n), place=z(n), bound=z((n, 2)), speed=z(n), wanted=wanted, wanted_at=np.array([wanted.ctypes.data]),
    )  # fmt: skip


open_loops = opener(loops(1, 1, 1, 1, 1, (1, 1)))


@kernel
def measure_loops(tree_table: Integers, loop_table: Integers) -> float:
    """The widest gap in metres; fills `Loops.gap`. Trees must be up to date, but for their links."""
    trees, loops = open_trees(tree_table), open_loops(loop_table)
    widest = 0.0
    for m in range(loops.size.shape[0]):
        _link(trees, loops, m)
        _measure(trees, loops, m)
        for c in range(loops.begin[m], loops.begin[m + 1]):
            widest = max(widest, loops.gap[c])
    return widest


@kernel
def close_loops(handle: int, tree_table: Integers, loop_table: Integers, most: float, dt: float) -> float:
    """Project all mechanisms whose loops are open; the widest gap that is left, in metres.

    Where a gap is wider than `TORN`, ``most`` metres of it are closed. With a handle, Bullet gets where they are; else
    the caller hands it on, as `Loops.moved` states. Trees must be up to date, but for their links.
    """
    trees, loops = open_trees(tree_table), open_loops(loop_table)
    left = 0.0
    for m in range(loops.size.shape[0]):
        _link(trees, loops, m)
        widest = _measure(trees, loops, m)
        loops.moved[m] = UNMOVED
        if widest > CLOSED:
            loops.moved[m] = MOVED if _project(trees, loops, m, widest, most, dt) else FAILED
            for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
                k = loops.tree[t]
                if handle != 0:
                    if loops.moved[m] == MOVED:
                        _send(handle, trees, loops, k)
                    read_tree(handle, trees, k)  # what Bullet has is what lasts
                    trees.linked[k] = False
        for c in range(loops.begin[m], loops.begin[m + 1]):
            left = max(left, loops.gap[c])
    return left


@inlined
def _link(trees: Trees, loops: Loops, m: int) -> None:
    for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
        if not trees.linked[loops.tree[t]]:
            follow(trees, loops.tree[t])


@kernel
def _project(trees: Trees, loops: Loops, m: int, widest: float, most: float, dt: float) -> bool:
    """Move mechanism ``m``, whose ``widest`` gap is measured, to where its loops are closed; whether that worked."""
    n, rows = loops.size[m], 6 * (loops.begin[m + 1] - loops.begin[m])
    _gather(trees, loops, m)
    begun, share = widest, 1.0 if widest <= TORN else most / widest
    moved = math.inf
    flat, firmly, steps = False, share == 1.0, STEPS  # firm rows first: what is left then is the gap of a flat place
    while steps > 0:
        steps -= 1
        if not _prepare(trees, loops, m, rows):
            return False
        flat = loops.firm[0] < loops.rank[0]
        if firmly and flat:
            loops.rank[0] = loops.firm[0]
        if not _step(loops, n, rows, share):
            return False
        moved = 0.0
        for i in range(n):
            moved = max(moved, abs(loops.step[i]))
        part = min(1.0, STRIDE / moved) if moved > 0.0 else 1.0
        _move(trees, loops, m, part)
        for i in range(n):
            loops.shift[i] += part * loops.step[i]
        _link(trees, loops, m)
        before, widest = widest, _measure(trees, loops, m)
        if widest <= DONE or share < 1.0:
            break
        if firmly and flat:
            if moved <= THROWN:
                firmly, begun, steps = False, widest, STEPS
                for i in range(n):
                    loops.shift[i] = 0.0
        elif PROGRESS * before < widest <= HELD_TWICE:
            break
    back = _excess(loops, n, begun, dt) if begun <= PLAY else 0.0
    if back > 0.0:
        for i in range(n):
            loops.step[i] = loops.shift[i]
            loops.shift[i] -= back * loops.step[i]
        _move(trees, loops, m, -back)
        _link(trees, loops, m)
        _measure(trees, loops, m)
    if (moved > CURVED or back > 0.0 or (firmly and flat)) and not _prepare(trees, loops, m, rows):
        return False
    if back > 0.0:  # what is not flat closes nevertheless
        if not _step(loops, n, rows, 1.0):
            return False
        far = 0.0
        for i in range(n):
            far = max(far, abs(loops.step[i]))
        _move(trees, loops, m, min(1.0, THROWN / far) if far > 0.0 else 0.0)
        _link(trees, loops, m)
        _measure(trees, loops, m)
    _slow(loops, n, rows, dt)
    _scatter(trees, loops, m)
    return True


@inlined
def _excess(loops: Loops, n: int, begun: float, dt: float) -> float:
    """The share of `shift` that goes beyond the way that the speeds led to in this tick of ``dt``.

    In a flat place, as where joints contradict each other by roundings, the gap ``begun`` asks for a long way back.
    Done, it would throw the mechanism back again and again, against the speeds that are reported.
    """
    far = 0.0
    for a in range(n):
        far = max(far, abs(loops.shift[a]))
    if far <= max(THROWN, FLAT * begun):
        return 0.0
    there = -dt * _product(loops, n, loops.speed, loops.shift) / _product(loops, n, loops.shift, loops.shift)
    return 1.0 - min(max(there, 0.0), 1.0)


# --- gaps ---------------------------------------------------------------------------------------


@inlined
def _measure(trees: Trees, loops: Loops, m: int) -> float:
    """Fill `error` and `gap` of mechanism ``m``: vectors and turns from the second frame to the first; the largest."""
    row, widest = 0, 0.0
    for c in range(loops.begin[m], loops.begin[m + 1]):
        one, other, error = loops.end[0], loops.end[1], loops.error
        compose(trees.pose[loops.end_row[c, 0]], loops.end_frame[c, 0], one)
        compose(trees.pose[loops.end_row[c, 1]], loops.end_frame[c, 1], other)
        square = 0.0
        for a in range(3):
            error[row + a] = one[a] - other[a]
            error[row + 3 + a] = 0.0
            square += error[row + a] * error[row + a]
        loops.gap[c] = math.sqrt(square)
        widest = max(widest, loops.gap[c])
        if not loops.point[c]:
            x, y, z, w = one[3], one[4], one[5], one[6]
            ox, oy, oz, ow = -other[3], -other[4], -other[5], other[6]
            tx = w * ox + x * ow + y * oz - z * oy
            ty = w * oy - x * oz + y * ow + z * ox
            tz = w * oz + x * oy - y * ox + z * ow
            tw = w * ow - x * ox - y * oy - z * oz
            sine = math.sqrt(tx * tx + ty * ty + tz * tz)
            if tw < 0.0:
                tx, ty, tz, tw = -tx, -ty, -tz, -tw
            angle = 2.0 * math.atan2(sine, tw)
            stretch = angle / sine if sine > 1e-12 else 2.0
            error[row + 3], error[row + 4], error[row + 5] = stretch * tx, stretch * ty, stretch * tz
            widest = max(widest, angle)
        row += 6
    return widest


# --- coordinates --------------------------------------------------------------------------------


@inlined
def _gather(trees: Trees, loops: Loops, m: int) -> None:
    """Places, limits and speeds of the coordinates of mechanism ``m``."""
    for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
        k = loops.tree[t]
        base = trees.begin[k]
        begin = loops.column[base]
        for i in range(begin, begin + loops.width[base]):
            loops.first[i] = begin
            loops.place[i], loops.bound[i, 0], loops.bound[i, 1] = 0.0, -math.inf, math.inf
            loops.speed[i] = trees.twist[base, i - begin]
            loops.linear[i], loops.shift[i] = i - begin < 3, 0.0
        for a in range(trees.first[k], trees.first[k + 1]):
            i = begin + loops.width[base] + a - trees.first[k]
            loops.first[i] = begin
            loops.place[i], loops.bound[i, 0], loops.bound[i, 1] = trees.joints[0, a], loops.low[a], loops.high[a]
            loops.speed[i] = trees.joints[1, a]
            loops.linear[i], loops.shift[i] = False, 0.0
        for r in range(base + 1, trees.begin[k + 1]):
            if loops.width[r] == 1:
                loops.linear[loops.column[r]] = trees.rows[r, 1] == SLIDES


@inlined
def _move(trees: Trees, loops: Loops, m: int, share: float) -> None:
    """Move mechanism ``m`` by a share of `step`."""
    for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
        k = loops.tree[t]
        base = trees.begin[k]
        i = loops.column[base]
        if loops.width[base] > 0:
            pose, step = trees.pose[base], loops.step
            for a in range(3):
                pose[a] += share * step[i + a]
            x, y, z, w = pose[3], pose[4], pose[5], pose[6]
            rx, ry, rz = 0.5 * share * step[i + 3], 0.5 * share * step[i + 4], 0.5 * share * step[i + 5]
            tx, ty = x + rx * w + ry * z - rz * y, y + ry * w + rz * x - rx * z
            tz, tw = z + rz * w + rx * y - ry * x, w - rx * x - ry * y - rz * z
            norm = math.sqrt(tx * tx + ty * ty + tz * tz + tw * tw)
            pose[3], pose[4], pose[5], pose[6] = tx / norm, ty / norm, tz / norm, tw / norm
            i += 6
        for a in range(trees.first[k], trees.first[k + 1]):
            loops.place[i] += share * loops.step[i]
            trees.joints[0, a] = loops.place[i]
            i += 1
        trees.linked[k] = False


@inlined
def _scatter(trees: Trees, loops: Loops, m: int) -> None:
    """Put the speeds of mechanism ``m`` back."""
    for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
        k = loops.tree[t]
        base = trees.begin[k]
        i = loops.column[base]
        for a in range(loops.width[base]):
            trees.twist[base, a] = loops.speed[i]
            i += 1
        for a in range(trees.first[k], trees.first[k + 1]):
            trees.joints[1, a] = loops.speed[i]
            i += 1
        trees.linked[k] = False


@inlined
def _send(handle: int, trees: Trees, loops: Loops, k: int) -> None:
    """Hand Bullet base and joints of tree ``k``."""
    command = init_motion(handle, trees.uid[k])
    wanted, at, base, first = loops.wanted, loops.wanted_at[0], trees.begin[k], trees.first[k]
    count = trees.first[k + 1] - first
    if trees.going[k]:
        pose = trees.pose[base]
        for a in range(6):
            wanted[a] = trees.twist[base, a]
        set_position(command, pose[0], pose[1], pose[2])
        set_orientation(command, pose[3], pose[4], pose[5], pose[6])
        set_linear_velocity(command, at)
        set_angular_velocity(command, at + 24)
    for a in range(count):
        wanted[13 + a], wanted[13 + count + a] = trees.joints[0, first + a], trees.joints[1, first + a]
    if count > 0:
        set_joint_positions(command, count, at + 8 * 13)
        set_joint_velocities(handle, command, count, at + 8 * (13 + count))
    submit(handle, command)


# --- mass matrix and Jacobian -------------------------------------------------------------------


@kernel
def _prepare(trees: Trees, loops: Loops, m: int, rows: int) -> bool:
    """Mass matrix, Jacobian and their factors of mechanism ``m`` where it is; whether the factor exists."""
    n = loops.size[m]
    origin = trees.pose[loops.end_row[loops.begin[m], 0]]
    ox, oy, oz = origin[0], origin[1], origin[2]
    for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
        for r in range(trees.begin[loops.tree[t]], trees.begin[loops.tree[t] + 1]):
            _vectors(trees, loops, r, ox, oy, oz)
            _inertia(trees, loops, r, ox, oy, oz)
    for i in range(n):
        for j in range(n):
            loops.M[i, j] = 0.0
    for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
        begin = trees.begin[loops.tree[t]]
        for r in range(trees.begin[loops.tree[t] + 1] - 1, begin, -1):
            for a in range(10):
                loops.inertia[trees.rows[r, 0], a] += loops.inertia[r, a]
            _mass(trees, loops, r)
        _mass(trees, loops, begin)
    if not _factor(loops.M, loops.first, n):
        return False
    row = 0
    for c in range(loops.begin[m], loops.begin[m + 1]):
        for i in range(row, row + 6):
            for j in range(n):
                loops.J[i, j] = 0.0
        _derive(trees, loops, loops.end_row[c, 0], 1.0, c, row, ox, oy, oz)
        _derive(trees, loops, loops.end_row[c, 1], -1.0, c, row, ox, oy, oz)
        row += 6
    _select(loops, m, rows)
    for i in range(loops.rank[0]):
        _divide(loops, n, i)
    return True


@inlined
def _vectors(trees: Trees, loops: Loops, r: int, ox: float, oy: float, oz: float) -> None:
    """Spatial vectors of the coordinates of row ``r``."""
    width, i = loops.width[r], loops.column[r]
    if width == 1:
        frame, fixed, s = trees.frame[r], trees.fixed[r], loops.axis[i]
        ax, ay, az = turned(frame, fixed[0], fixed[1], fixed[2])
        if trees.rows[r, 1] == SLIDES:
            s[0], s[1], s[2], s[3], s[4], s[5] = ax, ay, az, 0.0, 0.0, 0.0
        else:
            x, y, z = ox - frame[0], oy - frame[1], oz - frame[2]
            s[0], s[1], s[2] = ay * z - az * y, az * x - ax * z, ax * y - ay * x
            s[3], s[4], s[5] = ax, ay, az
    elif width == 6:
        x, y, z = ox - trees.pose[r, 0], oy - trees.pose[r, 1], oz - trees.pose[r, 2]
        for a in range(6):
            for b in range(6):
                loops.axis[i + a, b] = 1.0 if a == b else 0.0
        s = loops.axis
        s[i + 3, 1], s[i + 3, 2] = -z, y
        s[i + 4, 0], s[i + 4, 2] = z, -x
        s[i + 5, 0], s[i + 5, 1] = -y, x


@inlined
def _inertia(trees: Trees, loops: Loops, r: int, ox: float, oy: float, oz: float) -> None:
    """Inertia of the body of row ``r`` about the origin."""
    pose, out, mass, moment = trees.pose[r], loops.inertia[r], trees.mass[r], trees.inertia[r]
    x, y, z = pose[0] - ox, pose[1] - oy, pose[2] - oz
    out[0], out[1], out[2], out[3] = mass, mass * x, mass * y, mass * z
    out[4], out[5], out[6] = mass * (y * y + z * z), mass * (x * x + z * z), mass * (x * x + y * y)
    out[7], out[8], out[9] = -mass * x * y, -mass * x * z, -mass * y * z
    for a in range(3):
        ux, uy, uz = turned(pose, 1.0 if a == 0 else 0.0, 1.0 if a == 1 else 0.0, 1.0 if a == 2 else 0.0)
        out[4] += moment[a] * ux * ux
        out[5] += moment[a] * uy * uy
        out[6] += moment[a] * uz * uz
        out[7] += moment[a] * ux * uy
        out[8] += moment[a] * ux * uz
        out[9] += moment[a] * uy * uz


@inlined
def _mass(trees: Trees, loops: Loops, r: int) -> None:
    """Rows of the mass matrix that belong to row ``r``, which has the inertia of all that it carries."""
    b = loops.inertia[r]
    for i in range(loops.column[r], loops.column[r] + loops.width[r]):
        s = loops.axis[i]
        px = b[0] * s[0] + s[4] * b[3] - s[5] * b[2]
        py = b[0] * s[1] + s[5] * b[1] - s[3] * b[3]
        pz = b[0] * s[2] + s[3] * b[2] - s[4] * b[1]
        lx = b[4] * s[3] + b[7] * s[4] + b[8] * s[5] + b[2] * s[2] - b[3] * s[1]
        ly = b[7] * s[3] + b[5] * s[4] + b[9] * s[5] + b[3] * s[0] - b[1] * s[2]
        lz = b[8] * s[3] + b[9] * s[4] + b[6] * s[5] + b[1] * s[1] - b[2] * s[0]
        at = r
        while at >= 0:
            for j in range(loops.column[at], loops.column[at] + loops.width[at]):
                u = loops.axis[j]
                value = u[0] * px + u[1] * py + u[2] * pz + u[3] * lx + u[4] * ly + u[5] * lz
                loops.M[i, j] = value
                loops.M[j, i] = value
            at = trees.rows[at, 0]


@inlined
def _derive(trees: Trees, loops: Loops, r: int, sign: float, c: int, row: int, ox: float, oy: float, oz: float) -> None:
    """Add to the six rows from ``row`` what the joints up to row ``r`` do to the end of closure ``c`` on it."""
    end = loops.end[0] if sign > 0.0 else loops.end[1]
    compose(trees.pose[r], loops.end_frame[c, 0 if sign > 0.0 else 1], end)
    x, y, z = end[0] - ox, end[1] - oy, end[2] - oz
    at = r
    while at >= 0:
        for j in range(loops.column[at], loops.column[at] + loops.width[at]):
            s = loops.axis[j]
            loops.J[row, j] += sign * (s[0] + s[4] * z - s[5] * y)
            loops.J[row + 1, j] += sign * (s[1] + s[5] * x - s[3] * z)
            loops.J[row + 2, j] += sign * (s[2] + s[3] * y - s[4] * x)
            if not loops.point[c]:
                for a in range(3):
                    loops.J[row + 3 + a, j] += sign * s[3 + a]
        at = trees.rows[at, 0]


# --- solving ------------------------------------------------------------------------------------


@inlined
def _factor(A: Array, first: Integers, n: int) -> bool:
    """Replace the lower triangle of ``A`` (n, n), row i of which begins at ``first``, by its factor L, A = L Lᵀ."""
    for i in range(n):
        for j in range(first[i], i + 1):
            s = A[i, j]
            for k in range(first[i], j):
                s -= A[i, k] * A[j, k]
            if j < i:
                A[i, j] = s / A[j, j]
            elif s > 0.0:
                A[i, i] = math.sqrt(s)
            else:
                return False
    return True


@inlined
def _select(loops: Loops, m: int, rows: int) -> None:
    """Fill `row_of` with the rows of J that hold something which those before them do not, `rank` and `firm`.

    Pivoted Cholesky factorisation of the Gram matrix, lengths divided by the size of the mechanism: what joints hold
    twice, up to roundings, or not at all in a flat place, is left out of both projections.
    """
    n, A, left, J, size = loops.size[m], loops.A, loops.multiplier, loops.J, loops.extent[m]
    for i in range(rows):
        left[i] = 0.0
        for a in range(n):
            u = J[i, a] * (size if loops.linear[a] else 1.0) / (size if i % 6 < 3 else 1.0)
            left[i] += u * u
    loops.rank[0], loops.firm[0] = 0, 0
    for rank in range(min(rows, n)):
        best = 0
        for i in range(rows):
            if left[i] > left[best]:
                best = i
        if left[best] < REDUNDANT * REDUNDANT:
            break
        loops.rank[0] = rank + 1
        root = math.sqrt(left[best])
        if FLAT * root > 1.0:
            loops.firm[0] = rank + 1
        for i in range(rows):
            s = 0.0
            for a in range(n):
                s += J[i, a] * J[best, a] * (size * size if loops.linear[a] else 1.0)
            s /= (size if i % 6 < 3 else 1.0) * (size if best % 6 < 3 else 1.0)
            for k in range(rank):
                s -= A[i, k] * A[best, k]
            A[i, rank] = s / root
            left[i] -= A[i, rank] * A[i, rank]
        left[best] = -1.0
        loops.row_of[rank] = best


@inlined
def _divide(loops: Loops, n: int, i: int) -> None:
    """Row ``i`` of B: L⁻¹ times its row of J, of length 1."""
    L, y, square, row = loops.M, loops.B[i], 0.0, loops.row_of[i]
    for a in range(n):
        s = loops.J[row, a]
        for k in range(loops.first[a], a):
            s -= L[a, k] * y[k]
        y[a] = s / L[a, a]
        square += y[a] * y[a]
    loops.scale[i] = math.sqrt(square)
    for a in range(n):
        y[a] /= loops.scale[i]


@inlined
def _couple(loops: Loops, n: int, total: int) -> None:
    """Factor of B Bᵀ for ``total`` rows; a row that those before it hold as well is left out."""
    A = loops.A
    for i in range(total):
        for j in range(i + 1):
            s = 0.0
            for a in range(n):
                s += loops.B[i, a] * loops.B[j, a]
            for k in range(j):
                s -= A[i, k] * A[j, k]
            if j < i:
                A[i, j] = s / A[j, j]
            else:
                A[i, i] = math.sqrt(s) if s > WEAK else math.inf


@inlined
def _solve(loops: Loops, n: int, total: int) -> None:
    """Fill `step` with M⁻¹Jᵀ (J M⁻¹Jᵀ)⁻¹ times `multiplier`, which is used up."""
    A, x, L, y = loops.A, loops.multiplier, loops.M, loops.step
    for i in range(total):
        s = x[i] / loops.scale[i]
        for k in range(i):
            s -= A[i, k] * x[k]
        x[i] = s / A[i, i]
    for i in range(total - 1, -1, -1):
        x[i] /= A[i, i]
        for k in range(i):
            x[k] -= x[i] * A[i, k]
    for a in range(n):
        y[a] = 0.0
    for i in range(total):
        for a in range(n):
            y[a] += loops.B[i, a] * x[i]
    for a in range(n - 1, -1, -1):
        y[a] /= L[a, a]
        for k in range(loops.first[a], a):
            y[k] -= y[a] * L[a, k]


@inlined
def _keep(loops: Loops, n: int, i: int, row: int, coordinate: int) -> None:
    """Make row ``i`` of B, ``row`` of J, the constraint of one coordinate."""
    for a in range(n):
        loops.J[row, a] = 0.0
    loops.J[row, coordinate] = 1.0
    loops.row_of[i] = row
    _divide(loops, n, i)


@kernel
def _step(loops: Loops, n: int, rows: int, share: float) -> bool:
    """Fill `step` with what closes a share of the gaps within the limits; whether it is finite."""
    rank, more = loops.rank[0], 0
    for _ in range(SWEEPS):
        _couple(loops, n, rank + more)
        for i in range(rank + more):
            error = loops.error[loops.row_of[i]]
            loops.multiplier[i] = -share * error if i < rank else error
        _solve(loops, n, rank + more)
        found = 0
        for a in range(n):
            low, high = loops.bound[a, 0], loops.bound[a, 1]
            q, after = loops.place[a], loops.place[a] + loops.step[a]
            if not abs(after) < math.inf:
                return False
            below, above = after < low - AT_LIMIT and after < q, after > high + AT_LIMIT and after > q
            if (below or above) and more + found < n:
                row = rows + more + found
                _keep(loops, n, rank + more + found, row, a)
                loops.error[row] = min(low - q, 0.0) if below else max(high - q, 0.0)
                found += 1
        if found == 0:
            break
        more += found
    return True


@kernel
def _slow(loops: Loops, n: int, rows: int, dt: float) -> None:
    """Take from `speed` what opens loops, passes limits or is faster than `MAX_SPEED`; kinetic energy only falls.

    Where places were taken back that speeds had led to in this tick of ``dt``, as in a flat place that the joints'
    roundings block, so are the speeds along this way.
    """
    rank, more, v = loops.rank[0], 0, loops.speed
    before = _product(loops, n, v, v)
    for sweep in range(SWEEPS + 1):
        _couple(loops, n, rank + more)
        _constrain(loops, n, rank, more, v)
        found = 0
        for a in range(n):
            stopped = (v[a] < 0.0 and loops.place[a] <= loops.bound[a, 0] + AT_LIMIT) or (
                v[a] > 0.0 and loops.place[a] >= loops.bound[a, 1] - AT_LIMIT
            )
            fast = abs(v[a]) > (1.0 + SLACK) * MAX_SPEED
            if (fast or stopped) and sweep < SWEEPS and more + found < n:
                row = rows + more + found
                _keep(loops, n, rank + more + found, row, a)
                loops.error[row] = 0.0 if stopped else math.copysign(MAX_SPEED, v[a])
                found += 1
        if found == 0:
            break
        more += found
    after = _product(loops, n, v, v)
    share = min(1.0, math.sqrt(before / after)) if after > 0.0 else 1.0
    for a in range(n):
        v[a] *= share
    for i in range(rank, rank + more):
        loops.error[loops.row_of[i]] = 0.0
    way = loops.shift
    _constrain(loops, n, rank, more, way)
    square = _product(loops, n, way, way)
    if square == 0.0:
        return
    taken = min(max(-_product(loops, n, v, way) / square, 0.0), 1.0 / dt)
    for a in range(n):
        v[a] += taken * way[a]


@inlined
def _constrain(loops: Loops, n: int, rank: int, more: int, v: Array) -> None:
    """Project speeds ``v`` on the rows of closures, and of ``more`` coordinates, which get what `error` states."""
    for _ in range(2):  # the second takes up what the first leaves where grams hold kilograms
        for i in range(rank + more):
            row = loops.row_of[i]
            s = 0.0 if i < rank else loops.error[row]
            for a in range(n):
                s -= loops.J[row, a] * v[a]
            loops.multiplier[i] = s
        _solve(loops, n, rank + more)
        for a in range(n):
            v[a] += loops.step[a]


@inlined
def _product(loops: Loops, n: int, v: Array, w: Array) -> float:
    """The product vᵀ M w: twice the kinetic energy, of one with itself."""
    total = 0.0
    for k in range(n):
        s, t = 0.0, 0.0
        for a in range(k, n):
            if loops.first[a] <= k:
                s += loops.M[a, k] * v[a]
                t += loops.M[a, k] * w[a]
        total += s * t
    return total
