"""Ticks in which only bodies, joints, threads and jaws have work, as compiled code."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.arms.courses import strays
from ligature.coasting.clock import now
from ligature.coasting.passages import find_passages, react_all
from ligature.grasping.exchange import carry
from ligature.grasping.looking import may_grasp
from ligature.kernels import inlined, kernel
from ligature.physics.preparing import prepare
from ligature.physics.trees import load_body, push_bodies, read_bodies, step_world
from ligature.suture.colliders import LOOKS, NEAR
from ligature.suture.placing import look, open_watch
from ligature.suture.searching import LOOKED, SOLVED
from ligature.suture.substeps import open_rod
from ligature.suture.ticking import RodTick, call_tick_rod, open_rod_tick, surround

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

Threads = tuple[Flags, Integers, Integers, Integers, Array]
"""What the ticks of threads take: which bodies a command moves (bodies,); the table of a `Watch` of bodies and their
numbers; the `Rods.tick_tables`; and (2, 3) scratch."""


@kernel
def coast(
    handle: int, tree_table: Integers, axis_table: Integers, place_table: Integers, slowed: Integers, factors: Array,
    lifted: Integers, forces: Array, total: Array, acted: Flags, search: Integers, holds: Integers, exchanges: Integers,
    laden: Integers, lifts: Array, courses: Integers, looks: Integers, clock: Integers, spent: Array, dt: float,
    limit: float, ticks: int, begins: int, threads: Threads | None,
) -> tuple[int, int, bool]:  # fmt: skip
    """Advance by up to ``ticks``, and where ``begins`` is 1 begin another one, up to the step of the bodies.

    It ends after one in which anything is not finite or faster than bodies may be (`Motions.step`), and within one in
    which something has entered or left a hole, other bodies are near the threads than before, or a jaw may grasp or let
    go.
    It ends before one in which an arm is found away from its set-point.

    The first arguments are those of `prepare`; ``total`` and ``acted`` are those of `Impulses`, ``search`` the table of
    a `Search`, ``holds`` and ``exchanges`` those of `Grasps.carried`, ``laden`` and ``lifts`` of `Masses`, ``courses``
    and ``looks`` the tables of arms and of jaws that hold nothing; ``spent`` (3,) adds up seconds by phase. Without
    ``threads`` nothing of them is compiled. Returns how many ticks passed; how far another one has begun, as
    `Suture.conclude` takes it; and whether all trees of bodies are finite and slow enough.
    """
    begin = now(clock)
    for passed in range(ticks + begins):
        if strays(handle, tree_table, courses, passed):
            return passed, 0, True
        for body in range(acted.shape[0]):
            acted[body] = False
        prepare(handle, tree_table, axis_table, place_table, slowed, factors, lifted, forces, dt)
        prepared = now(clock)
        spent[0] += prepared - begin
        found = find_passages(handle, tree_table, place_table, search)
        if found != 0:
            return passed, found, True
        whole = True
        if threads is not None:
            if _look_around(handle, tree_table, place_table, threads, dt):
                return passed, LOOKED, True
            whole = _pass_rods(handle, tree_table, place_table, threads, total, acted, dt)
            react_all(handle, tree_table, place_table, search, total, acted, dt)
        held = passed < ticks
        if threads is not None:
            held = held and not may_grasp(tree_table, looks, threads[3], passed)
        else:
            held = held and not may_grasp(tree_table, looks, None, passed)
        held = held and carry(handle, tree_table, place_table, axis_table, total, acted, holds, exchanges, dt)
        moved = now(clock)
        spent[1] += moved - prepared
        if not held:
            return passed, SOLVED, True
        if laden.shape[0] > 0:
            push_bodies(handle, tree_table, place_table, laden, lifts)
        sound = step_world(handle, tree_table, limit)
        begin = now(clock)
        spent[2] += begin - moved
        if not (sound and whole):
            return passed + 1, 0, sound
    return ticks, 0, True


@inlined
def _look_around(handle: int, tree_table: Integers, place_table: Integers, threads: Threads, dt: float) -> bool:
    """Bring the bodies near the rods up to date; whether they are others than before."""
    _driven, watch_table, watched, rods, corners = threads
    if watched.shape[0] == 0:
        return False
    surround(rods, corners)
    read_bodies(handle, tree_table, place_table, watched, open_watch(watch_table).seen)
    return look(watch_table, corners, dt, LOOKS, NEAR)


@inlined
def _pass_rods(
    handle: int, tree_table: Integers, place_table: Integers, threads: Threads, total: Array, acted: Flags, dt: float
) -> bool:
    """A tick of all rods, and their impulses on bodies; whether the rods are finite and slow enough."""
    driven, _watch_table, _watched, rods, _corners = threads
    whole = True
    for r in range(rods.shape[0]):
        tick = open_rod_tick(rods[r])
        _hold_driven(tick, driven)
        call_tick_rod(rods[r].ctypes.data)
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


@inlined
def _hold_driven(tick: RodTick, driven: Flags) -> None:
    """Note which of the bodies around a rod are ``driven`` now: no thread moves them."""
    nodes = open_rod(tick.rod).nodes
    for i in range(tick.body.shape[0]):
        if tick.body[i] >= 0 and nodes.met[i]:
            nodes.fixed[i] = driven[tick.body[i]]
