"""Master arms by CRTK: ``<topic>measured_cp``, ``gripper/measured_js``, ``body/servo_cf``.

Poses are in the frame of the console (HRSV): x to the operator's left, y up, z away into the picture. Systems of
dVRK 1.x are heard under ``position_cartesian_current`` and ``state_gripper_current``. Metres, radians, newtons.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import rospy
from crtk_msgs.msg import OperatingState, StringStamped
from geometry_msgs.msg import PoseStamped, Quaternion, WrenchStamped
from numpy.typing import NDArray
from std_msgs.msg import Bool, Empty

from ligature.model.frames import matrix_quaternion
from ligature.teleop.calibration import Calibration, axes_of_words
from ligature.teleop.devices.device import Device, Reading, Take
from ligature.teleop.messages import Listener, pose_numbers

Array = NDArray[np.float64]

DEFAULTS = Calibration(axes=axes_of_words("left", "up", "away"), closed=-0.35, opened=1.05)
"""A gripper's angle is the jaw's, from 60° open to fingers pressed beyond closed."""

OPTIONS: dict[str, Any] = {}

POSES = ("measured_cp", "position_cartesian_current")
GRIPPERS = ("gripper/measured_js", "state_gripper_current")


class Adapter(Device):
    """A master arm whose topics begin with ``topic``, such as ``/MTMR/``."""

    def __init__(self, topic: str, options: dict[str, Any], take: Take) -> None:
        super().__init__(take)
        self._grip: float | None = None
        self._pose: list[float] | None = None
        self._listeners = [
            *(Listener(topic + name, self._moved) for name in POSES),
            *(Listener(topic + name, self._gripped) for name in GRIPPERS),
        ]
        self._force = rospy.Publisher(f"{topic}body/servo_cf", WrenchStamped, queue_size=1, tcp_nodelay=True)
        self._state: OperatingState | None = None
        self._states = rospy.Subscriber(f"{topic}operating_state", OperatingState, self._reported, queue_size=10)
        self._command = rospy.Publisher(f"{topic}state_command", StringStamped, queue_size=10)
        self._name = topic.strip("/")
        self._absolute = rospy.Publisher(f"{topic}body/set_cf_orientation_absolute", Bool, latch=True, queue_size=1)
        self._weightless = rospy.Publisher(f"{topic}use_gravity_compensation", Bool, latch=True, queue_size=1)
        self._move = rospy.Publisher(f"{topic}move_cp", PoseStamped, queue_size=1)
        self._lock = rospy.Publisher(f"{topic}lock_orientation", Quaternion, queue_size=1)
        self._unlock = rospy.Publisher(f"{topic}unlock_orientation", Empty, queue_size=1)

    def _moved(self, message: Any, sender: str) -> None:
        self._pose = pose_numbers(message)
        self.take(Reading(time.monotonic(), np.array(self._pose), self._grip))

    def _gripped(self, message: Any, sender: str) -> None:
        if len(message.position) == 1:
            self._grip = message.position[0]

    def _reported(self, message: OperatingState) -> None:
        self._state = message

    def make_ready(self) -> str:
        """Power and home the arm, as the dVRK's teleoperation does; systems of dVRK 1.x report no such state."""
        state = self._state
        if state is None or (state.state == "ENABLED" and state.is_homed and not state.is_busy):
            return ""
        if not state.is_busy:
            command = StringStamped(string="home" if state.state == "ENABLED" else "enable")
            command.header.stamp = rospy.Time.now()
            self._command.publish(command)
        return f"{self._name} is {state.state}{'' if state.is_homed else ' and not homed'}"

    def begin(self) -> None:
        """The hand moves the arm from now on: its weight is carried, and it yields."""
        self._absolute.publish(True)
        self._weightless.publish(True)
        self._unlock.publish()
        self.feel(np.zeros(6))

    def feel(self, wrench: Array) -> None:
        """Press and turn the hand, in axes of the console."""
        message = WrenchStamped()
        message.header.stamp = rospy.Time.now()
        f, t = message.wrench.force, message.wrench.torque
        f.x, f.y, f.z, t.x, t.y, t.z = wrench.tolist()
        self._force.publish(message)

    def turn_to(self, R: Array) -> bool:
        """Turn to an orientation where the arm is."""
        if self._pose is None:
            return False
        message = PoseStamped()
        message.header.stamp = rospy.Time.now()
        p, q = message.pose.position, message.pose.orientation
        p.x, p.y, p.z = self._pose[:3]
        q.x, q.y, q.z, q.w = matrix_quaternion(R)
        self._move.publish(message)
        return True

    def hold_orientation(self, R: Array) -> None:
        """Keep an orientation while the hand moves."""
        self._lock.publish(Quaternion(*matrix_quaternion(R)))

    def close(self) -> None:
        """Listen no more."""
        for listener in self._listeners:
            listener.close()
        self._states.unregister()
