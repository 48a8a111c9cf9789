"""What the scripts of the CRTK and dVRK Python packages do, call by call, against a running simulator.

Each function `run_…` follows one script of the dVRK that runs unattended, with shorter
waits. All arms run theirs at the same time. Whoever has the packages runs them unmodified: see docs/arms.md.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from tests.ros.conftest import ARMS
from tests.waiting import steady, until

pytestmark = pytest.mark.ros

CONNECTIONS = 5.0
SETTLED = (2e-4, 2e-3)
"""Metres and radians within which an arm without load stands at its goal."""


def on_all(arms: dict[str, Any], run: Callable[[Any], None], names: tuple[str, ...] = ARMS) -> None:
    """``run`` on each arm, at the same time."""
    with ThreadPoolExecutor(len(names)) as pool:
        futures = {name: pool.submit(run, arms[name]) for name in names}
    problems = [f"{name}: {future.exception()!r}" for name, future in futures.items() if future.exception()]
    assert not problems, "\n".join(problems)


def ready(arm: Any) -> None:
    assert arm.enable(10.0), "not enabled"
    assert arm.home(10.0), "not homed"


def at_rest(arm: Any, goal: np.ndarray) -> None:
    """The arm stands at the joint values ``goal``."""
    from ligature.robots.mtm import JOINT_NAMES  # its length distinguishes the kinds

    tolerance = np.full(len(goal), SETTLED[1])
    if len(goal) < len(JOINT_NAMES):
        tolerance[2] = SETTLED[0]
    # what ends a move may come before the state that it ended with
    until(
        lambda: (np.abs(arm.measured_jp() - goal) <= tolerance).all(),
        lambda: f"at its goal, and not off by {np.abs(arm.measured_jp() - goal)}", 5.0,
    )  # fmt: skip


def commanded(arm: Any, goal: np.ndarray) -> None:
    """The set-point of the tip is at ``goal``."""
    until(
        lambda: np.linalg.norm(arm.setpoint_cp()[:3] - goal[:3]) < SETTLED[0],
        lambda: f"{np.linalg.norm(arm.setpoint_cp()[:3] - goal[:3])} m from the goal", 5.0,
    )  # fmt: skip


def stream(send: Callable[[float], None], seconds: float, rate: float) -> None:
    """Call ``send`` with the time since the beginning, ``rate`` times a second."""
    begin = time.monotonic()
    for k in range(int(seconds * rate)):
        send(k / rate)
        time.sleep(max(0.0, begin + (k + 1) / rate - time.monotonic()))


# --- crtk_python_client ---------------------------------------------------------------------


def run_move_cp_example(arm: Any) -> None:
    """crtk_move_cp_example: there and back along each axis, each move waited for."""
    from tests.ros.crtk import shifted

    ready(arm)
    start = arm.setpoint_cp()
    for axis in range(3):
        for way in (0.02, 0.0):
            goal = shifted(start, way * np.eye(3)[axis])
            motion = arm.move_cp(goal)
            assert motion.wait(timeout=10.0), "the move did not end"
            assert not motion.is_busy()
            commanded(arm, goal)


def run_servo_cp_example(arm: Any) -> None:
    """crtk_servo_cp_example: a smooth wave along x, streamed."""
    from tests.ros.crtk import pose_distance, shifted

    ready(arm)
    start = arm.setpoint_cp()
    furthest = [0.0]

    def send(t: float) -> None:
        arm.servo_cp(shifted(start, [0.01 * (1.0 - np.cos(2.0 * np.pi * t)), 0.0, 0.0]))
        furthest[0] = max(furthest[0], pose_distance(arm.setpoint_cp(), start)[0])
        assert not arm.state.now.is_busy, "servo must not make an arm busy"

    stream(send, 1.0, 200.0)
    assert furthest[0] == pytest.approx(0.02, abs=1e-3)


def run_servo_jp_example(arm: Any) -> None:
    """crtk_servo_jp_example: a smooth wave on the first two joints, streamed."""
    ready(arm)
    start = arm.setpoint_jp()
    amplitude = np.zeros(len(start))
    amplitude[:2] = np.deg2rad(5.0)
    stream(lambda t: arm.servo_jp(start + amplitude * np.sin(2.0 * np.pi * t) ** 2), 1.0, 200.0)
    arm.servo_jp(start)
    steady(arm.measured_jp, within=1e-4)
    at_rest(arm, start)


def run_servo_cv_example(arm: Any) -> None:
    """crtk_servo_cv_example: one period of a velocity wave, then silence, and the arm stands still."""
    from tests.ros.crtk import pose_distance

    ready(arm)
    start, seen = arm.setpoint_cp(), []

    def send(t: float) -> None:
        arm.servo_cv([0.02 * np.sin(2.0 * np.pi * t), 0.0, 0.0, 0.0, 0.0, 0.0])
        seen.append(pose_distance(arm.setpoint_cp(), start)[0])

    stream(send, 1.0, 100.0)
    # less where simulated time lags behind the clock, more where a command comes late: the one before it lasts
    assert 0.1 < max(seen) / (0.02 / np.pi) < 2.0
    steady(lambda: arm.setpoint_cp()[:3], 0.3, 1e-7, "it stands without commands", 3.0)


@pytest.mark.parametrize("run", [run_move_cp_example, run_servo_cp_example, run_servo_jp_example, run_servo_cv_example])
def test_crtk_examples_run_on_all_arms(arms, run):
    on_all(arms, run)


def test_crtk_teleop_example_lets_a_puppet_follow_a_controller(arms):
    """crtk_teleop_example: the puppet repeats the controller's displacement, a gripper drives the jaw."""
    from tests.ros.crtk import shifted

    master, puppet = arms["MTMR"], arms["PSM1"]
    ready(master)
    ready(puppet)
    from_master, from_puppet = master.measured_cp(), puppet.setpoint_cp()
    motion = master.move_cp(shifted(from_master, [0.03, 0.0, 0.0]))
    while motion.is_busy():
        puppet.servo_cp(shifted(from_puppet, 0.5 * (master.measured_cp() - from_master)[:3]))
        puppet.jaw.servo_jp(0.2 + 0.5 * master.gripper())
        time.sleep(0.005)
    followed = steady(puppet.measured_cp, within=1e-4)[:3] - from_puppet[:3]
    np.testing.assert_allclose(followed, [0.015, 0.0, 0.0], atol=2e-3)


