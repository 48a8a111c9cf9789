"""Ticks in which only bodies, their joints and threads have work, as one compiled call.

Whatever else takes part in a tick has stated that it is idle; see `ligature.model.subsystem.Subsystem.idle_ticks`.
"""

from __future__ import annotations

import ctypes
import time

import llvmlite.binding
import numpy as np
from numba.core import types
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.physics import World
from ligature.physics.divergence import MAX_SPEED
from ligature.physics.preparing import prepare
from ligature.physics.trees import load_body, read_bodies, step_world
from ligature.suture import Suture
from ligature.suture.colliders import LOOKS, NEAR
from ligature.suture.placing import look, open_watch
from ligature.suture.substeps import open_rod
from ligature.suture.ticking import open_rod_tick, pass_tick, surround

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

PHASES = ("control", "suture", "bodies")
"""Phases of a tick that are timed here, in order."""

_CLOCK = int(time.CLOCK_MONOTONIC)

llvmlite.binding.add_symbol("clock_gettime", ctypes.cast(ctypes.CDLL(None).clock_gettime, ctypes.c_void_p).value)
_read_clock = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.intp))


class Coasting:
    """Coasts through ticks of one simulation.

    Attributes
    ----------
    spent
        (3,) seconds of the last call, by `PHASES`.
    """

    def __init__(self, world: World, suture: Suture) -> None:
        self._world, self._suture, self._dt = world, suture, world.dt
        self.spent, self._corners = np.zeros(len(PHASES)), np.zeros((2, 3))
        self._clock = np.zeros(3, np.int64)
        self._clock[2] = self._clock.ctypes.data
        self._coast(0)  # loads the kernel, which takes 0.1 s that a run would stand still for

    def pass_ticks(self, ticks: int) -> tuple[int, bool]:
        """Advance by up to ``ticks``, with the same bits as single ticks; returns how many passed.

        Returns also whether one more has begun, whose controllers have acted: threads, grasps and bodies are to follow.
        """
        self.spent[:] = 0.0
        ticks = min(ticks, self._suture.coasting_ticks()) if self._world.coasts else 0
        if ticks < 1:
            return 0, False
        passed, begun, sound = self._coast(ticks)
        self._suture.conclude(passed, begun)
        self._world.conclude(sound)
        return passed, begun

    def _coast(self, ticks: int) -> tuple[int, bool, bool]:
        world, rods = self._world, self._suture.rods
        return coast(
            *world.always, world.impulses.total, world.impulses.acted, rods.colliders.table, rods.colliders.indices,
            rods.tick_tables(), self._corners, self._clock, self.spent, self._dt, MAX_SPEED, ticks,
        )  # fmt: skip


@inlined
def _now(clock: Integers) -> float:
    """Seconds of a clock that never goes back; ``clock`` (3,) is scratch for two numbers, and its own address."""
    _read_clock(_CLOCK, clock[2])
    return float(clock[0]) + 1e-9 * float(clock[1])


@kernel
def coast(
    handle: int, tree_table: Integers, axis_table: Integers, place_table: Integers, slowed: Integers, factors: Array,
    lifted: Integers, forces: Array, total: Array, acted: Flags, watch_table: Integers, watched: Integers,
    rods: Integers, corners: Array, clock: Integers, spent: Array, dt: float, limit: float, ticks: int,
) -> tuple[int, bool, bool]:  # fmt: skip
    """Advance by up to ``ticks``; ends after one in which anything is not finite or has a speed not below ``limit``.

    It also ends within one in which other bodies are near the ``rods`` than before. The first arguments are those of
    `prepare`; ``total`` and ``acted`` are those of `Impulses`; ``spent`` (3,) adds up seconds by phase. Returns how
    many ticks passed, whether another one has begun, and whether all trees of bodies are finite and slow enough.
    """
    begin = _now(clock)
    for passed in range(ticks):
        for body in range(acted.shape[0]):
            acted[body] = False
        prepare(handle, tree_table, axis_table, place_table, slowed, factors, lifted, forces, dt)
        prepared = _now(clock)
        spent[0] += prepared - begin
        if _look_around(handle, tree_table, place_table, watch_table, watched, rods, corners, dt):
            return passed, True, True
        whole = _pass_rods(handle, tree_table, place_table, rods, total, acted, dt)
        moved = _now(clock)
        spent[1] += moved - prepared
        sound = step_world(handle, tree_table, limit)
        begin = _now(clock)
        spent[2] += begin - moved
        if not (sound and whole):
            return passed + 1, False, sound
    return ticks, False, True


@inlined
def _look_around(
    handle: int, tree_table: Integers, place_table: Integers, watch_table: Integers, watched: Integers, rods: Integers,
    corners: Array, dt: float,
) -> bool:  # fmt: skip
    """Bring the bodies near the rods up to date; whether they are others than before."""
    if rods.shape[0] == 0 or watched.shape[0] == 0:
        return False
    surround(rods, corners)
    read_bodies(handle, tree_table, place_table, watched, open_watch(watch_table).seen)
    return look(watch_table, corners, dt, LOOKS, NEAR)


@inlined
def _pass_rods(
    handle: int, tree_table: Integers, place_table: Integers, rods: Integers, total: Array, acted: Flags, dt: float
) -> bool:
    """A tick of all rods, and their impulses on bodies; whether the rods are finite and slow enough."""
    whole = True
    for r in range(rods.shape[0]):
        tick = open_rod_tick(rods[r])
        pass_tick(tick)
        rod = open_rod(tick.rod)
        for m in range(rod.counts[4]):
            node = rod.pushed[m]
            body = tick.body[node]
            if body < 0:
                continue
            for a in range(6):
                total[body, a] = total[body, a] + rod.impulse[node, a] if acted[body] else rod.impulse[node, a]
            acted[body] = True
            load_body(handle, tree_table, place_table, body, rod.impulse[node, :3], rod.impulse[node, 3:], dt)
        whole = whole and rod.counts[5] == 1
    return whole
