"""Lines of the contract of CRTK and dVRK 2.4 that no other module tries; docs/conformance.md is the whole table.

The run keeps base frames by the camera, as the console of a dVRK with a cart does.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ligature.model.frames import axis_rotation, frame, inverse, matrix_pose7, pose7_matrix

from tests.ros.conftest import BIN
from tests.waiting import stays, steady, until

pytestmark = pytest.mark.ros

HOME = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])
T_HRSV_BASE = {
    "MTML": frame(np.array([[-1, 0, 0], [0, 0.8660254, 0.5], [0, 0.5, -0.8660254]]), (0.18, 0.4, 0.475)),
    "MTMR": frame(np.array([[-1, 0, 0], [0, 0.8660254, 0.5], [0, 0.5, -0.8660254]]), (-0.18, 0.4, 0.475)),
}
"""Bases of the masters of the stock simulated systems."""


@pytest.fixture(scope="module")
def program(start: Callable[..., Any], arms_scene: Path) -> Any:
    program = start(BIN / "ligature", "run", arms_scene, "-p", "500", "--no-cameras", "--base-frames", "ECM")
    program.wait_for("first state published")
    return program


@pytest.fixture(scope="module")
def arms(program: Any, node: Any) -> Iterator[dict[str, Any]]:
    from tests.ros import crtk

    kinds = {"PSM1": crtk.Psm, "PSM2": crtk.Psm, "ECM": crtk.Arm, "MTML": crtk.Mtm, "MTMR": crtk.Mtm}
    found = {name: kind(node, name) for name, kind in kinds.items()}
    for arm in found.values():
        arm.check_connections(10.0)
        assert arm.enable(10.0) and arm.home(20.0)
    yield found
    for arm in found.values():
        arm.close()


@pytest.fixture
def psm(arms: dict[str, Any]) -> Any:
    """PSM1 at its home pose."""
    arm = arms["PSM1"]
    assert arm.enable(10.0) and arm.home(20.0)
    assert arm.move_jp(HOME).wait()
    steady(arm.measured_jp, within=1e-4)
    return arm


def hear_pose(link: Any, name: str) -> Any:
    from tests.ros.crtk import pose7

    return pose7_matrix(pose7(link.hear(name).pose))


def body(listen: Callable[..., Any], name: str) -> Callable[[], Any]:
    """AMBF's pose of a body in the world (4, 4), which knows nothing of CRTK."""
    from ambf_msgs.msg import RigidBodyState

    from tests.ros.crtk import pose7

    anchor = listen(f"/ambf/env/{name}/State", RigidBodyState)
    return lambda: pose7_matrix(pose7(anchor.wait().pose))


# --- frames -----------------------------------------------------------------------------------


def test_poses_are_in_the_frame_of_the_camera_wherever_it_goes(arms: Any, psm: Any, listen: Callable[..., Any]) -> None:
    """Anchors are AMBF's bodies: the camera's and the tool's, each apart from its tip by a pose that does not change."""
    ecm, camera, tool = arms["ECM"], body(listen, "phantom/CameraFrame"), body(listen, "psm1/toolyawlink")
    until(lambda: psm.hear("measured_cp").header.frame_id == "ECM", "instruments are in the frame of the camera")
    until(lambda: ecm.hear("measured_cp").header.frame_id == "Cart", "the camera is in the frame of the cart")
    assert psm.hear("local/measured_cp").header.frame_id == "PSM1_base"
    steady(lambda: hear_pose(psm, "measured_cp"), within=1e-5)
    T_camera_ecm = inverse(camera()) @ hear_pose(ecm, "measured_cp")
    T_tool_tip = inverse(tool()) @ camera() @ T_camera_ecm @ hear_pose(psm, "measured_cp")
    for joints in ([0.1, 0.1, 0.1, 0.2], [-0.2, 0.05, 0.14, -0.3], [0.0, 0.0, 0.12, 0.0]):
        assert ecm.move_jp(joints).wait()
        assert psm.move_jp(HOME + [*joints[:2], 0.0, *joints[1:]]).wait()
        steady(lambda: hear_pose(psm, "measured_cp"), within=1e-5)
        steady(tool, within=1e-5)
        expected = inverse(camera() @ T_camera_ecm) @ tool() @ T_tool_tip
        until(lambda e=expected: np.abs(hear_pose(psm, "measured_cp") - e).max() < 2e-3, f"{expected}", 5.0)
        world = hear_pose(ecm, "measured_cp")
        assert np.abs(world - camera() @ T_camera_ecm).max() < 1e-3


