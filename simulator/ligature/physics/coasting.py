"""Ticks in which nothing but the laws of joints, damping and gravity acts on bodies, as one compiled call."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import kernel
from ligature.physics.axes import act
from ligature.physics.trees import push_bodies, slow_down, step_world

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@kernel
def coast(
    handle: int, tree_table: Integers, axis_table: Integers, place_table: Integers, slowed: Integers, factors: Array,
    lifted: Integers, forces: Array, limit: float, dt: float, ticks: int,
) -> tuple[int, bool]:  # fmt: skip
    """Advance by up to ``ticks``, in each as `World` does; ends after one in which a speed is not below ``limit``.

    ``slowed`` and ``factors`` are those of `slow_down`, ``lifted`` and ``forces`` those of `push_bodies`. Returns how
    many ticks passed, and whether all speeds are finite and below the limit.
    """
    for passed in range(ticks):
        act(handle, tree_table, axis_table, dt)
        if slowed.shape[0] > 0:
            slow_down(handle, tree_table, slowed, factors)
        if lifted.shape[0] > 0:
            push_bodies(handle, tree_table, place_table, lifted, forces)
        if not step_world(handle, tree_table, limit):
            return passed + 1, False
    return ticks, True
