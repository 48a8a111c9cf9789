"""The search for passages: which needles and threads have entered which holes, and when to look again."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import kernel
from ligature.suture.tracking import look_for_needles, look_for_rod, next_search
from ligature.tables import opener

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

NEAR = 0.01
"""Distance in metres within which a hole's pose is read at every search."""

MAX_APPROACH = 0.5
"""Maximum speed in m/s of needles and threads between two searches."""

MAX_WAIT = 32
"""Most ticks between two searches for passages."""


SEARCHED, LOOKED, SOLVED = 1, 2, 3
"""How far compiled code has come in `Suture.step`: holes are searched, bodies around rods are read too, all is done."""


class Search(NamedTuple):
    """What a search takes: L paths, r rods the last of them, and H holes; groups of arrays are tables."""

    countdown: Integers  # (1,) ticks until the next search
    turn: Integers  # (1,) the hole that was read last although none is near; -1 before the first
    near: Flags  # (H,)
    gaps: Array  # (L, H) lower bounds of distances
    watched: Integers  # (w,) needles, then the bodies of the holes
    motion: Array  # (w, 13) of them
    passages: Integers
    paths: Integers
    sites: Integers
    rods: Integers  # (r, words) of their nodes
    first: Integers  # (r,) node of the first element
    elements: Integers  # (r,)
    before: Array  # (r, most elements + 1) length up to each element
    dt: Array  # (1,) seconds a tick


_whole, _real = np.zeros(1, np.int64), np.zeros(1)
open_search = opener(
    Search(
        countdown=_whole,
        turn=_whole,
        near=np.zeros(1, np.bool_),
        gaps=np.zeros((1, 1)),
        watched=_whole,
        motion=np.zeros((1, 13)),
        passages=_whole,
        paths=_whole,
        sites=_whole,
        rods=np.zeros((1, 1), np.int64),
        first=_whole,
        elements=_whole,
        before=np.zeros((1, 1)),
        dt=_real,
    )  # fmt: skip
)


@kernel
def search(table: Integers) -> None:
    """Find paths that have entered holes, by ``motion`` now, and the number of ticks in which no other can."""
    s = open_search(table)
    s.turn[0] = (s.turn[0] + 1) % s.near.shape[0]
    s.near[s.turn[0]] = True
    rods = s.first.shape[0]
    needles = s.gaps.shape[0] - rods
    look_for_needles(s.passages, s.paths, s.sites, needles, s.motion, s.near, s.gaps)
    for r in range(rods):
        look_for_rod(
            s.passages, s.sites, s.rods[r], s.first[r], s.before[r, : s.elements[r] + 1], needles + r, r,
            s.gaps[needles + r],
        )  # fmt: skip
    s.countdown[0] = next_search(s.gaps, s.near, NEAR, MAX_APPROACH * s.dt[0], MAX_WAIT)
