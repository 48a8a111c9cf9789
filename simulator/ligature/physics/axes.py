"""The law of every single axis of all joints, once a tick, as one compiled call. Radians, metres, N·m, N.

The PID is that of AMBF with its derivative taken implicitly: with velocity output
``v = P e + I ∫e + D ė`` and ``ė = ṫ − v`` the joint's velocity is ``v = (P e + I ∫e + D ṫ) / (1 + D)``. Evaluated
explicitly, as AMBF does, a D near 1 chatters at the rate of the loop; the implicit form is the same law
without it.

With force output the effort is ``P e + I ∫e + D (ṫ − v)``. It goes to a motor of that strength, whose velocity is the
one at which the effort vanishes: Bullet's solver finds the effort along with all contacts and loops, so that it is
the law's where the joint is heavy enough for it to act in full over a tick, and less where it would overshoot.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.model.commands import CommandType
from ligature.physics.bullet import (
    TORQUE_CONTROL,
    VELOCITY_CONTROL,
    VELOCITY_GAIN,
    init_motors,
    set_effort,
    set_gain,
    set_strength,
    set_velocity,
    submit,
)
from ligature.physics.feedforward import find_efforts
from ligature.physics.trees import (
    BASE_U,
    REST_SPEED,
    Trees,
    follow,
    load_joints,
    open_trees,
    part_moved,
    read_tree,
)
from ligature.tables import opener

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

FREE, FORCE, POSITION, VELOCITY = (
    -1,
    int(CommandType.FORCE),
    int(CommandType.POSITION),
    int(CommandType.VELOCITY),
)
SERVO = 3
"""Mode of a joint that an arm of a robot drives: it follows a set-point and its velocity."""

GIVING_FRICTION = 0.005
"""Effort (N·m or N) that a motor which gives always has, so that it arrives at its set-point."""

FREE_SPEED = 1e3
"""Speed in rad/s or m/s that an effort alone would reach, were it not bounded otherwise."""

STOP_GAIN = 0.2
"""Share of its way back that a stopped joint goes in a tick."""

RESIDUE = 1e-12
"""Effort of a joint that stands which counts as none, as a part of its spring's, or where that is small of 1 N or N·m,
or of what the spring exerts for 1 m or rad if that is less: springs of grains are weaker than a trillionth of a newton.

No spring balances a weight to the last bit: what remains moves a joint by parts of a picometre, but for ever."""

AT_STOP = 1e-6
"""Distance in rad or m from its stop at which an axis rests on it.

A motor that would take it farther beyond within a tick presses with all its strength."""

OBEYED = 3e-3
"""Difference in rad/s or m/s between an axis and its motor after a tick up to which nothing was in its way."""

FORESEEN = 0.5
"""Part of a motor's strength that is foreseen at most: with the rest it can still let go within the tick."""

SERVO_GAIN = 200.0
"""Closing speed over following error in 1/s: the set-point is reached with a time constant of 5 ms."""


class Axes(NamedTuple):
    """The single axes of all trees, (a,) each, tree by tree, and what holds for trees (k,)."""

    laden: Flags  # (k,) whether the joints of a tree bear `Trees.force`
    steered: Flags  # (k,) whether motors drive all axes of a tree whose base stands
    mode: Integers
    force_output: Flags
    turns: Flags
    sprung: Flags
    owned: Flags  # by an arm that is enabled
    driven: Flags  # by a motor
    pushed: Flags  # by an effort
    p: Array
    i: Array
    d: Array
    strength: Array  # largest effort of the motor
    low: Array  # limits of positions that are commanded
    high: Array
    stiffness: Array  # of springs
    damping: Array
    rest: Array
    most_stiffness: Array  # that ticks bear while the middle axis stands at zero
    most_damping: Array
    target: Array
    pace: Array  # of the target
    max_velocity: Array
    max_deceleration: Array
    yield_stiffness: Array
    integral: Array
    kick: Array
    kick_ticks: Integers
    stopped: Flags  # kept at a position
    stop: Array
    slowed: Flags  # velocity and strength of the motor are bounded
    lower_speed: Array
    upper_speed: Array
    upper_effort: Array
    motor: Array  # velocities of motors
    asked: Array  # what a motor with force output exerts at most
    limit: Array  # largest efforts of motors in the coming tick


