"""Ticks of rods for compiled code that does other parts of a tick, too: what one takes is one table for each rod.

Other kernels call `tick_rod` by its address. Numba would make its code, two thirds of all, part of each of them, which
took half a minute of compilation and 8 MB of each process.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernel_links import link, offer
from ligature.kernels import inlined, kernel
from ligature.suture.substeps import open_rod, run_tick
from ligature.tables import opener

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


class RodTick(NamedTuple):
    """What a tick of one rod takes; groups of arrays are the tables of `ligature.tables`."""

    rod: Integers
    touches: Integers  # (3, t) three buffers of contact points
    order: Integers  # (3,) which of them has the last tick's, which is for the next one's, which is scratch
    passages: Integers
    owner: Integers  # (1,) of its own among the passages
    springs: Integers
    constraints: Integers  # (g, 3)
    points: Array  # (g, 3, 2, 3)
    motion: Array  # (b, 13) of the bodies around
    met: Integers  # (m, 2) rows of `motion`, and their nodes
    positions: Array  # (n, 3) of the elements
    body: Integers  # (N,) the movable body of each node, -1 for others


_whole, _pairs = np.zeros(1, np.int64), np.zeros((1, 1), np.int64)
open_rod_tick = opener(
    RodTick(
        rod=_whole,
        touches=_pairs,
        order=_whole,
        passages=_whole,
        owner=_whole,
        springs=_whole,
        constraints=_pairs,
        points=np.zeros((1, 1, 1, 1)),
        motion=np.zeros((1, 1)),
        met=_pairs,
        positions=np.zeros((1, 1)),
        body=_whole,
    )  # fmt: skip
)


@kernel
def tick_rod(address: int) -> None:
    """One tick of the rod whose `RodTick` has its table at ``address``; see `run_tick`.

    Its contacts then are the last tick's.
    """
    tick = open_rod_tick(address)
    last, next_, scratch = tick.order[0], tick.order[1], tick.order[2]
    run_tick(
        tick.rod, tick.touches[last], tick.touches[next_], tick.touches[scratch], tick.passages, tick.owner[0],
        tick.springs, tick.constraints, tick.points, tick.motion, tick.met,
    )  # fmt: skip
    if open_rod(tick.rod).counts[3] == 1:
        tick.order[0], tick.order[1], tick.order[2] = scratch, last, next_
    else:
        tick.order[0], tick.order[1], tick.order[2] = next_, scratch, last


call_tick_rod = link("ligature_tick_rod")
"""`tick_rod` for other kernels; `offer_ticks` comes before the first of them is loaded."""


def offer_ticks() -> None:
    """Compile or load `tick_rod`, and let other kernels call it."""
    offer("ligature_tick_rod", tick_rod)


@inlined
def surround(ticks: Integers, corners: Array) -> None:
    """Corners (2, 3) of the box around all elements of the rods with the tables ``ticks`` (r, w)."""
    for a in range(3):
        corners[0, a], corners[1, a] = np.inf, -np.inf
    for r in range(ticks.shape[0]):
        positions = open_rod_tick(ticks[r]).positions
        for i in range(positions.shape[0]):
            for a in range(3):
                corners[0, a] = min(corners[0, a], positions[i, a])
                corners[1, a] = max(corners[1, a], positions[i, a])
