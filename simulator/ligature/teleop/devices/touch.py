"""Haptic pens: ``<topic>pose``, ``<topic>button`` with grey and white, ``<topic>force_feedback``.

Drivers differ in axes and units, which the calibration and ``unit`` take up. Metres, newtons.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import rosgraph
import rospy
from numpy.typing import NDArray

from ligature.teleop.calibration import Calibration, axes_of_words
from ligature.teleop.devices.device import Device, Reading, Take
from ligature.teleop.messages import Listener, MissingPackage, message_class, pose_numbers

Array = NDArray[np.float64]

DEFAULTS = Calibration(axes=axes_of_words("right", "up", "near"))
OPTIONS: dict[str, Any] = {"unit": 1.0, "force type": "omni_msgs/OmniFeedback"}
"""``unit``: metres of one unit of the driver's positions, 0.001 for those that report millimetres."""


class Adapter(Device):
    """A pen whose topics begin with ``topic``, such as ``/arm1/``."""

    def __init__(self, topic: str, options: dict[str, Any], take: Take) -> None:
        super().__init__(take)
        self._unit = options["unit"]
        self._buttons = {"grey": False, "white": False}
        self._force_topic, self._force_type = f"{topic}force_feedback", options["force type"]
        self._force: Any = None
        self._message: Any = None
        self._listeners = [Listener(f"{topic}pose", self._moved), Listener(f"{topic}button", self._pressed)]

    def _moved(self, message: Any, sender: str) -> None:
        pose = np.array(pose_numbers(message))
        pose[:3] *= self._unit
        self.take(Reading(time.monotonic(), pose, None, dict(self._buttons)))

    def _pressed(self, message: Any, sender: str) -> None:
        self._buttons = {"grey": bool(message.grey_button), "white": bool(message.white_button)}

    def feel(self, wrench: Array) -> None:
        """Press the hand, in the driver's axes; torques where its messages have them (``geometry_msgs/Wrench``).

        Without the driver's messages a warning names what is missing.
        """
        if self._message is None:
            self._message = self._force_message()
        if self._message:
            pressed = getattr(self._message, "wrench", self._message)
            pressed.force.x, pressed.force.y, pressed.force.z = wrench[:3].tolist()
            if hasattr(pressed, "torque"):
                pressed.torque.x, pressed.torque.y, pressed.torque.z = wrench[3:].tolist()
            self._force.publish(self._message)

    def _force_message(self) -> Any:
        """An empty message of the type that the driver listens to; False when it cannot be sent."""
        types = dict(rosgraph.Master(rospy.get_name()).getTopicTypes())
        try:
            type_ = message_class(types.get(self._force_topic, self._force_type), f"force on {self._force_topic}")
        except MissingPackage as error:
            rospy.logerr(f"{error}; the pen gives no force feedback")
            return False
        self._force = rospy.Publisher(self._force_topic, type_, queue_size=1, tcp_nodelay=True)
        return type_()

    def close(self) -> None:
        """Listen no more."""
        for listener in self._listeners:
            listener.close()
