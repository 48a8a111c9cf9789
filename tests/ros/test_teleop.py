"""Teleoperation through ROS only: device nodes that publish the real message types lead the arms of a simulator.

Definitions of messages whose packages are not installed are written here as their drivers publish them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ligature.model.frames import axis_rotation, frame, inverse, matrix_pose7, pose7_matrix
from numpy.typing import NDArray

from tests.ros.conftest import BIN

pytestmark = pytest.mark.ros
Array = NDArray[np.float64]

CONFIG = """
camera: ECM
settings: {scale: 0.5, fastest: 1.0, patience: 0.5, align: false}
devices:
  pen: {kind: touch, topic: /arm1/, buttons: {grey: clutch, white: close}}
  paddle: {kind: hydra, paddle: left, buttons: {bumper: clutch}}
pairs:
  pen: [PSM1, PSM2]
  paddle: [PSM2, PSM1]
"""

SEPARATOR = "=" * 80
BUTTONS = "int32 grey_button\nint32 white_button\n"
HYDRA = f"""std_msgs/Header header
razer_hydra/HydraPaddle[] paddles
{SEPARATOR}
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
{SEPARATOR}
MSG: razer_hydra/HydraPaddle
geometry_msgs/Transform transform
bool[] buttons
float32[] joy
float32 trigger
{SEPARATOR}
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
{SEPARATOR}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{SEPARATOR}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""
PEN_AXES = np.diag([1.0, -1.0, -1.0])
"""A pen's x to the right, y up, z near, in axes of the picture."""


@pytest.fixture(scope="module")
def simulator(start: Callable[..., Any], arms_scene: Path) -> Any:
    program = start(BIN / "ligature", "run", arms_scene, "-p", "500", "--no-cameras")
    program.wait_for("first state published")
    return program


@pytest.fixture(scope="module")
def arms(simulator: Any, node: Any) -> Iterator[dict[str, Any]]:
    from tests.ros import crtk

    clients = {name: kind(node, name) for name, kind in (("PSM1", crtk.Psm), ("PSM2", crtk.Psm), ("ECM", crtk.Arm))}
    for client in clients.values():
        assert client.enable(10.0)
        assert client.home(10.0)
        client.check_connections(10.0)
    yield clients
    for client in clients.values():
        client.close()


