"""A pair on ROS as the dVRK's teleoperation component: ``MTMR_PSM1/…``.

Besides the topics of the dVRK there is ``status``, which states in words what a pair does or what stands in its way.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import rospy
from crtk_msgs.msg import StringStamped
from geometry_msgs.msg import PoseStamped, QuaternionStamped, TwistStamped, WrenchStamped
from numpy.typing import NDArray
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool, Float64, String

from ligature.model.frames import matrix_pose7, matrix_quaternion
from ligature.robots.poses import rotation_vector

Array = NDArray[np.float64]
Heard = Callable[[str, Any], None]

DISABLED, SETTING, ALIGNING, ENABLED = "DISABLED", "SETTING_ARMS_STATE", "ALIGNING_MTM", "ENABLED"


class Topics:
    """Latched topics of a component, each published when its value changes."""

    def __init__(self, root: str, types: dict[str, type]) -> None:
        self._publishers = {
            name: rospy.Publisher(f"{root}/{name}", type_, latch=True, queue_size=10) for name, type_ in types.items()
        }
        self._types = types
        self._published: dict[str, Any] = {}

    def publish(self, name: str, value: Any) -> None:
        """Publish ``value`` unless it was the last one."""
        if self._published.get(name) == value:
            return
        self._published[name] = value
        type_ = self._types[name]
        message = Joy(buttons=[int(value)]) if type_ is Joy else type_(data=value)
        if type_ is Joy:
            message.header.stamp = rospy.Time.now()
        self._publishers[name].publish(message)


class PairTopics(Topics):
    """Topics of a leader and a follower; ``heard`` receives what a client asks for, on rospy's threads."""

    def __init__(self, root: str, scale: float, align: bool, heard: Heard) -> None:
        super().__init__(
            root,
            {
                "desired_state": String, "current_state": String, "following": Bool, "scale": Float64, "status": String,
                "align_mtm": Bool, "rotation_locked": Joy, "translation_locked": Joy,
            },
        )  # fmt: skip
        self.haptic = np.zeros(6)
        self._offset = rospy.Publisher(f"{root}/alignment_offset", QuaternionStamped, queue_size=1)
        self._leader = rospy.Publisher(f"{root}/MTM/measured_cp", PoseStamped, queue_size=1)
        self._follower = rospy.Publisher(f"{root}/PSM/setpoint_cp", PoseStamped, queue_size=1)
        self._speed = rospy.Publisher(f"{root}/MTM/measured_cv", TwistStamped, queue_size=1)
        self._last: tuple[Any, Array] | None = None
        for name, value in {
            "desired_state": DISABLED, "current_state": DISABLED, "following": False, "scale": scale,
            "align_mtm": align, "rotation_locked": False, "translation_locked": False,
        }.items():  # fmt: skip
            self.publish(name, value)
        listen(root, "state_command", StringStamped, lambda m: heard("state_command", m.string))
        listen(root, "set_scale", Float64, lambda m: heard("scale", m.data))
        listen(root, "lock_rotation", Bool, lambda m: heard("lock_rotation", m.data))
        listen(root, "lock_translation", Bool, lambda m: heard("lock_translation", m.data))
        listen(root, "set_align_MTM", Bool, lambda m: heard("align", m.data))
        listen(root, "following/mtm/body/servo_cf", WrenchStamped, self._pressed)

    def _pressed(self, message: Any) -> None:
        f, t = message.wrench.force, message.wrench.torque
        values = np.array([f.x, f.y, f.z, t.x, t.y, t.z])
        self.haptic = values if np.isfinite(values).all() else np.zeros(6)

    def read(self, offset: Array, T_view_hand: Array | None, T_camera_tip: Array | None) -> None:
        """Publish the readings: rotation (3, 3) of the tip in the hand, both poses (4, 4), the hand's velocity."""
        stamp = rospy.Time.now()
        if self._offset.get_num_connections():
            message = QuaternionStamped()
            message.header.stamp = stamp
            q = message.quaternion
            q.x, q.y, q.z, q.w = matrix_quaternion(offset)
            self._offset.publish(message)
        for publisher, T in ((self._leader, T_view_hand), (self._follower, T_camera_tip)):
            if publisher.get_num_connections() and T is not None and np.isfinite(T).all():
                publisher.publish(posed(T, stamp))
        self._publish_speed(stamp, T_view_hand)

    def _publish_speed(self, stamp: Any, T: Array | None) -> None:
        """Publish how the hand (4, 4) moved since the last reading: m/s and rad/s in axes of the view."""
        last, self._last = self._last, None if T is None or not np.isfinite(T).all() else (stamp, T)
        if last is None or self._last is None or T is None or not self._speed.get_num_connections():
            return
        dt = (stamp - last[0]).to_sec()
        if dt <= 0.0:
            return
        message = TwistStamped()
        message.header.stamp = stamp
        v, w = message.twist.linear, message.twist.angular
        v.x, v.y, v.z = ((T[:3, 3] - last[1][:3, 3]) / dt).tolist()
        w.x, w.y, w.z = (rotation_vector(T[:3, :3] @ last[1][:3, :3].T) / dt).tolist()
        self._speed.publish(message)


class CameraTopics(Topics):
    """Topics of the leaders of the camera: ``MTML_MTMR_ECM/…``."""

    def __init__(self, root: str, scale: float, heard: Heard) -> None:
        words = {"desired_state": String, "current_state": String, "status": String}
        super().__init__(root, {**words, "following": Bool, "scale": Float64})
        for name, value in {
            "desired_state": DISABLED, "current_state": DISABLED, "following": False, "scale": scale,
        }.items():  # fmt: skip
            self.publish(name, value)
        listen(root, "state_command", StringStamped, lambda m: heard("state_command", m.string))
        listen(root, "set_scale", Float64, lambda m: heard("scale", m.data))


def listen(root: str, name: str, type_: type, take: Callable[[Any], None]) -> None:
    """Subscribe a topic below ``root``."""
    rospy.Subscriber(f"{root}/{name}", type_, take, queue_size=10)


def posed(T: Array, stamp: Any) -> PoseStamped:
    """The message of a pose (4, 4)."""
    message = PoseStamped()
    message.header.stamp = stamp
    p, q = message.pose.position, message.pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = matrix_pose7(T).tolist()
    return message
