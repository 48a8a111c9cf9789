"""Proxies of input devices are models of the scene whose root link stands where the device states."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.model.scene import OutputType

GRIPPER = """
bodies: [BODY palm, BODY left, BODY right]
joints: [JOINT palm-left, JOINT palm-right]
namespace: /ambf/env/
BODY palm: {name: palm, mass: 0.5, inertia: {ix: 1, iy: 1, iz: 1}, location: {position: {x: 1.0, y: 0.0, z: 0.0}}}
BODY left: {name: left, mass: 0.1, inertia: {ix: 1, iy: 1, iz: 1}, location: {position: {x: 1.0, y: 0.1, z: 0.0}}}
BODY right: {name: right, mass: 0.1, inertia: {ix: 1, iy: 1, iz: 1}, location: {position: {x: 1.0, y: -0.1, z: 0.0}}}
JOINT palm-left: {name: palm-left, type: revolute, parent: BODY palm, child: BODY left,
  parent pivot: {x: 0, y: 0.1, z: 0}, child pivot: {x: 0, y: 0, z: 0}, parent axis: {x: 0, y: 0, z: 1},
  child axis: {x: 0, y: 0, z: 1}, joint limits: {low: -0.3, high: 0.5}}
JOINT palm-right: {name: palm-right, type: revolute, parent: BODY palm, child: BODY right,
  parent pivot: {x: 0, y: -0.1, z: 0}, child pivot: {x: 0, y: 0, z: 0}, parent axis: {x: 0, y: 0, z: 1},
  child axis: {x: 0, y: 0, z: 1}, joint limits: {low: 0.0, high: 0.7}}
"""
DEVICES = """
input devices: [arm1, second, third]
arm1:
  hardware name: PHANTOM Omni
  simulated multibody: gripper.yaml
  workspace scaling: 0.5
  location: {position: {x: 0.0, y: 0.0, z: 0.5}, orientation: {r: 0, p: 0, y: 1.5707963}}
  controller gain: {linear: {P: 200.0, D: 20.0}, angular: {P: 50.0, D: 1.0}}
  button mapping: {a1: 0, g1: 1}
second: {hardware name: Falcon, simulated multibody: gripper.yaml}
third: {hardware name: Falcon, simulated multibody: nowhere.yaml}
"""
LAUNCH = """
world config: world.yaml
color config: colors.yaml
input devices config: devices.yaml
multibody configs: [ball.yaml]
"""
BALL = "bodies: [BODY ball]\nBODY ball: {name: ball, mass: 0.0, location: {position: {x: 3.0, y: 0.0, z: 0.0}}}\n"
WORLD = """
cameras: [camera]
camera: {name: camera, location: {x: 0.0, y: 0.0, z: 2.0}, look at: {x: 0.0, y: 0.0, z: 0.0}, up: {x: 1.0, y: 0.0, z: 0.0}}
"""


def write_scene(folder: Path) -> Path:
    """A launch file with three input devices, two of which have a gripper."""
    files = {
        "gripper": GRIPPER,
        "devices": DEVICES,
        "launch": LAUNCH,
        "ball": BALL,
        "world": WORLD,
        "colors": "red: {}\n",
    }
    for name, text in files.items():
        (folder / f"{name}.yaml").write_text(text)
    return folder / "launch.yaml"


@pytest.fixture(scope="module")
def launch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("devices"))


def test_proxies_are_there_when_they_are_asked_for(launch: Path) -> None:
    assert [body.identity.name for body in ligature.load(launch).bodies] == ["ball"]
    scene = ligature.load(launch, devices=[0, 1])
    assert [device.proxy >= 0 for device in scene.input_devices] == [True, True, False]
    roots = [scene.bodies[device.proxy] for device in scene.input_devices[:2]]
    assert [root.identity.topic for root in roots] == [
        "/ambf/env/simulated_device/palm", "/ambf/env/simulated_device/palm1",
    ]  # fmt: skip
    assert [body.identity.passive for body in scene.bodies] == [False, *[False, True, True] * 2]


def test_a_proxy_stands_whole_where_the_device_states_with_its_gains(launch: Path) -> None:
    scene = ligature.load(launch, devices=[0])
    palm, left = scene.bodies[1:3]
    assert palm.T_world_body[:3, 3] == pytest.approx([0.0, 0.0, 0.5])
    assert left.T_world_body[:3, 3] == pytest.approx([-0.1, 0.0, 0.5], abs=1e-6), "turned with its palm"
    assert (palm.controller.linear.p, palm.controller.angular.d) == (200.0, 1.0)
    assert palm.controller.linear_output is OutputType.FORCE
    own = ligature.load(launch, devices=[1]).bodies[1]
    assert own.T_world_body[:3, 3] == pytest.approx([1.0, 0.0, 0.0]), "its own place without a location"


def test_a_proxy_that_nobody_drives_does_not_fall(launch: Path) -> None:
    simulation = ligature.Simulation(ligature.load(launch, devices=[0]))
    before = simulation.bodies["/ambf/env/simulated_device/palm"].pose
    simulation.step(300)
    assert simulation.bodies["/ambf/env/simulated_device/palm"].pose == pytest.approx(before, abs=1e-4)
    simulation.close()


def test_a_proxy_follows_the_poses_that_are_commanded(launch: Path) -> None:
    simulation = ligature.Simulation(ligature.load(launch, devices=[1]))
    palm = simulation.bodies["/ambf/env/simulated_device/palm"]
    goal = palm.pose + [0.05, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0]
    palm.command_pose(goal)
    simulation.step(1500)
    assert np.abs(palm.pose - goal).max() < 1e-3
    simulation.close()


def test_a_proxy_that_is_missing_is_a_finding(launch: Path) -> None:
    scene = ligature.load(launch, devices=[2, 7])
    assert scene.input_devices[2].proxy == -1
    texts = [str(found) for found in scene.diagnostics]
    assert any("nowhere.yaml" in text for text in texts), texts
    assert any(
        "input device index 7 is out of range; 'input devices' lists 3, counted from 0" in text for text in texts
    ), texts