@pytest.fixture(scope="module")
def teleop(arms: dict[str, Any], start: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("teleop")
    (folder / "teleop.yaml").write_text(CONFIG)
    program = start(BIN / "ligature", "teleop", folder / "teleop.yaml", "--record", folder / "record.jsonl")
    program.record = folder / "record.jsonl"
    program.wait_for("leading:")
    return program


def wait_for_listener(publisher: Any, count: int = 1) -> Any:
    """What is said before somebody listens is lost; the console's topics have two who do. Returns the publisher."""
    deadline = time.monotonic() + 10.0
    while publisher.get_num_connections() < count:
        assert time.monotonic() < deadline, f"fewer than {count} listen to {publisher.name}"
        time.sleep(0.01)
    return publisher


class Pen:
    """A haptic pen's driver: a pose at 200 Hz, and buttons."""

    def __init__(self, rospy: Any) -> None:
        import genpy.dynamic
        from geometry_msgs.msg import PoseStamped

        self.buttons_type = genpy.dynamic.generate_dynamic("omni_msgs/OmniButtonEvent", BUTTONS)[
            "omni_msgs/OmniButtonEvent"
        ]
        self._pose = rospy.Publisher("/arm1/pose", PoseStamped, queue_size=100, tcp_nodelay=True)
        self._buttons = rospy.Publisher("/arm1/button", self.buttons_type, queue_size=10, latch=True)
        self._message = PoseStamped()
        self.T = np.eye(4)
        for publisher in (self._pose, self._buttons):
            wait_for_listener(publisher)
        self.press()

    def press(self, grey: int = 0, white: int = 0) -> None:
        self._buttons.publish(self.buttons_type(grey, white))

    def send(self, values: Any = None) -> None:
        p, q = self._message.pose.position, self._message.pose.orientation
        p.x, p.y, p.z, q.x, q.y, q.z, q.w = matrix_pose7(self.T) if values is None else values
        self._pose.publish(self._message)

    def rest(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.send()
            time.sleep(0.005)

    def glide(self, way: Any, turn: Any = (0.0, 0.0, 0.0), seconds: float = 0.5) -> None:
        """Move by ``way`` and turn about ``turn`` evenly, in the pen's axes, then rest until the arm has settled."""
        start, turn = self.T.copy(), np.asarray(turn, dtype=float)
        angle = float(np.linalg.norm(turn))
        steps = int(seconds / 0.005)
        for k in range(1, steps + 1):
            R = axis_rotation(turn / angle, angle * k / steps) if angle else np.eye(3)
            self.T = frame(R @ start[:3, :3], start[:3, 3] + np.asarray(way) * k / steps)
            self.send()
            time.sleep(0.005)
        self.rest(0.4)

    def close(self) -> None:
        self._pose.unregister()
        self._buttons.unregister()


@pytest.fixture
def pen(teleop: Any, node: Any, following: Callable[..., None]) -> Iterator[Pen]:
    made = Pen(node)
    following(made, "pen_PSM1")
    yield made
    made.close()


@pytest.fixture
def following(node: Any, listen: Callable[..., Any]) -> Callable[..., None]:
    """Waits until a pair follows, the pen's driver running."""
    from std_msgs.msg import Bool, String

    def wait(pen: Pen, pair: str, seconds: float = 10.0) -> None:
        follows, status = listen(f"/{pair}/following", Bool), listen(f"/{pair}/status", String)
        deadline = time.monotonic() + seconds
        pen.press(grey=1)
        pen.rest(0.1)
        pen.press()
        while not (follows.messages and follows.messages[-1].data):
            assert time.monotonic() < deadline, f"{pair}: {status.messages[-1:]}"
            pen.rest(0.05)

    return wait


def camera_of(arms: dict[str, Any], name: str, node: Any, listen: Callable[..., Any]) -> Array:
    """T_base_camera of an arm, from what the set-up joints tell."""
    from geometry_msgs.msg import PoseStamped

    from tests.ros.crtk import pose7

    base, ecm = (listen(f"/SUJ/{each}/local/measured_cp", PoseStamped).wait() for each in (name, "ECM"))
    T_base, T_ecm = (pose7_matrix(pose7(each.pose)) for each in (base, ecm))
    return inverse(T_base) @ T_ecm @ pose7_matrix(arms["ECM"].measured_cp())


def apart(T: Array, U: Array) -> tuple[float, float]:
    """Millimetres and degrees."""
    from tests.ros.crtk import pose_distance

    metres, radians = pose_distance(matrix_pose7(T), matrix_pose7(U))
    return 1e3 * metres, float(np.rad2deg(radians))


def measured(arms: dict[str, Any], name: str) -> Array:
    return pose7_matrix(arms[name].measured_cp())


def test_the_tip_follows_the_pen_in_the_picture(
    pen: Pen, arms: dict[str, Any], node: Any, listen: Callable[..., Any]
) -> None:
    T_base_camera = camera_of(arms, "PSM1", node, listen)
    before, hand = inverse(T_base_camera) @ measured(arms, "PSM1"), pen.T.copy()
    for way, turn in (
        ((0.03, 0.02, 0.0), (0, 0, 0)),
        ((-0.02, 0.0, 0.02), (0.2, -0.1, 0.3)),
        ((0, -0.02, 0), (0, 0.2, 0)),
    ):
        pen.glide(way, turn)
        ideal = before.copy()
        ideal[:3, 3] += 0.5 * PEN_AXES @ (pen.T[:3, 3] - hand[:3, 3])
        ideal[:3, :3] = PEN_AXES @ pen.T[:3, :3] @ hand[:3, :3].T @ PEN_AXES.T @ before[:3, :3]
        far, turned = apart(inverse(T_base_camera) @ measured(arms, "PSM1"), ideal)
        assert far < 0.1
        assert turned < 0.1


def test_ten_clutches_move_the_pen_and_not_the_tip(pen: Pen, arms: dict[str, Any]) -> None:
    pen.rest(0.4)
    for k in range(10):
        before = measured(arms, "PSM1")
        pen.press(grey=1)
        pen.rest(0.05)
        pen.glide((0.02, 0.01, -0.01), (0.0, 0.05, 0.1), seconds=0.15)
        pen.press()
        pen.rest(0.15)
        far, turned = apart(measured(arms, "PSM1"), before)
        assert far < 0.05, k
        assert turned < 0.05, k


def test_the_white_button_closes_the_jaw(pen: Pen, arms: dict[str, Any]) -> None:
    pen.rest(0.2)
    pen.press(white=1)
    pen.rest(2.5)
    closed = arms["PSM1"].jaw.setpoint_jp()
    pen.press()
    pen.rest(1.0)
    assert closed < -0.3
    assert arms["PSM1"].jaw.setpoint_jp() > 0.9


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ([np.nan, 0, 0, 0, 0, 0, 1], "numbers that are no pose"),
        ([0, 0, 0, 0, 0, 0, 0], "numbers that are no pose"),
        ([0.5, 0.3, 0, 0, 0, 0, 1], "leapt"),
        (None, "silent"),
    ],
    ids=["nan", "zero quaternion", "leap", "silence"],
)
def test_a_device_that_fails_lets_the_arm_hold_and_says_why(
    pen: Pen, arms: dict[str, Any], listen: Callable[..., Any], values: Any, says: str, teleop: Any
) -> None:
    from std_msgs.msg import String

    status = listen("/pen_PSM1/status", String)
    pen.glide((0.01, 0.0, 0.0), seconds=0.1)
    before = measured(arms, "PSM1")
    if values is None:
        time.sleep(0.8)
    else:
        pen.send(values)
        pen.rest(0.1)
        pen.glide((0.03, 0.0, 0.0), seconds=0.2)
    assert says in status.wait(lambda m: says in m.data, 2.0).data
    far, _ = apart(measured(arms, "PSM1"), before)
    assert far < 0.02
    assert teleop.process.poll() is None


