"""The same as `looking` where there are threads; it stands alone as they do. World axes, metres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.grasping.looking import meets_body, open_looks, searches, surround_fingers
from ligature.kernels import inlined
from ligature.physics.trees import open_trees
from ligature.suture.ticking import open_rod_tick

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@inlined
def may_grasp_threads(tree_table: Integers, table: Integers, rods: Integers, passed: int) -> bool:
    """Whether a jaw searches after ``passed`` ticks, and may find a body or a part of the ``rods`` (r, w)."""
    if table.shape[0] == 0:
        return False
    boxes, looks = open_trees(tree_table).boxes, open_looks(table)
    for j in range(looks.due.shape[0]):
        if searches(looks.due[j], passed):
            surround_fingers(boxes, looks, j)
            if meets_body(boxes, looks, j) or _has_element(rods, looks.box):
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
