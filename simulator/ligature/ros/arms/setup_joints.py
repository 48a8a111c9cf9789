"""The set-up joints of the cart on ROS: where the bases of arms stand, which a scene fixes. Metres.

Topics are those of the dVRK, whose set-up joints have one operating state, with commands and reports for each arm.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Container, Sequence
from typing import Any

import rospy
from crtk_msgs.msg import OperatingState, StringStamped
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from ligature.model.frames import inverse, matrix_pose7
from ligature.model.scene import ArmKind, WorldSettings
from ligature.process import REPEAT
from ligature.ros.arms.bases import CART, bases, tip
from ligature.ros.arms.events import Clock
from ligature.ros.arms.latched import Latched
from ligature.ros.arms.outlet import ArmOutlet
from ligature.ros.arms.readings import set_pose

QUEUE = 10
JOINTS = 6
LOCAL = "local/measured_cp"
STATES = {"enable": "ENABLED", "disable": "DISABLED", "home": "ENABLED"}
"""State to which a command leads; the bases stay where they are in all of them."""

MOTIONS = {"servo_jp": JointState, "move_jp": JointState, "local/servo_cp": PoseStamped}
"""Commands by which set-up joints of a dVRK are moved while they are simulated; rejected with a reason."""


def setup_topics(world: WorldSettings, arm: str) -> list[str]:
    """What the set-up joints of an arm publish."""
    names = ("operating_state", "measured_js", "measured_cp", LOCAL, "warning")
    return [f"{world.root}SUJ/{arm}/{name}" for name in names]


class SetupJoints:
    """Publishes where the bases of the arms stand.

    Those of arms called in ``silent`` are not published.
    """

    def __init__(self, world: WorldSettings, outlets: Sequence[ArmOutlet], silent: Container[str]) -> None:
        self._outlets = [outlet for outlet in outlets if outlet.description.kind is not ArmKind.MTM]
        self._reference, self._frame_prefix = "ECM", world.frame_prefix
        self._arms: dict[str, _SetupArm] = {}
        self._clock = Clock()
        self._state = "ENABLED"
        rospy.Subscriber(f"{world.root}SUJ/set_reference_arm", String, self._refer, queue_size=QUEUE)
        for outlet in self._outlets:
            name = outlet.description.name
            if name not in silent:
                self._arms[name] = _SetupArm(f"{world.root}SUJ/{name}", name, self._command)
        self.beat()

    def fall_silent(self, arm: str) -> None:
        """Publish no more of an arm: another node does."""
        found = self._arms.pop(arm, None)
        if found is not None:
            threading.Thread(target=found.close, daemon=True).start()

    def beat(self) -> None:
        """Publish the operating state again: clients take none that is older than a second."""
        message = OperatingState(state=self._state, is_homed=True)
        message.header.stamp = self._clock.now()
        for arm in list(self._arms.values()):
            arm.report(message)

    def _command(self, arm: _SetupArm, command: str) -> None:
        state = STATES.get(command)
        if state is None:
            arm.warn(f"'{command[:40]}' is no state command of set-up joints; use one of {', '.join(STATES)}")
            return
        self._state = state
        self.beat()

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
    """The set-up joints of one arm, whose topics are below ``root``; ``command`` takes what switches all of them."""

    def __init__(self, root: str, name: str, command: Callable[[_SetupArm, str], None]) -> None:
        self._root = root
        self._state = Latched(f"{root}/operating_state", OperatingState)
        self._warning = Latched(f"{root}/warning", String)
        self._joints = JointState(name=[f"SUJ_{name}_J{i}" for i in range(JOINTS)], position=[0.0] * JOINTS)
        self._measured_js = rospy.Publisher(f"{root}/measured_js", JointState, queue_size=QUEUE)
        self._measured_cp = rospy.Publisher(f"{root}/measured_cp", PoseStamped, queue_size=QUEUE)
        self._local = rospy.Publisher(f"{root}/{LOCAL}", PoseStamped, queue_size=QUEUE)
        self._subscribers = [
            rospy.Subscriber(
                f"{root}/state_command", StringStamped, lambda m: command(self, m.string), queue_size=QUEUE
            ),
            *[
                rospy.Subscriber(f"{root}/{verb}", type_, self._reject(verb), queue_size=QUEUE)
                for verb, type_ in MOTIONS.items()
            ],
        ]

    def _reject(self, verb: str) -> Callable[[Any], None]:
        return lambda _: self.warn(f"{verb}: the bases of the arms are fixed; the scene's file places them")

    def warn(self, text: str) -> None:
        """Report why a command was rejected, on ``warning`` and, at most every two seconds, in the log."""
        self._warning.publish(text)
        rospy.logwarn_throttle(REPEAT, f"{self._root}: {text}")

    def report(self, state: OperatingState) -> None:
        """Publish the operating state."""
        self._state.publish(state)

    def publish(self, pose: Any, reference: str, local: Any, cart: str, stamp: Any) -> None:
        """Publish a pose (4, 4) in a frame called ``reference``, and one in the cart's."""
        self._joints.header.stamp = stamp
        self._measured_js.publish(self._joints)
        self._measured_cp.publish(_posed(reference, pose, stamp))
        self._local.publish(_posed(cart, local, stamp))

    def close(self) -> None:
        """Unregister all topics, so that another node can publish them."""
        self._state.close()
        self._warning.close()
        for end in (self._measured_js, self._measured_cp, self._local, *self._subscribers):
            end.unregister()


def _posed(frame: str, T: Any, stamp: Any) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id, message.header.stamp = frame, stamp
    set_pose(message.pose, matrix_pose7(T))
    return message
