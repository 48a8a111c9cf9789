"""Ray sensors, contact sensors, resistance and attachments in small scenes."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sensing.conftest import Make

WALL = (
    "Wall: {name: Wall, mass: 0, collision shape: BOX, collision geometry: {x: 0.2, y: 4, z: 4}, collision margin: 0.0001, "
    "location: {position: {x: 1.1, y: 0, z: 0}}}\n"
)


def sensor(type_: str, more: str) -> str:
    return (
        "bodies: [Wall, Probe]\nsensors: [S]\n" + WALL
        + "Probe: {name: Probe, mass: 1, inertia: {ix: 1, iy: 1, iz: 1}, inertial offset: {}}\n"
        + f"S: {{name: S, type: {type_}, parent: Probe, {more}}}\n"
    )  # fmt: skip


def test_a_ray_measures_how_near_what_it_hits_is(simulate: Make) -> None:
    rays = (
        "range: 2.0, array: [{offset: {x: 0, y: 0, z: 0}, direction: {x: 1, y: 0, z: 0}}, "
        "{offset: {x: 0, y: 0, z: 0}, direction: {x: 0, y: 1, z: 0}}, {offset: {x: 0, y: 0, z: 0}, direction: {x: 0.25, y: 0, z: 0}}]"
    )
    sim = simulate(sensor("Proximity", rays))
    sim.step(1)
    assert sim.state["ray_measurement"][0] == pytest.approx([0.5, 0.0, 0.0], abs=1e-3)
    assert sim.state["ray_body"][0].tolist() == [sim.bodies["Wall"].body.index, -1, -1]
    assert sim.state["ray_point"][0, 0] == pytest.approx([1, 0, 0], abs=1e-3)
    assert sim.state["ray_normal"][0, 0] == pytest.approx([-1, 0, 0], abs=1e-3)


def test_a_fan_of_rays_covers_its_angles_once(simulate: Make) -> None:
    fan = (
        "range: 3.0, parametric: {resolution: 3, horizontal angle: 1.0, vertical angle: 0.6, start offset: 0.1}, "
        "location: {position: {x: 0, y: 0, z: 0.5}}"
    )
    sim = simulate(sensor("Proximity", fan))
    rays = sim.scene.sensors[0].rays
    assert rays.shape == (9, 2, 3)
    assert np.linalg.norm(rays[:, 0], axis=1) == pytest.approx([0.1] * 9)
    assert np.linalg.norm(rays[:, 1] - rays[:, 0], axis=1) == pytest.approx([3.0] * 9)
    sim.step(1)
    assert (sim.state["ray_body"][0] >= 0).all()
    assert sim.state["ray_point"][0, 4] == pytest.approx([1, 0, 0.5], abs=1e-3)


def test_an_actuator_takes_what_its_sensor_hits(simulate: Make) -> None:
    from ligature.model.commands import ActuatorCommand

    text = sensor("Proximity", "range: 2.0, array: [{offset: {x: 0, y: 0, z: 0}, direction: {x: 1, y: 0, z: 0}}]")
    text = text.replace("sensors: [S]", "sensors: [S]\nactuators: [A]")
    sim = simulate(text + "A: {name: A, type: Constraint, parent: Probe}\n")
    sim.step(1)
    sim.apply(ActuatorCommand(0, True, sensor="S"))
    sim.step(1)
    assert sim.state["actuator_body"][0, 0] == sim.bodies["Wall"].body.index
    sim.apply(ActuatorCommand(0, False))
    sim.apply(ActuatorCommand(0, True, sensor="None"))
    assert "no proximity sensor is called 'None'; the scene has /ambf/env/S" in str(sim.problems[-1])


def test_a_resistance_sensor_pushes_back(simulate: Make) -> None:
    rays = (
        "range: 1.5, contact stiffness: 2.0, friction: {static: 0, dynamic: 0, damping: 0}, "
        "array: [{offset: {x: 0, y: 0, z: 0}, direction: {x: 1, y: 0, z: 0}}]"
    )
    sim = simulate(sensor("Resistance", rays))
    for _ in range(500):
        sim.step(1)
    # F_n = stiffness (1 − fraction) along the ray; the parent is pushed the other way
    assert sim.bodies["Probe"].twist[0] == pytest.approx(-2.0 * (1 - 1 / 1.5) * 0.5, rel=0.1)


def test_a_contact_sensor_lists_what_touches_its_body(simulate: Make) -> None:
    text = sensor("Contact", "distance threshold: 0.001").replace(
        "inertial offset: {}}",
        "inertial offset: {}, collision margin: 0.0001, collision shape: SPHERE, collision geometry: {radius: 0.1}}",
    )
    sim = simulate(text)
    probe, wall = sim.bodies["Probe"], sim.bodies["Wall"]
    sim.step(1)
    assert sim.state["contact_count"][0] == 0
    probe.command_wrench([5, 0, 0, 0, 0, 0])
    sim.step(900)
    assert sim.state["contact_count"][0] >= 1
    assert sim.state["contact_body"][0, 0] == wall.body.index
    assert sim.state["contact_point"][0, 0, 0] == pytest.approx(1.0, abs=2e-3)
    assert sim.state["contact_normal"][0, 0] == pytest.approx([-1, 0, 0], abs=1e-2)
    assert abs(sim.state["contact_distance"][0, 0]) < 2e-3


def test_cameras_on_cameras_follow_the_body_below(simulate: Make) -> None:
    text = (
        "bodies: [Head]\ncameras: [left, right]\nHead: {name: Head, mass: 0}\n"
        "left: {name: left, parent: Head, location: {x: 0.1, y: 0, z: 0}, look at: {x: 1, y: 0, z: 0}}\n"
        "right: {name: right, parent: left, location: {x: 0, y: 0.2, z: 0}, look at: {x: -1, y: 0.2, z: 0}}\n"
    )
    sim = simulate(text)
    sim.bodies["Head"].set_pose([1, 2, 3, 0, 0, np.sqrt(0.5), np.sqrt(0.5)])
    sim.step(1)
    assert sim.state["camera_world"][0, 0, :3] == pytest.approx([1, 2.1, 3])
    # the left camera looks along its own -x, which points away from the head; right lies along its +y
    from ligature.model.frames import pose7_matrix

    T = pose7_matrix(sim.state["camera_world"][0, 0])
    assert sim.state["camera_world"][0, 1, :3] == pytest.approx(T[:3, 3] + 0.2 * T[:3, 1])


def test_a_camera_is_placed_by_command_and_put_back_by_a_reset(simulate: Make) -> None:
    from ligature.model.commands import PlaceCommand, Reset

    sim = simulate(
        "bodies: [Head]\ncameras: [C]\nHead: {name: Head, mass: 0}\nC: {name: C, parent: Head, look at: {x: 1, y: 0, z: 0}}\n"
    )
    before = sim.state["camera_pose"][0, 0].copy()
    sim.apply(PlaceCommand("camera", 0, (0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)))
    sim.step(1)
    assert sim.state["camera_pose"][0, 0, 0] == 0.5
    sim.apply(Reset(bodies_only=True))
    assert sim.state["camera_pose"][0, 0, 0] == 0.5
    sim.apply(Reset())
    assert sim.state["camera_pose"][0, 0] == pytest.approx(before)
