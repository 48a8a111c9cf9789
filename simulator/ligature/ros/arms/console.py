"""The surgeon's console on ROS: teleoperation switches, foot pedals, power, and the set-up joints.

Topics are those of the dVRK's console 2.4, with the names of older versions. Teleoperation listens to these topics;
the console itself moves nothing but the power of the arms.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Container, Sequence
from typing import Any

import rospy
from crtk_msgs.msg import OperatingState
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Bool, Empty, Float64, Float64MultiArray, String

from ligature.model.frames import inverse, matrix_pose7
from ligature.model.scene import ArmKind, WorldSettings
from ligature.robots.commands import ArmCommand, StateCommand
from ligature.ros.arms.bases import CART, bases, tip
from ligature.ros.arms.latched import Latched
from ligature.ros.arms.outlet import ArmOutlet
from ligature.ros.arms.readings import set_pose

QUEUE = 10
SUJ_JOINTS = 6
LOCAL = "local/measured_cp"
PEDALS = ("clutch", "camera", "operator_present")
ALIASES = {
    "clutch": "footpedals/clutch",
    "camera": "footpedals/camera",
    "operator_present": "footpedals/operator_present",
}
OTHER_PEDALS = ("footpedals/coag", "footpedals/bicoag", "footpedals/cam_minus", "footpedals/cam_plus")
DEFAULT_SCALE = 0.2


class Console:
    """One console, and the system's power; ``push`` sends commands to arms. A ``silent`` one only listens."""

    def __init__(
        self, prefix: str, outlets: Sequence[ArmOutlet], push: Callable[[ArmCommand], None], silent: bool
    ) -> None:
        self._arms = [outlet.index for outlet in outlets]
        self._push, self._silent = push, silent
        self._published: list[Latched] = []
        console = f"{prefix}console"
        self._enabled = self._latched(f"{console}/teleop/enabled", Bool)
        self._scale = self._latched(f"{console}/teleop/scale", Float64)
        self._selected = self._latched(f"{console}/teleop/selected", String)
        self._unselected = self._latched(f"{console}/teleop/unselected", String)
        self._volume = self._latched(f"{prefix}system/volume", Float64)
        self._values: dict[Latched, Any] = {self._enabled: False, self._scale: DEFAULT_SCALE}
        self.beat()
        self._listen(f"{console}/teleop/enable", Bool, lambda m: self._report(self._enabled, m.data))
        self._listen(f"{console}/teleop/scale", Float64, self._hear_scale)
        self._listen(f"{console}/teleop/set_scale", Float64, self._set_scale)
        self._listen(f"{console}/teleop/select", String, lambda m: self._selected.publish(m.data))
        self._listen(f"{console}/teleop/unselect", String, lambda m: self._unselected.publish(m.data))
        self._pedals(prefix, console)
        for root in (f"{prefix}system", console):
            self._listen(f"{root}/power_on", Empty, lambda _: self._all("enable"))
            self._listen(f"{root}/power_off", Empty, lambda _: self._all("disable"))
            self._listen(f"{root}/home", Empty, lambda _: self._all("home"))
            self._listen(f"{root}/set_volume", Float64, lambda m: self._volume.publish(m.data))
            self._listen(f"{root}/beep", Float64MultiArray, lambda m: rospy.loginfo(f"beep {list(m.data)}"))
            self._listen(f"{root}/string_to_speech", String, lambda m: rospy.loginfo(f"string_to_speech: {m.data}"))

    def beat(self) -> None:
        """Publish switch and scale again: clients take none that is older than a second."""
        for topic, value in self._values.items():
            topic.publish(value)

    def _report(self, topic: Latched, value: Any) -> None:
        self._values[topic] = value
        topic.publish(value)

    def _hear_scale(self, message: Any) -> None:
        """Take the scale that the teleoperation node reports, which may come from its own file."""
        if message._connection_header["callerid"] != rospy.get_name():
            self._values[self._scale] = message.data

    def close(self) -> None:
        """Fall silent: another console publishes. What switches the power of arms is heard all the same."""
        for topic in self._published:
            topic.close()

    def _latched(self, topic: str, type_: type) -> Latched:
        self._published.append(Latched(topic, type_, self._silent))
        return self._published[-1]

    def _listen(self, topic: str, type_: type, take: Callable[[Any], None]) -> None:
        rospy.Subscriber(topic, type_, take, queue_size=QUEUE)

    def _pedals(self, prefix: str, console: str) -> None:
        """Pedals are pressed by ``emulate_…`` messages, and reported under their new and old names."""
        for pedal in PEDALS:
            names = (f"{console}/{pedal}", f"{prefix}{ALIASES[pedal]}")
            self._listen(f"{console}/emulate_{pedal}", Joy, _relay([self._latched(name, Joy) for name in names]))
        for name in OTHER_PEDALS:
            self._latched(f"{prefix}{name}", Joy)

    def _set_scale(self, message: Any) -> None:
        if 0.0 < message.data <= 1.0:
            self._report(self._scale, message.data)
        else:
            rospy.logwarn(f"console: a scale must be above 0 and at most 1, not {message.data:g}")

    def _all(self, command: str) -> None:
        for arm in self._arms:
            self._push(StateCommand(arm, command))


