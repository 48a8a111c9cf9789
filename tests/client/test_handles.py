"""Handles without a simulator: what setters put into commands, what getters read from states."""

from __future__ import annotations

import math
import threading
import time
from typing import Any

import pytest
from ambf_msgs.msg import ContactEvent, ContactSensorState, GhostObjectState, RigidBodyCmd, RigidBodyState, SensorState
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3, Wrench
from ligature.client import Actuator, Camera, ContactSensor, GhostObject, Object, RigidBody, Sensor, Vehicle, World
from std_msgs.msg import String

FORCE, POSITION, VELOCITY = RigidBodyCmd.TYPE_FORCE, RigidBodyCmd.TYPE_POSITION, RigidBodyCmd.TYPE_VELOCITY
KINDS = (Actuator, Camera, ContactSensor, GhostObject, Object, RigidBody, Sensor, Vehicle, World)


def body_with_joints(count: int = 3) -> RigidBody:
    body = RigidBody("/ambf/env/arm")
    body.ros_cb(
        RigidBodyState(
            pose=Pose(Point(1, 2, 3), Quaternion(0, 0, 0, 1)),
            joint_names=[f"joint{index}" for index in range(count)],
            joint_positions=[index / 10 for index in range(count)],
            joint_velocities=[float(index) for index in range(count)],
            joint_efforts=[10.0 * index for index in range(count)],
        )
    )
    return body


def xyz(v: Any) -> tuple[float, float, float]:
    return (v.x, v.y, v.z)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("arguments", [("/a/b",), (None, "/a/b"), (None, "/a/b", 0.5), ("/a/b", 0.5)])
def test_both_generations_of_constructors_work(kind: type, arguments: tuple[Any, ...]) -> None:
    assert kind(*arguments).get_name() == "/a/b"


@pytest.mark.parametrize("kind", KINDS)
def test_constructors_take_the_keywords_of_the_third_generation(kind: type) -> None:
    assert kind(ral=None, a_name="/a/b", time_out=1.0).get_name() == "/a/b"


def test_a_handle_without_a_name_states_how_it_is_made() -> None:
    with pytest.raises(TypeError, match=r"RigidBody needs a name: \(ral, name\)"):
        RigidBody()


@pytest.mark.parametrize("kind", KINDS)
def test_everything_can_be_read_before_the_first_message(kind: type) -> None:
    handle = kind("/a/b")
    assert handle.get_identifier() == "" and handle.get_parent_name() == ""
    assert handle.get_sim_step() == 0 and handle.get_msg_seq_num() == 0 and handle.get_msg_frame_id() == ""
    assert handle.get_msg_time_stamp().to_sec() == 0
    if hasattr(handle._state, "pose"):
        assert xyz(handle.get_pos()) == (0, 0, 0) and handle.get_rpy() == (0, 0, 0)


def test_the_pose_of_a_body_is_six_numbers() -> None:
    body = body_with_joints()
    assert body.get_pose() == [1, 2, 3, 0, 0, 0]


@pytest.mark.parametrize(("kind", "state"), [(GhostObject, GhostObjectState), (Sensor, SensorState)])
def test_the_pose_of_a_sensing_object_is_a_message(kind: type, state: type) -> None:
    handle = kind("/a/b")
    handle.ros_cb(state(pose=Pose(Point(1, 2, 3), Quaternion(0, 0, 0, 1))))
    assert isinstance(handle.get_pose(), Pose) and xyz(handle.get_pose().position) == (1, 2, 3)


def test_half_a_pose_is_completed_from_the_state_and_then_from_the_command() -> None:
    body = body_with_joints()
    body.set_rpy(0, 0, math.pi / 2)
    assert xyz(body._cmd.pose.position) == (1, 2, 3) and body._cmd.cartesian_cmd_type == POSITION
    body.ros_cb(RigidBodyState(pose=Pose(Point(9, 9, 9), Quaternion(0, 0, 0, 1))))
    body.set_pos(4, 5, 6)
    assert body._cmd.pose.orientation.z == pytest.approx(math.sqrt(0.5))
    body.set_rot([1, 0, 0, 0])
    assert xyz(body.get_pos_command()) == (4, 5, 6) and body.get_rot_command().x == 1


def test_a_pose_that_is_changed_later_does_not_change_the_command() -> None:
    body, pose = body_with_joints(), Pose(Point(1, 1, 1), Quaternion(0, 0, 0, 1))
    body.set_pose(pose)
    pose.position.x = 5
    assert body._cmd.pose.position.x == 1


