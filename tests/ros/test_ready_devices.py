"""Every device that needs no file leads an instrument to the right when its user moves to the right."""

from __future__ import annotations

import contextlib
import os
import pty
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ligature.model.frames import inverse, pose7_matrix
from ligature.teleop.ready import names, of_devices

from tests.ros.conftest import BIN, Program
from tests.waiting import until

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def arms(start: Callable[..., Any], arms_scene: Path, node: Any) -> Iterator[dict[str, Any]]:
    from tests.ros import crtk

    program = start(BIN / "ligature", "run", arms_scene, "-p", "500", "--no-cameras", "--base-frames", "ECM")
    program.wait_for("first state published")
    found = {"PSM1": crtk.Psm(node, "PSM1"), "PSM2": crtk.Psm(node, "PSM2"), "MTMR": crtk.Mtm(node, "MTMR")}
    for arm in found.values():
        arm.check_connections(10.0)
    yield found
    for arm in found.values():
        arm.close()


class Pen:
    """A Touch at its default topics."""

    def __init__(self, node: Any, arms: dict[str, Any]) -> None:
        from geometry_msgs.msg import PoseStamped

        self._publisher = node.Publisher("/Geomagic/pose", PoseStamped, queue_size=10, tcp_nodelay=True)
        self._message = PoseStamped()
        self._message.pose.orientation.w = 1.0

    def step(self, right: float) -> None:
        self._message.pose.position.x += right
        self._publisher.publish(self._message)

    def close(self) -> None:
        self._publisher.unregister()


class Stick:
    """A stick on a topic, deflected to the right; it is a speed."""

    def __init__(self, node: Any, topic: str, axis: int) -> None:
        from sensor_msgs.msg import Joy

        self._publisher = node.Publisher(topic, Joy, queue_size=10, tcp_nodelay=True)
        self._type, self._axis = Joy, axis

    def step(self, right: float) -> None:
        axes = [0.0] * 8
        axes[self._axis] = -1.0 if right else 0.0
        self._publisher.publish(self._type(axes=axes, buttons=[0] * 8))

    def close(self) -> None:
        self._publisher.unregister()


class Hydra:
    """The right paddle of a Hydra."""

    def __init__(self, node: Any, arms: dict[str, Any]) -> None:
        import genpy.dynamic
        from ligature.model.frames import matrix_pose7

        from tests.ros.drivers import HYDRA

        self._types = genpy.dynamic.generate_dynamic("razer_hydra/Hydra", HYDRA)
        self._publisher = node.Publisher("/hydra_calib", self._types["razer_hydra/Hydra"], queue_size=10)
        self._place, self._rest = np.zeros(3), matrix_pose7(np.eye(4))

    def step(self, right: float) -> None:
        self._place[1] -= right
        paddles = []
        for place in (np.zeros(3), self._place):
            paddle = self._types["razer_hydra/HydraPaddle"]()
            t, q = paddle.transform.translation, paddle.transform.rotation
            (t.x, t.y, t.z), q.w = place, 1.0
            paddle.buttons, paddle.joy, paddle.trigger = [False] * 7, [0.0, 0.0], 0.0
            paddles.append(paddle)
        self._publisher.publish(self._types["razer_hydra/Hydra"](paddles=paddles))

    def close(self) -> None:
        self._publisher.unregister()


class Master:
    """The right master arm, which the simulator has; its x is to the operator's left."""

    def __init__(self, node: Any, arms: dict[str, Any]) -> None:
        self._arm = arms["MTMR"]

    def step(self, right: float) -> None:
        if right:
            pose = self._arm.setpoint_cp()
            pose[0] -= right
            self._arm.servo_cp(pose)

    def close(self) -> None:
        pass


