"""The trees of a world as arrays for compiled code: read from Bullet, moved along with their joints, loaded.

Every tree has one row for its base and one for each link, in order, and its single axes follow each other, too. Poses
are x y z qx qy qz qw of inertial frames I in world axes, twists linear at the centre of mass, then angular; joints in
radians or metres.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.model.poses import compose
from ligature.physics.bullet import (
    WORLD_FRAME,
    add_force,
    add_torque,
    get_state,
    init_forces,
    init_motion,
    init_state_request,
    init_step,
    let_sleep,
    real_at,
    set_angular_velocity,
    set_joint_positions,
    set_joint_velocities,
    set_linear_velocity,
    slept,
    submit,
)
from ligature.physics.parking import Boxes, boxes, park, unpark
from ligature.tables import opener

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

TURNS, SLIDES = int(pybullet.JOINT_REVOLUTE), int(pybullet.JOINT_PRISMATIC)

BASE_Q, BASE_U = 7, 6
"""Numbers of the base before those of the first axis, among Bullet's coordinates and velocities."""

REST_SPEED = 1e-12
"""Speed in rad/s or m/s below which joints that nothing pushes stand: at this one, an hour makes 4 nm."""


MAX_RATE = 100.0
"""Maximum speed in rad/s or m/s of a coordinate of a tree with joints, as in Bullet; the projection sees to it."""

PARALLEL_RATE = 20.0
"""The same in rad/s for the two others of three turning axes where the middle one, at 90°, makes them parallel.

There their speeds are large and nearly cancel. At 100 rad/s they turn by 0.1 rad in a tick of 1 ms, and what is left of
them, which moves the body, is off by more than it is.
"""

SLACK = 1.0 + 1e-6
"""How much faster than that a coordinate may be: rounding does not count."""

TURN_PER_CHORD = math.pi
"""Angle over the distance of two unit quaternions that are at most half a turn apart, from above."""


class Trees(NamedTuple):
    """The trees of a world: k trees, r rows, a axes."""

    uid: Integers  # (k,) Bullet's number of the multibody
    begin: Integers  # (k + 1,) first row of each tree, and the end
    first: Integers  # (k + 1,) first axis of each tree, and the end
    going: Flags  # (k,) whether the base moves
    turning: Flags  # (k,) whether there are axes
    measured: Flags  # (k,) whether Bullet measures what the joints carry
    read: Flags  # (k,) whether base and joints are those that Bullet has
    linked: Flags  # (k,) whether the links are where base and joints have them
    quiet: Flags  # (k,) whether nothing but Bullet has acted on it since the last tick, and nothing acts otherwise
    still: Flags  # (k,) whether the last tick, in which it was quiet, left it where it was, at rest
    asleep: Flags  # (k,) whether Bullet passes over it in this tick
    sleepers: Integers  # (c,) where Bullet keeps whether colliders sleep, tree by tree; none of trees that never may
    sleepers_begin: Integers  # (k + 1,)
    ticks: Integers  # (1,) ticks since bodies were put where they began; before the first, no motor has an effort
    link: Integers  # (a,) Bullet's link of each axis
    middle: Integers  # (a,) how many axes on the middle one of three turning axes is, for the two others; else 0
    limp: Flags  # (a,) whether no motor drives it
    sent: Flags  # (a,) whether it reports another effort than its motor's, and that
    sent_effort: Array  # (a,)
    foreseen: Array  # (a,) part of a motor's effort that is known before Bullet solves for the rest
    pressed: Array  # (a,) effort with which a motor presses its axis on a stop; no other part of the tree feels it
    rows: Integers  # (r, 3) parent row, type and axis of the joint
    fixed: Array  # (r, 17) axis of the joint, link frame in its parent's at zero, inertial frame in the link frame
    far: Array  # (r,) how far anything that its joint moves is from that at most, with sliding joints beyond at 0
    mass: Array  # (r,)
    inertia: Array  # (r, 3) principal moments
    pose: Array  # (r, 7)
    twist: Array  # (r, 6)
    frame: Array  # (r, 7) pose and velocity of the link frames' origins
    speed: Array  # (r, 6)
    joints: Array  # (3, a) position, velocity, effort
    reaction: Array  # (a, 6)
    force: Array  # (r, 3) at the centres of mass
    load: Array  # (r, 6) scratch: force, and moment about the world's origin
    push: Array  # (a,)
    change: Array  # (a,) scratch: what motors are to add to velocities
    acceleration: Array  # (r, 6) scratch: of the link frames' origins
    before: Array  # (a,) scratch: positions before a tick
    last_motor: Array  # (2, a) velocity and largest effort of the motors that Bullet has; NaN before it has any
    answer: Integers  # (5,) its own address, and where Bullet puts what `read_tree` asks for
    wanted: Array  # (9,) what is on its way to Bullet: a twist, or force, torque and point
    wanted_at: Integers  # (1,) its address
    boxes: Boxes