def test_a_step_to_the_right_in_the_frame_of_the_camera_is_one_in_the_world(
    arms: Any, psm: Any, listen: Callable[..., Any]
) -> None:
    tool = body(listen, "psm1/toolyawlink")
    R_world_ecm = hear_pose(arms["ECM"], "measured_cp")[:3, :3]
    for axis in range(3):
        start, goal = tool()[:3, 3], psm.setpoint_cp()
        goal[axis] += 0.005
        psm.servo_cp(goal)
        until(lambda g=goal: np.linalg.norm(psm.measured_cp()[:3] - g[:3]) < 2e-4, "it gets there", 10.0)
        steady(lambda: tool()[:3, 3], within=1e-5)
        assert tool()[:3, 3] - start == pytest.approx(0.005 * R_world_ecm[:, axis], abs=3e-4)


def test_a_base_frame_by_hand_counts_until_the_camera_moves(arms: Any, psm: Any) -> None:
    """A view whose axes are not the tip's, as labs have it: measured in `ECM_view`."""
    from geometry_msgs.msg import PoseStamped

    from tests.ros.crtk import pose_message

    T_ecm_base = hear_pose(psm, "measured_cp") @ inverse(hear_pose(psm, "local/measured_cp"))
    T_view_ecm = frame(axis_rotation(np.array([0.0, 0.0, 1.0]), np.pi), (0.0, 0.0, 0.0))
    message = PoseStamped(pose=pose_message(matrix_pose7(T_view_ecm @ T_ecm_base)))
    message.header.frame_id = "ECM_view"
    before = hear_pose(psm, "measured_cp")
    psm.send("set_base_frame", message)
    for reading in ("measured_cp", "setpoint_cp"):
        until(lambda name=reading: psm.hear(name).header.frame_id == "ECM_view", f"{reading} in ECM_view", 10.0)
    assert np.abs(hear_pose(psm, "measured_cp") - T_view_ecm @ before).max() < 1e-3
    assert psm.hear("local/measured_cp").header.frame_id == "PSM1_base"
    ecm = arms["ECM"]
    assert ecm.move_jp([0.05, 0.0, 0.12, 0.0]).wait()
    until(lambda: psm.hear("measured_cp").header.frame_id == "ECM", "the console sets it anew", 10.0)
    assert ecm.move_jp([0.0, 0.0, 0.12, 0.0]).wait()


def test_set_up_joints_report_bases_in_the_cart_and_in_the_camera(
    psm: Any, arms: Any, listen: Callable[..., Any]
) -> None:
    from geometry_msgs.msg import PoseStamped

    from tests.ros.crtk import pose7

    poses = {name: listen(f"/SUJ/{name}/measured_cp", PoseStamped) for name in ("PSM1", "PSM2", "ECM")}
    assert {name: heard.wait().header.frame_id for name, heard in poses.items()} == {
        "PSM1": "ECM", "PSM2": "ECM", "ECM": "Cart",
    }  # fmt: skip
    T_ecm_base = hear_pose(psm, "measured_cp") @ inverse(hear_pose(psm, "local/measured_cp"))
    until(
        lambda: np.abs(pose7_matrix(pose7(poses["PSM1"].messages[-1].pose)) - T_ecm_base).max() < 2e-3, "the same base"
    )


@pytest.mark.parametrize("name", ["MTML", "MTMR"])
def test_masters_are_in_the_frame_of_the_console(arms: Any, name: str) -> None:
    arm = arms[name]
    steady(arm.measured_jp, within=1e-6)
    assert arm.hear("measured_cp").header.frame_id == "HRSV"
    got = hear_pose(arm, "measured_cp") @ inverse(hear_pose(arm, "local/measured_cp"))
    assert np.abs(got - T_HRSV_BASE[name]).max() < 1e-5


def test_names_frames_and_stamps_of_commands_are_not_looked_at(psm: Any) -> None:
    from geometry_msgs.msg import PoseStamped
    from sensor_msgs.msg import JointState

    from tests.ros.crtk import pose_message

    goal = HOME + [0.05, 0.0, 0.0, 0.0, 0.0, 0.0]
    psm.publish("servo_jp", JointState(name=["x"] * 6, position=list(goal)))  # and a stamp of zero
    until(lambda: np.abs(psm.measured_jp() - goal).max() < 1e-3, "joints by their order", 10.0)
    pose = psm.setpoint_cp()
    pose[0] += 0.005
    message = PoseStamped(pose=pose_message(pose))
    message.header.frame_id = "some other frame"
    psm.publish("servo_cp", message)
    until(lambda: np.linalg.norm(psm.measured_cp()[:3] - pose[:3]) < 2e-4, "a pose in the frame of measured_cp", 10.0)


# --- motion -----------------------------------------------------------------------------------