_KINDS = {
    **dict.fromkeys(("mode", "kick_ticks"), np.int64),
    **dict.fromkeys(("force_output", "turns", "sprung", "owned", "driven", "pushed", "stopped", "slowed"), np.bool_),
}
"""Kinds of the arrays that do not hold real numbers."""


def axes(trees: int, count: int) -> Axes:
    """Arrays for ``count`` axes of this number of trees, all limp."""
    arrays = {name: np.zeros(count, _KINDS.get(name, np.float64)) for name in Axes._fields}
    arrays["laden"], arrays["steered"] = np.zeros((2, trees), np.bool_)
    for name in ("max_velocity", "max_deceleration"):
        arrays[name][:] = np.inf
    arrays["mode"][:] = FREE
    return Axes._make(arrays.values())


open_axes = opener(axes(1, 1))


@kernel
def act(handle: int, tree_table: Integers, axis_table: Integers, dt: float) -> None:
    """Motor velocities and efforts of the coming tick for all axes; with a handle, Bullet gets them.

    Without one the trees must have been read, and linked where they are laden.
    """
    trees, axes = open_trees(tree_table), open_axes(axis_table)
    for k in range(trees.uid.shape[0]):
        begin, end = trees.first[k], trees.first[k + 1]
        motors, efforts = 0, 0
        for i in range(begin, end):
            motors += axes.driven[i]
            efforts += axes.pushed[i]
        if motors + efforts == 0:
            continue
        if handle != 0 and not trees.read[k]:
            read_tree(handle, trees, k)
        for i in range(begin, end):
            _follow_law(axes, trees, i, dt)
        if axes.laden[k]:
            if not trees.linked[k]:
                follow(trees, k)
            load_joints(trees, k)
        for i in range(begin, end):
            _bound(axes, trees, i, dt)
            if axes.sprung[i]:
                _balance(axes, trees, i)
        if axes.steered[k] and _foresee(axes, trees, k, dt):
            efforts += 1
        trees.quiet[k] = trees.quiet[k] and _unchanged(axes, trees, k)
        for i in range(begin, end):
            if axes.driven[i]:
                trees.last_motor[0, i], trees.last_motor[1, i] = axes.motor[i], axes.limit[i]
        if handle == 0 or (trees.quiet[k] and trees.still[k]):
            continue
        if motors > 0:
            _send_motors(handle, trees, axes, k)
        if efforts > 0:
            _send_efforts(handle, trees, axes, k)


@inlined
def _unchanged(axes: Axes, trees: Trees, k: int) -> bool:
    """Whether Bullet has the motors of tree ``k``, and no effort acts on it."""
    same = True
    for i in range(trees.first[k], trees.first[k + 1]):
        if axes.driven[i]:
            same = same and axes.motor[i] == trees.last_motor[0, i] and axes.limit[i] == trees.last_motor[1, i]
        if axes.pushed[i]:
            same = same and trees.push[i] == 0.0
        same = same and trees.foreseen[i] == 0.0
    return same


@inlined
def _foresee(axes: Axes, trees: Trees, k: int, dt: float) -> bool:
    """Find `Trees.foreseen` for the motors of tree ``k``, and leave the rest of their strength to Bullet.

    An axis that did not follow its motor, as a jaw on what it holds, is taken to go on as it does. Returns whether
    there is anything to foresee.
    """
    changes = False
    for i in range(trees.first[k], trees.first[k + 1]):
        obeys = abs(trees.joints[1, i] - trees.last_motor[0, i]) < OBEYED
        trees.change[i] = axes.motor[i] - trees.joints[1, i] if obeys else 0.0
        changes = changes or trees.change[i] != 0.0
    if not changes:
        return False
    if not trees.linked[k]:
        follow(trees, k)
    find_efforts(trees, k, dt)
    for i in range(trees.first[k], trees.first[k + 1]):
        most, other = FORESEEN * axes.limit[i], trees.push[i] if axes.pushed[i] else 0.0
        trees.foreseen[i] = min(max(trees.foreseen[i] - other, -most), most)
        axes.limit[i] -= abs(trees.foreseen[i])
        trees.push[i] = other + trees.foreseen[i]
    return True


