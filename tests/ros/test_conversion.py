"""Messages made from records: against what AMBF itself sent for the same scene, and by hand for the rest."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest
import rospy
import yaml
from ambf_msgs.msg import ActuatorCmd, RigidBodyCmd
from geometry_msgs.msg import Pose
from ligature.model.commands import CommandType
from ligature.model.scene import Scene
from ligature.ros import conversion

NEVER_SET = {"/ambf/env/psm1/tool_id/400006", "/ambf/env/psm2/tool_id/400006"}
"""Bodies without a mesh whose inertia and twist the reference leaves uninitialised."""

SENSOR_MODEL = """
namespace: /ambf/env/
bodies: [BODY Base, BODY Block]
joints: []
sensors: [SENSOR Ray, SENSOR Touch]
BODY Base: {name: Base, mass: 0, collision shape: BOX, collision geometry: {x: 0.1, y: 0.1, z: 0.1}}
BODY Block:
  name: Block
  mass: 1
  collision shape: BOX
  collision geometry: {x: 0.1, y: 0.1, z: 0.1}
  location: {position: {x: 0.2, y: 0, z: 0}, orientation: {r: 0, p: 0, y: 0}}
SENSOR Ray:
  name: Ray
  type: Proximity
  parent: BODY Base
  range: 0.5
  array:
  - {offset: {x: 0.0, y: 0.0, z: 0.0}, direction: {x: 1.0, y: 0.0, z: 0.0}}
  - {offset: {x: 0.0, y: 0.0, z: 0.0}, direction: {x: 0.0, y: 1.0, z: 0.0}}
