"""What acts on bodies in every tick, the laws of joints, damping and gravity, and ticks with nothing else, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import kernel
from ligature.physics.axes import act
from ligature.physics.trees import push_bodies, slow_down, step_world

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


@kernel
def coast(
    handle: int, tree_table: Integers, axis_table: Integers, place_table: Integers, slowed: Integers, factors: Array,
    lifted: Integers, forces: Array, dt: float, limit: float, ticks: int,
) -> tuple[int, bool]:  # fmt: skip
    """Advance by up to ``ticks``, in each as `World` does; ends after one in which a speed is not below ``limit``.

    The other arguments are those of `prepare`. Returns how many ticks passed, and whether all speeds are finite and
    below the limit.
    """
    for passed in range(ticks):
        prepare(handle, tree_table, axis_table, place_table, slowed, factors, lifted, forces, dt)
        if not step_world(handle, tree_table, limit):
            return passed + 1, False
    return ticks, True
