"""The surgeon's console on ROS: teleoperation switches, foot pedals, power, and the set-up joints.

Topics as in interface reference §5.4, aliases of older systems as in §5.8. Who teleoperates listens to these topics;
the console itself moves nothing but the power of the arms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import rospy
from crtk_msgs.msg import OperatingState
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Bool, Empty, Float64, Float64MultiArray, String

from ligature.model.frames import inverse, matrix_pose7, pose7_matrix
from ligature.model.scene import ArmKind, WorldSettings
from ligature.robots.commands import ArmCommand, StateCommand
from ligature.ros.arms.outlet import ArmOutlet
from ligature.ros.arms.readings import set_pose

QUEUE = 10
SUJ_JOINTS = 6
PEDALS = ("clutch", "camera", "operator_present")
ALIASES = {
    "clutch": "footpedals/clutch",
    "camera": "footpedals/camera",
    "operator_present": "footpedals/operator_present",
}
OTHER_PEDALS = ("footpedals/coag", "footpedals/bicoag", "footpedals/cam_minus", "footpedals/cam_plus")
DEFAULT_SCALE = 0.2


def _latched(topic: str, type_: type) -> Any:
    return rospy.Publisher(topic, type_, latch=True, queue_size=QUEUE)


class Console:
    """One console, and the system's power; ``push`` sends commands to arms."""

    def __init__(self, prefix: str, outlets: Sequence[ArmOutlet], push: Callable[[ArmCommand], None]) -> None:
        self._arms = [outlet.index for outlet in outlets]
        self._push = push
        console = f"{prefix}console"
        self._enabled = _latched(f"{console}/teleop/enabled", Bool)
        self._scale = _latched(f"{console}/teleop/scale", Float64)
        self._selected = _latched(f"{console}/teleop/selected", String)
        self._unselected = _latched(f"{console}/teleop/unselected", String)
        self._volume = _latched(f"{prefix}system/volume", Float64)
        self._enabled.publish(False)
        self._scale.publish(DEFAULT_SCALE)
        self._listen(f"{console}/teleop/enable", Bool, lambda m: self._enabled.publish(m.data))
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

    def _listen(self, topic: str, type_: type, take: Callable[[Any], None]) -> None:
        rospy.Subscriber(topic, type_, take, queue_size=QUEUE)

    def _pedals(self, prefix: str, console: str) -> None:
        """Pedals are pressed by ``emulate_…`` messages, and reported under their new and old names."""
        for pedal in PEDALS:
            names = (f"{console}/{pedal}", f"{prefix}{ALIASES[pedal]}")
            self._listen(f"{console}/emulate_{pedal}", Joy, _relay([_latched(name, Joy) for name in names]))
        self._others = [_latched(f"{prefix}{name}", Joy) for name in OTHER_PEDALS]

    def _set_scale(self, message: Any) -> None:
        if 0.0 < message.data <= 1.0:
            self._scale.publish(message.data)
        else:
            rospy.logwarn(f"console: a scale must be above 0 and at most 1, not {message.data:g}")

    def _all(self, command: str) -> None:
        for arm in self._arms:
            self._push(StateCommand(arm, command))


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


class SetupJoints:
    """Where the bases of the arms stand: fixed in a scene, published as the set-up joints of the cart."""

    def __init__(self, world: WorldSettings, outlets: Sequence[ArmOutlet]) -> None:
        self._outlets = [outlet for outlet in outlets if outlet.description.kind is not ArmKind.MTM]
        self._reference, self._frame_prefix = "ECM", world.frame_prefix
        self._joints: dict[str, Any] = {}
        self._local: dict[str, Any] = {}
        self._poses: dict[str, Any] = {}
        rospy.Subscriber(f"{world.root}SUJ/set_reference_arm", String, self._refer, queue_size=QUEUE)
        for outlet in self._outlets:
            name = outlet.description.name
            root = f"{world.root}SUJ/{name}"
            state = _latched(f"{root}/operating_state", OperatingState)
            message = OperatingState(state="ENABLED", is_homed=True)
            message.header.stamp = rospy.Time.now()
            state.publish(message)
            self._joints[name] = rospy.Publisher(f"{root}/measured_js", JointState, queue_size=QUEUE)
            self._poses[name] = rospy.Publisher(f"{root}/measured_cp", PoseStamped, queue_size=QUEUE)
            self._local[name] = rospy.Publisher(f"{root}/local/measured_cp", PoseStamped, queue_size=QUEUE)
            for verb in ("servo_jp", "move_jp"):
                rospy.Subscriber(f"{root}/{verb}", JointState, self._refuse(f"{root}/{verb}"), queue_size=QUEUE)

    def _refer(self, message: Any) -> None:
        known = [outlet.description.name for outlet in self._outlets]
        if message.data in known:
            self._reference = message.data
        else:
            rospy.logwarn(f"SUJ/set_reference_arm: there is no '{message.data}'; there are {', '.join(known)}")

    def _refuse(self, topic: str) -> Callable[[Any], None]:
        return lambda _: rospy.logwarn_throttle(2.0, f"{topic}: the bases of the arms are fixed in this scene")

    def publish(self, state: Any, stamp: Any) -> None:
        """Poses of the bases: of the reference arm in the world, of the others in the tip of the reference arm."""
        bases = {}
        for outlet in self._outlets:
            body = outlet.description.base
            bases[outlet.description.name] = outlet.T_base if body < 0 else pose7_matrix(state["body_pose"][body])
        T_world_tip = None
        for outlet in self._outlets:
            name = outlet.description.name
            if name == self._reference:
                T_world_tip = bases[name] @ pose7_matrix(state["arm"][outlet.index]["local_measured_cp"])
        for name, T in bases.items():
            apart = name != self._reference and T_world_tip is not None
            pose = inverse(T_world_tip) @ T if apart and T_world_tip is not None else T
            self._publish(self._poses[name], pose, self._reference if apart else "Cart", stamp)
            self._publish(self._local[name], T, "Cart", stamp)
            joints = JointState(name=[f"SUJ_{name}_J{i}" for i in range(SUJ_JOINTS)], position=[0.0] * SUJ_JOINTS)
            joints.header.stamp = stamp
            self._joints[name].publish(joints)

    def _publish(self, publisher: Any, T: Any, frame: str, stamp: Any) -> None:
        message = PoseStamped()
        message.header.frame_id, message.header.stamp = self._frame_prefix + frame, stamp
        set_pose(message.pose, matrix_pose7(T))
        publisher.publish(message)
