"""Arms in the physics: they go where they are reported, without load exactly, and contact shows in what is measured."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.model.commands import BodyCommand, CommandType
from ligature.model.frames import inverse, pose7_matrix, rpy_matrix
from ligature.model.scene import ArmKind
from ligature.robots.arm import Arm
from ligature.robots.commands import MoveJp, ServoJp

ROOT = Path(__file__).resolve().parents[1]
SCENE = ROOT / "scenes" / "suturing_small" / "launch.yaml"
ARMS_ONLY = (1, 2, 3, 4)
STEADY = np.deg2rad(0.1), 1e-4
"""Radians and metres of steady error without load."""

OVERSHOOT = 0.02
READY = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])


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
        assert (np.abs(speeds).max(axis=0) <= ratio * arm.joints.max_velocity * (1 + 1e-9)).all()
        assert (
            np.abs(np.diff(speeds, axis=0)).max(axis=0) <= ratio * arm.joints.max_acceleration * sim.dt * (1 + 1e-6)
        ).all()


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


@pytest.fixture
def whole() -> Simulation:
    """The whole scene, with what the arms work on."""
    return Simulation(ligature.load(SCENE))


@pytest.fixture
def psm(whole: Simulation) -> Arm:
    """PSM1 of the whole scene, enabled, homed and idle."""
    return placed(whole, "PSM1")


def placed(sim: Simulation, name: str) -> Arm:
    """An arm in its home pose without the way there."""
    arm = sim.arms[name]
    arm.place_jp(READY[: arm.joints.n])
    arm.adopt()
    return arm


def tip_of_bodies(sim: Simulation, arm: Arm) -> np.ndarray:
    """Pose (4, 4) of the tool in the base by the bodies' own poses."""
    (description,) = [a for a in sim.scene.arms if a.name == arm.name]
    base, tip = (pose7_matrix(sim.state["body_pose"][0, b]) for b in (description.base, description.tip))
    T = inverse(base) @ tip
    T[:3, :3] = T[:3, :3] @ rpy_matrix(-np.pi / 2, 0, -np.pi / 2).T
    return T


@pytest.mark.parametrize("q", [READY, [0.3, -0.2, 0.15, 1.0, 0.4, -0.6], [-0.5, 0.3, 0.2, -2.0, -0.8, 0.7]])
def test_the_kinematics_are_those_of_the_bodies(whole: Simulation, psm: Arm, q: list[float]) -> None:
    psm.servo_jp(q)
    whole.step(500)
    assert pose7_matrix(psm.local_measured_cp()) == pytest.approx(tip_of_bodies(whole, psm), abs=1e-6)


@pytest.mark.corpus
def test_the_kinematics_are_those_of_a_labs_bodies_as_well_as_its_file_has_them(corpus: Path) -> None:
    sim = Simulation(ligature.load(corpus / "suturing_scene" / "launch.yaml", models=[10, 11, 6, 7, 8, 9]))
    for name in ("PSM1", "PSM2"):
        arm = placed(sim, name)
        sim.step(2)
        error = pose7_matrix(arm.local_measured_cp()) - tip_of_bodies(sim, arm)
        assert np.abs(error[:3, 3]).max() < 1e-4
        assert np.abs(error[:3, :3]).max() < 1e-3


def test_a_moving_set_point_is_followed_within_milliseconds(whole: Simulation, psm: Arm) -> None:
    worst = 0.0
    for k in range(1000):
        psm.servo_jp(READY + 0.2 * np.sin(2 * np.pi * 0.5 * k * 1e-3) * np.array([1, 1, 0, 1, 1, 1]))
        whole.step()
        worst = max(worst, float(np.abs(psm.measured_js().position - psm.setpoint_js().position).max()))
    max_velocity = 0.2 * 2 * np.pi * 0.5
    assert worst < max_velocity * 0.012


def test_joint_commands_of_others_have_no_effect_while_the_arm_is_enabled(whole: Simulation, psm: Arm) -> None:
    base = whole.scene.arms[0].base
    command = BodyCommand(base, CommandType.FORCE, (0.0,) * 6, (CommandType.POSITION,) * 6, (0.5,) * 6)
    whole.apply(command)
    whole.step(300)
    assert psm.measured_js().position == pytest.approx(READY, abs=1e-6)
    assert any("have no effect: its arm is enabled" in str(problem) for problem in whole.problems)
    psm.disable()
    whole.apply(command)
    whole.step(1500)
    assert psm.measured_js().position[0] == pytest.approx(0.5, abs=0.01)


def test_homing_goes_to_the_home_pose(whole: Simulation) -> None:
    arm = whole.arms["PSM1"]
    arm.home()
    whole.step(2200)
    assert arm.is_homed and not arm.is_busy
    assert arm.measured_js().position == pytest.approx(READY, abs=1e-5)


