"""The running simulator on ROS: topics, rates, commands, watchdogs, resets, stepping, bad input."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from tests.ros.conftest import BIN, SMALL, Program
from tests.waiting import steady, until

pytestmark = pytest.mark.ros
BASE = "/ambf/env/psm1/baselink"
NEEDLE = "/ambf/env/phantom/Needle"
WORLD = "/ambf/env/World"


@pytest.fixture(scope="module", autouse=True)
def simulator(start: Callable[..., Program]) -> Program:
    program = start(BIN / "ligature", "run", SMALL, "-p", "500", "--min-hz", "100", "--max-hz", "200")
    program.wait_for("first state published")
    return program


def diagnostics(listen: Callable[..., Any]) -> dict[str, str]:
    from diagnostic_msgs.msg import DiagnosticArray

    listener = listen("/diagnostics", DiagnosticArray)
    return {pair.key: pair.value for pair in listener.wait().status[0].values}


def body_command(**fields: Any) -> Any:
    from ambf_msgs.msg import RigidBodyCmd

    command = RigidBodyCmd(**fields)
    command.pose.orientation.w = command.pose.orientation.w or 1.0
    return command


def test_objects_publish_at_the_rate_without_commands(listen: Callable[..., Any]) -> None:
    from ambf_msgs.msg import RigidBodyState

    needle = listen(f"{NEEDLE}/State", RigidBodyState)
    needle.wait()
    assert needle.comes_at(95, 105, 2.0)


def test_state_messages_state_who_they_are(listen: Callable[..., Any]) -> None:
    from ambf_msgs.msg import RigidBodyState

    message = listen(f"{NEEDLE}/State", RigidBodyState).wait()
    assert message.identifier.data == "/ambf/env/phantom/BODY Needle"
    assert message.name.data == "Needle"
    assert message.mass > 0 and message.pInertia.x > 0
    assert abs(time.time() - message.header.stamp.to_sec()) < 2.0
    assert message.pose.position.z == pytest.approx(0.7154, abs=2e-3)


def test_joint_lists_appear_with_the_first_command_and_joints_follow(
    listen: Callable[..., Any], publish: Callable[..., Any]
) -> None:
    from ambf_msgs.msg import RigidBodyState

    state = listen(f"{BASE}/State", RigidBodyState)
    assert state.wait().joint_names == []
    publisher = publish(f"{BASE}/Command", type(body_command()))
    command = body_command(
        joint_cmds=[0.1, 0.1, 0.1, 0.2, 0.1, 0.1, 0.3, 0.3], joint_cmds_types=[1] * 8, publish_joint_names=True,
        publish_joint_positions=True, publish_children_names=True,
    )  # fmt: skip
    publisher.publish(command)
    until(lambda: any(len(m.joint_names) == 8 for m in state.messages), "one command brings the lists")
    wanted = pytest.approx(command.joint_cmds, abs=2e-3)

    def follows() -> bool:
        publisher.publish(command)
        return state.messages[-1].joint_positions == wanted

    until(follows, lambda: f"the joints follow: {state.messages[-1].joint_positions}")
    message = state.messages[-1]
    assert message.joint_names[2] == "pitchendlink-maininsertionlink"
    assert message.children_names[0] == "yawlink"


def test_commanded_objects_publish_at_the_higher_rate_and_fall_back(
    listen: Callable[..., Any], publish: Callable[..., Any]
) -> None:
    from ambf_msgs.msg import RigidBodyState

    state = listen(f"{BASE}/State", RigidBodyState)
    state.wait()
    publisher = publish(f"{BASE}/Command", type(body_command()))
    silent = threading.Event()

    def command() -> None:
        while not silent.wait(0.02):
            publisher.publish(body_command())

    commanding = threading.Thread(target=command)
    commanding.start()
    try:
        assert state.comes_at(120, 220)  # of 200; a busy machine misses some
    finally:
        silent.set()
        commanding.join()
    assert state.comes_at(60, 115)


def test_sim_steps_and_times_advance(listen: Callable[..., Any]) -> None:
    from ambf_msgs.msg import WorldState

    world = listen(f"{WORLD}/State", WorldState)
    first = world.wait()
    last = world.wait(lambda message: message.sim_step > first.sim_step + 100)
    assert last.sim_time - first.sim_time == pytest.approx((last.sim_step - first.sim_step) * 0.002, rel=1e-2)


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e30])
def test_numbers_that_are_not_finite_are_rejected_and_counted(
    bad: float, listen: Callable[..., Any], publish: Callable[..., Any]
) -> None:
    from ambf_msgs.msg import RigidBodyState

    before = int(diagnostics(listen)["commands rejected"])
    publisher = publish(f"{NEEDLE}/Command", type(body_command()))
    command = body_command(cartesian_cmd_type=1)
    command.pose.position.x = bad
    for _ in range(10):
        publisher.publish(command)
        time.sleep(0.01)
    deadline = time.monotonic() + 5
    while int(diagnostics(listen)["commands rejected"]) <= before:
        assert time.monotonic() < deadline
    message = listen(f"{NEEDLE}/State", RigidBodyState).wait()
    assert math.isfinite(message.pose.position.x) and abs(message.pose.position.x) < 1


def test_bad_numbers_on_every_kind_of_command_topic_are_counted(
    listen: Callable[..., Any], publish: Callable[..., Any]
) -> None:
    from ambf_msgs.msg import ActuatorCmd, CameraCmd, LightCmd, RigidBodyState, WorldCmd

    before = int(diagnostics(listen)["commands rejected"])
    camera, light = CameraCmd(enable_position_controller=True), LightCmd(enable_position_controller=True)
    actuator = ActuatorCmd(actuate=True, use_offset=True)
    for pose in (camera.pose, light.pose, actuator.body_offset):
        pose.position.y, pose.orientation.w = math.nan, 1.0
    joints = body_command(joint_cmds=[math.nan] * 3, joint_cmds_types=[1, 1, 1])
    publish("/ambf/env/cameras/cameraL/Command", CameraCmd).publish(camera)
    publish("/ambf/env/lights/light2/Command", LightCmd).publish(light)
    publish("/ambf/env/ghosts/psm2/Actuator0/Command", ActuatorCmd).publish(actuator)
    publish(f"{BASE}/Command", type(joints)).publish(joints)
    publish(f"{WORLD}/Command", WorldCmd).publish(WorldCmd(enable_step_throttling=False, n_skip_steps=255))
    deadline = time.monotonic() + 5
    while int(diagnostics(listen)["commands rejected"]) < before + 4:
        assert time.monotonic() < deadline
    message = listen(f"{NEEDLE}/State", RigidBodyState).wait()
    assert math.isfinite(message.pose.position.x)


def test_an_unknown_command_type_is_rejected_and_nothing_else_stops(
    listen: Callable[..., Any], publish: Callable[..., Any]
) -> None:
    from ambf_msgs.msg import RigidBodyState

    publish(f"{NEEDLE}/Command", type(body_command())).publish(body_command(cartesian_cmd_type=9))
    assert listen(f"{NEEDLE}/State", RigidBodyState).comes_at(80, seconds=0.5)


def test_a_flood_of_commands_is_coalesced(listen: Callable[..., Any], publish: Callable[..., Any]) -> None:
    from ambf_msgs.msg import WorldState

    publisher = publish(f"{BASE}/Command", type(body_command()))
    before = diagnostics(listen)
    end = time.monotonic() + 1.0
    sent = 0
    while time.monotonic() < end:
        for _ in range(100):
            publisher.publish(body_command(joint_cmds=[0.1] * 40, joint_cmds_types=[1] * 40))
            sent += 1
        time.sleep(0.005)
    world = listen(f"{WORLD}/State", WorldState)
    world.wait()

    def counted() -> bool:
        after = diagnostics(listen)
        return all(int(after[name]) > int(before[name]) for name in ("commands received", "commands coalesced"))

    until(counted, "the flood is counted")
    assert world.comes_at(50, seconds=0.5)


def test_resets_put_bodies_back_and_time_goes_on(listen: Callable[..., Any], publish: Callable[..., Any]) -> None:
    from ambf_msgs.msg import RigidBodyState
    from std_msgs.msg import Empty

    needle = listen(f"{NEEDLE}/State", RigidBodyState)
    start = needle.wait()
    mover = publish(f"{NEEDLE}/Command", type(body_command()))
    command = body_command(cartesian_cmd_type=1)
    command.pose = start.pose
    command.pose.position.z += 0.05
    for _ in range(100):
        mover.publish(command)
        time.sleep(0.01)
    lifted = needle.messages[-1].pose.position.z
    assert lifted > start.pose.position.z - 0.05 + 0.03
    needle.wait(lambda m: m.pose.position.z < lifted - 0.01, 5.0)  # the command has run out
    time_before = needle.messages[-1].sim_time
    publish(f"{WORLD}/Command/Reset/Bodies", Empty).publish(Empty())
    needle.wait(lambda m: abs(m.pose.position.x - 0.005) < 1e-3 and m.pose.position.z < 0.7165, 5.0)
    needle.wait(lambda m: m.sim_time > time_before, 5.0)


def test_a_client_steps_the_world_by_the_edges_of_its_clock(
    listen: Callable[..., Any], publish: Callable[..., Any]
) -> None:
    from ambf_msgs.msg import WorldCmd, WorldState

    world = listen(f"{WORLD}/State", WorldState)
    publisher = publish(f"{WORLD}/Command", WorldCmd)
    clock = True
    publisher.publish(WorldCmd(enable_step_throttling=True, step_clock=clock, n_skip_steps=5))
    world.wait()
    steps = [int(steady(lambda: world.messages[-1].sim_step, 0.3))]
    for _ in range(8):
        clock = not clock
        publisher.publish(WorldCmd(enable_step_throttling=True, step_clock=clock, n_skip_steps=5))
        world.wait(lambda message: message.sim_step == steps[-1] + 5, 5.0)
        steps.append(int(steady(lambda: world.messages[-1].sim_step, 0.05)))
    assert {b - a for a, b in zip(steps[:-1], steps[1:], strict=True)} == {5}
    world.wait(lambda message: message.sim_step > steps[-1] + 50, 5.0)


def test_ghosts_and_actuators_have_their_topics(listen: Callable[..., Any], publish: Callable[..., Any]) -> None:
    from ambf_msgs.msg import ActuatorCmd, ActuatorState, GhostObjectState

    ghost = listen("/ambf/env/ghosts/psm1/left_finger_ghost/State", GhostObjectState).wait()
    assert ghost.parent_name.data == "psm1/BODY tool gripper left link"
    actuator = listen("/ambf/env/ghosts/psm1/Actuator0/State", ActuatorState)
    publisher = publish("/ambf/env/ghosts/psm1/Actuator0/Command", ActuatorCmd)
    command = ActuatorCmd(actuate=True)
    command.body_name.data = "Needle"
    for _ in range(10):
        publisher.publish(command)
        time.sleep(0.02)
    actuator.wait(lambda m: m.actuated, 2.0)
    actuator.wait(lambda m: not m.actuated, 3.0)


def test_parameters_of_cameras_and_lights_are_on_the_server(node: Any) -> None:
    assert node.get_param("/ambf/env/cameras/cameraL/field_view_angle") == pytest.approx(1.2)
    assert node.get_param("/ambf/env/lights/light2/type") == "SPOT"
    assert node.get_param(f"{WORLD}/point_cloud_topics") == [f"{WORLD}/point_cloud"]


def test_only_types_that_every_client_survives_are_advertised(node: Any) -> None:
    types = {type_ for _, type_ in node.get_published_topics("/ambf")}
    assert "ambf_msgs/SensorState" not in types and "ambf_msgs/ContactSensorState" not in types


def test_diagnostics_have_the_text_of_what_an_actuator_could_not_do(
    listen: Callable[..., Any], publish: Callable[..., Any]
) -> None:
    from ambf_msgs.msg import ActuatorCmd
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

    command = ActuatorCmd(actuate=True)
    command.body_name.data = "a body of no scene"
    publish("/ambf/env/ghosts/psm2/Actuator0/Command", ActuatorCmd).publish(command)

    def shown(array: Any) -> bool:
        found = [status for status in array.status if status.name == "ligature: simulation"]
        return any(
            status.level >= DiagnosticStatus.WARN
            and any("'a body of no scene'" in pair.value for pair in status.values)
            for status in found
        )

    listen("/diagnostics", DiagnosticArray).wait(shown, 20.0)
