"""What the world does to a body, read back from contacts, holds and threads."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from ligature import Simulation
from ligature.model.commands import ActuatorCommand

Make = Callable[[str], Simulation]
ROUGH = "friction: {static: 1.0, rolling: 0}, restitution: 0, collision margin: 0.0001, inertial offset: {}"
FLOOR = f"Floor: {{name: Floor, mass: 0, collision shape: BOX, collision geometry: {{x: 4, y: 4, z: 0.2}}, {ROUGH}}}\n"


def _box(name: str, x: float, z: float) -> str:
    return (
        f"{name}: {{name: {name}, mass: 2, collision shape: BOX, collision geometry: {{x: 0.2, y: 0.2, z: 0.2}}, {ROUGH}, "
        f"location: {{position: {{x: {x}, y: 0, z: {z}}}}}}}\n"
    )


def _wrench(sim: Simulation, names: list[str], point: np.ndarray) -> np.ndarray:
    return sim._world.wrenches.on([sim.bodies[name].body.index for name in names], point)


@pytest.mark.parametrize("order", ["[Floor, A]", "[A, Floor]"])
def test_a_pushed_box_at_rest_feels_its_weight_and_the_push_returned(simulate: Make, order: str) -> None:
    sim = simulate(f"bodies: {order}\n" + FLOOR + _box("A", 0.5, 0.2))
    sim.bodies["A"].command_wrench([3, 1, 0, 0, 0, 0])
    sim.step(500)
    centre = sim.bodies["A"].pose[:3]
    wrench = _wrench(sim, ["A"], centre)
    assert wrench == pytest.approx([-3, -1, 19.6, 0, 0, 0], abs=1e-3)
    assert _wrench(sim, ["Floor"], centre) == pytest.approx(-wrench, abs=1e-4)
    aside = _wrench(sim, ["A"], centre - [0.1, 0, 0])
    assert aside == pytest.approx([-3, -1, 19.6, 0, -1.96, -0.1], abs=1e-3)


def test_contacts_within_a_set_of_bodies_do_not_count(simulate: Make) -> None:
    sim = simulate("bodies: [Floor, A, B]\n" + FLOOR + _box("A", 0.0, 0.2) + _box("B", 0.0, 0.4))
    sim.step(500)
    point = np.array([0.0, 0.0, 0.1])
    assert _wrench(sim, ["B"], point)[2] == pytest.approx(19.6, abs=1e-2)
    assert _wrench(sim, ["A"], point)[2] == pytest.approx(19.6, abs=1e-2)
    assert _wrench(sim, ["A", "B"], point)[2] == pytest.approx(39.2, abs=1e-2)


def test_a_body_in_free_flight_feels_nothing(simulate: Make) -> None:
    sim = simulate("bodies: [A]\n" + _box("A", 0.0, 1.0))
    sim.bodies["A"].command_wrench([5, 0, 0, 1, 0, 0])
    sim.step(100)
    assert not _wrench(sim, ["A"], np.zeros(3)).any()


def test_a_held_body_weighs_on_its_holder(simulate: Make) -> None:
    text = "bodies: [Floor, A]\nactuators: [Gripper]\n" + FLOOR + _box("A", 0.5, 1.0)
    actuator = "Gripper: {name: Gripper, type: Constraint, parent: Floor, location: {position: {x: 0, y: 0, z: 0.3}, orientation: {r: 0.3, p: 0.5, y: 0.9}}}\n"
    sim = simulate(text + actuator)
    sim.apply(ActuatorCommand(0, True, body="A"))
    sim.bodies["A"].command_wrench([0, 0, 0, 0.1, 0.2, 0.3])
    sim.step(500)
    point = np.array([0.2, 0.1, 0.0])
    wrench = _wrench(sim, ["Floor"], point)
    moment = np.array([0.1, 0.2, 0.3]) + np.cross(sim.bodies["A"].pose[:3] - point, [0, 0, -19.6])
    assert wrench == pytest.approx([0, 0, -19.6, *moment], abs=2e-3)
    assert _wrench(sim, ["A"], point) == pytest.approx(-wrench, abs=1e-9)


def test_a_thread_weighs_on_what_it_hangs_from(simulate: Make) -> None:
    text = (
        "bodies: [Ball]\nsutures: [Silk]\nBall: {name: Ball, mass: 0.5, collision shape: SPHERE, collision geometry: {radius: 0.01}}\n"
        "Silk: {name: Silk, length: 0.1, diameter: 0.0005, youngs modulus: 1.0e+8, density: 5000, elements: 10, parent: Ball, "
        "location: {position: {x: 0, y: 0, z: -0.01}, orientation: {r: 3.14159265358979, p: 0, y: 0}}}\n"
    )
    sim = simulate(text)
    sim.bodies["Ball"].command_pose(sim.bodies["Ball"].pose)
    sim.step(1500)
    weight = 9.8 * sum(sim.scene.bodies[b].mass for b in sim.scene.rods[0].bodies)
    wrench = _wrench(sim, ["Ball"], sim.bodies["Ball"].pose[:3])
    assert wrench[2] == pytest.approx(-weight, rel=0.02)
    assert np.abs(wrench[3:]).max() < 0.02 * weight * 0.01