def test_force_and_torque_keep_the_other_half_and_leave_position_control() -> None:
    body = body_with_joints()
    body.set_pos(0, 0, 0)
    body.set_force(1, 2, 3)
    body.set_torque(4, 5, 6)
    assert (xyz(body._cmd.wrench.force), xyz(body._cmd.wrench.torque)) == ((1, 2, 3), (4, 5, 6))
    assert body._cmd.cartesian_cmd_type == FORCE
    body.wrench_command(6, 5, 4, 3, 2, 1)
    assert (xyz(body._cmd.wrench.force), xyz(body._cmd.wrench.torque)) == ((6, 5, 4), (3, 2, 1))
    body.set_wrench(Wrench(Vector3(1, 0, 0), Vector3()))
    assert body._cmd.wrench.force.x == 1


def test_velocities_keep_the_other_half() -> None:
    body = body_with_joints()
    body.set_linear_vel(1, 2, 3)
    body.set_angular_vel(4, 5, 6)
    assert (xyz(body._cmd.twist.linear), xyz(body._cmd.twist.angular)) == ((1, 2, 3), (4, 5, 6))
    assert body._cmd.cartesian_cmd_type == VELOCITY
    body.velocity_command(6, 5, 4, 3, 2, 1)
    assert (xyz(body._cmd.twist.linear), xyz(body._cmd.twist.angular)) == ((6, 5, 4), (3, 2, 1))
    body.set_twist(Twist(Vector3(7, 0, 0), Vector3()))
    assert body._cmd.twist.linear.x == 7


def test_a_pose_command_turns_about_z_then_y_then_x() -> None:
    body = body_with_joints()
    body.pose_command(1, 2, 3, math.pi / 2, 0, math.pi / 2, 0.1, 0.2)
    # a quarter turn about z takes x to y, the one about x takes that to z
    q = body._cmd.pose.orientation
    assert (q.x, q.y, q.z, q.w) == pytest.approx((0.5, -0.5, 0.5, 0.5))
    assert body._cmd.joint_cmds == []


def test_a_joint_command_grows_and_never_shrinks() -> None:
    body = body_with_joints()
    body.set_joint_pos("joint2", 0.5)
    assert (body._cmd.joint_cmds, body._cmd.joint_cmds_types) == ([0, 0, 0.5], [FORCE, FORCE, POSITION])
    body.set_joint_vel(0, 1.5)
    body.set_joint_effort(1, 2.5)
    assert body._cmd.joint_cmds == [1.5, 2.5, 0.5] and body._cmd.joint_cmds_types == [VELOCITY, FORCE, POSITION]


def test_many_joints_take_one_value_each_or_read_a_full_list_by_index() -> None:
    body = body_with_joints()
    body.set_multiple_joint_pos([0.1, 0.2], [2, 0])
    assert body._cmd.joint_cmds == [0.2, 0, 0.1]
    body.set_multiple_joint_vel([1, 2, 3], [2, 0])
    assert body._cmd.joint_cmds == [1, 0, 3] and body._cmd.joint_cmds_types == [VELOCITY, FORCE, VELOCITY]
    body.set_multiple_joint_effort([7], [1])
    assert body._cmd.joint_cmds == [1, 7, 3]
    with pytest.raises(
        ValueError, match=r"/ambf/env/arm: 1 values cannot command the joints \[0, 2\]; give one for each"
    ):
        body.set_multiple_joint_pos([1], [0, 2])


def test_joints_are_read_by_name_or_index() -> None:
    body = body_with_joints()
    assert body.get_joint_names() == ["joint0", "joint1", "joint2"] and body.get_num_joints() == 3
    assert body.get_joint_pos("joint2") == body.get_joint_pos(2) == pytest.approx(0.2)
    assert body.get_joint_vel(1) == 1 and body.get_joint_effort("joint1") == 10
    assert body.get_all_joint_vel() == [0, 1, 2] and body.get_all_joint_effort() == [0, 10, 20]
    assert body.get_joint_idx_from_name("joint1") == 1 and body.get_joint_name_from_idx(1) == "joint1"


@pytest.mark.parametrize("joint", ["elbow", 3, -1])
def test_a_joint_that_is_missing_gives_none_and_commands_nothing(joint: Any, caplog: Any) -> None:
    body = body_with_joints()
    assert body.get_joint_pos(joint) is None
    body.set_joint_pos(joint, 1.0)
    assert body._cmd.joint_cmds == []
    assert f"no joint {joint!r}; it has 0 joint0, 1 joint1, 2 joint2" in caplog.text


