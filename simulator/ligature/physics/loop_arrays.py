"""Arrays of mechanisms with loops, for the kernels that close them (`ligature.physics.projection`)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.tables import opener

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


class Loops(NamedTuple):
    """Mechanisms, with loops or of one tree: m mechanisms of t trees and c closures; r rows and a axes of all trees.

    At most n coordinates and k = 6 c + n rows of constraints in a mechanism.
    """

    tree: Integers  # (t,) the trees of each mechanism
    tree_begin: Integers  # (m + 1,) the first of them, and the end
    begin: Integers  # (m + 1,) first closure of each mechanism, and the end
    size: Integers  # (m,) coordinates
    extent: Array  # (m,) size in metres
    column: Integers  # (r,) the first coordinate of each row's own joint in its mechanism
    width: Integers  # (r,) their number: 0, 1, or 6 for a free base
    end_row: Integers  # (c, 2) the rows that a closure joins
    end_frame: Array  # (c, 2, 7) the frames that meet, in the inertial frames of the rows
    point: Flags  # (c,) whether it holds a point only
    low: Array  # (a,) limits of axes
    high: Array
    gap: Array  # (c,) metres by which closures are open
    moved: Integers  # (m,) what the last call did with a mechanism: `UNMOVED`, `MOVED` or `FAILED`
    end: Array  # (2, 7) scratch from here: poses of the frames
    error: Array  # (k,) gaps of all rows
    inertia: Array  # (r, 10) of each row and what it carries: mass, first moments, second moments xx yy zz xy xz yz
    axis: Array  # (n, 6) spatial vectors of the coordinates
    first: Integers  # (n,) first coordinate of the tree of each
    linear: Flags  # (n,) whether it is in metres
    M: Array  # (n, n) mass matrix, then its factor
    J: Array  # (k, n)
    row_of: Integers  # (k,) the rows of J that count
    rank: Integers  # (1,) how many of them belong to closures; rows of single coordinates follow
    firm: Integers  # (1,) how many of these, the first ones, a way of less than `FLAT` times their gap closes
    B: Array  # (k, n) these rows times the inverse factor, each divided by `scale`
    scale: Array  # (k,)
    A: Array  # (k, k) B Bᵀ and its factor
    multiplier: Array  # (k,)
    step: Array  # (n,)
    shift: Array  # (n,) what the projection changed of the coordinates so far
    place: Array  # (n,) coordinates of axes
    bound: Array  # (n, 2) limits of coordinates
    speed: Array  # (n,)
    most: Array  # (n,) largest speeds
    wanted: Array  # (13 + 2 n,) what is on its way to Bullet
    wanted_at: Integers  # (1,) its address


def loops(mechanisms: int, trees: int, closures: int, rows: int, axes: int, most: tuple[int, int]) -> Loops:
    """Arrays for this number of mechanisms, of ``most`` (coordinates, closures) each."""
    z, whole, no, n = np.zeros, np.int64, np.bool_, most[0]
    k = 6 * most[1] + n
    wanted = z(13 + 2 * n)
    return Loops(
        tree=z(trees, whole), tree_begin=z(mechanisms + 1, whole), begin=z(mechanisms + 1, whole),
        size=z(mechanisms, whole), extent=z(mechanisms), column=z(rows, whole), width=z(rows, whole),
        end_row=z((closures, 2), whole), end_frame=z((closures, 2, 7)), point=z(closures, no), low=z(axes),
        high=z(axes), gap=z(closures), moved=z(mechanisms, whole), end=z((2, 7)), error=z(k), inertia=z((rows, 10)),
        axis=z((n, 6)), first=z(n, whole), linear=z(n, no), M=z((n, n)), J=z((k, n)), row_of=z(k, whole),
        rank=z(1, whole), firm=z(1, whole), B=z((k, n)), scale=z(k), A=z((k, k)), multiplier=z(k), step=z(n),
        shift=z(n), place=z(n), bound=z((n, 2)), speed=z(n), most=z(n), wanted=wanted,
        wanted_at=np.array([wanted.ctypes.data]),
    )  # fmt: skip


open_loops = opener(loops(1, 1, 1, 1, 1, (1, 1)))
