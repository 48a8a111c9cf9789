"""What an arm reports when it happens: latched topics, each with its newest message."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import rospy
from crtk_msgs.msg import OperatingState
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool, Empty, Float64, String

from ligature.model.scene import ArmKind
from ligature.process import Reported
from ligature.robots.arm import CHALLENGE
from ligature.ros.arms.latched import Latched

STATES = ("DISABLED", "ENABLED", "PAUSED", "FAULT")

LATCHED: dict[str, type] = {
    "goal_reached": Bool,
    "desired_state": String,
    "error": String,
    "warning": String,
    "status": String,
    "trajectory_j/ratio": Float64,
    "trajectory_j/ratio_v": Float64,
    "trajectory_j/ratio_a": Float64,
}
"""Events that every arm publishes, latched."""
LATCHED_OF_KIND: dict[ArmKind, dict[str, type]] = {
    ArmKind.PSM: {"tool_type": String, "tool_type_request": Empty, "arm_clutch": Joy, "manip_clutch": Joy},
    ArmKind.ECM: {"endoscope_type": String, "arm_clutch": Joy, "manip_clutch": Joy},
    ArmKind.MTM: {"orientation_locked": Bool, "gripper/closed": Bool, "gripper/pinch": Empty},
}
"""Events of one kind of arm."""
_LOGS: dict[str, Callable[[str], None]] = {
    "error": rospy.logerr,
    "warning": rospy.logwarn,
    "status": rospy.logdebug,
}
NOT_READY = "arm not ready"


def event_topics(kind: ArmKind) -> list[str]:
    """Names of the event topics of an arm."""
    return ["operating_state", *LATCHED, *LATCHED_OF_KIND[kind]]


def operating_state(values: list[Any], stamp: Any) -> OperatingState:
    """The message of an ``operating_state`` event, or of a state record's three fields."""
    message = OperatingState(state=STATES[int(values[0])], is_homed=bool(values[1]), is_busy=bool(values[2]))
    message.header.stamp = stamp
    return message


class Clock:
    """Stamps that never repeat: a client takes no state that is not newer than its last."""

    def __init__(self) -> None:
        self._last = rospy.Time()

    def now(self) -> Any:
        """The time now, or a nanosecond after the last answer."""
        self._last = max(rospy.Time.now(), self._last + rospy.Duration(0, 1))
        return self._last


class StateStamps:
    """Stamps of states as they are read: those of the states, or of now while none comes, and none before the last."""

    def __init__(self, stale: float) -> None:
        self._stale = stale
        self._last = rospy.Time()

    def of(self, stamp: Any, now: Any) -> Any:
        """The stamp to send for a state of ``stamp``: ``now`` if it is older than ``stale`` seconds, as after a rest.

        Physics may have been held up between the stamp of its first state after a rest and handing it on. After the
        clock was set back stamps follow it.
        """
        found = now if (now - stamp).to_sec() > self._stale else stamp
        self._last = max(found, self._last) if self._last <= now else found
        return self._last


class EventTopics:
    """The event topics of one arm, whose topics are below ``root``."""

    def __init__(self, root: str, kind: ArmKind) -> None:
        self._root = root
        self._clock = Clock()
        self._state = [0, False, False]
        self._operating = Latched(f"{root}/operating_state", OperatingState)
        topics = {**LATCHED, **LATCHED_OF_KIND[kind]}
        self._publishers = {name: Latched(f"{root}/{name}", type_) for name, type_ in topics.items()}
        self._types = topics
        self._logged = Reported()
        self._warned = Reported()
        self.error = ""

    def publish(self, name: str, value: Any) -> None:
        """Publish an event."""
        if name == "operating_state":
            self._state = value
            self.beat()
        elif name in self._publishers and not (name == "warning" and self._repeats(value)):
            if name == "error":
                self.error = value
            type_ = self._types[name]
            self._publishers[name].publish(type_() if type_ is Empty else type_(data=value))
            self._log(name, value)

    def close(self) -> None:
        """Publish no more."""
        for topic in (self._operating, *self._publishers.values()):
            topic.close()

    @property
    def failed(self) -> bool:
        """Whether the arm is in FAULT; ``error`` is why."""
        return STATES[int(self._state[0])] == "FAULT"

    def beat(self) -> None:
        """Publish the operating state again, with a fresh stamp."""
        self._operating.publish(self.state())

    def state(self) -> OperatingState:
        """The newest operating state."""
        return operating_state(self._state, self._clock.now())

    def _repeats(self, warning: str) -> bool:
        """Whether a warning of an arm that is not ready was published a moment ago."""
        return NOT_READY in warning and not self._warned.is_new(warning, time.monotonic())

    def _log(self, name: str, value: Any) -> None:
        """What is an error, a warning or a status goes to the log as well, once in a while."""
        if name in _LOGS and self._logged.is_new(value, time.monotonic()):
            direct = value.startswith(f"{CHALLENGE}/")  # names its topic, which is not below this arm's
            _LOGS[name](f"{self._root.rpartition('/')[0]}/{value}" if direct else f"{self._root}: {value}")
