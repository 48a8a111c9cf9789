"""The search for passages: which needles and threads have entered which holes, and when to look again."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.suture.passages import CAPACITY
from ligature.suture.tracking import (
    follow_needle,
    follow_rod,
    look_for_needles,
    look_for_rod,
    next_search,
    open_passages,
    open_paths,
    open_sites,
)
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


SEARCHED, FOLLOWED, LOOKED, SOLVED = 1, 2, 3, 4
"""How far compiled code has come in `Suture.step`.

Holes are searched; passages are followed, too; bodies around rods are read, too; all is done.
"""


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
    mobile: Flags  # (H,) whether the hole's body moves
    lasting: Flags  # (C,) the passages that `follow` found to last
    reaction: Array  # (6,) scratch


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
        mobile=np.zeros(1, np.bool_),
        lasting=np.zeros(CAPACITY, np.bool_),
        reaction=np.zeros(6),
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


@kernel
def follow(table: Integers) -> bool:
    """Bring all passages up to date, by ``motion`` now; whether all are `Search.lasting`."""
    s = open_search(table)
    p, paths, sites = open_passages(s.passages), open_paths(s.paths), open_sites(s.sites)
    needles, whole = s.gaps.shape[0] - s.first.shape[0], True
    for hole in range(sites.shared.shape[0]):
        sites.shared[hole] = 0
    for c in range(p.filled[0]):
        hole, path = p.hole[c], p.path[c]
        sites.shared[hole] += 1
        place(s, sites.pose[hole], sites.twist[hole], needles + hole)
        if path < needles:
            for a in range(7):
                paths.pose[path, a] = s.motion[path, a]
    for c in range(p.filled[0]):
        r = p.path[c] - needles
        if r < 0:
            s.lasting[c] = follow_needle(s.passages, s.paths, s.sites, c)
        else:
            s.lasting[c] = follow_rod(
                s.passages, s.paths, s.sites, s.rods[r], s.first[r], s.before[r, : s.elements[r] + 1], c
            )
        whole = whole and s.lasting[c]
    return whole


@inlined
def place(s: Search, pose: Array, twist: Array, row: int) -> None:
    """Set a ``pose`` (7,) and ``twist`` (6,) to those of a row of ``motion``."""
    for a in range(7):
        pose[a] = s.motion[row, a]
    for a in range(6):
        twist[a] = s.motion[row, 7 + a]
