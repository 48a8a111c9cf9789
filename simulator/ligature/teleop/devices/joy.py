"""Game controllers and other sticks: the deflections of ``sensor_msgs/Joy`` are speeds of the hand.

A stick that is held still must be sent again and again: `joy_node` needs ``autorepeat_rate`` 20 or more. The hand moves
in the axes of the view: right, down, away. Metres and radians per second.
"""

from __future__ import annotations

import re
import time
from typing import Any

import numpy as np
import rospy
from sensor_msgs.msg import Joy

from ligature.teleop.calibration import Calibration
from ligature.teleop.devices.device import Device, RateHand, Reading, Take

DEFAULTS = Calibration()
OPTIONS: dict[str, Any] = {
    "moves": ["-0", "-1", "+7"], "turns": ["+4", "-3", "-6"], "speed": 0.1, "turn": 0.8, "deadband": 0.08,
    "timeout": 0.2,
}  # fmt: skip
"""``moves`` and ``turns``: the axis with its sign that moves right, down, away, and that turns about these; as of a
common game pad: left stick, cross up and down; right stick, cross left and right."""


class Adapter(Device):
    """A stick on ``topic``; buttons are called by their numbers."""

    def __init__(self, topic: str, options: dict[str, Any], take: Take) -> None:
        super().__init__(take)
        self._axes = [_axis(text) for text in (*options["moves"], *options["turns"])]
        if len(self._axes) != 6:
            raise ValueError("moves and turns name three axes each")
        self._hand = RateHand(options["speed"], options["turn"], options["timeout"], options["deadband"])
        self._buttons: dict[str, bool] = {}
        self._subscriber = rospy.Subscriber(topic, Joy, self._deflected, queue_size=10, tcp_nodelay=True)

    def _deflected(self, message: Any) -> None:
        axes = message.axes
        values = [sign * axes[index] if index < len(axes) else 0.0 for sign, index in self._axes]
        self._buttons = {str(k): bool(value) for k, value in enumerate(message.buttons)}
        self._hand.deflect(time.monotonic(), np.array(values))

    def poll(self, now: float) -> None:
        """Give where the hand is by now."""
        pose = self._hand.pose(now)
        if pose is not None:
            self.take(Reading(now, pose, None, dict(self._buttons)))

    def close(self) -> None:
        """Listen no more."""
        self._subscriber.unregister()


def _axis(text: str) -> tuple[float, int]:
    match = re.fullmatch(r"([+-]?)(\d+)", str(text))
    if match is None:
        raise ValueError(f"an axis is a number with a sign such as '-1', not '{text}'")
    return -1.0 if match[1] == "-" else 1.0, int(match[2])
