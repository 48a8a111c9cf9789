"""Teleoperation through ROS only: device nodes that publish the real message types drive the arms of a simulator.

Nothing here is measured against the clock; `tests.bench.teleop_suture` and `tests.bench.teleop_latency` measure.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ligature.model.frames import inverse

from tests.ros.conftest import BIN
from tests.ros.drivers import (
    PERIOD,
    TIMEOUT,
    Paddle,
    Pen,
    apart,
    camera_of,
    measured,
    patiently,
    settled,
    wait_for_listener,
)
from tests.waiting import until

pytestmark = pytest.mark.ros

CONFIG = """
camera: ECM
settings: {scale: 0.5, max velocity: 1.0, timeout: 2.0, align: false}
devices:
  pen: {kind: touch, topic: /arm1/, buttons: {grey: clutch, white: close}}
  paddle: {kind: hydra, paddle: left, buttons: {bumper: clutch}}
pairs:
  pen: [PSM1, PSM2]
  paddle: [PSM2, PSM1]
"""
"""Devices are trusted over two seconds of silence, so that a busy machine takes none of them for lost."""


@pytest.fixture(scope="module")
def arms(simulator: Any, node: Any) -> Iterator[dict[str, Any]]:
    from tests.ros import crtk

    clients = {name: kind(node, name) for name, kind in (("PSM1", crtk.Psm), ("PSM2", crtk.Psm), ("ECM", crtk.Arm))}
    for client in clients.values():
        assert patiently(partial(client.enable, 30.0))
        assert patiently(partial(client.home, 30.0))
        client.check_connections(30.0)
    yield clients
    for client in clients.values():
        client.close()


@pytest.fixture(scope="module")
def teleop(arms: dict[str, Any], start: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("teleop")
    (folder / "teleop.yaml").write_text(CONFIG)
    program = start(BIN / "ligature", "teleop", folder / "teleop.yaml", "--record", folder / "record.jsonl")
    program.record = folder / "record.jsonl"
    program.wait_for("driving:")
    return program


@pytest.fixture(scope="module")
def drivers(teleop: Any, node: Any) -> Iterator[tuple[Pen, Paddle]]:
    made = Pen(node), Paddle(node)
    yield made
    for driver in made:
        driver.close()


@pytest.fixture
def paddle(drivers: tuple[Pen, Paddle]) -> Paddle:
    return drivers[1]


@pytest.fixture
def pen(drivers: tuple[Pen, Paddle], following: Callable[..., None], arms: dict[str, Any]) -> Pen:
    pen = drivers[0]
    pen.muted, pen.sent = False, None
    following(pen, "pen_PSM1")
    settled(arms, "PSM1")
    return pen


@pytest.fixture
def following(node: Any, listen: Callable[..., Any]) -> Callable[..., None]:
    """Taps the clutch, which makes a device trusted again, and waits until the pair follows."""
    from std_msgs.msg import Bool, String

    def wait(pen: Pen, pair: str) -> None:
        follows, status = listen(f"/{pair}/following", Bool), listen(f"/{pair}/status", String)
        clutched(pen, follows, status)
        pen.press()
        until(lambda: follows.messages[-1].data, lambda: f"{pair}: {status.messages[-1:]}")

    return wait


def clutched(pen: Pen, follows: Any, status: Any) -> None:
    """Press the clutch, and wait until hands may move."""
    pen.press(grey=1)
    until(lambda: follows.messages and not follows.messages[-1].data, lambda: status.messages[-1:])
    time.sleep(0.05)


def test_the_tip_follows_the_pen_in_the_picture(pen: Pen, arms: dict[str, Any], listen: Callable[..., Any]) -> None:
    T_base_camera = camera_of(arms, "PSM1", listen)
    before, hand = inverse(T_base_camera) @ measured(arms, "PSM1"), pen.T.copy()
    for way, turn in (
        ((0.03, 0.02, 0.0), (0, 0, 0)),
        ((-0.02, 0.0, 0.02), (0.2, -0.1, 0.3)),
        ((0, -0.02, 0), (0, 0.2, 0)),
    ):
        pen.glide(way, turn)
        ideal = before.copy()
        ideal[:3, 3] += 0.5 * pen.AXES @ (pen.T[:3, 3] - hand[:3, 3])
        ideal[:3, :3] = pen.AXES @ pen.T[:3, :3] @ hand[:3, :3].T @ pen.AXES.T @ before[:3, :3]

        def off(ideal: Any = ideal) -> tuple[float, float]:
            return apart(inverse(T_base_camera) @ measured(arms, "PSM1"), ideal)

        until(lambda: max(off()) < 0.1, lambda: f"{off()} mm and degrees from where the hand is")


def test_ten_clutches_move_the_pen_and_not_the_tip(pen: Pen, arms: dict[str, Any], listen: Callable[..., Any]) -> None:
    from std_msgs.msg import Bool, String

    follows, status = listen("/pen_PSM1/following", Bool), listen("/pen_PSM1/status", String)
    before = settled(arms, "PSM1")
    for k in range(10):
        clutched(pen, follows, status)
        pen.glide((0.02, 0.01, -0.01), (0.0, 0.05, 0.1), seconds=0.1)
        pen.press()
        until(lambda: follows.messages[-1].data, status.messages[-1:])
        far, turned = apart(settled(arms, "PSM1"), before)
        assert far < 0.05, k
        assert turned < 0.05, k


def test_the_white_button_closes_the_jaw(pen: Pen, arms: dict[str, Any]) -> None:
    jaw = arms["PSM1"].jaw
    pen.press(white=1)
    until(lambda: patiently(jaw.setpoint_jp) < -0.3, "the jaw does not close")
    pen.press()
    until(lambda: patiently(jaw.setpoint_jp) > 0.9, "the jaw does not open")


@pytest.mark.parametrize(
    ("values", "status_word"),
    [
        ([np.nan, 0, 0, 0, 0, 0, 1], "sends invalid poses"),
        ([0, 0, 0, 0, 0, 0, 0], "sends invalid poses"),
        ([5.0, 3.0, 0, 0, 0, 0, 1], "leapt"),
        (None, "silent"),
    ],
    ids=["nan", "zero quaternion", "leap", "silence"],
)
def test_a_device_that_fails_lets_the_arm_hold_and_states_why(
    pen: Pen, arms: dict[str, Any], listen: Callable[..., Any], values: Any, status_word: str, teleop: Any
) -> None:
    from std_msgs.msg import Bool, String

    status, other = listen("/pen_PSM1/status", String), listen("/paddle_PSM2/following", Bool)
    before = settled(arms, "PSM1")
    pen.sent, pen.muted = values, values is None
    status.wait(lambda m: status_word in m.data, TIMEOUT)
    pen.sent, pen.muted = None, False
    pen.glide((0.02, 0.0, 0.0), seconds=0.2)
    assert status_word in status.messages[-1].data
    far, _ = apart(settled(arms, "PSM1"), before)
    assert far < 0.02
    assert teleop.process.poll() is None
    assert other.messages[-1].data


def test_the_pen_switches_to_the_other_arm_without_a_jump(
    pen: Pen, arms: dict[str, Any], following: Callable[..., None], publish: Callable[..., Any],
    listen: Callable[..., Any],
) -> None:  # fmt: skip
    from std_msgs.msg import String

    select = wait_for_listener(publish("/console/teleop/select", String), 2)
    unselect = wait_for_listener(publish("/console/teleop/unselect", String), 2)
    selected, unselected = listen("/console/teleop/selected", String), listen("/console/teleop/unselected", String)
    status = listen("/paddle_PSM2/status", String)
    before = {name: settled(arms, name) for name in ("PSM1", "PSM2")}
    unselect.publish("paddle_PSM2")
    status.wait(lambda m: m.data == "not selected")
    assert unselected.wait(lambda m: m.data == "paddle_PSM2")
    select.publish("pen_PSM2")
    following(pen, "pen_PSM2")
    assert "pen_PSM2" in [m.data for m in selected.messages]
    assert apart(settled(arms, "PSM2"), before["PSM2"])[0] < 0.05
    pen.glide((0.0, 0.0, 0.02))
    until(
        lambda: apart(measured(arms, "PSM2"), before["PSM2"])[0] == pytest.approx(10.0, abs=0.1),
        lambda: apart(measured(arms, "PSM2"), before["PSM2"]),
    )
    assert apart(measured(arms, "PSM1"), before["PSM1"])[0] < 0.05
    select.publish("pen_PSM1")
    following(pen, "pen_PSM1")
    select.publish("paddle_PSM2")
    status.wait(lambda m: m.data == "following")


def test_an_arm_that_two_leaders_claim_holds_and_the_claim_is_reported(
    pen: Pen, arms: dict[str, Any], publish: Callable[..., Any], listen: Callable[..., Any]
) -> None:
    from std_msgs.msg import String

    status = listen("/pen_PSM1/status", String)
    before = settled(arms, "PSM1")
    wait_for_listener(publish("/console/teleop/select", String), 2).publish("paddle_PSM1")
    status.wait(lambda m: "claims" in m.data)
    pen.glide((0.02, 0.0, 0.0), seconds=0.2)
    assert apart(settled(arms, "PSM1"), before)[0] < 0.02


def test_the_camera_pedal_moves_the_camera_and_not_the_tips(
    pen: Pen, paddle: Paddle, arms: dict[str, Any], publish: Callable[..., Any], listen: Callable[..., Any]
) -> None:
    from sensor_msgs.msg import Joy
    from std_msgs.msg import Bool

    before = {name: settled(arms, name) for name in ("PSM1", "PSM2", "ECM")}
    pedal = publish("/console/camera", Joy)
    follows = listen("/pen_paddle_ECM/following", Bool)
    pedal.publish(Joy(buttons=[1]))
    follows.wait(lambda m: m.data)
    for _ in range(40):
        pen.T[2, 3] += 0.02 / 40
        paddle.T[0, 3] -= 0.02 / 40
        time.sleep(PERIOD)

    def moved() -> Any:
        return (inverse(before["ECM"]) @ measured(arms, "ECM"))[:3, 3]

    until(lambda: moved() == pytest.approx([0.0, 0.0, 0.02], abs=5e-5), moved)
    pedal.publish(Joy(buttons=[0]))
    follows.wait(lambda m: not m.data)
    for name in ("PSM1", "PSM2"):
        assert apart(settled(arms, name), before[name])[0] < 0.05


def test_what_devices_stated_is_written_down_and_can_be_stated_again(
    teleop: Any, arms: dict[str, Any], start: Callable[..., Any], tmp_path: Path
) -> None:
    from ligature.teleop.record import Replay

    assert teleop.end(20.0) == 0
    replay = Replay(teleop.record)
    assert replay.devices == {"pen", "paddle"}
    reported = [*replay.due(0.0), *replay.due(1e6)]
    assert sum(name == "reading" for name, _ in reported) > 1000
    assert [value for name, value in reported if name == "camera"] == [True, False]
    lines = teleop.record.read_text().splitlines()
    (tmp_path / "part.jsonl").write_text("\n".join(_first_motion(lines)) + "\n")
    (tmp_path / "teleop.yaml").write_text(CONFIG)
    before = settled(arms, "PSM1")
    again = start(BIN / "ligature", "teleop", tmp_path / "teleop.yaml", "--replay", tmp_path / "part.jsonl")
    assert again.process.wait(60.0) == 0
    assert 5.0 < apart(settled(arms, "PSM1"), before)[0] < 30.0


def _first_motion(lines: list[str]) -> list[str]:
    """A second of the pen at rest, for the arm to be taken, then what it did first."""
    import json

    rows = [row for row in map(json.loads, lines) if row.get("device") == "pen"]
    start = next(k for k, row in enumerate(rows) if row["pose"][0] > 0.0)
    rest = [{**rows[0], "buttons": {}, "t": 0.02 * k} for k in range(50)]
    moved = [{**row, "buttons": {}, "t": row["t"] - rows[start]["t"] + 1.0} for row in rows[start : start + 100]]
    return [json.dumps(row) for row in (*rest, *moved)]
