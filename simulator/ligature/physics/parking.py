"""Takes boxes of bodies that rest, far from all that moves, out of Bullet's comparison of all pairs for one tick.

Two boxes that are where the last tick had them overlap as they did then, and one that moved overlaps none that is
farther away than it moved. So Bullet finds the same pairs. It skips boxes without an owner; the owners are put back
after the tick, for rays and other questions. Boxes that have a pair keep theirs, for Bullet looks for contacts of all
pairs. World axes, metres.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined
from ligature.physics.bullet import (
    BOX_BYTES,
    FIRST_BOX,
    FIRST_PAIR,
    LAST_BOX,
    PAIR_BYTES,
    PAIR_COUNT,
    PAIRS,
    put_word,
    real_at,
    whole_at,
    word_at,
)

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

ROUNDING = 1e-6
"""What Bullet's sums may differ from ours, in metres, and more."""

LOW, HIGH = 3, 7
"""Where the corners of a box are, in real numbers from its begin."""


class Boxes(NamedTuple):
    """The boxes of a world that may be taken out, n of them, of k trees; none where nothing may sleep."""

    phase: Integers  # (1,) address of the broad phase
    at: Integers  # (n,) addresses of the boxes
    owner: Integers  # (n,) what each belongs to
    tree: Integers  # (n,)
    row: Integers  # (s,) which of these each place of the broad phase has, -1 is another
    moved: Array  # (k,) how far any point of a tree has moved since its boxes were compared, at most
    parked: Flags  # (k,) whether a tree is where it was then
    out: Flags  # (n,) what is taken out in this tick
    last: Integers  # (1,) scratch


def boxes(trees: int, count: int = 0, places: int = 0) -> Boxes:
    """Arrays for ``count`` boxes of this number of trees; what has not been compared yet may be anywhere."""
    z, whole = np.zeros, np.int64
    return Boxes(
        phase=z(1, whole), at=z(count, whole), owner=z(count, whole), tree=z(count, whole), row=np.full(places, -1),
        moved=np.full(trees, np.inf), parked=z(trees, np.bool_), out=z(count, np.bool_), last=z(1, whole),
    )  # fmt: skip


@inlined
def park(boxes: Boxes) -> None:
    """Take out what need not be compared in the coming tick; `unpark` is to follow."""
    if boxes.at.shape[0] == 0:  # without boxes there is no address of the broad phase either
        return
    for k in range(boxes.parked.shape[0]):
        if not (boxes.parked[k] or boxes.moved[k] < np.inf):
            return
    for i in range(boxes.at.shape[0]):
        boxes.out[i] = boxes.parked[boxes.tree[i]] and word_at(boxes.at[i]) == boxes.owner[i]
    _keep_paired(boxes)
    for i in range(boxes.at.shape[0]):
        k = boxes.tree[i]
        if not boxes.parked[k]:
            _keep_near(boxes, boxes.at[i], boxes.moved[k] + ROUNDING)
    boxes.last[0] = word_at(boxes.phase[0] + LAST_BOX)
    for i in range(boxes.at.shape[0]):
        if boxes.out[i]:
            put_word(boxes.at[i], 0)


@inlined
def unpark(boxes: Boxes) -> None:
    """Put back what `park` took out."""
    found = False
    for i in range(boxes.at.shape[0]):
        if boxes.out[i]:
            put_word(boxes.at[i], boxes.owner[i])
            boxes.out[i], found = False, True
    if found:  # Bullet goes on to the last box that has an owner
        put_word(boxes.phase[0] + LAST_BOX, boxes.last[0])


@inlined
def _keep_paired(boxes: Boxes) -> None:
    """Keep the boxes that Bullet has a pair of."""
    for j in range(count_pairs(boxes)):
        for side in range(2):
            i = paired(boxes, j, side)
            if i >= 0:
                boxes.out[i] = False


@inlined
def count_pairs(boxes: Boxes) -> int:
    """How many pairs of boxes Bullet has."""
    return whole_at(word_at(boxes.phase[0] + PAIRS) + PAIR_COUNT)


@inlined
def paired(boxes: Boxes, j: int, side: int) -> int:
    """Which box is on a ``side``, 0 or 1, of Bullet's ``j``-th pair; -1 is another than these."""
    at = word_at(word_at(boxes.phase[0] + PAIRS) + FIRST_PAIR) + PAIR_BYTES * j + 8 * side
    place = (word_at(at) - word_at(boxes.phase[0] + FIRST_BOX)) // BOX_BYTES
    return boxes.row[place] if 0 <= place < boxes.row.shape[0] else -1


@inlined
def _keep_near(boxes: Boxes, box: int, moved: float) -> None:
    """Keep the boxes that the one at an address may overlap, which has ``moved`` so far at most."""
    for i in range(boxes.at.shape[0]):
        if boxes.out[i]:
            apart, other = False, boxes.at[i]
            for a in range(3):
                apart = apart or real_at(box, LOW + a) - moved > real_at(other, HIGH + a)
                apart = apart or real_at(other, LOW + a) - moved > real_at(box, HIGH + a)
            boxes.out[i] = apart