def trees(count: int, rows: int, axes: int, sleepers: int = 0, compared: Boxes | None = None) -> Trees:
    """Arrays for ``count`` trees with these numbers of rows, axes and colliders that may sleep."""
    z, whole, no = np.zeros, np.int64, np.bool_
    answer, wanted = z(5, whole), z(9)
    answer[0] = answer.ctypes.data
    return Trees(
        uid=z(count, whole), begin=z(count + 1, whole), first=z(count + 1, whole), going=z(count, no),
        turning=z(count, no), measured=z(count, no), read=z(count, no), linked=z(count, no), ticks=z(1, whole),
        quiet=z(count, no), still=z(count, no), asleep=z(count, no), sleepers=z(sleepers, whole),
        sleepers_begin=z(count + 1, whole), before=z(axes), last_motor=np.full((2, axes), np.nan),
        link=z(axes, whole), middle=z(axes, whole), limp=np.ones(axes, no), sent=z(axes, no), sent_effort=z(axes),
        foreseen=z(axes), pressed=z(axes),
        rows=np.full((rows, 3), -1), fixed=z((rows, 17)), far=np.full(rows, np.inf), mass=z(rows), inertia=z((rows, 3)),
        pose=z((rows, 7)), twist=z((rows, 6)), frame=z((rows, 7)), speed=z((rows, 6)), joints=z((3, axes)),
        reaction=z((axes, 6)), force=z((rows, 3)), load=z((rows, 6)), push=z(axes), change=z(axes),
        acceleration=z((rows, 6)), answer=answer,
        wanted=wanted, wanted_at=np.array([wanted.ctypes.data]), boxes=compared or boxes(count),
    )  # fmt: skip


open_trees = opener(trees(1, 1, 1))


@inlined
def read_tree(handle: int, trees: Trees, k: int) -> None:
    """Read base and joints of tree ``k`` from Bullet, which have moved since; a base that stands is not read."""
    out = trees.answer[0]
    status = submit(handle, init_state_request(handle, trees.uid[k]))
    get_state(status, 0, 0, 0, 0, 0, out + 8, out + 16, out + 24, 0, out + 32, 0, 0)
    q, u, reactions, efforts = trees.answer[1], trees.answer[2], trees.answer[3], trees.answer[4]
    if trees.going[k]:
        row = trees.begin[k]
        for a in range(7):
            trees.pose[row, a] = real_at(q, a)
        for a in range(6):
            trees.twist[row, a] = real_at(u, a)
    first = trees.first[k]
    for i in range(first, trees.first[k + 1]):
        link = trees.link[i]
        trees.joints[0, i] = real_at(q, BASE_Q + i - first)
        trees.joints[1, i] = real_at(u, BASE_U + i - first)
        silent = trees.ticks[0] == 0 or trees.limp[i]
        effort = 0.0 if silent else real_at(efforts, link) + trees.foreseen[i] + trees.pressed[i]
        trees.joints[2, i] = trees.sent_effort[i] if trees.sent[i] else effort
        if trees.measured[k]:
            for a in range(6):
                trees.reaction[i, a] = 0.0 if trees.ticks[0] == 0 else real_at(reactions, 6 * link + a)
    trees.read[k] = True


@kernel
def read_one(handle: int, table: Integers, k: int) -> None:
    """Read base and joints of tree ``k`` of a table of `Trees`."""
    read_tree(handle, open_trees(table), k)


