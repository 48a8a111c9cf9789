"""A needle that is put anywhere, its thread through whatever lies there: nothing is thrown. Metres, seconds."""

from __future__ import annotations

from collections.abc import Iterator

import ligature
import numpy as np
import pytest
from ligature import Simulation

MAX_SPEED = 5.0
"""The end of a thread that swings down with its needle reaches 4 m/s.

Where contacts push out what was put deep into a body, every third placement exceeded 5 m/s, up to 173.
"""


@pytest.fixture(scope="module")
def simulation() -> Iterator[Simulation]:
    simulation = Simulation(ligature.load("suturing_small"))
    simulation.step(300)
    yield simulation
    simulation.close()


@pytest.fixture(scope="module")
def start(simulation: Simulation) -> ligature.Snapshot:
    return simulation.snapshot()


def put(simulation: Simulation, number: int) -> None:
    """Put the needle at a random pose in the box around some body, or near its start."""
    scene, rng = simulation.scene, np.random.default_rng([number, 7])
    needle = scene.needles[0].body
    solid = [b.index for b in scene.bodies if b.colliders and b.index != needle and b.index not in scene.rod_bodies]
    at = simulation.state["body_pose"][0, needle, :3].copy()
    low, high = simulation._world.queries.surroundings([int(rng.choice(solid))])[1]
    low, high = np.maximum(low, at - 0.06), np.minimum(high, at + 0.06)
    if (high < low).any():
        low, high = at - 0.03, at + 0.03
    place, q = rng.uniform(low, high), rng.normal(size=4)
    simulation.set_pose(needle, np.r_[place, q / np.linalg.norm(q)])


def speed(simulation: Simulation) -> float:
    return float(np.linalg.norm(simulation.state["body_twist"][0, :, :3], axis=1).max())


@pytest.mark.parametrize("number", [1, 2, 13, 14, 16, 20, 22, 23])
def test_a_needle_that_is_put_anywhere_throws_nothing(
    simulation: Simulation, start: ligature.Snapshot, number: int
) -> None:
    simulation.restore(start)
    put(simulation, number)
    top_speed = 0.0
    for _ in range(500):
        simulation.step(1)
        top_speed = max(top_speed, speed(simulation))
    assert top_speed < MAX_SPEED
    assert not [p for p in simulation.problems if p.code == "diverged"]


def test_a_snapshot_while_the_thread_is_drawn_out_continues_with_the_same_bits(
    simulation: Simulation, start: ligature.Snapshot
) -> None:
    simulation.restore(start)
    put(simulation, 16)
    simulation.step(20)
    snapshot, ends = simulation.snapshot(), []
    for _ in range(2):
        simulation.restore(snapshot)
        simulation.step(100)
        ends.append(simulation.state_hash())
    assert ends[0] == ends[1]


def test_it_comes_to_rest_on_what_is_below(simulation: Simulation, start: ligature.Snapshot) -> None:
    simulation.restore(start)
    put(simulation, 14)
    simulation.step(10000)
    assert speed(simulation) < 0.05
    needle = simulation.scene.needles[0].body
    table = next(b.index for b in simulation.scene.bodies if b.identity.key == "BODY Table")
    floor = simulation._world.queries.surroundings([table])[1][0, 2]
    assert simulation.state["body_pose"][0, [needle, *simulation.scene.rod_bodies], 2].min() > floor