def test_the_pen_switches_to_the_other_arm_without_a_jump(
    pen: Pen, arms: dict[str, Any], following: Callable[..., None], publish: Callable[..., Any],
    listen: Callable[..., Any],
) -> None:  # fmt: skip
    from std_msgs.msg import String

    select = wait_for_listener(publish("/console/teleop/select", String), 2)
    unselect = wait_for_listener(publish("/console/teleop/unselect", String), 2)
    selected = listen("/console/teleop/selected", String)
    before = {name: measured(arms, name) for name in ("PSM1", "PSM2")}
    unselect.publish("paddle_PSM2")
    pen.rest(0.1)
    select.publish("pen_PSM2")
    following(pen, "pen_PSM2")
    assert selected.wait(lambda m: m.data == "pen_PSM2").data
    pen.rest(0.2)
    assert apart(measured(arms, "PSM2"), before["PSM2"])[0] < 0.05
    pen.glide((0.0, 0.0, 0.02))
    assert apart(measured(arms, "PSM2"), before["PSM2"])[0] == pytest.approx(10.0, abs=0.1)
    assert apart(measured(arms, "PSM1"), before["PSM1"])[0] < 0.05
    select.publish("pen_PSM1")
    following(pen, "pen_PSM1")
    select.publish("paddle_PSM2")
    pen.rest(0.1)


def test_an_arm_that_two_leaders_claim_holds_and_the_claim_is_told(
    pen: Pen, arms: dict[str, Any], publish: Callable[..., Any], listen: Callable[..., Any]
) -> None:
    from std_msgs.msg import String

    status = listen("/pen_PSM1/status", String)
    pen.rest(0.1)
    wait_for_listener(publish("/console/teleop/select", String), 2).publish("paddle_PSM1")
    pen.rest(0.1)
    before = measured(arms, "PSM1")
    pen.glide((0.02, 0.0, 0.0), seconds=0.2)
    assert apart(measured(arms, "PSM1"), before)[0] < 0.02
    assert "claims" in status.wait(lambda m: "claims" in m.data).data