def test_relative_joint_commands_add_to_set_points_and_to_goals(psm: Any) -> None:
    for _ in range(4):
        psm.servo_jr([0.01, 0.0, 0.0, 0.0, 0.0, 0.0])
        time.sleep(0.03)
    until(lambda: abs(psm.measured_jp()[0] - 0.04) < 5e-4, "four steps of servo_jr", 10.0)
    psm.move_jp(HOME + [0.4, 0.0, 0.0, 0.0, 0.0, 0.0]).wait(is_busy=True)
    assert psm.move_jr([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]).wait()
    until(lambda: abs(psm.setpoint_jp()[0] - 0.5) < 1e-4, "relative to the goal of the move that runs", 5.0)


@pytest.mark.parametrize("by", ["move", "servo", "hold"])
def test_an_interrupted_move_reports_that_its_goal_was_not_reached(
    psm: Any, listen: Callable[..., Any], by: str
) -> None:
    from std_msgs.msg import Bool

    reached = listen("/PSM1/goal_reached", Bool)
    reached.wait()
    assert psm.move_jp(HOME + [0.8, 0.0, 0.0, 0.0, 0.0, 0.0]).wait(is_busy=True)
    before = len(reached.messages)
    if by == "servo":
        psm.servo_jp(psm.setpoint_jp())
    elif by == "hold":
        psm.hold()
    else:
        psm.move_jp(HOME)
    until(lambda: [m.data for m in reached.messages[before:]][:1] == [False], "the first move is given up", 5.0)
    if by == "hold":
        at = psm.setpoint_jp()
        stays(lambda: np.abs(psm.setpoint_jp() - at).max() < 1e-9, "it stays where it was stopped", 0.3)


def test_moves_keep_the_limits_of_velocity(psm: Any, listen: Callable[..., Any]) -> None:
    from sensor_msgs.msg import JointState

    heard = listen("/PSM1/setpoint_js", JointState)
    assert psm.move_jp(HOME + [1.2, 0.4, 0.05, 1.0, 0.5, 0.5]).wait()
    assert psm.move_jp(HOME).wait()
    top = np.abs([m.velocity for m in heard.messages]).max(axis=0)
    limits = np.array([*np.deg2rad([90.0, 90.0]), 0.2, *np.deg2rad([1080.0] * 3)])
    assert (top <= limits + 1e-6).all() and top[0] > 0.3, top


def test_the_jaw_shares_the_busy_flag_and_reports_no_velocity_of_its_set_point(psm: Any) -> None:
    assert psm.jaw.open_jaw().wait(is_busy=True), "the arm is busy while its jaw moves"
    until(lambda: not psm.state.now.is_busy, "and idle after it", 5.0)
    assert not psm.jaw.hear("setpoint_js").velocity and psm.jaw.hear("setpoint_js").name == ["jaw"]
    psm.jaw.servo_jp(9.0)
    until(lambda: abs(psm.jaw.setpoint_jp() - np.deg2rad(80.0)) < 0.02, "clipped to the range of the tool", 5.0)
    psm.jaw.servo_jp(0.0)


@pytest.mark.parametrize("verb", ["servo_cs", "body/servo_cf", "spatial/servo_cf"])
def test_efforts_of_nothing_leave_the_arm_floating(psm: Any, verb: str) -> None:
    """A state of which nothing is valid, and wrenches of zero: no motion of an arm without weight, and no FAULT."""
    from crtk_msgs.msg import CartesianState
    from geometry_msgs.msg import WrenchStamped

    at = psm.measured_jp()
    for _ in range(20):
        psm.send(verb, CartesianState() if verb == "servo_cs" else WrenchStamped())
        time.sleep(0.01)
    assert psm.state.now.state == "ENABLED"
    assert np.abs(psm.measured_jp() - at).max() < 0.02
    psm.hold()


@pytest.mark.parametrize("axis", range(3))
def test_a_spatial_force_pushes_along_axes_of_the_reference_frame(psm: Any, axis: int) -> None:
    from geometry_msgs.msg import WrenchStamped

    start = psm.measured_cp()[:3]
    message = WrenchStamped()
    setattr(message.wrench.force, "xyz"[axis], 2.0)
    for _ in range(60):
        psm.send("spatial/servo_cf", message)
        time.sleep(0.01)
        if np.linalg.norm(psm.measured_cp()[:3] - start) > 0.004:
            break
    moved = psm.measured_cp()[:3] - start
    psm.hold()
    assert moved[axis] > 0.0 and np.linalg.norm(moved) > 0.001
    assert moved[axis] / np.linalg.norm(moved) > 0.5, f"pushed along axis {axis}, it went {moved}"