class Terminal:
    """A terminal whose user types or drags; ``word`` is what moves to the right."""

    def __init__(self, word: Callable[[int], bytes]) -> None:
        self._user, self._end = pty.openpty()
        tty.setraw(self._user)
        self.topic, self._word, self._count = os.ttyname(self._end), word, 0

    def step(self, right: float) -> None:
        if right:
            os.write(self._user, self._word(self._count))
            self._count += 1
        os.set_blocking(self._user, False)
        with contextlib.suppress(BlockingIOError):  # what the device shows
            os.read(self._user, 1000)

    def types(self, text: str) -> None:
        os.write(self._user, text.encode())

    def close(self) -> None:
        os.close(self._user)
        os.close(self._end)


def drag(count: int) -> bytes:
    """A press first, then drags a cell to the right each."""
    return f"\x1b[<{0 if count == 0 else 32};{10 + count};10M".encode()


DRIVERS: dict[str, Callable[[Any, dict[str, Any]], Any]] = {
    "touch": Pen, "hydra": Hydra, "mtm": Master,
    "spacemouse": lambda node, arms: Stick(node, "/spacenav/joy", 1),
    "gamepad": lambda node, arms: Stick(node, "/joy", 0),
    "keyboard": lambda node, arms: Terminal(lambda _: b"d"), "mouse": lambda node, arms: Terminal(drag),
}  # fmt: skip
PERIOD = 0.01
WAY = 0.006
"""Metres that the tip is to go."""


def marks_phases(terminal: Terminal, heard: Any, device: str) -> None:
    """Keys of a terminal go forth and back through the phases of the device's configuration, and round."""
    phases = of_devices([device]).phases
    assert len(phases) > 2
    keys = "p" * (len(phases) + 1) + "PPp"
    wanted = [*phases, phases[0], phases[-1], phases[-2], phases[-1]]
    for count, key in enumerate(keys, 1):
        terminal.types(key)
        until(lambda count=count: len(heard.messages) == count, lambda: f"{[m.data for m in heard.messages]}")
    assert [message.data for message in heard.messages] == wanted


def test_every_ready_device_has_a_driver_here() -> None:
    assert sorted(DRIVERS) == names()


@pytest.mark.parametrize("device", sorted(DRIVERS))
def test_an_instrument_goes_to_the_right_with_its_user(
    arms: dict[str, Any], node: Any, ros_env: dict[str, str], listen: Callable[..., Any], device: str
) -> None:
    from std_msgs.msg import Bool, String

    psm = arms["PSM1"]
    assert psm.enable(10.0) and psm.home(20.0)
    assert psm.move_jp([0.0, 0.0, 0.12, 0.0, 0.0, 0.0]).wait()
    driver = DRIVERS[device](node, arms)
    name = {"touch": "pen", "hydra": "right", "mtm": "MTMR"}.get(device, device)
    topic = f"={driver.topic}" if isinstance(driver, Terminal) else ""
    status = listen(f"/{name}_PSM1/status", String)
    following = listen(f"/{name}_PSM1/following", Bool)
    program = Program([str(BIN / "ligature"), "teleop", "--device", f"{device}{topic}", "--timeout", "2"], ros_env)

    def follows() -> bool:
        driver.step(0.0)
        return bool(following.messages and following.messages[-1].data)

    try:
        until(
            follows,
            lambda: f"{device} drives:\n{program.output}\n{[m.data for m in status.messages[-3:]]}",
            60.0,
            PERIOD,
        )
        begin = pose7_matrix(psm.setpoint_cp())  # in the frame of the camera's tip: x right, y down, z away
        deadline = time.monotonic() + 30.0
        while (moved := psm.setpoint_cp()[:3] - begin[:3, 3])[0] < WAY:
            assert time.monotonic() < deadline, f"{device}: the tip went {moved}\n{program.output}"
            driver.step(0.0005)
            time.sleep(PERIOD)
        assert np.linalg.norm(moved[1:]) < 0.2 * WAY, f"{device}: it went to {moved}"
        turned = inverse(begin) @ pose7_matrix(psm.setpoint_cp())
        assert np.trace(turned[:3, :3]) > 3.0 - 1e-3, "it did not turn"
        if isinstance(driver, Terminal):
            marks_phases(driver, listen("/ligature/phase", String), device)
    finally:
        program.end(20.0)
        driver.close()