def test_the_camera_pedal_moves_the_camera_and_not_the_tips(
    pen: Pen, arms: dict[str, Any], publish: Callable[..., Any], listen: Callable[..., Any], node: Any
) -> None:
    from sensor_msgs.msg import Joy
    from std_msgs.msg import Bool

    before = {name: measured(arms, name) for name in ("PSM1", "PSM2", "ECM")}
    pedal = publish("/console/camera", Joy)
    paddle = Paddle(node)
    pedal.publish(Joy(buttons=[1]))
    follows = listen("/pen_paddle_ECM/following", Bool)
    for k in range(80):
        if k >= 20 and k < 60:
            pen.T[2, 3] += 0.02 / 40
            paddle.T[0, 3] -= 0.02 / 40
        pen.send()
        paddle.send()
        time.sleep(0.01)
    assert follows.messages[-1].data
    pedal.publish(Joy(buttons=[0]))
    pen.rest(0.3)
    paddle.close()
    moved = inverse(before["ECM"]) @ measured(arms, "ECM")
    assert moved[:3, 3] == pytest.approx([0.0, 0.0, 0.02], abs=1e-3)
    for name in ("PSM1", "PSM2"):
        assert apart(measured(arms, name), before[name])[0] < 0.05


class Paddle:
    """The driver of a Razer Hydra: both paddles, the right one at rest."""

    def __init__(self, rospy: Any) -> None:
        import genpy.dynamic

        types = genpy.dynamic.generate_dynamic("razer_hydra/Hydra", HYDRA)
        self._types = types
        self._publisher = rospy.Publisher("/hydra_calib", types["razer_hydra/Hydra"], queue_size=1, tcp_nodelay=True)
        self.T = np.eye(4)
        wait_for_listener(self._publisher)

    def send(self, trigger: float = 0.0) -> None:
        paddles = []
        for T in (self.T, np.eye(4)):
            paddle = self._types["razer_hydra/HydraPaddle"]()
            t, q = paddle.transform.translation, paddle.transform.rotation
            t.x, t.y, t.z, q.x, q.y, q.z, q.w = matrix_pose7(T)
            paddle.buttons, paddle.joy, paddle.trigger = [False] * 7, [0.0, 0.0], trigger
            paddles.append(paddle)
        message = self._types["razer_hydra/Hydra"](paddles=paddles)
        self._publisher.publish(message)

    def close(self) -> None:
        self._publisher.unregister()


def test_what_devices_said_is_written_down_and_can_be_said_again(
    teleop: Any, arms: dict[str, Any], start: Callable[..., Any], tmp_path: Path
) -> None:
    from ligature.teleop.record import Replay

    assert teleop.end() == 0
    replay = Replay(teleop.record)
    assert replay.devices == {"pen", "paddle"}
    told = [*replay.due(0.0), *replay.due(1e6)]
    assert sum(name == "reading" for name, _ in told) > 1000
    assert [value for name, value in told if name == "camera"] == [True, False]
    lines = teleop.record.read_text().splitlines()
    (tmp_path / "part.jsonl").write_text("\n".join(_first_motion(lines)) + "\n")
    (tmp_path / "teleop.yaml").write_text(CONFIG)
    before = measured(arms, "PSM1")
    again = start(BIN / "ligature", "teleop", tmp_path / "teleop.yaml", "--replay", tmp_path / "part.jsonl")
    assert again.process.wait(30.0) == 0
    time.sleep(0.3)
    assert 5.0 < apart(measured(arms, "PSM1"), before)[0] < 30.0


def _first_motion(lines: list[str]) -> list[str]:
    """Three seconds of the pen at rest, for the arm to become ready, then what it did first."""
    import json

    rows = [row for row in map(json.loads, lines) if row.get("device") == "pen"]
    start = next(k for k, row in enumerate(rows) if row["pose"][0] > 0.0)
    rest = [{**rows[0], "buttons": {}, "t": 0.02 * k} for k in range(150)]
    moved = [{**row, "buttons": {}, "t": row["t"] - rows[start]["t"] + 3.0} for row in rows[start : start + 100]]
    return [json.dumps(row) for row in (*rest, *moved)]
