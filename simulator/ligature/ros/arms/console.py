"""The surgeon's console on ROS: teleoperation switches, foot pedals, power.

Topics are those of the dVRK's console 2.4, with the names of older versions. Teleoperation listens to these topics;
the console itself moves nothing but the power of the arms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import rospy
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool, Empty, Float64, Float64MultiArray, String

from ligature.process import REPEAT
from ligature.robots.commands import ArmCommand, StateCommand
from ligature.ros.arms.latched import Latched
from ligature.ros.arms.outlet import ArmOutlet

QUEUE = 10
PEDALS = {
    "clutch": "clutch", "camera": "camera", "operator_present": "operator_present", "coag": "coag", "bicoag": "bicoag",
    "focus_minus": "cam_minus", "focus_plus": "cam_plus",
}  # fmt: skip
"""Buttons below ``console/``, each with its name below ``footpedals/``."""

SELECTING = {"select": "selected", "unselect": "unselected"}
"""Commands that choose a pair of arms, and what reports it, below ``console/teleop/``."""

DOCUMENTED = {
    "select": "select_teleop", "unselect": "unselect_teleop", "selected": "teleop_selected",
    "unselected": "teleop_unselected",
}  # fmt: skip
"""Names of the same in the dVRK's documentation."""

DEFAULT_SCALE = 0.2


class Console:
    """One console, and the system's power; ``push`` sends commands to arms. A ``silent`` one only listens."""

    def __init__(
        self, prefix: str, outlets: Sequence[ArmOutlet], push: Callable[[ArmCommand], None], silent: bool
    ) -> None:
        self._outlets, self._push, self._silent = outlets, push, silent
        self._published: list[Latched] = []
        console = f"{prefix}console"
        self._enabled = self._latched(f"{console}/teleop/enabled", Bool)
        self._scale = self._latched(f"{console}/teleop/scale", Float64)
        self._volume = self._latched(f"{prefix}system/volume", Float64)
        self._values: dict[Latched, Any] = {self._enabled: False, self._scale: DEFAULT_SCALE}
        self.beat()
        self._listen(f"{console}/teleop/enable", Bool, lambda m: self._report(self._enabled, m.data))
        self._listen(f"{console}/teleop/scale", Float64, self._hear_scale)
        self._listen(f"{console}/teleop/set_scale", Float64, self._set_scale)
        for command, report in SELECTING.items():
            reports = [self._latched(f"{console}/teleop/{name}", String) for name in (report, DOCUMENTED[report])]
            for name in (command, DOCUMENTED[command]):
                self._listen(f"{console}/teleop/{name}", String, _relay(reports, lambda m: m.data))
        self._pedals(prefix, console)
        for root in (f"{prefix}system", console):
            self._listen(f"{root}/power_on", Empty, lambda _: self._all("enable"))
            self._listen(f"{root}/power_off", Empty, lambda _: self._power_off())
            self._listen(f"{root}/home", Empty, lambda _: self._all("home"))
            self._listen(f"{root}/set_volume", Float64, self._set_volume)
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
        for pedal, old in PEDALS.items():
            reports = [self._latched(name, Joy) for name in (f"{console}/{pedal}", f"{prefix}footpedals/{old}")]
            self._listen(f"{console}/emulate_{pedal}", Joy, _relay(reports, _press))

    def _set_scale(self, message: Any) -> None:
        if 0.0 < message.data <= 1.0:
            self._report(self._scale, message.data)
        else:
            rospy.logwarn_throttle(REPEAT, f"console: a scale must be above 0 and at most 1, not {message.data:g}")

    def _set_volume(self, message: Any) -> None:
        if 0.0 <= message.data <= 1.0:
            self._volume.publish(message.data)
        else:
            rospy.logwarn_throttle(REPEAT, f"console: a volume is from 0 to 1, not {message.data:g}")

    def _all(self, command: str) -> None:
        """Have all arms ``enable`` or ``home``; a FAULT is ended before (as in the dVRK)."""
        for outlet in self._outlets:
            if outlet.events.failed:
                self._push(StateCommand(outlet.index, "disable"))
            self._push(StateCommand(outlet.index, command))

    def _power_off(self) -> None:
        """Disable teleoperation and all arms."""
        self._report(self._enabled, False)
        for outlet in self._outlets:
            self._push(StateCommand(outlet.index, "disable"))


def console_topics(prefix: str) -> list[str]:
    """What only a console publishes; pedals and selections have others who press and select."""
    return [f"{prefix}console/teleop/enabled", f"{prefix}system/volume"]


def _relay(publishers: Sequence[Any], content: Callable[[Any], Any]) -> Callable[[Any], None]:
    """What publishes the ``content`` of each message that it is given, unless it is None."""

    def relay(message: Any) -> None:
        event = content(message)
        if event is not None:
            for publisher in publishers:
                publisher.publish(event)

    return relay


def _press(message: Any) -> Joy | None:
    """A button event of now: 1 pressed, 0 released, 2 clicked; None without a button, which clients cannot read."""
    if not message.buttons:
        needed = "send 'buttons: [1]' (pressed) or [0] (released)"
        rospy.logwarn_throttle(REPEAT, f"console: a pedal needs a button: {needed}")
        return None
    event = Joy(buttons=list(message.buttons[:1]))
    event.header.stamp = rospy.Time.now()
    return event
