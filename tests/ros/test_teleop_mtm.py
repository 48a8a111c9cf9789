"""A master arm of the simulator drives an instrument: alignment, the dVRK's component topics, forces, rivals."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest

from tests.ros.conftest import BIN
from tests.ros.drivers import apart, camera_of, measured, patiently, settled, wait_for_listener
from tests.waiting import stays, until

pytestmark = pytest.mark.ros

CONFIG = """
camera: ECM
enabled: false
settings: {timeout: 2.0}
devices:
  MTMR: {kind: mtm, force: {gain: 1.0, limit: 2.0, damping: 0.0}}
pairs: {MTMR: [PSM1, PSM2]}
"""
VIEW_CONSOLE = np.diag([-1.0, -1.0, 1.0])
"""The console's axes (left, up, away) in the picture's (right, down, away)."""


@pytest.fixture(scope="module")
def simulator(simulator: Any, start: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The simulator of `arms_scene`, teleoperated."""
    file = tmp_path_factory.mktemp("teleop") / "teleop.yaml"
    file.write_text(CONFIG)
    start(BIN / "ligature", "teleop", file).wait_for("driving:")
    return simulator


@pytest.fixture(scope="module")
def arms(simulator: Any, node: Any) -> Iterator[dict[str, Any]]:
    from tests.ros import crtk

    clients = {n: kind(node, n) for n, kind in (("PSM1", crtk.Psm), ("MTMR", crtk.Mtm), ("ECM", crtk.Arm))}
    for client in (clients["MTMR"], clients["ECM"]):
        assert patiently(partial(client.enable, 30.0))
        assert patiently(partial(client.home, 30.0))
    yield clients
    for client in clients.values():
        client.close()


@pytest.fixture
def component(arms: dict[str, Any], listen: Callable[..., Any], publish: Callable[..., Any]) -> Callable[[str], Any]:
    """Enables the pair and waits until it follows; gives listeners of its topics."""
    from std_msgs.msg import Bool, String

    heard = {name: listen(f"/MTMR_PSM1/{name}", String) for name in ("current_state", "desired_state", "status")}
    heard["following"] = listen("/MTMR_PSM1/following", Bool)
    wait_for_listener(publish("/console/teleop/enable", Bool), 2).publish(True)
    try:
        heard["following"].wait(lambda m: m.data, 40.0)
    except AssertionError as error:
        raise AssertionError(heard["status"].messages[-1:]) from error
    return heard.__getitem__


def drive(mtm: Any, way: Any, seconds: float = 0.5) -> None:
    """Carry the master arm by ``way``, in axes of the console, as a hand does."""
    start = patiently(mtm.setpoint_cp)
    steps = int(seconds / 0.005)
    for k in range(1, steps + 1):
        goal = start.copy()
        goal[:3] += np.asarray(way) * min(k / steps, 1.0)
        mtm.servo_cp(goal)
        time.sleep(0.005)


def test_an_arm_that_is_off_is_made_ready_and_the_master_turns_to_it(
    component: Any, arms: dict[str, Any], node: Any, listen: Callable[..., Any]
) -> None:
    states = [m.data for m in component("current_state").messages]
    assert states[-1] == "ENABLED"
    assert component("desired_state").messages[-1].data == "ENABLED"
    T_camera_tip = np.linalg.inv(camera_of(arms, "PSM1", listen)) @ measured(arms, "PSM1")
    R_view_hand = VIEW_CONSOLE @ measured(arms, "MTMR")[:3, :3]
    turn = np.rad2deg(np.arccos(np.clip((np.trace(R_view_hand.T @ T_camera_tip[:3, :3]) - 1) / 2, -1, 1)))
    assert turn < 5.5


