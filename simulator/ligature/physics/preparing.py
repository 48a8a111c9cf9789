"""What acts on bodies in every tick, the laws of joints, damping and gravity, as one compiled call."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import kernel
from ligature.physics.axes import act
from ligature.physics.trees import push_bodies, slow_down

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@kernel
def prepare(
    handle: int, tree_table: Integers, axis_table: Integers, place_table: Integers, slowed: Integers, factors: Array,
    lifted: Integers, forces: Array, dt: float,
) -> None:  # fmt: skip
    """Have Bullet take motors, damping and gravity of the coming tick.

    ``slowed`` and ``factors`` are those of `slow_down`, ``lifted`` and ``forces`` those of `push_bodies`.
    """
    act(handle, tree_table, axis_table, dt)
    if slowed.shape[0] > 0:
        slow_down(handle, tree_table, slowed, factors)
    if lifted.shape[0] > 0:
        push_bodies(handle, tree_table, place_table, lifted, forces)
