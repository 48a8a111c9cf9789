"""The surgeon's console as teleoperation hears it: switches, pedals, selections (as in the dVRK)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import rospy
from diagnostic_msgs.msg import KeyValue
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool, Empty, Float64, String

Put = Callable[[str, Any], None]

PEDALS = {
    "clutch": ("console/clutch", "footpedals/clutch"),
    "camera": ("console/camera", "footpedals/camera"),
    "present": ("console/operator_present", "footpedals/operator_present"),
}
PRESSED = 1


class ConsoleTopics:
    """Hands what a console asks for to ``put`` as a name and a value, on rospy's threads.

    Names are ``enable``, ``scale``, ``select`` and ``unselect`` with the name of a pair, ``pair`` with those of leader
    and follower (dVRK 2.3 and older), ``cycle`` with that of a leader, and the pedals ``clutch``, ``camera`` and
    ``present``, and ``phase`` for that with the topic ``phase_pedal``, if it is not empty.
    """

    def __init__(self, prefix: str, put: Put, phase_pedal: str = "") -> None:
        root = f"{prefix}console/teleop"
        self._selected = rospy.Publisher(f"{root}/selected", String, latch=True, queue_size=10)
        self._unselected = rospy.Publisher(f"{root}/unselected", String, latch=True, queue_size=10)
        self._scale = rospy.Publisher(f"{root}/scale", Float64, latch=True, queue_size=10)
        self._old_selected = rospy.Publisher(f"{root}/teleop_psm_selected", KeyValue, latch=True, queue_size=10)
        self._old_unselected = rospy.Publisher(f"{root}/teleop_psm_unselected", KeyValue, latch=True, queue_size=10)
        self._listen(f"{root}/enable", Bool, lambda m: put("enable", m.data))
        self._listen(f"{root}/set_scale", Float64, lambda m: put("scale", m.data))
        for word in ("select", "unselect"):
            for name in (word, f"{word}_teleop"):  # the latter is in the dVRK's documentation
                self._listen(f"{root}/{name}", String, partial(_hand, put, word))
        for power_off in ("system/power_off", "console/power_off"):
            self._listen(prefix + power_off, Empty, lambda _: put("enable", False))
        self._listen(f"{root}/select_teleop_psm", KeyValue, lambda m: put("pair", (m.key, m.value)))
        self._listen(f"{root}/cycle_teleop_psm_by_mtm", String, lambda m: put("cycle", m.data))
        for pedal, topics in PEDALS.items():
            for topic in topics:
                self._listen(prefix + topic, Joy, _pedal(pedal, put))
        if phase_pedal:
            self._listen(prefix + phase_pedal, Joy, _pedal("phase", put))

    @staticmethod
    def _listen(topic: str, type_: type, take: Callable[[Any], None]) -> None:
        rospy.Subscriber(topic, type_, take, queue_size=10, tcp_nodelay=True)

    def selected(self, leader: str, follower: str) -> None:
        """Report that a leader drives a follower now."""
        self._selected.publish(f"{leader}_{follower}")
        self._old_selected.publish(KeyValue(leader, follower))

    def unselected(self, leader: str, follower: str) -> None:
        """Report that a leader does not drive a follower any more."""
        self._unselected.publish(f"{leader}_{follower}")
        self._old_unselected.publish(KeyValue(leader, follower))

    def scaled(self, scale: float) -> None:
        """Report the scale of all pairs."""
        self._scale.publish(scale)


def _hand(put: Put, name: str, message: Any) -> None:
    put(name, message.data)


def _pedal(name: str, put: Put) -> Callable[[Any], None]:
    def take(message: Any) -> None:
        if message.buttons:
            put(name, message.buttons[0] == PRESSED)

    return take