@kernel
def step_world(handle: int, table: Integers, limit: float) -> bool:
    """Advance Bullet by a tick, and read all trees; whether all speeds are finite and below ``limit``."""
    trees = open_trees(table)
    for k in range(trees.uid.shape[0]):
        trees.asleep[k] = trees.still[k] and trees.quiet[k]
        if trees.asleep[k]:
            for i in range(trees.sleepers_begin[k], trees.sleepers_begin[k + 1]):
                let_sleep(trees.sleepers[i])
        stands = not (trees.going[k] or trees.turning[k]) and trees.quiet[k]
        trees.boxes.parked[k] = trees.asleep[k] or stands
    park(trees.boxes)
    submit(handle, init_step(handle))
    unpark(trees.boxes)
    for k in range(trees.uid.shape[0]):
        trees.boxes.moved[k] = 0.0
        trees.asleep[k] = trees.asleep[k] and slept(trees.sleepers[trees.sleepers_begin[k]])
    pass_tick(trees)
    for k in range(trees.uid.shape[0]):
        if not trees.read[k]:
            _read_moved(handle, trees, k)
        trees.quiet[k] = True
    return below(trees, limit)


@inlined
def _read_moved(handle: int, trees: Trees, k: int) -> None:
    """Read tree ``k`` after a tick, and find out whether it moved in it."""
    row, first, end = trees.begin[k], trees.first[k], trees.first[k + 1]
    rested = True
    for a in range(7):
        trees.wanted[a] = trees.pose[row, a]
    for a in range(6):
        rested = rested and trees.twist[row, a] == 0.0
    for i in range(first, end):
        trees.before[i] = trees.joints[0, i]
        rested = rested and trees.joints[1, i] == 0.0
    read_tree(handle, trees, k)
    trees.boxes.moved[k] = _moved(trees, k)
    if creeps(trees, k):
        _halt(handle, trees, k)
    still = rested and trees.quiet[k] and trees.sleepers_begin[k] < trees.sleepers_begin[k + 1]
    for a in range(7):
        still = still and trees.wanted[a] == trees.pose[row, a]
    for a in range(6):
        still = still and trees.twist[row, a] == 0.0
    for i in range(first, end):
        still = still and trees.before[i] == trees.joints[0, i] and trees.joints[1, i] == 0.0
        if trees.measured[k]:  # Bullet adds to what joints carry, from 0 in every tick in which it does not sleep
            for a in range(6):
                still = still and trees.reaction[i, a] == 0.0
    trees.still[k] = still


@inlined
def _moved(trees: Trees, k: int) -> float:
    """How far any point of tree ``k`` has moved in a tick at most, since `Trees.wanted` and `Trees.before`."""
    begin = trees.begin[k]
    old, new = trees.wanted, trees.pose[begin]
    shift, one, other = 0.0, 0.0, 0.0
    for a in range(3):
        shift += (new[a] - old[a]) ** 2
    for a in range(3, 7):
        one, other = one + (new[a] - old[a]) ** 2, other + (new[a] + old[a]) ** 2
    moved, slid = math.sqrt(shift), 0.0
    for r in range(trees.begin[k + 1] - 1, begin, -1):  # what a joint moves comes after it
        joint = trees.rows[r, 2]
        if joint >= 0:
            now, before = trees.joints[0, joint], trees.before[joint]
            if trees.rows[r, 1] == SLIDES:
                moved += abs(now - before)
                slid += max(abs(now), abs(before))
            else:
                moved += (trees.far[r] + slid) * abs(now - before)
    return moved + (trees.far[begin] + slid) * TURN_PER_CHORD * math.sqrt(min(one, other))


@inlined
def creeps(trees: Trees, k: int) -> bool:
    """Whether the joints of tree ``k``, on which nothing but Bullet acts, are to stand: springs arrive only nearly."""
    moves = False
    for i in range(trees.first[k], trees.first[k + 1]):
        speed = abs(trees.joints[1, i])
        if not (trees.limp[i] and speed < REST_SPEED):
            return False
        moves = moves or speed > 0.0
    return moves and trees.quiet[k] and not trees.going[k]


