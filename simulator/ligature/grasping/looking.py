"""Whether a jaw that holds nothing may find anything between its fingers, for compiled code that passes many ticks.

A search asks Bullet for all bodies that meet the box around both fingers. Bullet's own boxes are those of the begin of
the last tick; none has moved since by more than `Boxes.moved`. World axes, metres.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined
from ligature.physics.bullet import real_at
from ligature.physics.parking import HIGH, LOW, ROUNDING, Boxes
from ligature.physics.trees import open_trees
from ligature.suture.ticking import open_rod_tick
from ligature.tables import opener

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

SEARCH_PERIOD = 5
"""Ticks between two searches for bodies between open fingers."""


class Looks(NamedTuple):
    """The jaws of a world, j of them, and the boxes of `Boxes`, n."""

    due: Integers  # (j,) ticks until a jaw searches; -1 where it does not
    fingers: Flags  # (j, n) boxes of its fingers
    others: Flags  # (j, n) boxes of what it may grasp
    box: Array  # (2, 3) scratch: corners around the fingers


def looks(jaws: int, boxes: int) -> Looks:
    """Arrays for this many jaws and boxes; none searches."""
    none = np.zeros((2, jaws, boxes), np.bool_)
    return Looks(due=np.full(jaws, -1), fingers=none[0].copy(), others=none[1].copy(), box=np.zeros((2, 3)))


open_looks = opener(looks(1, 1))


@inlined
def searches(due: int, passed: int) -> bool:
    """Whether a jaw searches in the tick after ``passed`` ticks."""
    return 0 <= due <= passed and (passed - due) % SEARCH_PERIOD == 0


@inlined
def surround_fingers(boxes: Boxes, looks: Looks, j: int) -> None:
    """Fill `Looks.box` with a box that has the one around both fingers of jaw ``j`` in it."""
    low, high = looks.box[0], looks.box[1]
    for a in range(3):
        low[a], high[a] = np.inf, -np.inf
    for i in range(boxes.at.shape[0]):
        if looks.fingers[j, i]:
            moved = boxes.moved[boxes.tree[i]] + ROUNDING
            for a in range(3):
                low[a] = min(low[a], real_at(boxes.at[i], LOW + a) - moved)
                high[a] = max(high[a], real_at(boxes.at[i], HIGH + a) + moved)


@inlined
def meets_body(boxes: Boxes, looks: Looks, j: int) -> bool:
    """Whether `Looks.box` meets that of a body which jaw ``j`` may grasp."""
    low, high, meets = looks.box[0], looks.box[1], False
    for i in range(boxes.at.shape[0]):
        if looks.others[j, i]:
            apart = False
            for a in range(3):
                apart = apart or real_at(boxes.at[i], LOW + a) > high[a] or real_at(boxes.at[i], HIGH + a) < low[a]
            meets = meets or not apart
    return meets


@inlined
def may_grasp(tree_table: Integers, table: Integers, rods: Integers | None, passed: int) -> bool:
    """Whether a jaw searches after ``passed`` ticks, and may find a body or a part of the ``rods`` (r, w).

    ``table`` is that of `Looks`, or empty. Without ``rods`` nothing of them is compiled.
    """
    if table.shape[0] == 0:
        return False
    boxes, looks = open_trees(tree_table).boxes, open_looks(table)
    for j in range(looks.due.shape[0]):
        if searches(looks.due[j], passed):
            surround_fingers(boxes, looks, j)
            if meets_body(boxes, looks, j):
                return True
            if rods is not None:  # noqa: SIM102 - Numba leaves out a branch by None alone
                if _has_element(rods, looks.box):
                    return True
    return False


@inlined
def _has_element(rods: Integers, box: Array) -> bool:
    """Whether the centre of an element is in a box (2, 3)."""
    for r in range(rods.shape[0]):
        positions = open_rod_tick(rods[r]).positions
        for i in range(positions.shape[0]):
            inside = True
            for a in range(3):
                inside = inside and box[0, a] <= positions[i, a] <= box[1, a]
            if inside:
                return True
    return False
