"""Rays, contacts, actuators and lights through our client: what AMBF's example of sensing and grasping does."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.ros.conftest import BIN, Program
from tests.waiting import until

pytestmark = pytest.mark.ros

SCENE = """
namespace: /ambf/env/
gravity: {x: 0, y: 0, z: 0}
bodies: [Wall, Probe]
sensors: [Rays, Touch]
actuators: [Hold]
lights: [Lamp]
Wall: {name: wall, mass: 0, collision shape: BOX, collision geometry: {x: 0.2, y: 4, z: 4}, collision margin: 0.0001,
  location: {position: {x: 1.1, y: 0, z: 0}}}
Probe: {name: probe, mass: 1, inertia: {ix: 1, iy: 1, iz: 1}, collision shape: SPHERE, collision geometry: {radius: 0.1},
  collision margin: 0.0001}
Rays: {name: tip_sensor_array, type: Proximity, parent: Probe, range: 2.0, array: [
  {offset: {x: 0, y: 0, z: 0}, direction: {x: 1, y: 0, z: 0}}, {offset: {x: 0, y: 0, z: 0}, direction: {x: 0, y: 1, z: 0}}]}
Touch: {name: touch, type: Contact, parent: Probe, distance threshold: 0.05, process contact details: true}
Hold: {name: tip_actuator0, type: Constraint, parent: Probe}
Lamp: {name: lamp, location: {x: 0, y: 0, z: 2}, direction: {x: 0, y: 0, z: -1}}
"""


@pytest.fixture(scope="module")
def client(tmp_path_factory: Any, ros_env: dict[str, str], node: Any) -> Iterator[Any]:
    from ligature.client import Client

    file = tmp_path_factory.mktemp("scene") / "probe.yaml"
    Path(file).write_text(SCENE)
    program = Program([str(BIN / "ligature"), "run", str(file), "-p", "500"], ros_env)
    try:
        program.wait_for("first state published")
        client = Client("sensing")
        client.connect()
        yield client
        client.clean_up()
    finally:
        program.end()


def test_rays_report_what_they_hit_and_how_near_it_is(client: Any) -> None:
    rays = client.get_obj_handle("tip_sensor_array")
    assert rays.get_count() == 2 and rays.get_range(0) == pytest.approx(2.0) and rays.get_parent() == "Probe"
    assert rays.is_triggered(0) and not rays.is_triggered(1) and rays.is_triggered(2) is None
    assert rays.get_all_measurements() == pytest.approx([0.5, 0.0], abs=1e-3)
    assert rays.get_sensed_object(0) == "/ambf/env/Wall"
    assert rays.get_pose().orientation.w == 1.0


def test_an_actuator_takes_what_a_ray_hits_and_lets_go(client: Any) -> None:
    actuator = client.get_obj_handle("tip_actuator0")
    rays = client.get_obj_handle("tip_sensor_array")
    actuator.actuate_from_sensor_data(rays.get_identifier())
    until(lambda: actuator._state.actuated)
    actuator.deactuate()
    until(lambda: not actuator._state.actuated)


def test_a_contact_sensor_names_what_touches(client: Any) -> None:
    probe, touch = client.get_obj_handle("probe"), client.get_obj_handle("touch")
    assert touch.get_num_contact_events() == 0 and touch.get_contact_event(0) is None
    probe.set_pos(0.95, 0.0, 0.0)
    until(lambda: touch.get_num_contact_events() == 1)
    assert touch.get_all_contact_object_names() == [touch.get_contact_object_name(0)] == ["/ambf/env/Wall"]
    assert touch.get_contact_event(0).contact_data[0].distance.data < 0.05


def test_a_light_is_moved_and_stays(client: Any) -> None:
    lamp = client.get_obj_handle("lamp")
    assert lamp.get_pos().z == pytest.approx(2.0)
    lamp.set_pos(0.0, 1.0, 2.0)
    until(lambda: lamp.get_pos().y == pytest.approx(1.0))
    assert lamp.get_pos_command().y == 1.0
