"""Adapters of devices on ROS without a simulator: generations of names and types, and packages that are missing."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from ligature.teleop.devices import module
from ligature.teleop.devices.device import Reading

from tests.waiting import until

pytestmark = pytest.mark.ros


def adapter(kind: str, topic: str, **options: Any) -> tuple[Any, list[Reading]]:
    found, readings = module(kind), []
    return found.Adapter(topic, {**found.OPTIONS, **options}, readings.append), readings


@pytest.mark.parametrize(
    "names", [("measured_cp", "gripper/measured_js"), ("position_cartesian_current", "state_gripper_current")]
)
def test_a_master_is_heard_under_its_new_and_its_old_names(
    node: Any, publish: Callable[..., Any], names: tuple[str, str]
) -> None:
    from geometry_msgs.msg import PoseStamped
    from sensor_msgs.msg import JointState

    device, readings = adapter("mtm", "/dvrk/MTML/")
    pose, gripper = publish(f"/dvrk/MTML/{names[0]}", PoseStamped), publish(f"/dvrk/MTML/{names[1]}", JointState)
    message = PoseStamped()
    message.pose.position.x, message.pose.orientation.w = 0.2, 1.0

    def heard() -> bool:
        gripper.publish(JointState(position=[0.5]))
        pose.publish(message)
        return bool(readings and readings[-1].grip == 0.5)

    until(heard)
    assert readings[-1].pose == pytest.approx([0.2, 0, 0, 0, 0, 0, 1])
    device.close()


def test_poses_of_the_transform_type_of_older_systems_are_understood(node: Any, publish: Callable[..., Any]) -> None:
    from geometry_msgs.msg import TransformStamped

    device, readings = adapter("mtm", "/old/MTML/")
    pose = publish("/old/MTML/measured_cp", TransformStamped)
    message = TransformStamped()
    message.transform.translation.y, message.transform.rotation.w = 0.3, 1.0
    until(lambda: pose.publish(message) or readings)
    assert readings[-1].pose[:3] == pytest.approx([0, 0.3, 0])
    device.close()


@pytest.mark.parametrize(
    ("kind", "axes", "way"),
    [("joy", [1.0] + [0.0] * 7, (-1, 0, 0)), ("joy", [0.0, 1.0] + [0.0] * 6, (0, -1, 0)),
     ("spacenav", [1.0, 0, 0, 0, 0, 0], (0, 0, 1)), ("spacenav", [0, 0, 1.0, 0, 0, 0], (0, -1, 0))],
)  # fmt: skip
def test_a_stick_moves_the_hand_where_it_is_pushed(
    node: Any, publish: Callable[..., Any], kind: str, axes: list[float], way: tuple[int, ...]
) -> None:
    from sensor_msgs.msg import Joy

    device, readings = adapter(kind, f"/test/{kind}", speed=0.1)
    stick = publish(f"/test/{kind}", Joy)

    def moved() -> bool:
        stick.publish(Joy(axes=axes, buttons=[0, 1]))
        device.poll(time.monotonic())
        return bool(readings and np.linalg.norm(readings[-1].pose[:3]) > 0.005)

    until(moved)
    direction = readings[-1].pose[:3] / np.linalg.norm(readings[-1].pose[:3])
    assert direction == pytest.approx(np.array(way, dtype=float))
    assert readings[-1].buttons == {"0": False, "1": True}
    device.close()


def test_a_pen_in_millimetres_is_read_in_metres(node: Any, publish: Callable[..., Any]) -> None:
    from geometry_msgs.msg import PoseStamped

    device, readings = adapter("touch", "/mm/", unit=0.001)
    pose = publish("/mm/pose", PoseStamped)
    message = PoseStamped()
    message.pose.position.z, message.pose.orientation.w = 120.0, 1.0
    until(lambda: pose.publish(message) or readings)
    assert readings[-1].pose[2] == pytest.approx(0.12)
    device.close()


def test_messages_of_a_type_that_is_no_pose_are_reported_and_the_pen_is_heard_on(
    node: Any, publish: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    from geometry_msgs.msg import PoseStamped
    from std_msgs.msg import String

    reported: list[str] = []
    monkeypatch.setattr(node, "logerr_throttle_identical", lambda _, text: reported.append(text))
    device, readings = adapter("touch", "/mixed/")
    wrong = publish("/mixed/pose", String)
    until(lambda: wrong.publish("here") or reported)
    assert "/mixed/pose: /ligature_tests" in reported[0]
    assert "sends std_msgs/String, which cannot be decoded" in reported[0]
    assert not readings
    wrong.unregister()
    pose = publish("/mixed/pose", PoseStamped)
    message = PoseStamped()
    message.pose.orientation.w = 1.0
    until(lambda: pose.publish(message) or readings)
    device.close()


def test_a_message_package_that_is_missing_is_named(node: Any) -> None:
    from ligature.teleop.messages import MissingPackage, message_class

    with pytest.raises(
        MissingPackage, match=r"force on /arm1/force_feedback needs messages omni_msgs/OmniFeedback: install"
    ):
        message_class("omni_msgs/OmniFeedback", "force on /arm1/force_feedback")
    with pytest.raises(MissingPackage, match="std_msgs/Nothing"):
        message_class("std_msgs/Nothing", "something")


def test_a_pen_presses_back_with_its_driver_s_messages(
    node: Any, listen: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys
    import types

    import genpy.dynamic

    made = genpy.dynamic.generate_dynamic(
        "omni_msgs/OmniFeedback",
        "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 position\n" + "=" * 80
        + "\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n",
    )["omni_msgs/OmniFeedback"]  # fmt: skip
    package = types.ModuleType("omni_msgs.msg")
    package.OmniFeedback = made  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "omni_msgs", types.ModuleType("omni_msgs"))
    monkeypatch.setitem(sys.modules, "omni_msgs.msg", package)
    felt = listen("/pressed/force_feedback", made)
    device, _ = adapter("touch", "/pressed/")
    until(lambda: device.feel(np.array([0.1, 0.2, 0.3, 0, 0, 0])) or felt.messages)
    force = felt.messages[-1].force
    assert (force.x, force.y, force.z) == pytest.approx((0.1, 0.2, 0.3))
    device.close()


def test_the_guide_asks_for_motions_and_reports_the_block(node: Any, publish: Callable[..., Any]) -> None:
    import threading
    from pathlib import Path

    from geometry_msgs.msg import PoseStamped
    from ligature.teleop.config import from_text
    from ligature.teleop.guide import calibration_of

    config = from_text("devices: {pen: {kind: touch, topic: /guided/}}\npairs: {pen: PSM1}\n", Path("teleop.yaml"))
    places = iter([(0.0, 0.0, 0.0), (0.0, -0.1, 0.0), (0.1, 0.0, 0.0), (0.0, 0.0, 0.0)])
    message, stop = PoseStamped(), threading.Event()
    message.pose.orientation.w = 1.0
    publisher = node.Publisher("/guided/pose", PoseStamped, queue_size=1)

    def drive() -> None:
        while not stop.wait(0.02):
            publisher.publish(message)

    driver = threading.Thread(target=drive)
    driver.start()

    def ask(question: str) -> str:
        p = message.pose.position
        p.x, p.y, p.z = next(places)
        time.sleep(0.2)  # the hand is still when Enter is pressed
        return ""

    try:
        block = calibration_of(config, "pen", ask, lambda text: None)
    finally:
        stop.set()
        driver.join()
        publisher.unregister()
    device = from_text(
        f"devices:\n  pen:\n    kind: touch\n    {block.strip().replace(chr(10), chr(10) + '    ')}\npairs: {{pen: PSM1}}\n",
        Path("t"),
    )
    assert device.devices["pen"].calibration.axes @ [0, -1, 0] == pytest.approx([1, 0, 0], abs=1e-4)
    assert device.devices["pen"].calibration.axes @ [1, 0, 0] == pytest.approx([0, -1, 0], abs=1e-4)
