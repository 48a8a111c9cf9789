"""An arm that is driven, known by its CRTK topics alone: a simulated one, or a real one. Metres, radians, newtons."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rospy
from crtk_msgs.msg import OperatingState, StringStamped
from geometry_msgs.msg import PoseStamped, WrenchStamped
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from ligature.model.frames import matrix_pose7
from ligature.teleop.calibration import pose_of
from ligature.teleop.frames import Frames
from ligature.teleop.messages import pose_numbers
from ligature.teleop.pairing import Tip

Array = NDArray[np.float64]

FRESH = 0.5
"""Seconds after which what an arm reported counts as lost."""


class Arm:
    """An arm below ``root``; ``rival`` receives the name of another node that sends it servo commands."""

    def __init__(self, name: str, root: str, frames: Frames, rival: Callable[[str, str], None]) -> None:
        self.name, self._frames, self._rival = name, frames, rival
        self._setpoint: tuple[float, str, Array] | None = None
        self._jaw = 0.0
        self._wrench = np.zeros(6)
        self._state: Any = None
        self._asked = ""
        self._command = rospy.Publisher(f"{root}/state_command", StringStamped, queue_size=5)
        self._servo = rospy.Publisher(f"{root}/servo_cp", PoseStamped, queue_size=1, tcp_nodelay=True)
        self._jaw_servo = rospy.Publisher(f"{root}/jaw/servo_jp", JointState, queue_size=1, tcp_nodelay=True)
        self._listen(f"{root}/operating_state", OperatingState, self._on_state)
        self._listen(f"{root}/setpoint_cp", PoseStamped, self._on_setpoint)
        self._listen(f"{root}/measured_cp", PoseStamped, self._on_measured)
        self._listen(f"{root}/jaw/setpoint_js", JointState, self._on_jaw)
        self._listen(f"{root}/body/measured_cf", WrenchStamped, self._on_force)
        self._listen(f"{root}/servo_cp", rospy.AnyMsg, self._on_command)

    def _listen(self, topic: str, type_: type, take: Callable[[Any], None]) -> None:
        rospy.Subscriber(topic, type_, take, queue_size=5, tcp_nodelay=True)

    # --- reports of it

    def _on_state(self, message: Any) -> None:
        self._state = message

    def _on_setpoint(self, message: Any) -> None:
        self._setpoint = time.monotonic(), message.header.frame_id, pose_of(np.array(pose_numbers(message)))

    def _on_measured(self, message: Any) -> None:
        T = pose_of(np.array(pose_numbers(message)))
        self._frames.put(message.header.frame_id, self.name, T)

    def _on_jaw(self, message: Any) -> None:
        if message.position and np.isfinite(message.position[0]):
            self._jaw = message.position[0]

    def _on_force(self, message: Any) -> None:
        f, t = message.wrench.force, message.wrench.torque
        self._wrench = np.array([f.x, f.y, f.z, t.x, t.y, t.z])

    def _on_command(self, raw: Any) -> None:
        sender = raw._connection_header["callerid"]
        if sender != rospy.get_name():
            self._rival(self.name, sender)

    def obstacle(self) -> str:
        """Why the arm cannot be driven; empty when it can."""
        state = self._state
        if state is None:
            return f"{self.name} reports no operating state"
        if self._setpoint is None or time.monotonic() - self._setpoint[0] > FRESH:
            return f"{self.name} reports no set-point"
        if state.state != "ENABLED":
            return f"{self.name} is {state.state}"
        if not state.is_homed:
            return f"{self.name} is not homed"
        return f"{self.name} is busy with a move" if state.is_busy else ""

    def tip(self, camera: str) -> Tip | None:
        """Set-points in the camera's frame; None while frames or set-points are unknown."""
        if self._setpoint is None:
            return None
        _, frame_id, T = self._setpoint
        T_camera_frame = self._frames.between(camera, frame_id)
        return None if T_camera_frame is None else Tip(T_camera_frame @ T, self._jaw)

    def setpoint(self) -> tuple[str, Array] | None:
        """The frame of the set-point and the set-point (4, 4) in it; None while it is unknown."""
        return None if self._setpoint is None else self._setpoint[1:]

    def keep(self) -> None:
        """Nothing: an arm holds its last set-point."""

    def wrench_in(self, camera: str) -> Array:
        """Force and torque (6,) of the world on the tip in the camera's axes; zeros while they are unknown."""
        T = self._frames.between(camera, self.name)
        return np.zeros(6) if T is None else np.asarray((self._wrench.reshape(2, 3) @ T[:3, :3].T).reshape(6))

    # --- commands to it

    def make_ready(self) -> None:
        """Ask for power, then for homing, each once."""
        state = self._state
        word = "enable" if state.state == "DISABLED" else "home"
        if word != self._asked and state.state in ("DISABLED", "ENABLED") and not state.is_busy:
            self._asked = word
            message = StringStamped(string=word)
            message.header.stamp = rospy.Time.now()
            self._command.publish(message)

    @property
    def reports(self) -> bool:
        """Whether the arm was heard of."""
        return self._state is not None

    def forget_asking(self) -> None:
        """Ask again the next time."""
        self._asked = ""

    def go(self, T_camera_tip: Array, camera: str, guard: float = 0.0) -> None:
        """Servo to a pose in the camera's frame; a tip stays ``guard`` metres from the remote centre at least."""
        if self._setpoint is None:
            return
        T_frame_camera = self._frames.between(self._setpoint[1], camera)
        if T_frame_camera is None:
            return
        T = T_frame_camera @ T_camera_tip
        if guard > 0.0:
            T_frame_base = self._frames.between(self._setpoint[1], f"{self.name}_base")
            centre = np.zeros(3) if T_frame_base is None else T_frame_base[:3, 3]
            away = T[:3, 3] - centre
            distance = float(np.linalg.norm(away))
            if 0.0 < distance < guard:
                T[:3, 3] = centre + away * (guard / distance)
        message = PoseStamped()
        message.header.stamp = rospy.Time.now()
        message.header.frame_id = self._setpoint[1]
        p, q = message.pose.position, message.pose.orientation
        p.x, p.y, p.z, q.x, q.y, q.z, q.w = matrix_pose7(T).tolist()
        self._servo.publish(message)

    def go_jaw(self, angle: float) -> None:
        """Servo the jaw, unless it is sent there already."""
        if angle == self._jaw:
            return
        message = JointState(name=["jaw"], position=[angle])
        message.header.stamp = rospy.Time.now()
        self._jaw_servo.publish(message)
