"""Spares Bullet's broad phase the ticks in which no two boxes begin or cease to overlap.

Where Bullet compares all pairs of boxes it looks up each of the n²/2 pairs in its table of pairs, in every tick, which
took a third of its step; the table changes only where the comparison of two boxes comes out differently. Compiled code
stands before Bullet's function therefore: it compares all boxes in a microsecond and calls that function only when a
pair came or went, or somebody changed which pairs collide. What Bullet does otherwise is what it did.

Bullet reaches the function through the table of functions that the first word of each C++ object points to. The object
gets a copy of its table, in which one entry is replaced, with the arrays of compiled code behind it. Its layout is
checked against what Bullet writes into it; where anything differs, Bullet goes on alone.

Sources: Bullet's `btSimpleBroadphase` and `btHashedOverlappingPairCache`; Itanium C++ ABI, virtual table layout.
"""

from __future__ import annotations

import ctypes
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import callback, inlined
from ligature.physics import objects
from ligature.physics.bullet import call_method, real_at, whole_at, word_at
from ligature.tables import opener, table_at, table_of

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

SIMPLE, HASHED = "18btSimpleBroadphase", "28btHashedOverlappingPairCache"
"""Names of the classes of a broad phase that compares all pairs, and of its table of pairs, in Bullet's library."""

ENTRIES, BEFORE, CALCULATE = 14, 2, 8
"""Functions in the table of a broad phase, words before the first of them, and which finds overlapping pairs."""

LAST, HANDLES, PAIRS = 16, 24, 48
"""Bytes into a broad phase: number of the last box, address of the boxes, address of the table of pairs."""

PAIR_COUNT = 12
"""Bytes into the table of pairs: how many there are."""

STRIDE, OBJECT, FILTER, NUMBER, LOW, HIGH = 96, 0, 8, 16, 24, 56
"""Bytes of a box, and into it: the object that has it, group and mask of what collides, its number, its corners."""

FIRST_NUMBER = 2
"""Number that Bullet gives to the first box."""

MOST = 512
"""Boxes up to which they are compared here; with more, Bullet does so as ever."""


class Boxes(NamedTuple):
    """What compiled code knows of a broad phase."""

    own: Integers  # (1,) address of Bullet's function
    seen: Integers  # (3,) boxes and pairs after Bullet's function last looked, and whether it must look again
    corners: Array  # (6, N) lower and upper corners
    meet: Flags  # (N, N) which boxes overlap, above the diagonal


def boxes() -> Boxes:
    """Arrays for `MOST` boxes, of which nothing is known."""
    return Boxes(
        np.zeros(1, np.int64), np.array([-1, -1, 1]), np.zeros((6, MOST)), np.zeros((MOST, MOST), dtype=np.bool_)
    )


open_boxes = opener(boxes())


@callback("void(intp, intp)")
def find_pairs(broad_phase: int, dispatcher: int) -> None:
    """What Bullet calls in each tick to bring its table of pairs up to date."""
    known = open_boxes(table_at(word_at(broad_phase) + 8 * ENTRIES))
    if need_look(known, broad_phase):
        call_method(known.own[0], broad_phase, dispatcher)
        known.seen[0], known.seen[1] = whole_at(broad_phase + LAST), whole_at(word_at(broad_phase + PAIRS) + PAIR_COUNT)
        known.seen[2] = 0


@inlined
def need_look(known: Boxes, broad_phase: int) -> bool:
    """Whether Bullet's table of pairs may change."""
    last, handles = whole_at(broad_phase + LAST), word_at(broad_phase + HANDLES)
    need = known.seen[2] != 0 or known.seen[0] != last
    need = need or known.seen[1] != whole_at(word_at(broad_phase + PAIRS) + PAIR_COUNT)
    if last >= MOST:
        return True
    corners = known.corners
    for i in range(last + 1):
        at = handles + STRIDE * i
        alone = word_at(at + OBJECT) == 0 or word_at(at + FILTER) == 0
        for a in range(3):
            corners[a, i] = np.inf if alone else real_at(at + LOW, a)
            corners[3 + a, i] = -np.inf if alone else real_at(at + HIGH, a)
    return _compare(last + 1, corners, known.meet) or need


@inlined
def _compare(count: int, corners: Array, meet: Flags) -> bool:
    """Bring ``meet`` up to date; whether it changed."""
    low_x, low_y, low_z, high_x, high_y, high_z = corners
    changed = False
    for i in range(count):
        row = meet[i]
        ax, ay, az, bx, by, bz = low_x[i], low_y[i], low_z[i], high_x[i], high_y[i], high_z[i]
        for j in range(i + 1, count):
            along = (ax <= high_x[j]) & (low_x[j] <= bx)
            across = (ay <= high_y[j]) & (low_y[j] <= by) & (az <= high_z[j]) & (low_z[j] <= bz)
            now = along & across
            changed |= now != row[j]
            row[j] = now
    return changed


class BroadPhase:
    """The broad phase of a client, spared what changes nothing where that is possible.

    Keep it as long as the client, which works with its memory.

    Attributes
    ----------
    active
        Whether compiled code stands before Bullet's.
    """

    def __init__(self, handle: int) -> None:
        self._boxes = boxes()
        address = objects.part(handle, SIMPLE) if handle else 0
        self.active = bool(address) and _is_as_known(address)
        if self.active:
            self._stand_before(address)

    def _stand_before(self, address: int) -> None:
        table = objects.words(objects.words(address, 1)[0] - 8 * BEFORE, BEFORE + ENTRIES)
        self._boxes.own[0] = table[BEFORE + CALCULATE]
        self._table = np.concatenate([table, table_of(self._boxes)])
        self._table[BEFORE + CALCULATE] = find_pairs()
        ctypes.c_int64.from_address(address).value = self._table.ctypes.data + 8 * BEFORE

    def forget(self) -> None:
        """Others collide from now on: have Bullet look at all pairs again."""
        self._boxes.seen[2] = 1


def _is_as_known(address: int) -> bool:
    """Whether the object at an address is laid out as above, by what Bullet has written into it."""
    found = objects.words(address, 8)
    pairs, last, handles = int(found[PAIRS // 8]), int(found[LAST // 8]) & 0xFFFFFFFF, int(found[HANDLES // 8])
    if objects.class_of(pairs) != HASHED or not 0 < last < MOST:
        return False
    rows = objects.words(handles, (last + 1) * STRIDE // 8)
    if len(rows) < (last + 1) * STRIDE // 8:
        return False
    rows = rows.reshape(last + 1, STRIDE // 8)
    numbers = rows[:, NUMBER // 8] & 0xFFFFFFFF
    low, high = (rows.view(np.float64)[:, at // 8 : at // 8 + 3] for at in (LOW, HIGH))
    held = rows[:, OBJECT // 8] != 0
    return bool((numbers == np.arange(last + 1) + FIRST_NUMBER).all() and (low[held] <= high[held]).all())
