"""The search for needles and threads in holes within ticks that are one compiled call."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined
from ligature.physics.trees import read_bodies
from ligature.suture.searching import open_search, search
from ligature.suture.tracking import open_passages

Integers = NDArray[np.int64]


@inlined
def find_passages(handle: int, tree_table: Integers, place_table: Integers, table: Integers) -> bool:
    """Search for passages where it is time to, else count this tick; whether there is one now.

    ``table`` is that of a `Search`, empty in a scene where nothing can be in a hole.
    """
    if table.shape[0] == 0:
        return False
    s = open_search(table)
    if s.countdown[0] > 0:
        s.countdown[0] -= 1
        return False
    read_bodies(handle, tree_table, place_table, s.watched, s.motion)
    search(table)
    return bool(open_passages(s.passages).filled[0] > 0)
