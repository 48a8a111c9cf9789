"""Ticks of a scene without threads, as compiled code.

It stands alone so that such a scene neither compiles nor loads the equations of threads.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.coasting.clock import now
from ligature.coasting.passages import find_passages
from ligature.kernels import kernel
from ligature.physics.preparing import prepare
from ligature.physics.trees import step_world
from ligature.suture.searching import SEARCHED, SOLVED

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


@kernel
def coast(
    handle: int, tree_table: Integers, axis_table: Integers, place_table: Integers, slowed: Integers, factors: Array,
    lifted: Integers, forces: Array, acted: Flags, search: Integers, clock: Integers, spent: Array, dt: float,
    limit: float, ticks: int, begins: int,
) -> tuple[int, int, bool]:  # fmt: skip
    """Advance by up to ``ticks``, and begin another one, as `ligature.coasting.threads.coast` does."""
    begin = now(clock)
    for passed in range(ticks + begins):
        for body in range(acted.shape[0]):
            acted[body] = False
        prepare(handle, tree_table, axis_table, place_table, slowed, factors, lifted, forces, dt)
        prepared = now(clock)
        spent[0] += prepared - begin
        if find_passages(handle, tree_table, place_table, search):
            return passed, SEARCHED, True
        searched = now(clock)
        spent[1] += searched - prepared
        if passed == ticks:
            return passed, SOLVED, True
        sound = step_world(handle, tree_table, limit)
        begin = now(clock)
        spent[2] += begin - searched
        if not sound:
            return passed + 1, 0, False
    return ticks, 0, True
