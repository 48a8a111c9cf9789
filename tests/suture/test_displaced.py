"""A body at a thread's end that others hold elsewhere than the thread left it: the thread follows, and is not thrown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from ligature.model.shapes import Cylinder
from ligature.suture.description import Attachment
from ligature.suture.rod import Rod
from ligature.suture.step import MAX_NEWTON
from numpy.typing import NDArray

from tests.suture.conftest import DT, Bench, body, damped, from_material
from tests.suture.test_careful import ALONG_Y

Array = NDArray[np.float64]

POST, HAND = 0, 1
JOINT, POINTS = "a joint at its end", "three points"
"""How the hand holds an element."""


def thread_in_a_light_hand(rng: np.random.Generator, held: str) -> tuple[Bench, Rod, Array, int]:
    """A thread that winds around a post, and a hand of 0.1 g that holds an element beyond it.

    Also the way out at the thread's beginning, and the element.
    """
    thick, radius, turns = rng.uniform(0.2e-3, 0.5e-3), rng.uniform(1e-3, 4e-3), rng.uniform(0.3, 1.2)
    angle = np.linspace(0.0, 2.0 * np.pi * turns, 400)
    r = radius + 0.5 * thick + rng.uniform(-2e-6, 2e-5)
    around = np.column_stack([r * np.cos(angle), 1.5 * thick * angle / (2.0 * np.pi), r * np.sin(angle)])
    tails = np.linspace(1.0, 0.0, 60)[:-1, None] * rng.uniform(2e-3, 8e-3)
    begin, end = around[0] - around[1], around[-1] - around[-2]
    begin, end = begin / np.linalg.norm(begin), end / np.linalg.norm(end)
    points = np.vstack([around[0] + tails * begin, around, around[-1] + tails[::-1] * end])
    at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    n = int(np.clip(at[-1] / (1.3 * thick), 12, 60))
    points = np.stack([np.interp(np.linspace(0.0, at[-1], n + 1), at, points[:, a]) for a in range(3)], axis=1)
    made = from_material(points, thick, 1e7, 1100.0, gravity=(0, 0, 0), straight=False, friction=0.6)
    element = n - 1 if held == JOINT else int(rng.integers(n - 1 - int(n * tails[0, 0] / at[-1]), n - 1))
    T_element, T_hand, none = np.eye(4), np.eye(4), np.zeros(3)
    T_hand[:3, :3] = made.T_world_inertial[element][:3, :3]
    if held == JOINT:
        T_element[:3, 3] = made.ends[-1, 1]
    fixed = Attachment(element, HAND, T_element, T_hand, none, none, none, none, none)
    made = replace(made, attachments=(fixed,), compliance=np.full(n - 1, at[-1] / n / 4000.0))
    post = body(POST, Cylinder(radius, 0.05), friction=1.0, R=ALONG_Y)
    at_hand = points[-1] if held == JOINT else made.T_world_inertial[element][:3, 3]
    bench = Bench([post, body(HAND, None, at_hand, 1e-4, 1e-9)])
    rod = bench.add(damped(made, 0.9))
    return bench, rod, begin, element


@pytest.mark.parametrize("held", [JOINT, POINTS])
@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_divided_ticks_throw_a_thread_no_faster_than_whole_ones_when_its_hand_is_put_elsewhere(
    held: str, seed: int
) -> None:
    """Between two ticks the hand moves by twice its distance at most; friction on the post changes by as much.

    Where the first part of a divided tick took all of it off, a thread with a joint was 9 to 107 times as fast,
    and one that three points hold up to 4 times.
    """
    rng = np.random.default_rng(seed)
    bench, rod, out, element = thread_in_a_light_hand(rng, held)
    rod.set_gravity(0, tuple(10.0 ** rng.uniform(-4.0, -1.5) / rod.description.mass[0] * out))
    place, divided, far = bench.pose[HAND].copy(), 0, 10.0 ** rng.uniform(-4.3, -3.7)
    for _ in range(60):
        way = rng.normal(size=3)
        bench.pose[HAND][:] = place
        bench.pose[HAND][:3] += far * way / np.linalg.norm(way)
        bench.twist[HAND][:] = 0.0
        bench.step()
        divided += rod.newton_steps > MAX_NEWTON
        assert np.linalg.norm(rod.twists[element, :3]) < 2.5 * far / DT
    assume(divided)
