"""A master arm has weight: it sinks in effort modes, unless gravity compensation carries it; its motors have limits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.robots import mtm_arm
from ligature.robots.axes import Axes
from ligature.robots.mtm import Mtm
from ligature.robots.mtm_arm import MtmArm
from ligature.robots.mtm_weight import MAX_EFFORT, weight
from ligature.robots.plant import IdealPlant

DT = 1e-3
SEEDS = st.integers(0, 2**32 - 1)


def master(side: str = "left", damping: float = 1.0) -> MtmArm:
    """A master arm as a scene has it, homed."""
    kinematics = Mtm(side)
    limits = np.array([kinematics.lower, kinematics.upper])
    plant = IdealPlant(limits[0], limits[1], mtm_arm.INERTIA, damping * mtm_arm.DAMPING, np.zeros(7))
    joints = Axes(kinematics.joint_names, limits, mtm_arm.MAX_VELOCITY, mtm_arm.MAX_ACCELERATION, plant)
    ends = mtm_arm.GRIPPER_LIMITS
    fingers = IdealPlant(ends[0], ends[1], np.full(1, 1e-3), np.full(1, 1e-2), np.zeros(1))
    arm = MtmArm("MTML", kinematics, joints, Axes(("gripper",), ends, np.full(1, 20.0), np.full(1, 200.0), fingers))
    arm.home()
    advance(arm, 3.0)
    assert arm.is_homed
    return arm


def advance(arm: MtmArm, seconds: float) -> None:
    for _ in range(round(seconds / DT)):
        arm.tick(DT)


def somewhere(arm: MtmArm, seed: int) -> np.ndarray:
    """Joint values inside the limits, where the arm is put."""
    low, high = arm.joints.limits
    q = low + np.random.default_rng(seed).uniform(0.2, 0.8, 7) * (high - low)
    arm.servo_jp(q)
    arm.tick(DT)
    return q


def test_weights_are_those_that_the_laboratory_identified() -> None:
    """At zero, and with the upper arm level: by hand from the published numbers, g = 9.81."""
    assert weight(np.zeros(7))[1:3] == pytest.approx([9.81 * (0.16363 + 0.02505) - 1.33154, 9.81 * 0.02505], abs=1e-3)
    level = np.zeros(7)
    level[1] = np.pi / 2
    expected = [9.81 * (-0.68178 - 0.00960) - 1.33154 + 7.16606 * np.pi / 2, -9.81 * 0.00960]
    assert weight(level)[1:3] == pytest.approx(expected, abs=1e-3)


@settings(deadline=None)
@given(seed=SEEDS)
def test_a_weight_does_no_work_on_the_way_round(seed: int) -> None:
    """It has a potential: its derivatives are symmetric, wherever the arm is."""
    q, h = np.random.default_rng(seed).uniform(-1.0, 1.0, 7), 1e-5
    rows = [(weight(q + h * e) - weight(q - h * e)) / (2 * h) for e in np.eye(7)]
    assert np.array(rows) == pytest.approx(np.array(rows).T, abs=1e-6)
    for turned in (0, 3, 4, 5, 6):  # about the vertical, and of the wrist
        assert rows[turned] == pytest.approx(np.zeros(7), abs=1e-9)


def test_an_arm_without_friction_keeps_its_energy_as_it_swings() -> None:
    arm = master(damping=0.0)
    arm.servo_jf(np.zeros(7))
    work, most = 0.0, 0.0
    for _ in range(300):
        before = arm.joints.measured()[0].copy()
        arm.tick(DT)
        position, velocity, _ = arm.joints.measured()
        work -= float(weight((before + position) / 2) @ (position - before))
        energy = 0.5 * float(mtm_arm.INERTIA @ velocity**2)
        most = max(most, energy)
        assert energy == pytest.approx(work, abs=0.02 * most + 1e-4)
    assert most > 0.05


@settings(deadline=None, max_examples=20)
@given(seed=SEEDS, side=st.sampled_from(["left", "right"]))
def test_with_gravity_compensation_an_arm_stays_and_without_it_sinks(seed: int, side: str) -> None:
    arm = master(side)
    q = somewhere(arm, seed)
    arm.use_gravity_compensation(True)
    arm.body_servo_cf(np.zeros(6))
    advance(arm, 1.0)
    assert arm.measured_js().position == pytest.approx(q, abs=1e-6)
    assert arm.measured_js().effort == pytest.approx(weight(q), abs=1e-6), "the motors bear it"
    assert arm.setpoint_js().effort == pytest.approx(np.zeros(7), abs=1e-12), "nobody asked for an effort"
    arm.use_gravity_compensation(False)
    advance(arm, 0.05)
    moved = arm.measured_js().position - q
    heavy = np.abs(weight(q)) > 0.05
    assert (np.sign(moved[heavy]) == -np.sign(weight(q)[heavy])).all()
    assert moved[[0, 3, 4, 5, 6]] == pytest.approx(np.zeros(5), abs=1e-9)


def test_an_arm_that_is_freed_or_held_does_not_sink() -> None:
    arm = master()
    arm.free()
    advance(arm, 1.0)
    assert arm.gravity_compensation
    assert arm.measured_js().position == pytest.approx(np.zeros(7), abs=1e-6)
    arm.use_gravity_compensation(False)
    arm.hold()
    advance(arm, 1.0)
    assert arm.measured_js().position == pytest.approx(np.zeros(7), abs=1e-6)


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_no_motor_exerts_more_than_it_can(joint: int, sign: float) -> None:
    arm = master(damping=0.0)
    arm.use_gravity_compensation(True)
    asked = np.zeros(7)
    asked[joint] = sign * 1e6
    arm.servo_jf(asked)
    load = weight(arm.joints.measured()[0])
    arm.tick(DT)
    state = arm.measured_js()
    assert state.effort[joint] == sign * MAX_EFFORT[joint]
    expected = DT * (sign * MAX_EFFORT[joint] - load[joint]) / mtm_arm.INERTIA[joint]
    assert state.velocity[joint] == pytest.approx(expected, rel=1e-9), "the weight counts against the motor's limit"


def test_a_wrench_that_motors_cannot_exert_is_cut_joint_by_joint() -> None:
    arm = master()
    arm.body_servo_cf([500.0, 0.0, 300.0, 0.0, 0.0, 0.0])
    arm.tick(DT)
    effort = arm.measured_js().effort
    assert (np.abs(effort) <= MAX_EFFORT).all() and (np.abs(effort) == MAX_EFFORT).any()
