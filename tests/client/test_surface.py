"""What AMBF's and CRTK's clients offer, ours offers: walked name by name."""

from __future__ import annotations

import inspect

import ligature.client
import pytest

BASE = """get_children_names get_identifier get_msg_frame_id get_msg_header get_msg_seq_num get_msg_time_stamp get_name
get_num_of_children get_parent_name get_pos get_pos_command get_pose get_rot get_rot_command get_rpy get_sim_step is_active
ros_cb set_active set_name set_pos set_pose set_rot set_rpy"""
PLACED = BASE.replace("get_children_names ", "").replace("get_num_of_children ", "")
SURFACE = {
    "Client": """clean_up connect create_rate get_common_namespace get_obj_handle get_obj_names get_obj_pose get_ral get_time
    get_world_handle is_shutdown ral refresh set_obj_cmd""",
    "RigidBody": f"""{BASE} get_all_joint_effort get_all_joint_pos get_all_joint_vel get_angular_vel
    get_angular_velocity_command get_force_command get_inertia get_joint_effort get_joint_idx_from_name
    get_joint_name_from_idx get_joint_names get_joint_pos get_joint_vel get_linear_vel get_linear_velocity_command
    get_num_joints get_publish_children_name_flag get_publish_children_names_flag get_publish_joint_names_flag
    get_publish_joint_positions_flag get_torque_command is_joint_idx_valid pose_command set_angular_vel set_force
    set_joint_effort set_joint_pos set_joint_vel set_linear_vel set_multiple_joint_effort set_multiple_joint_pos
    set_multiple_joint_vel set_publish_children_names_flag set_publish_joint_names_flag set_publish_joint_positions_flag
    set_torque set_twist set_wrench velocity_command wrench_command""",
    "World": "enable_throttling get_name reset reset_bodies ros_cb set_num_step_skips update",
    "Actuator": f"{PLACED} actuate actuate_from_sensor_data deactuate",
    "Camera": PLACED,
    "Light": PLACED,
    "GhostObject": "get_all_sensed_obj_names get_pose get_sensed_obj_name",
    "Sensor": """get_all_measurements get_count get_measurement get_parent get_pose get_range get_sensed_object
    is_triggered""",
    "ContactSensor": """get_all_contact_event get_all_contact_object_names get_contact_event get_contact_object_name
    get_num_contact_events""",
    "Object": f"{BASE} pose_command set_force set_joint_effort set_joint_pos set_torque wrench_command",
    "Vehicle": """get_wheel_count set_powered_wheel_indices set_steered_wheel_indices set_vehicle_brake set_vehicle_power
    set_vehicle_steering set_vehicle_steering_ackerman set_wheel_brake set_wheel_power set_wheel_steering""",
    "ral": """check_connections create_child create_duration create_rate create_time get_published_topics get_timestamp
    get_topic_name is_shutdown namespace node_name now now_msg on_shutdown parse_argv publisher ros_version service_client
    set_timestamp shutdown sleep spin spin_and_execute subscriber to_sec""",
}


@pytest.mark.parametrize("name", SURFACE)
def test_every_name_of_theirs_is_there(name: str) -> None:
    ours = {member for member, _ in inspect.getmembers(getattr(ligature.client, name))}
    assert set(SURFACE[name].split()) - ours == set()


def test_commands_are_read_back_before_anything_was_measured() -> None:
    """As AMBF's: wrenches and twists that were commanded; a twist that never was is the measured one."""
    from ligature.client import RigidBody

    body = RigidBody("/ambf/env/any")
    body.set_force(1.0, 2.0, 3.0)
    body.set_torque(4.0, 5.0, 6.0)
    assert (body.get_force_command().y, body.get_torque_command().z) == (2.0, 6.0)
    body._state.twist.linear.x = 0.5
    assert body.get_linear_velocity_command().x == 0.5
    body.set_linear_vel(0.1, 0.0, 0.0)
    body.set_angular_vel(0.0, 0.2, 0.0)
    assert (body.get_linear_velocity_command().x, body.get_angular_velocity_command().y) == (0.1, 0.2)
    assert (body.object_type, body.body_type) == ("RIGID_BODY", "DYNAMIC")