@inlined
def _halt(handle: int, trees: Trees, k: int) -> None:
    """Let the joints of tree ``k`` stand where they are."""
    first, end = trees.first[k], trees.first[k + 1]
    for i in range(first, end):
        trees.joints[1, i] = 0.0
    command = init_motion(handle, trees.uid[k])
    set_joint_positions(command, end - first, trees.joints[0, first:].ctypes.data)  # without, Bullet sets no velocity
    set_joint_velocities(handle, command, end - first, trees.joints[1, first:].ctypes.data)
    submit(handle, command)


@inlined
def pass_tick(trees: Trees) -> None:
    """A tick is over: what does not sleep is elsewhere."""
    trees.ticks[0] += 1
    for k in range(trees.uid.shape[0]):
        if (trees.going[k] or trees.turning[k]) and not trees.asleep[k]:
            trees.read[k] = trees.linked[k] = False


@inlined
def below(trees: Trees, limit: float) -> bool:
    """Whether bodies without joints are slower than ``limit``, coordinates of trees with joints within `most_rate`."""
    sound = True
    for k in range(trees.uid.shape[0]):
        most = limit if trees.first[k] == trees.first[k + 1] else SLACK * MAX_RATE
        for a in range(6):
            sound = sound and abs(trees.twist[trees.begin[k], a]) < most
    for i in range(trees.link.shape[0]):
        speed = abs(trees.joints[1, i])
        sound = sound and (speed < PARALLEL_RATE or speed < SLACK * most_rate(trees, i))
    return sound


@inlined
def part_moved(trees: Trees, i: int) -> float:
    """Part of the inertia that axis ``i``, one of three that turn, moves alone: cos² of how far the middle one is."""
    return np.cos(trees.joints[0, i + trees.middle[i]]) ** 2


@inlined
def most_rate(trees: Trees, i: int) -> float:
    """Maximum speed of axis ``i`` where its tree is: that of parallel axes from about 60° of the middle one on."""
    if trees.middle[i] == 0:
        return MAX_RATE
    return PARALLEL_RATE + (MAX_RATE - PARALLEL_RATE) * part_moved(trees, i) ** 2


@kernel
def expire(table: Integers) -> None:
    """`pass_tick` for a table of `Trees`."""
    pass_tick(open_trees(table))


@kernel
def creeps_one(table: Integers, k: int) -> bool:
    """`creeps` for a table of `Trees`."""
    return creeps(open_trees(table), k)


@kernel
def sound(table: Integers, limit: float) -> bool:
    """`below` for a table of `Trees`."""
    return below(open_trees(table), limit)


@kernel
def link_trees(table: Integers) -> None:
    """Bring the links of all trees to where bases and joints have them; these are up to date."""
    trees = open_trees(table)
    for k in range(trees.uid.shape[0]):
        if not trees.linked[k]:
            follow(trees, k)


@kernel
def link_one(table: Integers, k: int) -> None:
    """`follow` for a table of `Trees`."""
    follow(open_trees(table), k)


@kernel
def load_one(table: Integers, k: int) -> None:
    """`load_joints` for a table of `Trees`."""
    load_joints(open_trees(table), k)