@inlined
def _follow_law(axes: Axes, trees: Trees, k: int, dt: float) -> None:
    """Motor velocity and effort of one axis by its command and spring; advances its integral and its kick."""
    position, velocity = trees.joints[0, k], trees.joints[1, k]
    axes.motor[k] = axes.asked[k] = trees.push[k] = 0.0
    trees.foreseen[k] = trees.pressed[k] = 0.0
    if axes.mode[k] == POSITION:
        error = axes.target[k] - position
        if axes.turns[k]:
            error = (error + np.pi) % (2 * np.pi) - np.pi
        axes.integral[k] += error * dt
        pull = axes.p[k] * error + axes.i[k] * axes.integral[k]
        jump = 0.0
        if axes.kick_ticks[k] > 0:
            jump = axes.kick[k]
            axes.kick_ticks[k] -= 1
        if axes.force_output[k]:
            axes.asked[k] = pull + axes.d[k] * (jump - velocity)
            axes.motor[k] = jump + _vanishing(pull, axes.d[k], STOP_GAIN / dt * abs(error))
        else:
            axes.motor[k] = (pull + axes.d[k] * jump) / (1.0 + axes.d[k])
    elif axes.mode[k] == SERVO:
        error = axes.target[k] - position
        closing = min(SERVO_GAIN * abs(error), np.sqrt(2.0 * axes.max_deceleration[k] * abs(error)))
        axes.motor[k] = min(
            max(axes.pace[k] + np.copysign(closing, error), -axes.max_velocity[k]), axes.max_velocity[k]
        )
    elif axes.mode[k] == VELOCITY:
        axes.motor[k] = axes.target[k]
    elif axes.mode[k] == FORCE:
        trees.push[k] = axes.target[k]
    if axes.sprung[k]:
        stiffness, damping = _bearable(axes, trees, k)
        trees.push[k] += stiffness * (axes.rest[k] - position) - damping * velocity


@inlined
def _bearable(axes: Axes, trees: Trees, k: int) -> tuple[float, float]:
    """Stiffness and damping of one axis, no more than ticks bear.

    Where two of three turning axes are near parallel, either of them moves `part_moved` of the inertia that it moves
    where they are square, for the other gives way.
    """
    stiffness, damping = axes.stiffness[k], axes.damping[k]
    if trees.middle[k] != 0:
        part = part_moved(trees, k)
        stiffness = min(stiffness, part * axes.most_stiffness[k])
        damping = min(damping, part * axes.most_damping[k])
    return stiffness, damping


@inlined
def _balance(axes: Axes, trees: Trees, k: int) -> None:
    """Take the effort of a sprung axis that stands as none where its spring bears the weight; see `RESIDUE`."""
    velocity = trees.joints[1, k]
    if abs(velocity) < REST_SPEED:
        stiffness, damping = _bearable(axes, trees, k)
        spring = stiffness * abs(axes.rest[k] - trees.joints[0, k])
        if abs(trees.push[k] + damping * velocity) <= RESIDUE * max(min(1.0, stiffness), spring):
            trees.push[k] = 0.0


@inlined
def _vanishing(pull: float, damping: float, most: float) -> float:
    """Velocity at which a damper takes up ``pull``, at most ``most``."""
    if abs(pull) > damping * most:
        return np.copysign(most, pull)
    return pull / damping if damping > 0.0 else 0.0


@inlined
def _bound(axes: Axes, trees: Trees, k: int, dt: float) -> None:
    """Maximum effort of one motor, by its strength, its compliance, its stops and its speed limits."""
    position, velocity, strength = trees.joints[0, k], trees.joints[1, k], axes.strength[k]
    limit = strength
    if axes.yield_stiffness[k] > 0.0:
        limit = min(axes.yield_stiffness[k] * abs(axes.target[k] - position) + GIVING_FRICTION, strength)
    if axes.mode[k] == POSITION and axes.force_output[k]:
        limit = abs(axes.asked[k])
    if axes.slowed[k]:
        effort, wanted = limit, axes.motor[k]
        if axes.mode[k] == FORCE:
            effort, wanted = abs(axes.target[k]), np.sign(axes.target[k]) * FREE_SPEED
        axes.motor[k] = min(max(wanted, axes.lower_speed[k]), axes.upper_speed[k])
        within = axes.lower_speed[k] <= velocity <= axes.upper_speed[k]
        limit = min(effort, axes.upper_effort[k]) if within else strength
    if axes.stopped[k]:
        axes.motor[k] = STOP_GAIN / dt * (axes.stop[k] - position)
        if not axes.slowed[k]:
            limit = strength
    axes.limit[k] = limit
    _keep_within_stops(axes, trees, k, dt)