# --- dvrk_python ----------------------------------------------------------------------------


def run_arm_test(arm: Any) -> None:
    """dvrk_arm_test: home, joint moves and servo, Cartesian servo and moves."""
    from tests.ros.crtk import shifted

    ready(arm)
    goal = arm.setpoint_jp()
    if len(goal) < 7:
        goal[:4] = 0.0
        goal[2] = 0.12
        assert arm.move_jp(goal).wait(), "the first move did not end"
        assert arm.move_jp(goal).wait(), "a move of no length did not end"
    start = arm.setpoint_jp()
    at_rest(arm, start)
    swing = np.zeros(len(start))
    swing[:2] = np.deg2rad(5.0)
    stream(lambda t: arm.servo_jp(start + swing * np.sin(np.pi * t) ** 2), 2.0, 100.0)
    steady(arm.setpoint_jp)  # a command of the stream that comes after the move, on a topic of its own, would end it
    for sign in (1.0, -1.0, 0.0):
        goal = start + 2.0 * sign * swing
        assert arm.move_jp(goal).wait(), "a joint move did not end"
    at_rest(arm, start)
    tip = arm.setpoint_cp()
    stream(lambda t: arm.servo_cp(shifted(tip, 0.02 * np.sin(np.pi * t) ** 2 * np.array([1.0, 1.0, 0.0]))), 1.0, 100.0)
    steady(arm.setpoint_cp)
    for axis in (0, 1):
        for way in (0.05, -0.05, 0.0):
            target = shifted(tip, way * np.eye(3)[axis])
            assert arm.move_cp(target).wait(), "a Cartesian move did not end"
            commanded(arm, target)


def test_dvrk_arm_test_runs_on_all_arms(arms):
    on_all(arms, run_arm_test)