@kernel
def slow_down(handle: int, table: Integers, slowed: Integers, factors: Array) -> None:
    """Multiply linear and angular velocity of the trees ``slowed`` (n,), which have no links, by ``factors`` (n, 2)."""
    trees = open_trees(table)
    for i in range(slowed.shape[0]):
        k = slowed[i]
        if not trees.read[k]:
            read_tree(handle, trees, k)
        twist, moves = trees.twist[trees.begin[k]], False
        for a in range(6):
            moves = moves or twist[a] != 0.0
            trees.wanted[a] = factors[i, a // 3] * twist[a]
        if moves:
            trees.quiet[k] = False
            for a in range(6):
                twist[a] = trees.wanted[a]
            command = init_motion(handle, trees.uid[k])
            set_linear_velocity(command, trees.wanted_at[0])
            set_angular_velocity(command, trees.wanted_at[0] + 24)
            submit(handle, command)


@inlined
def bring_up(handle: int, trees: Trees, k: int, link: bool) -> None:
    """Bring base and joints of tree ``k`` up to date, and its ``link``s; without a handle the former are."""
    if handle != 0 and not trees.read[k]:
        read_tree(handle, trees, k)
    if link and not trees.linked[k]:
        follow(trees, k)


class Places(NamedTuple):
    """Where bodies are among the trees, by the body's index: b bodies; the tree of an element of a rod is -1."""

    tree: Integers  # (b,)
    row: Integers  # (b,)
    uid: Integers  # (b,) Bullet's multibody, and the link in it
    link: Integers  # (b,)


open_places = opener(Places(*(np.zeros((4, 1), dtype=np.int64))))


@kernel
def read_bodies(handle: int, tree_table: Integers, place_table: Integers, bodies: Integers, out: Array) -> None:
    """Poses of the inertial frames of ``bodies`` (n,), and twists, to ``out`` (n, 13)."""
    trees, places = open_trees(tree_table), open_places(place_table)
    for i in range(bodies.shape[0]):
        body = bodies[i]
        row = places.row[body]
        bring_up(handle, trees, places.tree[body], places.link[body] >= 0)
        for a in range(7):
            out[i, a] = trees.pose[row, a]
        for a in range(6):
            out[i, 7 + a] = trees.twist[row, a]


@kernel
def load_body(
    handle: int, tree_table: Integers, place_table: Integers, body: int, impulse: Array, moment: Array, dt: float
) -> None:
    """Apply the force and torque that have an ``impulse`` (3,) and ``moment`` (3,) in the coming tick of ``dt``.

    The force acts at the centre of mass of the body.
    """
    trees, places = open_trees(tree_table), open_places(place_table)
    bring_up(handle, trees, places.tree[body], places.link[body] >= 0)
    for a in range(3):
        trees.wanted[a], trees.wanted[3 + a] = impulse[a] / dt, moment[a] / dt
    load(handle, trees, places, body)


@inlined
def load(handle: int, trees: Trees, places: Places, body: int) -> None:
    """Apply the wanted force and torque in the coming tick, the force at the centre of mass of a body, as read."""
    submit(handle, _push(handle, trees, places, body))
    command = init_forces(handle)  # a command of its own: Bullet puts the second of two over the first
    add_torque(command, places.uid[body], places.link[body], trees.wanted_at[0] + 24, WORLD_FRAME)
    submit(handle, command)


@kernel
def push_bodies(handle: int, tree_table: Integers, place_table: Integers, bodies: Integers, forces: Array) -> None:
    """Apply ``forces`` (n, 3) at the centres of mass of ``bodies`` (n,) in the coming tick."""
    trees, places = open_trees(tree_table), open_places(place_table)
    for i in range(bodies.shape[0]):
        body = bodies[i]
        bring_up(handle, trees, places.tree[body], places.link[body] >= 0)
        for a in range(3):
            trees.wanted[a] = forces[i, a]
        submit(handle, _push(handle, trees, places, body))


@inlined
def _push(handle: int, trees: Trees, places: Places, body: int) -> int:
    """Bullet's command that applies the wanted force at the centre of mass of a body."""
    trees.quiet[places.tree[body]] = False
    for a in range(3):
        trees.wanted[6 + a] = trees.pose[places.row[body], a]
    command = init_forces(handle)
    at = trees.wanted_at[0]
    add_force(command, places.uid[body], places.link[body], at, at + 48, WORLD_FRAME)
    return command


# --- links --------------------------------------------------------------------------------------


@inlined
def follow(trees: Trees, k: int) -> None:
    """Poses and twists of the links of tree ``k``."""
    frame, speed, pose, twist = trees.frame, trees.speed, trees.pose, trees.twist
    begin = trees.begin[k]
    for a in range(7):
        frame[begin, a] = pose[begin, a]
    for a in range(6):
        speed[begin, a] = twist[begin, a]
    for r in range(begin + 1, trees.begin[k + 1]):
        p, kind, joint = trees.rows[r, 0], trees.rows[r, 1], trees.rows[r, 2]
        f, v, fixed = frame[r], speed[r], trees.fixed[r]
        compose(frame[p], fixed[3:10], f)
        ax, ay, az = turned(f, fixed[0], fixed[1], fixed[2])
        q, qd = 0.0, 0.0
        if joint >= 0:
            q, qd = trees.joints[0, joint], trees.joints[1, joint]
        if kind == SLIDES:
            f[0], f[1], f[2] = f[0] + q * ax, f[1] + q * ay, f[2] + q * az
        _carried(speed[p], f[0] - frame[p, 0], f[1] - frame[p, 1], f[2] - frame[p, 2], v)
        if kind == SLIDES:
            v[0], v[1], v[2] = v[0] + qd * ax, v[1] + qd * ay, v[2] + qd * az
        elif kind == TURNS:
            v[3], v[4], v[5] = v[3] + qd * ax, v[4] + qd * ay, v[5] + qd * az
            s, c = math.sin(0.5 * q), math.cos(0.5 * q)
            x, y, z, w = f[3], f[4], f[5], f[6]
            ax, ay, az = s * ax, s * ay, s * az
            f[3] = c * x + w * ax + ay * z - az * y
            f[4] = c * y + w * ay + az * x - ax * z
            f[5] = c * z + w * az + ax * y - ay * x
            f[6] = c * w - ax * x - ay * y - az * z
        compose(f, fixed[10:17], pose[r])
        _carried(v, pose[r, 0] - f[0], pose[r, 1] - f[1], pose[r, 2] - f[2], twist[r])
    trees.linked[k] = True


@inlined
def turned(pose: Array, px: float, py: float, pz: float) -> tuple[float, float, float]:
    """The vector p, given in the frame ``pose``, in world axes."""
    x, y, z, w = pose[3], pose[4], pose[5], pose[6]
    cx, cy, cz = y * pz - z * py + w * px, z * px - x * pz + w * py, x * py - y * px + w * pz
    return px + 2.0 * (y * cz - z * cy), py + 2.0 * (z * cx - x * cz), pz + 2.0 * (x * cy - y * cx)


@inlined
def _carried(twist: Array, rx: float, ry: float, rz: float, out: Array) -> None:
    """The velocity ``twist`` (6,) at a point that lies r off."""
    wx, wy, wz = twist[3], twist[4], twist[5]
    out[0] = twist[0] + wy * rz - wz * ry
    out[1] = twist[1] + wz * rx - wx * rz
    out[2] = twist[2] + wx * ry - wy * rx
    out[3], out[4], out[5] = wx, wy, wz


@inlined
def load_joints(trees: Trees, k: int) -> None:
    """Add to ``push`` what the forces on the links of tree ``k``, which are up to date, do to its joints."""
    force, load, pose = trees.force, trees.load, trees.pose
    for r in range(trees.begin[k], trees.begin[k + 1]):
        x, y, z = force[r, 0], force[r, 1], force[r, 2]
        cx, cy, cz = pose[r, 0], pose[r, 1], pose[r, 2]
        load[r, 0], load[r, 1], load[r, 2] = x, y, z
        load[r, 3], load[r, 4], load[r, 5] = cy * z - cz * y, cz * x - cx * z, cx * y - cy * x
    bear(trees, k, trees.push)


@inlined
def bear(trees: Trees, k: int, effort: Array) -> None:
    """Add to ``effort`` (a,) what `Trees.load` does to the joints of tree ``k``; loads of links add up to the base."""
    rows, fixed, frame, load = trees.rows, trees.fixed, trees.frame, trees.load
    begin, end = trees.begin[k], trees.begin[k + 1]
    for r in range(end - 1, begin, -1):
        p, kind, joint = rows[r, 0], rows[r, 1], rows[r, 2]
        if joint >= 0:
            f, at = frame[r], load[r]
            ax, ay, az = turned(f, fixed[r, 0], fixed[r, 1], fixed[r, 2])
            if kind == SLIDES:
                effort[joint] += ax * at[0] + ay * at[1] + az * at[2]
            else:
                mx = at[3] - (f[1] * at[2] - f[2] * at[1])
                my = at[4] - (f[2] * at[0] - f[0] * at[2])
                mz = at[5] - (f[0] * at[1] - f[1] * at[0])
                effort[joint] += ax * mx + ay * my + az * mz
        for a in range(6):
            load[p, a] += load[r, a]