@inlined
def _keep_within_stops(axes: Axes, trees: Trees, k: int, dt: float) -> None:
    """Ask a motor for no more than what takes its axis to its stop, and note how it presses on one.

    Bullet stops only an axis that is beyond already: one a bit before would be thrown through its stop, and back.
    """
    position, wanted = trees.joints[0, k], axes.motor[k]
    down, up = axes.low[k] - position, axes.high[k] - position
    lowest = 0.0 if -AT_STOP < down < 0.0 else down / dt
    highest = 0.0 if 0.0 < up < AT_STOP else up / dt
    axes.motor[k] = min(max(wanted, lowest), highest)
    if abs(down) < AT_STOP and wanted * dt < down - AT_STOP:
        trees.pressed[k] = -axes.limit[k]
    elif abs(up) < AT_STOP and wanted * dt > up + AT_STOP:
        trees.pressed[k] = axes.limit[k]


@inlined
def asked_of(axes: Axes, trees: Trees, k: int, stiffness: float) -> float:
    """Effort that the command of an axis asks for, were the axis stopped where it is.

    A motor with a set-point pulls in proportion to its following error, with ``stiffness`` (N·m/rad, N/m)
    unless it has a yield stiffness; one with a velocity pulls with all its strength.
    """
    mode, target = axes.mode[k], axes.target[k]
    behind = target - trees.joints[0, k]
    if axes.turns[k]:
        behind = (behind + np.pi) % (2 * np.pi) - np.pi
    if mode == FORCE:
        return target
    if mode == VELOCITY:
        return np.sign(target) * axes.strength[k]
    if mode == SERVO and axes.yield_stiffness[k] != 0.0:
        return axes.yield_stiffness[k] * behind
    if mode == POSITION and axes.force_output[k]:
        return axes.asked[k]
    return stiffness * behind if mode in (SERVO, POSITION) else 0.0


@kernel
def requested_effort(tree_table: Integers, axis_table: Integers, k: int, stiffness: float) -> float:
    """`asked_of` for tables of `Trees` and `Axes`."""
    return asked_of(open_axes(axis_table), open_trees(tree_table), k, stiffness)


@inlined
def stop_at(axes: Axes, trees: Trees, k: int, position: float, effort: float) -> bool:
    """Keep an axis at ``position`` from now on, whatever its command; it reports ``effort``.

    Returns whether nothing stopped it before: then motors are to be sorted anew.
    """
    afresh = not axes.stopped[k]
    axes.stopped[k], axes.stop[k], axes.slowed[k] = True, position, False
    trees.sent[k], trees.sent_effort[k] = True, effort if effort != 0.0 else 0.0
    return afresh


@kernel
def stop(tree_table: Integers, axis_table: Integers, k: int, position: float, effort: float) -> bool:
    """`stop_at` for tables of `Trees` and `Axes`."""
    return stop_at(open_axes(axis_table), open_trees(tree_table), k, position, effort)


@inlined
def _send_motors(handle: int, trees: Trees, axes: Axes, k: int) -> None:
    """Set the motors of tree ``k``."""
    begin, end = trees.first[k], trees.first[k + 1]
    command = init_motors(handle, trees.uid[k], VELOCITY_CONTROL)
    for i in range(begin, end):
        if axes.driven[i]:
            at = BASE_U + i - begin
            set_velocity(command, at, axes.motor[i])
            set_gain(command, at, VELOCITY_GAIN)
            set_strength(command, at, axes.limit[i])
    submit(handle, command)


@inlined
def _send_efforts(handle: int, trees: Trees, axes: Axes, k: int) -> None:
    """Set the efforts of tree ``k``."""
    begin, end = trees.first[k], trees.first[k + 1]
    command = init_motors(handle, trees.uid[k], TORQUE_CONTROL)
    for i in range(begin, end):
        if axes.pushed[i] or trees.foreseen[i] != 0.0:
            set_effort(command, BASE_U + i - begin, trees.push[i])
    submit(handle, command)
