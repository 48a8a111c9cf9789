"""The search for needles and threads in holes within ticks that are one compiled call."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined
from ligature.physics.trees import load_body, read_bodies
from ligature.suture.passage_forces import react
from ligature.suture.searching import FOLLOWED, SEARCHED, follow, open_search, search
from ligature.suture.tracking import open_passages, open_sites

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]


@inlined
def find_passages(handle: int, tree_table: Integers, place_table: Integers, table: Integers) -> int:
    """Search for passages where it is time to, else count this tick, and follow those that there are.

    Returns `SEARCHED` where there are new ones, which are not followed yet, `FOLLOWED` where one has ended, else 0.
    ``table`` is that of a `Search`, empty in a scene where nothing can be in a hole.
    """
    if table.shape[0] == 0:
        return 0
    s = open_search(table)
    p = open_passages(s.passages)
    before = p.filled[0]
    if s.countdown[0] > 0:
        s.countdown[0] -= 1
    else:
        read_bodies(handle, tree_table, place_table, s.watched, s.motion)
        search(table)
    if p.filled[0] > before:
        return SEARCHED
    if before == 0:
        return 0
    read_bodies(handle, tree_table, place_table, s.watched, s.motion)
    return 0 if follow(table) else FOLLOWED


@inlined
def react_all(
    handle: int, tree_table: Integers, place_table: Integers, table: Integers, total: Array, acted: Flags, dt: float
) -> None:
    """Apply the reactions of all passages to the bodies of their holes; the rods have ticked."""
    if table.shape[0] == 0:
        return
    s = open_search(table)
    p, sites = open_passages(s.passages), open_sites(s.sites)
    needles = s.gaps.shape[0] - s.first.shape[0]
    for c in range(p.filled[0]):
        hole, out = p.hole[c], s.reaction
        react(s.passages, sites.pose, c, out)
        if s.mobile[hole]:
            body = s.watched[needles + hole]
            for a in range(6):
                total[body, a] = total[body, a] + out[a] if acted[body] else out[a]
            acted[body] = True
            load_body(handle, tree_table, place_table, body, out[:3], out[3:], dt)