SENSOR Touch: {name: Touch, type: Contact, parent: BODY Base}
"""


def plain(message: Any) -> Any:
    """A message as nested plain values, the form of the recorded samples."""
    if hasattr(message, "__slots__"):
        return {name: plain(getattr(message, name)) for name in message.__slots__}
    if isinstance(message, list | tuple):
        return [plain(item) for item in message]
    return message


def first_state(scene: Scene) -> np.void:
    simulation = ligature.Simulation(scene, update=5e-3)
    simulation.step(5)
    return simulation.state[0]


@pytest.fixture(scope="module")
def scene(corpus: Path) -> Scene:
    return ligature.load(corpus / "suturing_scene" / "launch.yaml", [10, 11, 6, 7, 8, 9])


@pytest.fixture(scope="module")
def messages(scene: Scene) -> dict[str, Any]:
    """The first message of every object, by topic."""
    state = first_state(scene)
    return {
        template.identity.topic: plain(template.fill(state, rospy.Time(1))) for template in conversion.templates(scene)
    }


@pytest.fixture(scope="module")
def samples(golden: Path) -> dict[str, Any]:
    """What the reference sent, by topic."""
    found = {}
    for path in sorted((golden / "samples").glob("*.yaml")):
        topic = path.read_text().partition("# topic: ")[2].partition("/State")[0]
        if not topic.endswith("/World"):
            found[topic] = yaml.safe_load(path.read_text().replace("nan", ".nan"))
    return found


def fields(sample: dict[str, Any], *names: str) -> Iterator[tuple[str, Any]]:
    return ((name, sample[name]) for name in names if name in sample)


def numbers(pose: dict[str, dict[str, float]]) -> list[float]:
    return [*pose["position"].values(), *pose["orientation"].values()]


@pytest.mark.corpus
def test_every_object_of_the_reference_has_a_message_of_the_same_form(
    messages: dict[str, Any], samples: dict[str, Any]
) -> None:
    assert len(samples) == 34
    for topic, sample in samples.items():
        assert messages[topic].keys() == sample.keys(), topic


@pytest.mark.corpus
def test_names_parents_and_types_are_those_of_the_reference(messages: dict[str, Any], samples: dict[str, Any]) -> None:
    for topic, sample in samples.items():
        for name, value in fields(sample, "identifier", "name", "parent_name", "type"):
            assert messages[topic][name] == value, f"{topic} {name}"


@pytest.mark.corpus
def test_lists_are_empty_until_a_command_asks_for_them(messages: dict[str, Any], samples: dict[str, Any]) -> None:
    for topic, sample in samples.items():
        lists = ("children_names", "joint_names", "joint_positions", "joint_velocities", "joint_efforts")
        for name, value in fields(sample, *lists):
            assert messages[topic][name] == value == [], f"{topic} {name}"


@pytest.mark.corpus
def test_mass_and_inertia_are_those_of_the_reference(messages: dict[str, Any], samples: dict[str, Any]) -> None:
    compared = 0
    for topic, sample in samples.items():
        if "mass" not in sample or topic in NEVER_SET:
            continue
        assert messages[topic]["mass"] == pytest.approx(sample["mass"]), topic
        if sample["mass"] > 0:
            inertia = messages[topic]["pInertia"]
            assert list(inertia.values()) == pytest.approx(list(sample["pInertia"].values()), rel=0.02), topic
            compared += 1
    assert compared == 11


@pytest.mark.corpus
def test_attached_objects_report_the_references_pose_in_their_parent(
    messages: dict[str, Any], samples: dict[str, Any]
) -> None:
    for topic, sample in samples.items():
        if "parent_name" in sample:
            ours, theirs = numbers(messages[topic]["pose"]), numbers(sample["pose"])
            assert ours[:3] == pytest.approx(theirs[:3], abs=1e-6), topic
            same = abs(np.dot(ours[3:], theirs[3:]))
            assert same == pytest.approx(1.0, abs=1e-6), topic


@pytest.mark.corpus
def test_the_very_first_poses_are_valid_and_static_bodies_stand_where_the_reference_has_them(
    messages: dict[str, Any], samples: dict[str, Any]
) -> None:
    for topic, sample in samples.items():
        ours = numbers(messages[topic]["pose"])
        assert np.linalg.norm(ours[3:]) == pytest.approx(1.0, abs=1e-9), topic
        if sample.get("mass") == 0.0:
            assert ours[:3] == pytest.approx(numbers(sample["pose"])[:3], abs=1e-6), topic


def body(scene: Scene, name: str) -> Any:
    return next(b for b in scene.bodies if b.identity.topic.endswith(name))


@pytest.mark.corpus
def test_a_command_switches_lists_on_and_none_switches_them_off(scene: Scene) -> None:
    template = conversion.BodyTemplate(scene, body(scene, "psm1/baselinksimple"))
    state = first_state(scene)
    template.ask(True, True, True)
    template.ask(False, False, False)
    message = template.fill(state, rospy.Time(1))
    assert [len(message.joint_names), len(message.joint_positions)] == [8, 8]
    assert [len(message.joint_velocities), len(message.joint_efforts)] == [8, 8]
    assert message.joint_names[0] == "baselink-yawlink" and len(message.children_names) >= 8


@pytest.mark.corpus
def test_joint_types_that_are_missing_mean_force_and_extra_values_are_left_out(scene: Scene) -> None:
    message = RigidBodyCmd(joint_cmds=[0.1] * 20, joint_cmds_types=[1, 2])
    command = conversion.body_command(message, body(scene, "psm1/baselinksimple"))
    assert command.joint_types == (CommandType.POSITION, CommandType.VELOCITY, *[CommandType.FORCE] * 6)
    assert len(command.joint_values) == 8


@pytest.mark.corpus
@pytest.mark.parametrize(
    "message", [RigidBodyCmd(cartesian_cmd_type=7), RigidBodyCmd(joint_cmds=[0.0], joint_cmds_types=[5])]
)
def test_unknown_command_types_state_what_would_be_right(scene: Scene, message: RigidBodyCmd) -> None:
    with pytest.raises(ValueError, match=r"0 \(force\), 1 \(position\) or 2 \(velocity\)"):
        conversion.body_command(message, body(scene, "psm1/baselinksimple"))


def test_short_quaternions_are_no_rotation_and_others_are_normalised() -> None:
    pose = Pose()
    assert conversion.pose7(pose) == (0, 0, 0, 0, 0, 0, 1)
    pose.orientation.z = pose.orientation.w = 3.0
    assert conversion.pose7(pose)[3:] == pytest.approx((0, 0, math.sqrt(0.5), math.sqrt(0.5)))


def test_what_an_actuator_command_leaves_out_is_none() -> None:
    command = conversion.actuator_command(ActuatorCmd(actuate=True), 3)
    assert (command.actuator, command.actuate, command.offset, command.sensor) == (3, True, None, None)


def test_ray_and_contact_sensors_state_what_they_see(tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    path.write_text(SENSOR_MODEL)
    scene = ligature.load(path)
    state = first_state(scene)
    ray, touch = [t.fill(state, rospy.Time(1)) for t in conversion.templates(scene) if t.kind == "sensor"]
    assert (ray.type.data, ray.count, ray.range) == ("PROXIMITY", 2, [0.5])
    assert ray.triggered == [True, False]
    assert ray.measurement == pytest.approx([1 - 0.15 / 0.5, 0.0], abs=0.01)
    assert [sensed.data for sensed in ray.sensed_objects] == ["/ambf/env/BODY Block"]
    assert list(ray.sensed_objects_map) == [0, 255]
    assert (touch.type.data, touch.contact_events) == ("CONTACT", [])


@pytest.mark.parametrize("n", [1, 5, 7, 20])
def test_a_velocity_of_another_length_is_rejected_and_not_left_out(n: int) -> None:
    from ligature.model.scene import ArmKind
    from ligature.robots.operating_state import Rejected
    from ligature.ros.arms.commands import listeners
    from sensor_msgs.msg import JointState

    from tests.robots.conftest import advance, ideal_psm

    take = {topic: take for topic, _, take in listeners(0, ArmKind.PSM)}["servo_jp"]
    arm = ideal_psm()
    arm.home()
    advance(arm, 3.0)
    for velocity in ([], [0.1] * 6):
        take(JointState(position=[0.1] * 6, velocity=velocity)).carry_out(arm)
    with pytest.raises(Rejected, match=f"servo_jp velocity takes 6 numbers .*, not {n}"):
        take(JointState(position=[0.2] * 6, velocity=[0.1] * n)).carry_out(arm)
    assert arm.setpoint_js().position == pytest.approx([0.1] * 6)
