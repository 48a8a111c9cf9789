"""What the grasps of a world need in each tick, as compiled calls on its trees: nothing else asks for Python then.

World axes, SI units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.grasping.fingers import EFFORT, LEAST_LEVER, STIFFNESS
from ligature.grasping.friction import grasp_arrays, motions, open_motions, predict_free, scratch, solve
from ligature.kernels import inlined, kernel
from ligature.physics.axes import asked_of, axes, open_axes, stop_at
from ligature.physics.trees import Places, Trees, bring_up, load, open_places, open_trees, trees
from ligature.tables import table_of

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

JUMP = 0.01
"""Displacement in metres of a holder within a tick beyond which it was put elsewhere."""

CREEP = 0.2e-3
"""Slip in metres after which a jaw checks that the body is still between its pads."""

RELEASED, AFRESH, CREPT = 1, 2, 4
"""What `keep` finds: the jaw lets go; a finger was not stopped before; the body has slipped by `CREEP`."""


@kernel
def keep(
    handle: int, tree_table: Integers, place_table: Integers, axis_table: Integers, palm: int, fingers: Integers,
    opening: Array, levers: Array, positions: Array, palm_at: Array, pads: Array, slid: Array, checked: float,
) -> int:  # fmt: skip
    """Press the pads of a jaw by the efforts that the commands of its ``fingers`` (2,), axes of the world, ask for.

    ``opening`` (2,) are the directions in which they open, ``levers``, ``positions`` (2,), ``palm_at`` (3,)
    and ``checked`` of a `JawGrasp`, ``pads`` (3,) and ``slid`` (2,) those of its grasp. Returns the sum of what it
    finds; a jaw that lets go is left as it is.
    """
    trees, places, axes = open_trees(tree_table), open_places(place_table), open_axes(axis_table)
    force = np.inf
    for side in range(2):
        effort = min(-opening[side] * asked_of(axes, trees, fingers[side], STIFFNESS), EFFORT)
        force = min(force, effort / max(levers[side], LEAST_LEVER))
    row, jumped = places.row[palm], False
    bring_up(handle, trees, places.tree[palm], places.link[palm] >= 0)
    for a in range(3):
        jumped = jumped or abs(trees.pose[row, a] - palm_at[a]) > JUMP
    if not force > 0.0 or jumped:
        return RELEASED
    found = CREPT if slid[0] > checked + CREEP else 0
    pads[2] = force
    for a in range(3):
        palm_at[a] = trees.pose[row, a]
    for side in range(2):
        if stop_at(axes, trees, fingers[side], positions[side], -opening[side] * (force * levers[side])):
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
    handle: int, tree_table: Integers, place_table: Integers, total: Array, acted: Flags, motion_table: Integers,
    grasp_table: Integers, room_table: Integers, mass: float, inertia: Array, own_mass: float, gravity: Array,
    laden: bool, dt: float,
) -> None:  # fmt: skip
    """Exchange the impulses of the coming tick between a body and its holders: `Motions.bodies`.

    ``mass`` and ``inertia`` (3,) are those of the body now, ``own_mass`` and ``gravity`` (3,) its own; with ``laden``,
    the difference moves with its holders. ``total`` and ``acted`` of `ligature.physics.impulses` are updated. With a
    handle, Bullet gets the impulses; without one the trees must have been read.
    """
    trees, places, moves = open_trees(tree_table), open_places(place_table), open_motions(motion_table)
    body = moves.bodies[0]
    _read(handle, trees, places, body, moves.body_pose, moves.body_twist)
    for g in range(moves.palm_pose.shape[0]):
        _read(handle, trees, places, moves.bodies[1 + g], moves.palm_pose[g], moves.palm_twist[g])
    moves.inverse[0] = 1.0 / mass
    for a in range(3):
        moves.inverse[1 + a] = 1.0 / inertia[a]
    for a in range(6):
        moves.pending[a] = total[body, a] if acted[body] else 0.0
    predict_free(motion_table, room_table, own_mass, gravity, dt)
    if handle != 0 and laden:
        for a in range(6):
            trees.wanted[a] = moves.attached_load[a]
        load(handle, trees, places, body)
    solve(motion_table, grasp_table, room_table, dt)
    for i in range(moves.bodies.shape[0]):
        at = moves.bodies[i]
        for a in range(6):
            total[at, a] = moves.impulse[i, a] + (total[at, a] if acted[at] else 0.0)
            trees.wanted[a] = moves.impulse[i, a] / dt
        acted[at] = True
        if handle != 0 and moves.pushable[i]:
            load(handle, trees, places, at)


def warm_up() -> None:
    """Compile the kernels or load them from the cache, so that the first grasp of a run does not wait."""
    group, places, laws = trees(1, 1, 2), Places(*np.array([[0], [0], [0], [-1]])), axes(1, 2)  # tables need them alive
    moves, held, room = motions(1), grasp_arrays(1), scratch(1)
    here, place = table_of(group), table_of(places)
    both, one, zero = np.zeros(2, dtype=np.int64), np.ones(2), np.zeros(3)
    keep(0, here, place, table_of(laws), 0, both, one, one, one, zero, zero, zero[:2], 0.0)
    total, acted = np.zeros((1, 6)), np.zeros(1, np.bool_)
    tables = table_of(moves), table_of(held), table_of(room)
    exchange(0, here, place, total, acted, *tables, 1.0, np.ones(3), 1.0, zero, False, 1e-3)
