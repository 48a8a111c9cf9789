"""Arms in the physics: they go where they are told, without load exactly, and contact shows in what is measured."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.model.scene import ArmKind
from ligature.simulation import Simulation

ROOT = Path(__file__).resolve().parents[1]
SCENE = ROOT / "scenes" / "suturing_small" / "launch.yaml"
ARMS_ONLY = (1, 2, 3, 4)
STEADY = np.deg2rad(0.1), 1e-4
"""Radians and metres of steady error without load."""

OVERSHOOT = 0.02


@pytest.fixture(scope="module")
def scene():
    return ligature.load(SCENE, ARMS_ONLY)


@pytest.fixture(scope="module")
def ready(scene):
    """The arms homed, and a snapshot of that."""
    simulation = Simulation(scene)
    for arm in simulation.arms.values():
        arm.home()
    simulation.step(3000)
    yield simulation, simulation.snapshot()
    simulation.close()


@pytest.fixture
def sim(ready):
    simulation, homed = ready
    simulation.restore(homed)
    return simulation


def steady(arm) -> np.ndarray:
    """Steady errors allowed on each joint."""
    allowed = np.full(arm.joints.n, STEADY[0])
    if arm.kind != "MTM":
        allowed[2] = STEADY[1]
    return allowed


def finish(sim, arm, most: float = 10.0) -> None:
    """Step until a move has ended and the arm has settled."""
    for _ in range(round(most / 0.05)):
        sim.step(50)
        if not arm.is_busy:
            sim.step(200)
            return
    raise AssertionError(f"{arm.name} is busy after {most} s")


def test_the_small_scene_has_two_arms_and_two_masters():
    whole = ligature.load(SCENE)
    assert [(arm.name, arm.kind) for arm in whole.arms] == [
        ("PSM1", ArmKind.PSM), ("PSM2", ArmKind.PSM), ("ECM", ArmKind.ECM), ("MTML", ArmKind.MTM),
        ("MTMR", ArmKind.MTM),
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["PSM1", "PSM2", "MTML", "MTMR"])
def test_random_joint_goals_are_reached_and_held(sim, name):
    arm = sim.arms[name]
    rng = np.random.default_rng(8)
    for _ in range(2):
        middle, half = 0.5 * (arm.joints.limits[0] + arm.joints.limits[1]), 0.4 * np.diff(arm.joints.limits, axis=0)[0]
        goal = middle + rng.uniform(-1.0, 1.0, arm.joints.n) * np.minimum(half, 1.0)
        arm.move_jp(goal)
        finish(sim, arm)
        assert (np.abs(arm.measured_js().position - goal) <= steady(arm)).all()


@pytest.mark.parametrize("joint", range(6))
def test_a_step_of_the_set_point_does_not_overshoot(sim, joint):
    arm = sim.arms["PSM1"]
    start = arm.setpoint_js().position
    step = np.zeros(6)
    step[joint] = 0.01 if joint == 2 else 0.2
    arm.servo_jp(start + step)
    trace = []
    for _ in range(800):
        sim.step(1)
        trace.append(arm.measured_js().position[joint] - start[joint])
    reached = np.array(trace) / step[joint]
    assert reached.max() <= 1.0 + OVERSHOOT
    assert reached[-1] == pytest.approx(1.0, abs=1e-3)


def test_a_cartesian_move_ends_at_its_goal(sim):
    arm = sim.arms["PSM2"]
    goal = arm.measured_cp() + [0.03, -0.02, -0.01, 0.0, 0.0, 0.0, 0.0]
    arm.move_cp(goal)
    finish(sim, arm)
    np.testing.assert_allclose(arm.measured_cp()[:3], goal[:3], atol=STEADY[1])
    assert abs(arm.measured_cp()[3:] @ goal[3:]) > np.cos(STEADY[0])


def test_moves_keep_to_the_limits_of_velocity_and_acceleration(sim):
    arm = sim.arms["PSM1"]
    start = arm.setpoint_js().position
    for ratio in (1.0, 0.5):
        arm.trajectory_j_set_ratio(ratio)
        arm.move_jp(start + [0.8, -0.5, 0.05, 1.0, 0.5, -0.5] if ratio == 1.0 else start)
        velocities = []
        while arm.is_busy:
            sim.step(1)
            velocities.append(arm.setpoint_js().velocity)
        speeds = np.array(velocities)
        assert (np.abs(speeds).max(axis=0) <= ratio * arm.joints.fastest * (1 + 1e-9)).all()
        assert (np.abs(np.diff(speeds, axis=0)).max(axis=0) <= ratio * arm.joints.hardest * sim.dt * (1 + 1e-6)).all()


def test_what_stands_in_the_way_shows_in_measured_values_and_not_in_set_points():
    sim = Simulation(ligature.load(SCENE))
    arm = sim.arms["PSM1"]
    arm.home()
    sim.step(3000)
    assert np.abs(arm.spatial_measured_cf()).max() < 1e-6
    into_the_block = np.array([0.0, 0.0, 0.22, 0.0, 0.0, 0.0])
    arm.servo_jp(into_the_block)
    sim.step(800)
    np.testing.assert_allclose(arm.setpoint_js().position, into_the_block, atol=1e-12)
    assert arm.measured_js().position[2] < 0.19
    assert np.linalg.norm(arm.measured_cp()[:3] - arm.setpoint_cp()[:3]) > 0.03
    pushed = arm.spatial_measured_cf()[:3]
    assert pushed[2] > 10.0, "the block pushes the tip back along the shaft"
    sim.close()


def test_measured_velocity_is_the_change_of_the_measured_pose(sim):
    arm = sim.arms["PSM1"]
    start = arm.setpoint_js().position
    for k in range(200):
        arm.servo_jp(start + 0.1 * np.sin(2 * np.pi * k * 1e-3) * np.array([1, 1, 0.1, 1, 1, 1]))
        sim.step(1)
    before = arm.measured_cp()
    twist = arm.measured_cv()
    for k in range(200, 210):
        arm.servo_jp(start + 0.1 * np.sin(2 * np.pi * k * 1e-3) * np.array([1, 1, 0.1, 1, 1, 1]))
        sim.step(1)
    np.testing.assert_allclose((arm.measured_cp() - before)[:3] / 0.010, twist[:3], atol=2e-3, rtol=0.05)


def test_equal_commands_give_equal_hashes(scene):
    hashes = []
    for _ in range(2):
        sim = Simulation(scene)
        sim.arms["PSM1"].home()
        sim.step(2500)
        for k in range(100):
            sim.arms["PSM1"].servo_jp([0.1 * np.sin(k / 20), 0, 0.12, 0, 0.1, 0])
            sim.arms["PSM1"].jaw.servo_jp(0.3)
            sim.step(5)
        hashes.append(sim.state_hash())
        sim.close()
    assert hashes[0] == hashes[1]