def test_what_is_not_a_number_is_refused_where_it_is_set() -> None:
    body = body_with_joints()
    with pytest.raises((TypeError, ValueError)):
        body.set_joint_pos(0, "far")  # type: ignore[arg-type]
    with pytest.raises((TypeError, ValueError)):
        body.set_pos(None, 0, 0)  # type: ignore[arg-type]
    assert body._cmd.joint_cmds == [] and body._cmd.cartesian_cmd_type == FORCE


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_number_that_is_not_finite_leaves_the_last_command(bad: float, caplog: Any) -> None:
    body = body_with_joints()
    body.set_joint_pos(1, 0.5)
    body.set_joint_pos(1, bad)
    body.set_force(1, 0, 0)
    body.set_force(bad, 0, 0)
    body.set_linear_vel(0, bad, 0)
    body.set_rot([0, 0, 0, bad])
    body.set_rpy(0, bad, 0)
    body.pose_command(1, 2, 3, bad, 0, 0)
    assert body._cmd.joint_cmds == [0, 0.5] and body._cmd.wrench.force.x == 1 and body._cmd.twist.linear.y == 0
    assert body._cmd.cartesian_cmd_type == FORCE
    assert f"/ambf/env/arm: {bad} are not valid commands; keeping the previous command" in caplog.text


def test_active_bodies_ask_for_their_lists() -> None:
    body = RigidBody("/a/b")
    assert not body.is_active() and not body.get_publish_joint_positions_flag()
    body.set_active()
    assert body.is_active() and body.get_publish_children_names_flag()
    assert body.get_publish_joint_names_flag() and body.get_publish_joint_positions_flag()


def test_joints_that_were_just_asked_for_are_waited_for_but_not_for_ever() -> None:
    body = RigidBody("/a/b")
    begin = time.monotonic()
    assert body.get_num_joints() == 0 and time.monotonic() - begin < 0.4
    body.set_active()
    listing = threading.Timer(0.1, body.ros_cb, [RigidBodyState(joint_names=["a"], joint_positions=[0.5])])
    listing.start()
    assert body.get_joint_pos("a") == 0.5
    without = RigidBody("/a/c")
    without.set_active()
    begin = time.monotonic()
    assert without.get_joint_names() == [] and 0.4 < time.monotonic() - begin < 5.0
    begin = time.monotonic()
    assert without.get_joint_pos(0) is None and time.monotonic() - begin < 0.4


def test_only_what_has_a_pose_command_can_be_moved() -> None:
    camera = Camera("/a/camera")
    assert not camera._cmd.enable_position_controller
    camera.set_pos(1, 2, 3)
    assert camera._cmd.enable_position_controller and xyz(camera._cmd.pose.position) == (1, 2, 3)
    with pytest.raises(TypeError, match="a GhostObject cannot be moved"):
        GhostObject("/a/ghost").set_pos(1, 2, 3)


def test_an_actuator_holds_by_name_or_by_sensor_and_lets_go() -> None:
    actuator = Actuator("/a/Actuator0")
    actuator.actuate("Needle")
    assert actuator._cmd.actuate and actuator._cmd.body_name.data == "Needle" and not actuator._cmd.use_sensor_data
    actuator.actuate_from_sensor_data("/a/sensor")
    assert actuator._cmd.use_sensor_data and actuator._cmd.sensor_identifier.data == "/a/sensor"
    actuator.deactuate()
    assert not actuator._cmd.actuate and actuator._cmd.body_name.data == ""


def test_a_ghost_names_what_is_inside() -> None:
    ghost = GhostObject("/a/ghost")
    ghost.ros_cb(GhostObjectState(sensed_objects=[String("BODY Needle"), String("BODY Thread")]))
    assert ghost.get_all_sensed_obj_names() == ["BODY Needle", "BODY Thread"]
    assert ghost.get_sensed_obj_name(1) == "BODY Thread" and ghost.get_sensed_obj_name(2) is None


def test_a_sensor_reads_its_rays() -> None:
    sensor = Sensor("/a/sensor")
    sensor.ros_cb(
        SensorState(
            parent_name=String("BODY tip"), count=2, triggered=[True, False], range=[0.1], measurement=[0.5, 0.0],
            sensed_objects=[String("Needle"), String("")],
        )
    )  # fmt: skip
    assert sensor.get_count() == 2 and sensor.is_triggered(0) and sensor.get_parent() == "BODY tip"
    assert sensor.get_range(1) == 0.1 and sensor.get_all_measurements() == [0.5, 0.0]
    assert sensor.get_measurement(0) == 0.5 and sensor.get_sensed_object(0) == "Needle"
    assert sensor.is_triggered(2) is None and sensor.get_range(2) is None and sensor.get_sensed_object(2) is None


