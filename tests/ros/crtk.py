"""A small CRTK client for tests, as demanding as crtk_python_client and dvrk_python.

Feedback that never came, is older than `FRESH` seconds or carries a stamp of zero is an error. A state whose stamp is
not newer than the last one is not taken. A move has ended only after it was seen busy. Joint arrays are rad or m,
poses x y z qx qy qz qw, twists and wrenches linear then angular.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from crtk_msgs.msg import CartesianImpedance, CartesianState, OperatingState, StringStamped
from crtk_msgs.srv import QueryForwardKinematics, QueryInverseKinematics
from geometry_msgs.msg import Pose, PoseStamped, Quaternion, TwistStamped, WrenchStamped
from ligature.model.frames import matrix_pose7, pose7_matrix
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Bool, Empty, Float64, Float64MultiArray, String

Array = NDArray[np.float64]

FRESH = 1.0
"""Seconds after which feedback counts as lost (the library's ``connection_timeout``)."""


class Latest:
    """The newest message of a topic and when it came."""

    def __init__(self, rospy: Any, topic: str, type_: Any) -> None:
        self.topic = topic
        self.message: Any = None
        self.arrived = -np.inf
        self.count = 0
        self.changed = threading.Condition()
        self.subscriber = rospy.Subscriber(topic, type_, self._take, queue_size=10, tcp_nodelay=True)

    def _take(self, message: Any) -> None:
        with self.changed:
            self.message, self.arrived = message, time.monotonic()
            self.count += 1
            self.changed.notify_all()

    def fresh(self) -> Any:
        """The newest message; TimeoutError when it is old or there is none."""
        with self.changed:
            if self.message is None:
                self.changed.wait(FRESH)
            age = time.monotonic() - self.arrived
            if age > FRESH:
                raise TimeoutError(f"{self.topic}: last message {age:.2f} s ago")
            return self.message


class Link:
    """Topics below one namespace, both directions."""

    def __init__(self, rospy: Any, namespace: str) -> None:
        self.rospy = rospy
        self.namespace = namespace
        self.children: list[Link] = []
        self._heard: dict[str, Latest] = {}
        self._publishers: dict[str, Any] = {}

    def topic(self, name: str) -> str:
        return f"{self.namespace}/{name}"

    def listen(self, name: str, type_: Any) -> Latest:
        return self._heard.setdefault(name, Latest(self.rospy, self.topic(name), type_))

    def talk(self, name: str, type_: Any, latch: bool = False) -> None:
        self._publishers[name] = self.rospy.Publisher(
            self.topic(name), type_, latch=latch, queue_size=10, tcp_nodelay=True
        )

    def publish(self, name: str, message: Any) -> None:
        """Publish a message as it is."""
        self._publishers[name].publish(message)

    def send(self, name: str, message: Any) -> None:
        """Publish a message, stamped with now."""
        if hasattr(message, "header"):
            message.header.stamp = self.rospy.Time.now()
        self.publish(name, message)

    def hear(self, name: str) -> Any:
        """The newest fresh message of ``name``; a zero stamp is an error."""
        message = self._heard[name].fresh()
        if hasattr(message, "header") and message.header.stamp.to_sec() == 0.0:
            raise RuntimeError(f"{self.topic(name)} is invalid: its stamp is zero")
        return message

    def unconnected(self) -> list[str]:
        ends = {**{n: h.subscriber for n, h in self._heard.items()}, **self._publishers}
        mine = [self.topic(name) for name, end in ends.items() if end.get_num_connections() == 0]
        return mine + [topic for child in self.children for topic in child.unconnected()]

    def check_connections(self, timeout: float = 5.0) -> None:
        """TimeoutError naming every topic, also of children, that has nobody at its other end."""
        deadline = time.monotonic() + timeout
        while missing := self.unconnected():
            if time.monotonic() > deadline:
                raise TimeoutError(f"nobody at the other end of {', '.join(missing)}")
            time.sleep(0.02)

    def close(self) -> None:
        for heard in self._heard.values():
            heard.subscriber.unregister()
        for publisher in self._publishers.values():
            publisher.unregister()
        for child in self.children:
            child.close()


class OperatingStateLink:
    """Follows ``operating_state`` as the real client does."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.events: list[OperatingState] = []
        self.busy_since = self.idle_since = -np.inf
        self.changed = threading.Condition()
        self._stamp = 0.0
        self.subscriber = link.rospy.Subscriber(
            link.topic("operating_state"), OperatingState, self._take, queue_size=100, tcp_nodelay=True
        )
        link.talk("state_command", StringStamped, latch=True)

    def _take(self, message: OperatingState) -> None:
        stamp = message.header.stamp.to_sec()
        with self.changed:
            if stamp <= self._stamp:
                return
            self._stamp = stamp
            self.events.append(message)
            if message.is_busy:
                self.busy_since = time.monotonic()
            else:
                self.idle_since = time.monotonic()
            self.changed.notify_all()

    @property
    def now(self) -> OperatingState:
        with self.changed:
            if not self.changed.wait_for(lambda: self.events, FRESH):
                raise TimeoutError(f"{self.link.topic('operating_state')}: no message")
            return self.events[-1]

    def wait_for(self, condition: Callable[[OperatingState], bool], timeout: float, after: int = 0) -> bool:
        """Whether a state that satisfies ``condition`` comes in time; ``after`` events are not counted."""
        with self.changed:
            return self.changed.wait_for(lambda: any(map(condition, self.events[after:][-1:])), timeout)

    def command(self, word: str) -> int:
        """Send a state command; returns how many events there were before."""
        with self.changed:
            before = len(self.events)
        self.link.send("state_command", StringStamped(string=word))
        return before


class Motion:
    """A move under way."""

    def __init__(self, state: OperatingStateLink) -> None:
        self._state = state
        self._start = time.monotonic()

    def _seen_busy(self) -> bool:
        return self._state.busy_since >= self._start

    def is_busy(self, timeout: float = 30.0) -> bool:
        """Whether the move goes on; before anything was heard of it, yes."""
        if not self._seen_busy():
            return time.monotonic() - self._start < timeout
        return bool(self._state.now.is_busy)

    def wait(self, is_busy: bool = False, timeout: float = 30.0) -> bool:
        """Wait until the arm was seen busy with this move and (unless ``is_busy``) idle again; False when it was not."""
        state = self._state
        deadline = time.monotonic() + timeout
        with state.changed:
            if not state.changed.wait_for(self._seen_busy, timeout):
                return False
            return is_busy or state.changed.wait_for(
                lambda: state.idle_since >= self._start and not state.events[-1].is_busy, deadline - time.monotonic()
            )


class Arm(Link):
    """What ``dvrk.arm`` connects and does."""

    def __init__(self, rospy: Any, name: str) -> None:
        super().__init__(rospy, f"/{name}")
        self.name = name
        self.state = OperatingStateLink(self)
        for topic, type_ in HEARD.items():
            self.listen(topic, type_)
        for topic, type_ in SENT.items():
            self.talk(topic, type_, latch=topic in LATCHED)

    def unconnected(self) -> list[str]:
        lost = [] if self.state.subscriber.get_num_connections() else [self.topic("operating_state")]
        return lost + super().unconnected()

    def close(self) -> None:
        self.state.subscriber.unregister()
        super().close()

    # --- state

    def enable(self, timeout: float) -> bool:
        before = self.state.command("enable")
        return self.state.now.state == "ENABLED" or self.state.wait_for(lambda s: s.state == "ENABLED", timeout, before)

    def home(self, timeout: float) -> bool:
        done = self.state.now.is_homed and not self.state.now.is_busy
        before = self.state.command("home")
        return done or self.state.wait_for(lambda s: s.is_homed and not s.is_busy, timeout, before)

    def disable(self, timeout: float) -> bool:
        self.state.command("disable")
        return self.state.wait_for(lambda s: s.state == "DISABLED", timeout)

    # --- feedback

    def measured_js(self) -> tuple[Array, Array, Array]:
        return arrays(self.hear("measured_js"))

    def measured_jp(self) -> Array:
        return self.measured_js()[0]

    def setpoint_jp(self) -> Array:
        return arrays(self.hear("setpoint_js"))[0]

    def measured_cp(self) -> Array:
        return pose7(self.hear("measured_cp").pose)

    def setpoint_cp(self) -> Array:
        return pose7(self.hear("setpoint_cp").pose)

    def jacobian(self, frame: str) -> Array:
        message = self.hear(f"{frame}/jacobian")
        return np.array(message.data).reshape([d.size for d in message.layout.dim])

    # --- motion

    def servo_jp(self, position: ArrayLike, velocity: ArrayLike = ()) -> None:
        self.send("servo_jp", JointState(position=list(np.asarray(position)), velocity=list(np.asarray(velocity))))

    def servo_jr(self, step: ArrayLike) -> None:
        self.send("servo_jr", JointState(position=list(np.asarray(step))))

    def servo_jf(self, effort: ArrayLike) -> None:
        self.send("servo_jf", JointState(effort=list(np.asarray(effort))))

    def servo_cp(self, pose: ArrayLike) -> None:
        self.send("servo_cp", PoseStamped(pose=pose_message(pose)))

    def servo_cv(self, twist: ArrayLike) -> None:
        message = TwistStamped()
        v, w = message.twist.linear, message.twist.angular
        v.x, v.y, v.z, w.x, w.y, w.z = np.asarray(twist, dtype=float)
        self.send("servo_cv", message)

    def move_jp(self, goal: ArrayLike) -> Motion:
        motion = Motion(self.state)
        self.send("move_jp", JointState(position=list(np.asarray(goal))))
        return motion

    def move_jr(self, step: ArrayLike) -> Motion:
        motion = Motion(self.state)
        self.send("move_jr", JointState(position=list(np.asarray(step))))
        return motion

    def move_cp(self, pose: ArrayLike) -> Motion:
        motion = Motion(self.state)
        self.send("move_cp", PoseStamped(pose=pose_message(pose)))
        return motion

    def hold(self) -> None:
        self.send("hold", Empty())

    # --- services

    def forward_kinematics(self, jp: ArrayLike, local: bool = False) -> Any:
        name = self.topic("local/forward_kinematics" if local else "forward_kinematics")
        return self.rospy.ServiceProxy(name, QueryForwardKinematics)(list(np.asarray(jp)), Pose())

    def inverse_kinematics(self, jp: ArrayLike, cp: ArrayLike) -> Any:
        service = self.rospy.ServiceProxy(self.topic("inverse_kinematics"), QueryInverseKinematics)
        return service(pose_message(cp), list(np.asarray(jp)))


class Jaw(Link):
    """The jaw of a PSM; it shares the busy flag of its arm."""

    def __init__(self, arm: Arm) -> None:
        super().__init__(arm.rospy, arm.topic("jaw"))
        self._state = arm.state
        for name in ("measured_js", "setpoint_js"):
            self.listen(name, JointState)
        for name in ("servo_jp", "move_jp", "servo_jf"):
            self.talk(name, JointState)

    def measured_jp(self) -> float:
        return float(self.hear("measured_js").position[0])

    def setpoint_jp(self) -> float:
        return float(self.hear("setpoint_js").position[0])

    def servo_jp(self, angle: float) -> None:
        self.send("servo_jp", JointState(position=[angle]))

    def move_jp(self, angle: float) -> Motion:
        motion = Motion(self._state)
        self.send("move_jp", JointState(position=[angle]))
        return motion

    def close_jaw(self) -> Motion:
        return self.move_jp(np.deg2rad(-20.0))

    def open_jaw(self, angle: float = np.deg2rad(60.0)) -> Motion:
        return self.move_jp(angle)


class Psm(Arm):
    """What ``dvrk.psm`` adds."""

    def __init__(self, rospy: Any, name: str) -> None:
        super().__init__(rospy, name)
        self.jaw = Jaw(self)
        self.children.append(self.jaw)
        self.talk("emulate_tool_present", Bool)


class Mtm(Arm):
    """What ``dvrk.mtm`` adds."""

    def __init__(self, rospy: Any, name: str) -> None:
        super().__init__(rospy, name)
        self.listen("gripper/measured_js", JointState)
        self.talk("lock_orientation", Quaternion, latch=True)
        self.talk("unlock_orientation", Empty, latch=True)
        self.talk("servo_ci", CartesianImpedance)

    def gripper(self) -> float:
        return float(self.hear("gripper/measured_js").position[0])


class Console(Link):
    """What ``dvrk.console`` connects."""

    def __init__(self, rospy: Any, name: str = "console") -> None:
        super().__init__(rospy, f"/{name}")
        self.listen("teleop/scale", Float64)
        self.listen("teleop/selected", String)
        self.listen("teleop/unselected", String)
        self.talk("teleop/enable", Bool, latch=True)
        self.talk("teleop/set_scale", Float64, latch=True)
        for topic in ("teleop/select", "teleop/unselect", "teleop/select_teleop", "teleop/unselect_teleop"):
            self.talk(topic, String)
        for pedal in CONSOLE_PEDALS:
            self.listen(pedal, Joy)
            self.talk(f"emulate_{pedal}", Joy)


class System(Link):
    """What ``dvrk.system`` connects."""

    def __init__(self, rospy: Any, name: str = "system") -> None:
        super().__init__(rospy, f"/{name}")
        for topic in ("power_off", "power_on", "home"):
            self.talk(topic, Empty)
        self.talk("set_volume", Float64)
        self.talk("beep", Float64MultiArray)
        self.talk("string_to_speech", String)


class SetupArm(Link):
    """What ``dvrk.suj`` connects of one arm."""

    def __init__(self, rospy: Any, arm: str) -> None:
        super().__init__(rospy, f"/SUJ/{arm}")
        self.listen("operating_state", OperatingState)
        self.listen("measured_js", JointState)
        self.listen("measured_cp", PoseStamped)
        self.listen("local/measured_cp", PoseStamped)
        self.listen("warning", String)
        self.talk("state_command", StringStamped, latch=True)
        self.talk("move_jp", JointState)


CONSOLE_PEDALS = ("operator_present", "clutch", "camera", "focus_minus", "focus_plus", "coag", "bicoag")

HEARD = {
    "setpoint_js": JointState, "setpoint_cp": PoseStamped, "measured_js": JointState, "measured_cp": PoseStamped,
    "measured_cv": TwistStamped, "spatial/measured_cf": WrenchStamped, "spatial/jacobian": Float64MultiArray,
    "body/measured_cf": WrenchStamped, "body/jacobian": Float64MultiArray, "local/measured_cp": PoseStamped,
    "local/setpoint_cp": PoseStamped, "trajectory_j/ratio": Float64,
}  # fmt: skip
"""Topics that every arm publishes, as `Arm` hears them."""

SENT = {
    "hold": Empty, "free": Empty, "servo_jp": JointState, "servo_jr": JointState, "servo_cp": PoseStamped,
    "servo_jf": JointState, "move_jp": JointState, "move_jr": JointState, "move_cp": PoseStamped,
    "spatial/servo_cf": WrenchStamped, "body/servo_cf": WrenchStamped, "body/set_cf_orientation_absolute": Bool,
    "use_gravity_compensation": Bool, "trajectory_j/set_ratio": Float64, "servo_cv": TwistStamped,
    "servo_cs": CartesianState, "set_base_frame": PoseStamped, "trajectory_j/set_ratio_v": Float64,
    "trajectory_j/set_ratio_a": Float64,
}  # fmt: skip
"""Topics that every arm subscribes."""

LATCHED = ("body/set_cf_orientation_absolute", "use_gravity_compensation")
"""Commands that clients publish latched."""

EVENTS = {
    "trajectory_j/ratio_v": Float64, "trajectory_j/ratio_a": Float64, "goal_reached": Bool, "desired_state": String,
    "error": String, "warning": String, "status": String,
}  # fmt: skip
"""Event topics of every arm that no client checks for."""

READS = {
    "local/measured_cv": TwistStamped, "gravity_compensation/setpoint_js": JointState,
}  # fmt: skip
"""Feedback of every arm that no client checks for."""

BUTTONS = {"PSM": ("arm_clutch", "manip_clutch"), "ECM": ("arm_clutch", "manip_clutch"), "MTM": ()}
"""Topics of buttons (`Joy`) on each kind of arm."""

BUTTON = Joy


def arrays(message: JointState) -> tuple[Array, Array, Array]:
    """Position, velocity and effort of a joint state."""
    return np.array(message.position), np.array(message.velocity), np.array(message.effort)


def pose7(message: Pose) -> Array:
    """A pose as x y z qx qy qz qw."""
    p, q = message.position, message.orientation
    return np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])


def pose_message(pose: ArrayLike) -> Pose:
    """The message of a pose, given as seven numbers or as a matrix."""
    values = np.asarray(pose, dtype=float)
    values = matrix_pose7(values) if values.shape == (4, 4) else values
    message = Pose()
    p, q = message.position, message.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = values
    return message


def shifted(pose: ArrayLike, step: ArrayLike) -> Array:
    """A pose (7,) moved by ``step`` (3,) with its orientation kept."""
    moved = np.array(pose, dtype=float)
    moved[:3] += step
    return moved


def pose_distance(pose: ArrayLike, other: ArrayLike) -> tuple[float, float]:
    """Metres and radians between two poses (7,)."""
    T, U = pose7_matrix(np.asarray(pose)), pose7_matrix(np.asarray(other))
    turn = np.linalg.norm(T[:3, :3] - U[:3, :3]) / np.sqrt(2.0)
    return float(np.linalg.norm(T[:3, 3] - U[:3, 3])), float(2.0 * np.arcsin(min(turn / 2.0, 1.0)))