def test_an_impedance_pulls_towards_its_place(psm: Any) -> None:
    """`servo_ci` has a stiffness of 200 N/m about a place 5 mm away; the tip goes there, or near."""
    from crtk_msgs.msg import CartesianImpedance

    start = psm.measured_cp()
    message = CartesianImpedance()
    message.force_orientation.w = message.torque_orientation.w = 1.0
    p = message.force_position
    p.x, p.y, p.z = start[:3] + [0.005, 0.0, 0.0]
    for side in (message.position_positive, message.position_negative):
        side.p.x = side.p.y = side.p.z = -200.0
        side.d.x = side.d.y = side.d.z = -20.0
    for _ in range(300):
        psm.send("servo_ci", message) if "servo_ci" in psm._publishers else _talk(psm, message)
        time.sleep(0.01)
    moved = psm.measured_cp()[:3] - start[:3]
    psm.hold()
    assert moved[0] == pytest.approx(0.005, abs=0.003), moved


def _talk(psm: Any, message: Any) -> None:
    from crtk_msgs.msg import CartesianImpedance

    psm.talk("servo_ci", CartesianImpedance)
    until(lambda: psm._publishers["servo_ci"].get_num_connections() > 0, "servo_ci is heard")
    psm.send("servo_ci", message)


def test_what_is_not_ready_is_said_at_most_every_two_seconds(psm: Any, listen: Callable[..., Any]) -> None:
    from std_msgs.msg import String

    assert psm.disable(5.0)
    warnings = listen("/PSM1/warning", String)
    before = len(warnings.messages)
    begin = time.monotonic()
    while time.monotonic() - begin < 3.0:
        psm.servo_jp(HOME)
        time.sleep(0.02)
    assert 1 <= len(warnings.messages) - before <= 3, [m.data for m in warnings.messages[before:]]
    assert psm.enable(5.0) and psm.home(10.0)


def test_a_latched_state_command_of_a_client_that_still_runs_does_no_harm(psm: Any, node: Any) -> None:
    from crtk_msgs.msg import StringStamped

    latched = node.Publisher("/PSM1/state_command", StringStamped, latch=True, queue_size=1)
    latched.publish(StringStamped(string="enable"))
    stays(lambda: psm.state.now.state == "ENABLED" and psm.state.now.is_homed, "it stays enabled and homed", 0.5)
    latched.unregister()


@pytest.mark.parametrize("value", [0.0, -0.1, 1.01, float("nan"), float("inf")])
def test_ratios_out_of_range_change_nothing(psm: Any, listen: Callable[..., Any], value: float) -> None:
    from std_msgs.msg import Float64, String

    warning, ratio = listen("/PSM1/warning", String), listen("/PSM1/trajectory_j/ratio", Float64)
    ratio.wait()
    before = len(warning.messages)
    psm.send("trajectory_j/set_ratio", Float64(value))
    until(lambda: len(warning.messages) > before, f"a warning about {value}", 5.0)
    assert ratio.messages[-1].data == 1.0


def test_a_master_sinks_in_effort_modes_unless_gravity_compensation_carries_it(
    arms: dict[str, Any], listen: Callable[..., Any]
) -> None:
    from geometry_msgs.msg import WrenchStamped
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Bool

    master = arms["MTMR"]
    assert master.move_jp([0.0] * 7).wait()
    steady(master.measured_jp, within=1e-4)
    gravity = listen("/MTMR/gravity_compensation/setpoint_js", JointState)
    carried = np.array(gravity.wait().effort)
    assert carried[[0, 3, 4, 5, 6]] == pytest.approx(np.zeros(5)) and (np.abs(carried[1:3]) > 0.1).all()
    master.send("use_gravity_compensation", Bool(True))
    master.send("body/servo_cf", WrenchStamped())
    until(lambda: np.abs(master.measured_js()[2] - carried).max() < 1e-3, "the motors carry the weight", 10.0)
    steady(master.measured_jp, within=1e-4)
    at = master.measured_jp()
    stays(
        lambda: np.abs(master.measured_jp() - at).max() < 1e-3,
        "where it is; not carried, it would sink by centimetres",
        0.5,
    )
    master.send("use_gravity_compensation", Bool(False))
    until(lambda: np.abs(master.measured_jp() - at).max() > 0.01, "it sinks", 10.0)
    master.hold()


def test_efforts_beyond_those_of_the_motors_are_cut(arms: dict[str, Any]) -> None:
    from ligature.robots.mtm_weight import MAX_EFFORT

    master = arms["MTMR"]
    master.servo_jf([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 50.0])
    until(lambda: master.measured_js()[2][6] == pytest.approx(MAX_EFFORT[6]), "the roll's motor gives all it can", 10.0)
    master.hold()