def test_the_instrument_follows_the_master_by_the_dvrk_s_scale(
    component: Any, arms: dict[str, Any], node: Any, listen: Callable[..., Any]
) -> None:
    from geometry_msgs.msg import TwistStamped

    T_base_camera = camera_of(arms, "PSM1", listen)
    settled(arms, "MTMR")
    hand, tip = measured(arms, "MTMR")[:3, 3], settled(arms, "PSM1")
    speeds = listen("/MTMR_PSM1/MTM/measured_cv", TwistStamped)
    drive(arms["MTMR"], (0.03, 0.02, -0.02))
    until(lambda: any(m.twist.linear.x < -0.01 for m in speeds.messages), "the hand's speed is not reported")
    moved = settled(arms, "MTMR")[:3, 3] - hand
    assert np.linalg.norm(moved) > 0.03
    ideal = tip[:3, 3] + 0.2 * T_base_camera[:3, :3] @ VIEW_CONSOLE @ moved
    until(
        lambda: 1e3 * np.linalg.norm(measured(arms, "PSM1")[:3, 3] - ideal) < 0.1,
        lambda: (measured(arms, "PSM1"), ideal),
    )


def test_locks_and_scale_are_reported_and_move_nothing(
    component: Any, arms: dict[str, Any], publish: Callable[..., Any], listen: Callable[..., Any]
) -> None:
    from sensor_msgs.msg import Joy
    from std_msgs.msg import Bool, Float64

    lock, scale = publish("/MTMR_PSM1/lock_translation", Bool), publish("/MTMR_PSM1/set_scale", Float64)
    before = settled(arms, "PSM1")
    lock.publish(True)
    assert listen("/MTMR_PSM1/translation_locked", Joy).wait(lambda m: m.buttons[0] == 1)
    drive(arms["MTMR"], (0.02, 0.0, 0.0), 0.2)
    settled(arms, "MTMR")
    assert apart(settled(arms, "PSM1"), before)[0] < 0.05
    lock.publish(False)
    scale.publish(0.4)
    reported = listen("/MTMR_PSM1/scale", Float64)
    assert reported.wait(lambda m: m.data == 0.4)
    scale.publish(7.0)
    stays(lambda: reported.messages[-1].data == 0.4, "a scale of 7 is rejected", 0.2)
    assert apart(settled(arms, "PSM1"), before)[0] < 0.05


def test_what_is_pressed_on_the_hand_arrives_at_the_master(
    component: Any, publish: Callable[..., Any], listen: Callable[..., Any]
) -> None:
    from geometry_msgs.msg import WrenchStamped

    felt, push = (
        listen("/MTMR/body/servo_cf", WrenchStamped),
        publish("/MTMR_PSM1/following/mtm/body/servo_cf", WrenchStamped),
    )
    message = WrenchStamped()
    message.wrench.force.z = 0.3
    push.publish(message)
    assert felt.wait(lambda m: abs(m.wrench.force.z - 0.3) < 0.05)
    message.wrench.force.z = 0.0
    push.publish(message)
    assert felt.wait(lambda m: abs(m.wrench.force.z) < 0.05)


def test_an_arm_that_another_node_moves_holds_and_reports_it(
    component: Any, arms: dict[str, Any], publish: Callable[..., Any]
) -> None:
    from sensor_msgs.msg import Joy

    arms["PSM1"].servo_cp(patiently(arms["PSM1"].setpoint_cp))
    assert component("status").wait(lambda m: "claims" in m.data)
    before = settled(arms, "PSM1")
    drive(arms["MTMR"], (0.0, 0.02, 0.0), 0.2)
    settled(arms, "MTMR")
    assert apart(settled(arms, "PSM1"), before)[0] < 0.02
    pedal = publish("/footpedals/clutch", Joy)
    for pressed in (1, 0):
        pedal.publish(Joy(buttons=[pressed]))
        time.sleep(0.1)
    assert component("following").wait(lambda m: m.data)


def test_disabled_and_without_an_operator_nothing_drives(component: Any, publish: Callable[..., Any]) -> None:
    from crtk_msgs.msg import StringStamped
    from sensor_msgs.msg import Joy

    present = publish("/console/operator_present", Joy)
    present.publish(Joy(buttons=[0]))
    assert component("status").wait(lambda m: m.data == "the operator is not present")
    present.publish(Joy(buttons=[1]))
    assert component("following").wait(lambda m: m.data)
    publish("/MTMR_PSM1/state_command", StringStamped).publish(StringStamped(string="disable"))
    assert component("current_state").wait(lambda m: m.data == "DISABLED")
    assert component("following").wait(lambda m: not m.data)
