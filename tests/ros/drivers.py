"""Drivers of input devices for tests: they publish the real message types, steadily, as the devices' own drivers do.

Definitions of messages whose packages are not installed are written here as their drivers publish them. Metres.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from ligature.model.frames import axis_rotation, frame, inverse, matrix_pose7, pose7_matrix
from numpy.typing import NDArray

from tests.waiting import until

Array = NDArray[np.float64]

PERIOD = 0.005
TIMEOUT = 40.0
"""Seconds that a test waits for what takes a moment when nothing else runs."""

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


def patiently(ask: Callable[[], Any], seconds: float = TIMEOUT) -> Any:
    """What a client reports, although a busy machine keeps its messages waiting for longer than the client does."""
    deadline = time.monotonic() + seconds
    while True:
        try:
            return ask()
        except TimeoutError:
            if time.monotonic() > deadline:
                raise


def wait_for_listener(publisher: Any, count: int = 1) -> Any:
    """What is stated before somebody listens is lost; the console's topics have two who do. Returns the publisher."""
    until(lambda: publisher.get_num_connections() >= count, f"fewer than {count} listen to {publisher.name}")
    return publisher


class Driver:
    """Publishes the pose ``T`` (4, 4) of the handle every `PERIOD`; ``grip`` is how far its grip is pressed, 0 to 1.

    ``muted`` silences it, ``states`` (7,) replaces the pose.
    """

    AXES = np.eye(3)
    """The device's axes in those of the picture."""

    def __init__(self) -> None:
        self.T = np.eye(4)
        self.grip = 0.0
        self.muted = False
        self.sent: Any = None
        self.spoke = 0.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._speak, daemon=True)

    def start(self) -> None:
        """Begin to speak."""
        self._thread.start()

    def _speak(self) -> None:
        due = time.monotonic()
        while not self._stop.is_set():
            if not self.muted:
                self.spoke = time.monotonic()
                self.send(matrix_pose7(self.T) if self.sent is None else self.sent)
            due = max(due + PERIOD, time.monotonic() - 0.1)
            self._stop.wait(max(0.0, due - time.monotonic()))

    def send(self, values: Any) -> None:
        """Publish a pose (7,)."""
        raise NotImplementedError

    def glide(self, way: Any, turn: Any = (0.0, 0.0, 0.0), seconds: float = 0.5) -> None:
        """Move by ``way`` and turn about ``turn`` evenly, in the device's axes."""
        start, turn = self.T.copy(), np.asarray(turn, dtype=float)
        angle = float(np.linalg.norm(turn))
        steps = int(seconds / PERIOD)
        for k in range(1, steps + 1):
            R = axis_rotation(turn / angle, angle * k / steps) if angle else np.eye(3)
            self.T = frame(R @ start[:3, :3], start[:3, 3] + np.asarray(way) * k / steps)
            time.sleep(PERIOD)

    def close(self) -> None:
        """Speak no more."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()


class Pen(Driver):
    """A haptic pen: a pose, and buttons when they change; x to the right, y up, z near."""

    AXES = np.diag([1.0, -1.0, -1.0])

    def __init__(self, rospy: Any) -> None:
        import genpy.dynamic
        from geometry_msgs.msg import PoseStamped

        super().__init__()
        name = "omni_msgs/OmniButtonEvent"
        self.buttons_type = genpy.dynamic.generate_dynamic(name, BUTTONS)[name]
        self._pose = rospy.Publisher("/arm1/pose", PoseStamped, queue_size=100, tcp_nodelay=True)
        self._buttons = rospy.Publisher("/arm1/button", self.buttons_type, queue_size=10, latch=True)
        self._message = PoseStamped()
        for publisher in (self._pose, self._buttons):
            wait_for_listener(publisher)
        self.press()
        self.start()

    def press(self, grey: int = 0, white: int = 0) -> None:
        """Press or let go of the buttons."""
        self._buttons.publish(self.buttons_type(grey, white))

    def send(self, values: Any) -> None:
        p, q = self._message.pose.position, self._message.pose.orientation
        p.x, p.y, p.z, q.x, q.y, q.z, q.w = values
        self._pose.publish(self._message)

    def close(self) -> None:
        super().close()
        self._pose.unregister()
        self._buttons.unregister()


class Paddle(Driver):
    """A Razer Hydra: both paddles, the right one at rest; x away, y to the left, z up. The grip is the trigger."""

    AXES = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])

    def __init__(self, rospy: Any) -> None:
        import genpy.dynamic

        super().__init__()
        self.buttons = [False] * 7
        self._types = genpy.dynamic.generate_dynamic("razer_hydra/Hydra", HYDRA)
        self._publisher = rospy.Publisher(
            "/hydra_calib", self._types["razer_hydra/Hydra"], queue_size=100, tcp_nodelay=True
        )
        wait_for_listener(self._publisher)
        self.start()

    def send(self, values: Any) -> None:
        paddles = []
        for pose, buttons in ((values, self.buttons), (matrix_pose7(np.eye(4)), [False] * 7)):
            paddle = self._types["razer_hydra/HydraPaddle"]()
            t, q = paddle.transform.translation, paddle.transform.rotation
            t.x, t.y, t.z, q.x, q.y, q.z, q.w = pose
            paddle.buttons, paddle.joy, paddle.trigger = list(buttons), [0.0, 0.0], self.grip
            paddles.append(paddle)
        self._publisher.publish(self._types["razer_hydra/Hydra"](paddles=paddles))

    def close(self) -> None:
        super().close()
        self._publisher.unregister()


# --- what arms do -----------------------------------------------------------------------------


def camera_of(arms: dict[str, Any], name: str, listen: Callable[..., Any]) -> Array:
    """T_base_camera of an arm, as the set-up joints report it."""
    from geometry_msgs.msg import PoseStamped

    from tests.ros.crtk import pose7

    base, ecm = (listen(f"/SUJ/{each}/local/measured_cp", PoseStamped).wait() for each in (name, "ECM"))
    T_base, T_ecm = (pose7_matrix(pose7(each.pose)) for each in (base, ecm))
    return inverse(T_base) @ T_ecm @ measured(arms, "ECM")


def apart(T: Array, U: Array) -> tuple[float, float]:
    """Millimetres and degrees."""
    from tests.ros.crtk import pose_distance

    metres, radians = pose_distance(matrix_pose7(T), matrix_pose7(U))
    return 1e3 * metres, float(np.rad2deg(radians))


def measured(arms: dict[str, Any], name: str) -> Array:
    """Where the tip is, (4, 4)."""
    return pose7_matrix(patiently(arms[name].measured_cp))


def settled(arms: dict[str, Any], name: str) -> Array:
    """Where the tip is, (4, 4), once it moves no more and is where it was sent."""
    last = measured(arms, name)

    def rests() -> bool:
        nonlocal last
        time.sleep(0.15)
        before, last = last, measured(arms, name)
        moved, _ = apart(last, before)
        left, turned = apart(last, pose7_matrix(patiently(arms[name].setpoint_cp)))
        return moved < 0.002 and left < 0.03 and turned < 0.03

    until(rests, lambda: f"{name} does not come to rest")
    return last
