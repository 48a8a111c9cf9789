"""A body kinematically controlled or twists pushes as firmly as a needle of half a kilogram, however light it is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from ligature import Simulation

Make = Callable[[str], Simulation]
SMOOTH = "friction: {static: 0.1, rolling: 0}, restitution: 0, collision margin: 0.0001, inertial offset: {}"
SCENE = (
    "bodies: [Ball, Block]\n"
    "Ball: {name: Ball, mass: 0.0001, collision shape: SPHERE, collision geometry: {radius: 0.01}, "
    f"{SMOOTH}, location: {{position: {{x: 0, y: 0, z: 1}}}}}}\n"
    "Block: {name: Block, mass: 1, collision shape: BOX, collision geometry: {x: 0.02, y: 0.1, z: 0.1}, "
    f"{SMOOTH}, gravity: {{x: 0, y: 0, z: 0}}, location: {{position: {{x: 0.03, y: 0, z: 1}}}}}}\n"
)


@pytest.fixture
def sim(simulate: Make) -> Simulation:
    return simulate(SCENE)


def control(sim: Simulation, x: float) -> None:
    sim.bodies["Ball"].command_pose([x, 0, 1, 0, 0, 0, 1])


def test_a_light_body_pushes_a_heavy_one_aside(sim: Simulation) -> None:
    control(sim, 0.05)
    sim.step(2000)
    assert sim.bodies["Ball"].pose[:3] == pytest.approx([0.05, 0, 1], abs=1e-4)
    assert sim.bodies["Block"].pose[0] > 0.069


def test_released_it_falls_by_its_own_weight(sim: Simulation) -> None:
    control(sim, 0.0)
    sim.step(200)
    assert sim.bodies["Ball"].pose[:3] == pytest.approx([0, 0, 1], abs=1e-6)
    sim.bodies["Ball"].command_wrench([0.0] * 6)
    sim.step(100)
    assert sim.bodies["Ball"].twist[2] == pytest.approx(-0.981, rel=0.01)
    sim.bodies["Ball"].command_wrench([0, 0, 2 * 9.81e-4, 0, 0, 0])
    sim.step(100)
    assert sim.bodies["Ball"].twist[2] == pytest.approx(0.0, abs=0.01)


def test_a_snapshot_of_a_driven_body_continues_with_the_same_bits(sim: Simulation) -> None:
    control(sim, 0.05)
    sim.step(300)
    snapshot = sim.snapshot()
    sim.step(300)
    first = sim.state_hash()
    sim.restore(snapshot)
    sim.step(300)
    assert sim.state_hash() == first
    assert np.isfinite(sim.bodies["Block"].pose).all()


def test_a_new_pursuit_by_forces_begins_without_the_slope_of_an_earlier_one(simulate: Make) -> None:
    """A client commands a pose, then no force, moves the body otherwise and commands a pose again."""
    sim = simulate(
        "bodies: [Ball]\n"
        "Ball: {name: Ball, mass: 0.1, collision shape: SPHERE, collision geometry: {radius: 0.01}, "
        f"{SMOOTH}, gravity: {{x: 0, y: 0, z: 0}}, controller: {{linear: {{P: 2, I: 0, D: 1}}}}}}\n"
    )
    ball = sim.bodies["Ball"]
    ball.command_pose([0.1, 0, 0, 0, 0, 0, 1])
    sim.step(5)
    ball.command_wrench([0.0] * 6)
    ball.set_pose([0, 0, 0, 0, 0, 0, 1])
    ball.command_pose([-0.1, 0, 0, 0, 0, 0, 1])
    sim.step(1)
    assert ball.twist[0] == pytest.approx(-2 * 0.1 / 0.1 * 1e-3, rel=1e-3)