def test_a_disabled_arm_is_limp_and_reports_where_it_is(whole: Simulation, psm: Arm) -> None:
    psm.disable()
    (description,) = [a for a in whole.scene.arms if a.name == "PSM1"]
    tip = whole.bodies[whole.scene.bodies[description.tip].identity.topic]
    tip.command_wrench([5.0, 0, 0, 0, 0, 0])
    whole.step(200)
    assert np.abs(psm.measured_js().position - READY).max() > 1e-2
    assert psm.setpoint_js().position == pytest.approx(psm.measured_js().position)


def test_a_closing_jaw_presses_by_how_far_it_was_asked_to_close(whole: Simulation, psm: Arm) -> None:
    psm.jaw.servo_jp([0.0])
    whole.step(300)
    loose = psm.jaw.measured_js()
    assert loose.position == pytest.approx([0.0], abs=5e-3)
    psm.jaw.close()
    whole.step(600)
    pressed = psm.jaw.measured_js()
    assert pressed.position == pytest.approx([0.0], abs=0.02)
    assert pressed.effort[0] == pytest.approx(-1.0 * np.deg2rad(20) / 2, abs=0.01)


def test_the_ecm_moves_the_cameras_about_its_remote_centre(whole: Simulation) -> None:
    ecm = placed(whole, "ECM")
    frame = whole.bodies["BODY CameraFrame"]
    start, local = frame.pose, pose7_matrix(ecm.local_measured_cp())
    ecm.move_jp([0.1, -0.1, 0.14, 0.2])
    while ecm.is_busy:
        whole.step(10)
    moved = inverse(local) @ pose7_matrix(ecm.local_measured_cp())
    flip = np.diag([1.0, -1.0, -1.0, 1.0])
    assert pose7_matrix(frame.pose) == pytest.approx(pose7_matrix(start) @ flip @ moved @ flip, abs=1e-9)


def test_a_reset_ends_moves_and_arms_stay_where_it_puts_them(whole: Simulation, psm: Arm) -> None:
    psm.move_jp([0.5, 0.1, 0.15, 0, 0, 0])
    whole.step(300)
    whole.reset()
    assert not psm.is_busy
    whole.step(200)
    assert psm.measured_js().position == pytest.approx(np.zeros(6), abs=1e-5)
    assert psm.is_enabled and psm.is_homed


def test_commands_that_travelled_do_what_calls_do_and_refusals_become_warnings(whole: Simulation, psm: Arm) -> None:
    psm.events.clear()
    whole.apply(MoveJp(0, (0.1, 0, 0.12, 0, 0, 0)))
    assert psm.is_busy
    whole.apply(MoveJp(0, (0.1,) * 4))
    reported = [(event.name, event.value) for event in psm.events]
    assert ("goal_reached", False) in reported
    assert any(name == "warning" and "move_jp takes 6 numbers" in value for name, value in reported)
    with pytest.raises(ValueError, match="finite"):
        whole.apply(ServoJp(0, (float("nan"),) * 6))


def test_a_snapshot_in_the_middle_of_moves_continues_bit_for_bit(whole: Simulation, psm: Arm) -> None:
    other = whole.arms["MTML"]
    other.enable()
    psm.move_jp([0.5, 0.1, 0.15, 0.5, 0.2, 0.1])
    whole.step(150)
    snapshot = whole.snapshot()
    whole.step(400)
    first = whole.state_hash()
    whole.restore(snapshot)
    whole.step(400)
    assert whole.state_hash() == first


def test_an_unknown_arm_is_named_with_the_known_ones(whole: Simulation) -> None:
    with pytest.raises(KeyError, match="unknown arm 'PSM3'; choose one of PSM1, PSM2, ECM, MTML, MTMR"):
        whole.arms["PSM3"]


def test_what_a_tip_feels_after_a_restore_is_not_what_it_felt_as_many_ticks_after_another() -> None:
    pegs = ligature.load(ROOT / "scenes" / "peg_transfer" / "launch.yaml", [0, 1, 2])
    simulation, fresh = Simulation(pegs), Simulation(pegs)
    block = next(body.index for body in pegs.bodies if body.identity.name == "Block2")
    apart = simulation.snapshot()
    simulation.set_pose(block, simulation.state["body_pose"][0, pegs.jaws[0].fingers[0]])
    touching = simulation.snapshot()
    rng = np.random.default_rng(2)
    for ticks in rng.integers(1, 30, 6).tolist():
        for snapshot in (apart, touching, apart):
            simulation.restore(snapshot)
            simulation.step(ticks)
            fresh.restore(snapshot)
            fresh.step(31)
            fresh.restore(snapshot)
            fresh.step(ticks)
            assert simulation.state_hash(clock=False) == fresh.state_hash(clock=False), ticks
            felt = simulation.arms["PSM1"].spatial_measured_cf().any()
            assert felt == (snapshot is touching), ticks