def console_topics(prefix: str) -> list[str]:
    """What only a console publishes; pedals and selections have others who press and select."""
    return [f"{prefix}console/teleop/enabled", f"{prefix}system/volume"]


def _relay(publishers: Sequence[Any]) -> Callable[[Any], None]:
    def relay(message: Any) -> None:
        for publisher in publishers:
            publisher.publish(_press(message))

    return relay


def _press(message: Any) -> Joy:
    """A button event of now: 1 pressed, 0 released, 2 clicked."""
    event = Joy(buttons=list(message.buttons[:1]))
    event.header.stamp = rospy.Time.now()
    return event


def setup_topics(world: WorldSettings, arm: str) -> list[str]:
    """What the set-up joints of an arm publish."""
    return [f"{world.root}SUJ/{arm}/{name}" for name in ("operating_state", "measured_js", "measured_cp", LOCAL)]


class SetupJoints:
    """Where the bases of the arms stand: fixed in a scene, published as the set-up joints of the cart.

    Those of arms called in ``silent`` are not published.
    """

    def __init__(self, world: WorldSettings, outlets: Sequence[ArmOutlet], silent: Container[str]) -> None:
        self._outlets = [outlet for outlet in outlets if outlet.description.kind is not ArmKind.MTM]
        self._reference, self._frame_prefix = "ECM", world.frame_prefix
        self._arms: dict[str, _SetupArm] = {}
        rospy.Subscriber(f"{world.root}SUJ/set_reference_arm", String, self._refer, queue_size=QUEUE)
        for outlet in self._outlets:
            name = outlet.description.name
            if name not in silent:
                self._arms[name] = _SetupArm(f"{world.root}SUJ/{name}", name)

    def fall_silent(self, arm: str) -> None:
        """Publish no more of an arm: another node does."""
        found = self._arms.pop(arm, None)
        if found is not None:
            threading.Thread(target=found.close, daemon=True).start()

    def _refer(self, message: Any) -> None:
        known = [outlet.description.name for outlet in self._outlets]
        if message.data in known:
            self._reference = message.data
        else:
            rospy.logwarn(f"SUJ/set_reference_arm: unknown arm '{message.data}'; choose one of {', '.join(known)}")

    def publish(self, state: Any, stamp: Any) -> None:
        """Poses of the bases: of the reference arm in the world, of the others in the tip of the reference arm."""
        stands = bases(self._outlets, state)
        T_world_tip = tip(self._outlets, state, self._reference)
        for name, arm in self._arms.items():
            T = stands[name]
            apart = name != self._reference and T_world_tip is not None
            pose = inverse(T_world_tip) @ T if apart and T_world_tip is not None else T
            reference = self._frame_prefix + (self._reference if apart else CART)
            arm.publish(pose, reference, T, f"{self._frame_prefix}{CART}", stamp)


class _SetupArm:
    """The set-up joints of one arm, whose topics are below ``root``."""

    def __init__(self, root: str, name: str) -> None:
        self._state = Latched(f"{root}/operating_state", OperatingState)
        message = OperatingState(state="ENABLED", is_homed=True)
        message.header.stamp = rospy.Time.now()
        self._state.publish(message)
        self._joints = JointState(name=[f"SUJ_{name}_J{i}" for i in range(SUJ_JOINTS)], position=[0.0] * SUJ_JOINTS)
        self._measured_js = rospy.Publisher(f"{root}/measured_js", JointState, queue_size=QUEUE)
        self._measured_cp = rospy.Publisher(f"{root}/measured_cp", PoseStamped, queue_size=QUEUE)
        self._local = rospy.Publisher(f"{root}/{LOCAL}", PoseStamped, queue_size=QUEUE)
        self._refusing = [
            rospy.Subscriber(f"{root}/{verb}", JointState, self._refuse(f"{root}/{verb}"), queue_size=QUEUE)
            for verb in ("servo_jp", "move_jp")
        ]

    def _refuse(self, topic: str) -> Callable[[Any], None]:
        return lambda _: rospy.logwarn_throttle(2.0, f"{topic}: the bases of the arms are fixed in this scene")

    def publish(self, pose: Any, reference: str, local: Any, cart: str, stamp: Any) -> None:
        """Publish a pose (4, 4) in a frame called ``reference``, and one in the cart's."""
        self._joints.header.stamp = stamp
        self._measured_js.publish(self._joints)
        self._measured_cp.publish(_posed(reference, pose, stamp))
        self._local.publish(_posed(cart, local, stamp))

    def close(self) -> None:
        """Unregister all topics, so that another node can publish them."""
        self._state.close()
        for end in (self._measured_js, self._measured_cp, self._local, *self._refusing):
            end.unregister()


def _posed(frame: str, T: Any, stamp: Any) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id, message.header.stamp = frame, stamp
    set_pose(message.pose, matrix_pose7(T))
    return message