def test_a_contact_sensor_lists_who_touches() -> None:
    sensor = ContactSensor("/a/sensor")
    sensor.ros_cb(ContactSensorState(contact_events=[ContactEvent(object_name=String("BODY Needle"))]))
    assert sensor.get_num_contact_events() == len(sensor.get_all_contact_event()) == 1
    assert sensor.get_contact_object_name(0) == "BODY Needle" and sensor.get_contact_object_name(1) is None
    assert sensor.get_all_contact_object_names() == ["BODY Needle"] and sensor.get_contact_event(1) is None


def test_a_legacy_object_marks_the_joints_it_drives_to_positions() -> None:
    legacy = Object("/a/object")
    legacy.ros_cb(Object.State(joint_names=["a", "b"], joint_positions=[0, 0]))
    legacy.set_joint_pos("b", 0.5)
    legacy.set_joint_effort(0, 2.0)
    assert legacy._cmd.joint_cmds == [2.0, 0.5] and legacy._cmd.position_controller_mask == [False, True]
    legacy.pose_command(1, 2, 3, 0, 0, 0, 0.1, 0.2)
    assert legacy._cmd.enable_position_controller and legacy._cmd.position_controller_mask == [True, True]
    legacy.wrench_command(1, 2, 3, 4, 5, 6)
    assert not legacy._cmd.enable_position_controller and legacy._cmd.wrench.torque.z == 6


def car() -> Vehicle:
    vehicle = Vehicle("/a/car")
    places = [(1, 0.5), (1, -0.5), (-1, 0.5), (-1, -0.5)]
    offsets = [Pose(position=Point(x, y, 0)) for x, y in places]
    vehicle.ros_cb(Vehicle.State(wheel_count=4, wheel_offsets=offsets))
    vehicle.set_steered_wheel_indices([0, 1])
    vehicle.set_powered_wheel_indices([2, 3])
    return vehicle


def test_a_vehicle_powers_steers_and_brakes_its_wheels() -> None:
    vehicle = car()
    vehicle.set_vehicle_power(3)
    vehicle.set_vehicle_steering(0.2)
    vehicle.set_wheel_brake(1, 0.7)
    assert vehicle._cmd.wheel_power == [0, 0, 3, 3] and vehicle._cmd.wheel_steering == [0.2, 0.2, 0, 0]
    assert vehicle._cmd.wheel_brake == [0, 0.7, 0, 0] and not vehicle._cmd.brake
    vehicle.set_vehicle_brake(1)
    assert vehicle._cmd.brake and vehicle._cmd.wheel_brake == [1, 1, 1, 1]


@pytest.mark.parametrize("turn", [0.3, -0.3])
def test_ackermann_steering_points_all_axes_at_one_centre(turn: float) -> None:
    vehicle = car()
    vehicle.set_vehicle_steering_ackerman(turn)
    centre = 2.0 / math.tan(turn)
    left, right = vehicle._cmd.wheel_steering[:2]
    assert math.tan(left) == pytest.approx(2.0 / (centre - 0.5))
    assert math.tan(right) == pytest.approx(2.0 / (centre + 0.5))
    vehicle.set_vehicle_steering_ackerman(0.0)
    assert vehicle._cmd.wheel_steering[:2] == [0, 0]


@pytest.mark.parametrize("steps", [0, 101, -1])
def test_a_world_takes_one_to_a_hundred_steps_an_update(steps: int) -> None:
    world = World("/a/World")
    with pytest.raises(ValueError, match="must be 1 to 100"):
        world.set_num_step_skips(steps)
    world.set_num_step_skips(100)
    assert world._cmd.n_skip_steps == 100


def test_a_world_without_updates_ends_throttling_after_its_time_out() -> None:
    world = World(None, "/a/World", 0.0)
    world.enable_throttling(True)
    assert world._cmd.enable_step_throttling
    world._updated -= 0.1
    world.clear_command()
    assert not world._cmd.enable_step_throttling


def test_a_handle_without_a_client_states_where_handles_come_from() -> None:
    for call in (World("/a/World").reset, RigidBody("/a/b").publish):
        with pytest.raises(RuntimeError, match=r"is not connected: get its handle from a Client after connect\(\)"):
            call()
