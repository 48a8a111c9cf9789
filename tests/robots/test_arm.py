"""Servo and moves of an arm in joint and Cartesian space, on ideal axes."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable

import numpy as np
import pytest
from ligature.model.frames import frame, matrix_pose7, pose7_matrix, rpy_matrix
from ligature.robots.arm import Arm
from ligature.robots.impedance import CartesianImpedance
from ligature.robots.operating_state import Rejected
from ligature.robots.psm_arm import LEAST_DEPTH, MAX_ACCELERATION, MAX_VELOCITY, PsmArm

from tests.robots.conftest import DT, advance

Reported = Callable[[Arm, str], list[object]]


def test_a_servo_step_is_the_set_point_at_once_and_never_busy(ready: PsmArm) -> None:
    ready.servo_jp([0.1, -0.2, 0.15, 0.3, 0.4, -0.5])
    assert ready.setpoint_js().position == pytest.approx([0.1, -0.2, 0.15, 0.3, 0.4, -0.5])
    assert not ready.is_busy


def test_set_points_are_clipped_to_the_limits(ready: PsmArm) -> None:
    ready.servo_jp([5.0, -5.0, 1.0, 0, 0, 0])
    wanted = [ready.kinematics.upper[0], ready.kinematics.lower[1], ready.kinematics.upper[2], 0, 0, 0]
    assert ready.setpoint_js().position == pytest.approx(wanted)


@pytest.mark.parametrize("values", [[0.0] * 4, [0.0] * 7, [np.nan] * 6, []])
def test_wrong_joint_arrays_are_refused_and_change_nothing(ready: PsmArm, values: list[float]) -> None:
    before = ready.setpoint_js().position
    for request in (ready.servo_jp, ready.move_jp, ready.servo_jr, ready.move_jr, ready.servo_jf, ready.servo_jv):
        with pytest.raises(Rejected, match="takes"):
            request(values)
    assert ready.setpoint_js().position == pytest.approx(before)
    assert not ready.is_busy


def test_a_move_keeps_velocity_and_acceleration_limits_and_ends_at_its_goal(ready: PsmArm, reported: Reported) -> None:
    goal = np.array([0.8, -0.5, 0.2, 2.0, -1.0, 1.0])
    ready.move_jp(goal)
    rows = []
    while ready.is_busy:
        ready.tick(DT)
        rows.append(ready.setpoint_js().position)
    q = np.array(rows)
    speed = np.diff(q, axis=0) / DT
    assert (np.abs(speed) <= MAX_VELOCITY * (1 + 1e-6)).all()
    assert (np.abs(np.diff(speed, axis=0)) / DT <= MAX_ACCELERATION * 1.01).all()
    assert q[-1] == pytest.approx(goal, abs=1e-9)
    assert reported(ready, "goal_reached") == [True]


def test_a_move_at_a_tenth_of_speed_and_acceleration_takes_the_time_that_they_allow(ready: PsmArm) -> None:
    ready.trajectory_j_set_ratio_v(0.1)
    ready.move_jp([0.5, 0, 0.12, 0, 0, 0])
    start = ready.time
    while ready.is_busy:
        ready.tick(DT)
    v, a = 0.1 * MAX_VELOCITY[0], MAX_ACCELERATION[0]
    assert ready.time - start == pytest.approx(0.5 / v + v / a, abs=3 * DT)


def test_a_move_of_no_length_is_busy_for_a_moment_and_reaches_its_goal(ready: PsmArm, reported: Reported) -> None:
    ready.move_jp(ready.setpoint_js().position)
    assert ready.is_busy
    advance(ready, 0.03)
    assert ready.is_busy
    advance(ready, 0.1)
    assert not ready.is_busy
    assert [list(value)[2] for value in reported(ready, "operating_state")] == [True, False]  # type: ignore[call-overload]
    assert reported(ready, "goal_reached") == [True]


def test_a_newer_move_takes_over_without_a_jump(ready: PsmArm, reported: Reported) -> None:
    ready.move_jp([1.0, 0, 0.12, 0, 0, 0])
    advance(ready, 0.4)
    speed = ready.setpoint_js().velocity[0]
    ready.move_jp([0.0, 0, 0.12, 0, 0, 0])
    ready.tick(DT)
    assert ready.setpoint_js().velocity[0] == pytest.approx(speed, abs=MAX_ACCELERATION[0] * 2 * DT)
    advance(ready, 3.0)
    assert ready.setpoint_js().position[0] == pytest.approx(0.0, abs=1e-9)
    assert reported(ready, "goal_reached") == [False, True]


def test_a_servo_interrupts_a_move(ready: PsmArm, reported: Reported) -> None:
    ready.move_jp([1.0, 0, 0.12, 0, 0, 0])
    advance(ready, 0.2)
    ready.servo_jp([0.0, 0, 0.12, 0, 0, 0])
    assert not ready.is_busy
    assert reported(ready, "goal_reached") == [False]


def test_a_relative_move_begins_at_the_goal_of_the_running_one(ready: PsmArm) -> None:
    ready.move_jr([0.2, 0, 0, 0, 0, 0])
    advance(ready, 0.05)
    ready.move_jr([0.3, 0, 0, 0, 0, 0])
    advance(ready, 3.0)
    assert ready.setpoint_js().position[0] == pytest.approx(0.5, abs=1e-9)


def test_a_velocity_stream_ends_when_nobody_streams(ready: PsmArm) -> None:
    ready.servo_jv([0.5, 0, 0, 0, 0, 0])
    advance(ready, 1.0)
    assert ready.setpoint_js().position[0] == pytest.approx(0.05, abs=0.002)
    assert ready.setpoint_js().velocity[0] == 0.0


def test_a_set_point_with_velocity_comes_to_rest_when_the_stream_ends(ready: PsmArm) -> None:
    ready.servo_jp([0.1, 0, 0.12, 0, 0, 0], [1.0, 0, 0, 0, 0, 0])
    assert ready.setpoint_js().velocity[0] == 1.0
    advance(ready, 0.2)
    assert ready.setpoint_js().velocity[0] == 0.0


def test_cartesian_set_points_are_reached(ready: PsmArm) -> None:
    goal = ready.setpoint_cp()
    goal[:3] += [0.02, -0.01, 0.005]
    ready.servo_cp(goal)
    assert ready.setpoint_cp() == pytest.approx(goal, abs=1e-9)
    goal[:3] -= [0.03, 0.0, 0.0]
    ready.move_cp(pose7_matrix(goal))
    advance(ready, 3.0)
    assert ready.measured_cp() == pytest.approx(goal, abs=1e-9)


def test_a_pose_that_cannot_be_reached_is_refused_with_the_reason(ready: PsmArm) -> None:
    above = ready.setpoint_cp()
    above[2] = 0.1
    for request in (ready.servo_cp, ready.move_cp):
        with pytest.raises(Rejected, match=r"no inverse kinematics of PSM1 at .*0\.1\].*above the remote centre"):
            request(above)
    assert not ready.is_busy


@pytest.mark.parametrize(
    ("pose", "why"),
    [
        ([0.0] * 7, "length 0; it must be 1"),
        ([np.inf, 0, 0, 0, 0, 0, 1], "finite"),
        ([0.0, 0, 0], "not the shape"),
    ],
)
def test_what_is_no_pose_is_refused(ready: PsmArm, pose: list[float], why: str) -> None:
    with pytest.raises(Rejected, match=why):
        ready.servo_cp(pose)


def test_cartesian_motion_needs_depth_and_keeps_it(ready: PsmArm) -> None:
    goal = ready.setpoint_cp()
    goal[2] = -0.02
    ready.servo_cp(goal)
    assert ready.depth == pytest.approx(LEAST_DEPTH, abs=1e-9)
    ready.servo_jp(np.zeros(6))
    with pytest.raises(Rejected, match="is 35 mm below the remote centre; insert it to 45 mm first"):
        ready.servo_cp(goal)


def test_a_base_frame_applies_to_poses_and_commands_but_not_to_local_ones(ready: PsmArm) -> None:
    T = frame(rpy_matrix(0.3, -0.2, 1.0), (0.1, 0.2, 0.3))
    local = ready.local_measured_cp()
    ready.set_base_frame(matrix_pose7(T), "ECM")
    assert ready.local_measured_cp() == pytest.approx(local)
    assert pose7_matrix(ready.measured_cp()) == pytest.approx(T @ pose7_matrix(local), abs=1e-12)
    goal = ready.setpoint_cp()
    goal[:3] += 0.01
    ready.servo_cp(goal)
    assert ready.setpoint_cp() == pytest.approx(goal, abs=1e-9)


def test_a_twist_moves_the_tip_along_it(ready: PsmArm) -> None:
    start = ready.measured_cp()
    for _ in range(10):
        ready.servo_cv([0.02, 0.01, 0, 0, 0, 0])
        advance(ready, 0.05)
    moved = ready.measured_cp() - start
    assert moved[:3] == pytest.approx([0.01, 0.005, 0.0], abs=3e-4)
    assert ready.measured_cv()[:3] == pytest.approx([0.02, 0.01, 0.0], abs=1e-3)


def test_free_arms_yield_to_a_wrench_along_it(ready: PsmArm) -> None:
    start = ready.measured_cp()
    ready.spatial_servo_cf([1.0, 0, 0, 0, 0, 0])
    advance(ready, 0.2)
    moved = ready.measured_cp()[:3] - start[:3]
    assert moved[0] > 1e-3
    ready.hold()
    held = ready.measured_cp()
    advance(ready, 0.5)
    assert ready.measured_cp() == pytest.approx(held, abs=1e-9)


def test_an_impedance_pulls_the_tip_to_where_its_springs_rest(ready: PsmArm) -> None:
    start = pose7_matrix(ready.measured_cp())
    gains = np.zeros((4, 4, 3))
    gains[:2, 0], gains[:2, 1] = -200.0, -20.0
    ready.servo_ci(CartesianImpedance(start[:3, 3] + [0.01, 0, 0], np.eye(3), start[:3, :3], gains))
    advance(ready, 6.0)
    assert ready.measured_cp()[:3] == pytest.approx(start[:3, 3] + [0.01, 0, 0], abs=5e-4)


def test_the_jaw_moves_with_the_busy_flag_of_the_arm(ready: PsmArm) -> None:
    assert ready.jaw is not None
    ready.jaw.open()
    assert ready.is_busy
    advance(ready, 1.0)
    assert not ready.is_busy
    assert ready.jaw.measured_js().position == pytest.approx([np.deg2rad(60)])
    ready.jaw.close()
    advance(ready, 1.0)
    assert ready.jaw.setpoint_js().position == pytest.approx([np.deg2rad(-20)], abs=1e-5)


def test_jaw_and_joints_move_side_by_side(ready: PsmArm, reported: Reported) -> None:
    assert ready.jaw is not None
    ready.move_jp([1.0, 0, 0.12, 0, 0, 0])
    ready.jaw.move_jp([0.5])
    advance(ready, 0.5)
    assert ready.is_busy
    advance(ready, 3.0)
    assert ready.measured_js().position[0] == pytest.approx(1.0)
    assert ready.jaw.measured_js().position == pytest.approx([0.5])
    assert reported(ready, "goal_reached") == [True]


def test_another_instrument_brings_its_own_limits(ready: PsmArm, reported: Reported) -> None:
    ready.set_tool_type("MEGA_NEEDLE_DRIVER:420194")
    assert reported(ready, "tool_type") == ["MEGA_NEEDLE_DRIVER:420194"]
    ready.servo_jp([0, 0, 0.12, 0, 1.39, 0])
    assert ready.setpoint_js().position[4] == pytest.approx(1.2217)
    with pytest.raises(Rejected, match="set_tool_type: unknown instrument 1"):
        ready.set_tool_type("SPOON:1")


def test_without_its_tool_an_arm_is_not_homed(ready: PsmArm) -> None:
    ready.emulate_tool_present(False)
    assert not ready.is_homed
    ready.home()
    advance(ready, 1.0)
    assert not ready.is_homed
    for act in (lambda: ready.move_jp(np.zeros(6)), lambda: ready.jaw.servo_jp(0.2), ready.hold):
        with pytest.raises(Rejected, match="has no tool; arm not ready: send true to 'emulate_tool_present'"):
            act()
    ready.emulate_tool_present(True)
    assert ready.is_homed
    ready.move_jp(np.zeros(6))


def test_an_arm_that_homes_without_its_tool_is_homed_with_it(psm: PsmArm) -> None:
    psm.emulate_tool_present(False)
    psm.home()
    advance(psm, 5.0)
    assert not psm.is_homed
    psm.emulate_tool_present(True)
    assert psm.is_homed
    psm.unhome()
    assert not psm.is_homed


@pytest.mark.parametrize("ratio", [0.0, -1.0, 1.5])
def test_ratios_outside_their_range_are_refused(ready: PsmArm, ratio: float) -> None:
    with pytest.raises(Rejected, match="above 0 and at most 1"):
        ready.trajectory_j_set_ratio(ratio)
    assert ready.joints.ratio_v == 1.0


@pytest.mark.parametrize("seed", range(10))
def test_the_common_ratio_is_reported_only_while_both_are_the_same(
    ready: PsmArm, reported: Reported, seed: int
) -> None:
    """As the dVRK does, whose clients read it after each change of either."""
    rng = np.random.default_rng(seed)
    v, a = 1.0, 1.0
    for number in range(1, 20):
        ratio = float(rng.choice([0.1, 0.25, 1.0]))
        which = rng.choice(["", "_v", "_a"])
        getattr(ready, f"trajectory_j_set_ratio{which}")(ratio)
        v, a = (v if which == "_a" else ratio), (a if which == "_v" else ratio)
        assert len(reported(ready, "trajectory_j/ratio")) == number
        assert reported(ready, "trajectory_j/ratio")[-1] == (v if v == a else 0.0)
        assert (ready.joints.ratio_v, ready.joints.ratio_a) == (v, a)


def test_a_lasting_following_error_is_a_fault_that_disable_ends(ready: PsmArm, reported: Reported) -> None:
    ready.servo_jp([0.9, 0, 0.12, 0, 0, 0])
    ready.joints.plant.read()[0, 0] = 0.0
    for _ in range(300):
        ready.watch(0.005)
    assert ready.operating_state.state.name == "FAULT"
    (error,) = reported(ready, "error")
    assert "joint yaw is 0.9 away from its set-point" in str(error)
    with pytest.raises(Rejected):
        ready.enable()
    ready.disable()
    ready.enable()
    advance(ready, 0.5)
    assert ready.is_enabled


def test_forward_and_inverse_kinematics_on_demand(ready: PsmArm) -> None:
    q = np.array([0.2, -0.3, 0.15, 0.5, -0.4, 0.3])
    pose = ready.forward_kinematics(q, local=True)
    assert ready.inverse_kinematics(np.zeros(6), pose) == pytest.approx(q, abs=1e-9)
    assert ready.forward_kinematics(q[:3]) == pytest.approx(ready.forward_kinematics([*q[:3], 0, 0, 0]))
    with pytest.raises(Rejected, match="too many joints"):
        ready.forward_kinematics(np.zeros(8))
    with pytest.raises(Rejected, match="incorrect number of joints"):
        ready.inverse_kinematics(np.zeros(4), pose)


def test_a_restored_arm_goes_on_as_the_other_did(ready: PsmArm) -> None:
    ready.move_jp([0.5, 0.2, 0.15, 0, 0, 0])
    advance(ready, 0.3)
    kept = copy.deepcopy(ready.snapshot())
    plant = copy.deepcopy(ready.joints.plant.snapshot())
    advance(ready, 0.5)
    first = ready.measured_js().position
    ready.restore(kept)
    ready.joints.plant.restore(plant)
    advance(ready, 0.5)
    assert (ready.measured_js().position == first).all()


def test_a_rejected_servo_cs_names_itself(ready: PsmArm) -> None:
    for parts in (([0.0] * 7, None, None), (None, [math.nan] * 6, None), (None, None, [math.inf] * 6)):
        with pytest.raises(Rejected, match="^servo_cs: "):
            ready.servo_cs(*parts)


@pytest.mark.parametrize("name", ["f" * 65, "ü" * 33, "🪡" * 17])
def test_a_frame_whose_name_has_no_room_is_rejected_and_not_cut_off(ready: PsmArm, name: str) -> None:
    with pytest.raises(Rejected, match=f"may have 64 bytes, not {len(name.encode())}"):
        ready.set_base_frame([1, 0, 0, 0, 0, 0, 1], name)
    assert ready.reference == "" and (ready.base_frame == np.eye(4)).all()
    ready.set_base_frame([1, 0, 0, 0, 0, 0, 1], name[: 64 // len(name[0].encode())])
    assert ready.reference
