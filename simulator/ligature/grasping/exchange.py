"""What the grasps of a world need in each tick, as compiled calls on its trees: nothing else asks for Python then.

World axes, SI units.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.grasping.fingers import EFFORT, LEAST_LEVER, STIFFNESS
from ligature.grasping.friction import (
    friction_limits,
    grasp_arrays,
    motions,
    open_motions,
    predict_free,
    scratch,
    solve,
)
from ligature.kernels import inlined, kernel
from ligature.physics.axes import Axes, asked_of, axes, open_axes, requested_effort, stop, stop_at
from ligature.physics.trees import Places, Trees, bring_up, load, open_places, open_trees, trees
from ligature.tables import opener, table_of

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

JUMP = 0.01
"""Displacement in metres of a holder within a tick beyond which it was put elsewhere."""

CREEP = 0.2e-3
"""Slip in metres after which a jaw checks that the body is still between its pads."""

RELEASED, AFRESH, CREPT = 1, 2, 4
"""What `keep` finds: the jaw lets go; a finger was not stopped before; the body has slipped by `CREEP`."""


class JawArrays(NamedTuple):
    """A jaw that holds a body."""

    palm: Integers  # (1,) the body of the pads
    fingers: Integers  # (2,) axes of the world that turn them
    opening: Array  # (2,) the directions in which they open
    levers: Array  # (2,), and so on as in a `JawGrasp`
    positions: Array  # (2,)
    palm_at: Array  # (3,)
    checked: Array  # (1,)
    pads: Array  # (3,) of its grasp
    slid: Array  # (2,)


class Exchanged(NamedTuple):
    """The grasps of a body, for `exchange`; groups of arrays are tables."""

    motions: Integers
    grasps: Integers
    room: Integers
    mass: Array  # (2,) of the body now, and its own
    inertia: Array  # (3,) now
    gravity: Array  # (3,) of its own mass
    laden: Flags  # (1,) whether the difference moves with its holders


_whole, _real = np.zeros(1, np.int64), np.zeros(1)
open_jaw = opener(JawArrays(_whole, _whole, *[_real] * 7))
open_exchanged = opener(Exchanged(_whole, _whole, _whole, _real, _real, _real, np.zeros(1, np.bool_)))


@inlined
def _press(axes: Axes, trees: Trees, held: JawArrays) -> float:
    """Force between the fingers of a jaw, by the efforts that their commands ask for."""
    force = np.inf
    for side in range(2):
        effort = min(-held.opening[side] * asked_of(axes, trees, held.fingers[side], STIFFNESS), EFFORT)
        force = min(force, effort / max(held.levers[side], LEAST_LEVER))
    return force


@inlined
def _jumped(trees: Trees, row: int, palm_at: Array) -> bool:
    """Whether a palm was put elsewhere since the last tick."""
    jumped = False
    for a in range(3):
        jumped = jumped or abs(trees.pose[row, a] - palm_at[a]) > JUMP
    return jumped


@kernel
def keeps(handle: int, tree_table: Integers, place_table: Integers, axis_table: Integers, holds: Integers) -> bool:
    """Whether `keep` would find nothing for any of the jaws of ``holds`` (j, words), tables of a `JawArrays`."""
    trees, places, axes = open_trees(tree_table), open_places(place_table), open_axes(axis_table)
    for j in range(holds.shape[0]):
        held = open_jaw(holds[j])
        palm = held.palm[0]
        bring_up(handle, trees, places.tree[palm], places.link[palm] >= 0)
        released = not _press(axes, trees, held) > 0.0 or _jumped(trees, places.row[palm], held.palm_at)
        afresh = not (axes.stopped[held.fingers[0]] and axes.stopped[held.fingers[1]])
        if released or afresh or held.slid[0] > held.checked[0] + CREEP:
            return False
    return True


@kernel
def keep(handle: int, tree_table: Integers, place_table: Integers, axis_table: Integers, hold_table: Integers) -> int:
    """Press the pads of a jaw by the efforts that the commands of its fingers ask for.

    ``hold_table`` is that of a `JawArrays`. Returns the sum of what it finds; a jaw that lets go is left as it is.
    """
    trees, places, axes = open_trees(tree_table), open_places(place_table), open_axes(axis_table)
    held = open_jaw(hold_table)
    palm, force = held.palm[0], _press(axes, trees, held)
    row = places.row[palm]
    bring_up(handle, trees, places.tree[palm], places.link[palm] >= 0)
    if not force > 0.0 or _jumped(trees, row, held.palm_at):
        return RELEASED
    found = CREPT if held.slid[0] > held.checked[0] + CREEP else 0
    held.pads[2] = force
    for a in range(3):
        held.palm_at[a] = trees.pose[row, a]
    for side in range(2):
        if stop_at(
            axes, trees, held.fingers[side], held.positions[side], -held.opening[side] * (force * held.levers[side])
        ):
            found |= AFRESH
    trees.quiet[places.tree[palm]] = False
    return found


@inlined
def _read(handle: int, trees: Trees, places: Places, body: int, pose: Array, twist: Array) -> None:
    """Pose (7,) of the inertial frame of a body, and its twist (6,)."""
    bring_up(handle, trees, places.tree[body], places.link[body] >= 0)
    row = places.row[body]
    for a in range(7):
        pose[a] = trees.pose[row, a]
    for a in range(6):
        twist[a] = trees.twist[row, a]


@kernel
def exchange(
    handle: int, tree_table: Integers, place_table: Integers, total: Array, acted: Flags, table: Integers, dt: float
) -> None:
    """Exchange the impulses of the coming tick between a body and its holders: `Motions.bodies`.

    ``table`` is that of what is `Exchanged`; ``total`` and ``acted`` of `ligature.physics.impulses` are updated. With a
    handle, Bullet gets the impulses; without one the trees must have been read.
    """
    trees, places, held = open_trees(tree_table), open_places(place_table), open_exchanged(table)
    moves = open_motions(held.motions)
    body = moves.bodies[0]
    _read(handle, trees, places, body, moves.body_pose, moves.body_twist)
    for g in range(moves.palm_pose.shape[0]):
        _read(handle, trees, places, moves.bodies[1 + g], moves.palm_pose[g], moves.palm_twist[g])
    moves.inverse[0] = 1.0 / held.mass[0]
    for a in range(3):
        moves.inverse[1 + a] = 1.0 / held.inertia[a]
    for a in range(6):
        moves.pending[a] = total[body, a] if acted[body] else 0.0
    predict_free(held.motions, held.room, held.mass[1], held.gravity, dt)
    if handle != 0 and held.laden[0]:
        for a in range(6):
            trees.wanted[a] = moves.attached_load[a]
        load(handle, trees, places, body)
    solve(held.motions, held.grasps, held.room, dt)
    for i in range(moves.bodies.shape[0]):
        at = moves.bodies[i]
        for a in range(6):
            total[at, a] = moves.impulse[i, a] + (total[at, a] if acted[at] else 0.0)
            trees.wanted[a] = moves.impulse[i, a] / dt
        acted[at] = True
        if handle != 0 and moves.pushable[i]:
            load(handle, trees, places, at)


@inlined
def carry(
    handle: int, tree_table: Integers, place_table: Integers, axis_table: Integers, total: Array, acted: Flags,
    holds: Integers, exchanges: Integers, dt: float,
) -> bool:  # fmt: skip
    """Do what jaws do in a tick in which each holds on to its body; False, and nothing, where one may not.

    The tables are those of a `JawArrays` for each jaw, and of what is `Exchanged` for each body.
    """
    if holds.shape[0] == 0:
        return True
    if not keeps(handle, tree_table, place_table, axis_table, holds):
        return False
    for j in range(holds.shape[0]):
        keep(handle, tree_table, place_table, axis_table, holds[j])
    for b in range(exchanges.shape[0]):
        exchange(handle, tree_table, place_table, total, acted, exchanges[b], dt)
    return True


def warm_up() -> None:
    """Compile the kernels or load them from the cache, so that the first grasp of a run does not wait."""
    group, places, laws = trees(1, 1, 2), Places(*np.array([[0], [0], [0], [-1]])), axes(1, 2)  # tables need them alive
    here, place = table_of(group), table_of(places)
    zero, one = np.zeros(3), np.ones(3)
    hold = JawArrays(
        np.zeros(1, np.int64), np.zeros(2, np.int64), one[:2], one[:2], one[:2], one, zero[:1], zero, zero[:2]
    )
    keep(0, here, place, table_of(laws), table_of(hold))
    moves, held, room = motions(1), grasp_arrays(1), scratch(1)
    tables = table_of(moves), table_of(held), table_of(room)
    exchanged = Exchanged(*tables, one[:2], one, zero, np.zeros(1, np.bool_))
    exchange(0, here, place, np.zeros((1, 6)), np.zeros(1, np.bool_), table_of(exchanged), 1e-3)
    friction_limits(1.0, 1.0, 1.0)
    requested_effort(here, table_of(laws), 0, 1.0)
    stop(here, table_of(laws), 0, 0.0, 0.0)