def run_move_wait_test(arm: Any) -> None:
    """dvrk_move_wait_test: moves of the first joint waited for, and polled for being busy."""
    ready(arm)
    start = arm.setpoint_jp()
    step = np.zeros(len(start))
    step[0] = np.deg2rad(10.0)
    for goal in (start + step, start - step):
        assert arm.move_jp(goal).wait(), "wait() gave up"
        at_rest(arm, goal)
    motion = arm.move_jp(start)
    polls = 0
    while motion.is_busy():
        polls += 1
        time.sleep(0.01)
    assert polls > 5, "it was never busy"
    at_rest(arm, start)
    motion = arm.move_jp(start + step)
    assert motion.wait(is_busy=True, timeout=2.0), "it was not seen busy"
    assert motion.wait(), "wait() after wait(is_busy=True) gave up"
    assert arm.move_jr(-step).wait()
    at_rest(arm, start)


def test_dvrk_move_wait_test_runs_on_all_arms(arms):
    on_all(arms, run_move_wait_test)


def test_dvrk_system_test_finds_its_subscribers(simulator, node):
    from std_msgs.msg import Float64, Float64MultiArray, String

    from tests.ros.crtk import System

    system = System(node)
    system.check_connections(2.0)
    system.send("set_volume", Float64(0.5))
    system.send("beep", Float64MultiArray(data=[0.3, 3000.0, 0.5]))
    system.send("string_to_speech", String("hello"))
    system.close()


def test_dvrk_reset_teleoperation_brings_master_and_roll_to_zero(arms, node):
    """dvrk_reset_teleoperation: stop teleoperation, both arms to zero, start it again."""
    from std_msgs.msg import Bool

    from tests.ros.crtk import Console

    console = Console(node)
    console.check_connections(CONNECTIONS)
    enabled: list[bool] = []
    listener = node.Subscriber("/console/teleop/enabled", Bool, lambda message: enabled.append(message.data))
    master, psm = arms["MTML"], arms["PSM1"]
    ready(master)
    ready(psm)
    console.send("teleop/enable", Bool(False))
    zero = np.zeros(7)
    assert master.move_jp(zero).wait()
    at_rest(master, zero)
    goal = psm.setpoint_jp()
    goal[3] = 0.0
    assert psm.move_jp(goal).wait()
    at_rest(psm, goal)
    console.send("teleop/enable", Bool(True))
    until(lambda: enabled[-1:] == [True], "teleoperation is enabled", 5.0)
    listener.unregister()
    console.close()


def run_gravity_collection(arm: Any) -> None:
    """dvrk_ecm_psm_gc_collect: a grid of poses, some beyond the limits, efforts read at each."""
    ready(arm)
    assert arm.home(0.0), "homed already: home() without timeout is True"
    angles = arm.setpoint_jp()
    for yaw, pitch, insertion in ((-80.0, -40.0, 0.005), (-40.0, 60.0, 0.105), (0.0, 20.0, 0.205), (40.0, -20.0, 0.23)):
        goal = angles.copy()
        goal[:3] = np.deg2rad(yaw), np.deg2rad(pitch), insertion
        assert arm.move_jp(goal).wait(), f"{yaw}, {pitch}, {insertion}: the move did not end"
        effort = arm.measured_js()[2]
        assert len(effort) >= 3
        assert np.isfinite(effort).all()
        yaw_goal = goal[0]
        until(
            lambda yaw_goal=yaw_goal: abs(arm.measured_jp()[0] - yaw_goal) < SETTLED[1],
            "yaw is within its limits: it must be reached", 5.0,
        )  # fmt: skip
    moves = len(angles) == 4
    last = arm.move_jp([0.0, 0.0, 0.12, 0.0])
    assert last.wait(timeout=20.0 if moves else 5.0) == moves, "four values move an ECM, and a PSM not"
    assert arm.move_jp(np.where(np.arange(len(angles)) == 2, 0.12, 0.0)).wait()


def test_dvrk_gravity_collection_runs_on_psm_and_ecm(arms):
    on_all(arms, run_gravity_collection, ("PSM1", "ECM"))
