"""A tick reads nothing that an earlier tick left but what a snapshot holds.

Scratch is made useless before every tick, in two ways; the bits of the state must not change. What a tick reads but no
snapshot holds would let a run that is restored go on differently.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from ligature import Simulation
from ligature.suture.rod import TOUCHES_KEPT, Rod
from ligature.suture.substeps import MAX_STEPS
from numpy.typing import NDArray

from tests.attributes import scratch
from tests.driving import EVERY, Driver
from tests.suture.test_careful import thread_on_a_post
from tests.test_determinism import FALLING, OURS, scene_of

Array = NDArray[Any]

TICKS = 40
SPOILS = {"NaN": (np.nan, True, 1), "numbers": (-0.37, False, 0)}
"""What scratch is filled with: real numbers, flags, and numbers of rows, which must exist."""


def spoil(array: Array, how: str) -> None:
    real, flag, row = SPOILS[how]
    array[...] = {"f": real, "b": flag, "i": row, "u": row}[array.dtype.kind]


def leftovers(rod: Rod) -> Iterator[Array]:
    """What of a rod's arrays no tick may read before it writes it."""
    arrays, (last, *others) = rod._arrays, rod._touches
    yield from (*arrays.work, arrays.shape_poses, arrays.pushed, arrays.counts)
    for touches in others:
        yield from touches
    count = int(last.count[0])
    for name, array in zip(last._fields, last, strict=True):
        if name != "count":
            yield array[count:] if name in TOUCHES_KEPT else array
    filled = int(rod.springs.filled[0])
    for array in rod.springs[1:]:
        yield array[filled:]


@pytest.mark.parametrize(
    "name", [*OURS[::2], FALLING, *(pytest.param(name, marks=pytest.mark.slow) for name in OURS[1::2])]
)
def test_no_tick_of_a_scene_reads_scratch_of_an_earlier_one(name: str) -> None:
    scene, ends = scene_of(name), {}
    for how in ("", *SPOILS):
        simulation, driver = Simulation(scene), Driver(scene, 4)
        for tick in range(TICKS):
            if how:
                for array in scratch(simulation).values():
                    spoil(array, how)
                for rod in simulation._suture.rods.rods:
                    for array in leftovers(rod):
                        spoil(array, how)
            driver.run(simulation, tick, tick + 1) if tick % EVERY == 0 else simulation.step(1)
        ends[how] = simulation.state_hash()
    assert len(set(ends.values())) == 1, ends


def test_no_tick_of_a_thread_that_sticks_and_slips_reads_scratch_of_an_earlier_one() -> None:
    divided = 0
    for seed in range(8):
        ends = []
        for how in ("", *SPOILS):
            bench, rod = thread_on_a_post(seed, bool(seed % 2), 0.3)
            steps = []
            for _ in range(TICKS):
                if how:
                    for array in leftovers(rod):
                        spoil(array, how)
                bench.step()
                steps.append(rod.newton_steps)
            ends.append((rod.positions.tobytes(), rod.twists.tobytes(), steps))
        assert ends[0] == ends[1] == ends[2], seed
        divided += max(steps) > MAX_STEPS
    assert divided > 3, "there were careful steps"
