"""The proxy of an input device as a follower, by AMBF's topics of its root link.

It stands for an arm where a scene has none that is free. Metres, radians; the grip goes from 0, closed, to 1.
"""

from __future__ import annotations

import time

import numpy as np
import rospy
from ambf_msgs.msg import RigidBodyCmd, RigidBodyState
from numpy.typing import NDArray

from ligature.model.frames import matrix_pose7
from ligature.robots.poses import rotation_vector
from ligature.teleop.calibration import pose_of
from ligature.teleop.config import GRIP, ProxySpec
from ligature.teleop.follower import FRESH
from ligature.teleop.frames import Frames
from ligature.teleop.messages import pose_numbers
from ligature.teleop.pairing import Tip

Array = NDArray[np.float64]

KEEP = 0.05
"""Seconds after which the last command is sent again: a body without commands is released."""


class Proxy:
    """A proxy called ``name``; has what `ligature.teleop.follower.Arm` has."""

    def __init__(self, name: str, spec: ProxySpec, frames: Frames) -> None:
        self.name, self._spec, self._frames = name, spec, frames
        self._heard = -np.inf
        self._measured = np.eye(4)
        self._goal: Array | None = None
        self._grip = GRIP[1]
        self._sent = -np.inf
        self._publisher = rospy.Publisher(f"{spec.topic}/Command", RigidBodyCmd, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber(f"{spec.topic}/State", RigidBodyState, self._on_state, queue_size=1, tcp_nodelay=True)

    def _on_state(self, message: RigidBodyState) -> None:
        self._measured = pose_of(np.array(pose_numbers(message)))
        self._heard = time.monotonic()

    @property
    def reports(self) -> bool:
        """Whether the proxy was heard of."""
        return bool(np.isfinite(self._heard))

    def obstacle(self) -> str:
        """Why it cannot be driven; empty when it can."""
        if time.monotonic() - self._heard > FRESH:
            return f"no state of the proxy arrives on {self._spec.topic}; run the simulator with the same -i"
        return ""

    def setpoint(self) -> tuple[str, Array] | None:
        """The world, and the goal (4, 4) in it; where the proxy is while it has none."""
        if not self.reports:
            return None
        return "world", self._measured if self._goal is None else self._goal

    def tip(self, camera: str) -> Tip | None:
        """Goals in the camera's frame; None while the view or the proxy is unknown."""
        goal, T_camera_world = self.setpoint(), self._frames.between(camera, "world")
        return None if goal is None or T_camera_world is None else Tip(T_camera_world @ goal[1], self._grip)

    def wrench_in(self, camera: str) -> Array:
        """What keeps the proxy from where the hand wants it (6,), in the camera's axes.

        A spring of the haptic gains between both, as AMBF's: a proxy that lies against something stays behind.
        """
        T_camera_world = self._frames.between(camera, "world")
        if self._goal is None or T_camera_world is None:
            return np.zeros(6)
        linear, angular = self._spec.stiffness
        R = T_camera_world[:3, :3]
        away = self._measured[:3, 3] - self._goal[:3, 3]
        turned = rotation_vector(self._measured[:3, :3] @ self._goal[:3, :3].T)
        return np.concatenate([linear * R @ away, angular * R @ turned])

    def make_ready(self) -> None:
        """Nothing: it is driven as it is."""

    def forget_asking(self) -> None:
        """Nothing."""

    def go(self, T_camera_tip: Array, camera: str, guard: float = 0.0) -> None:
        """Go to a pose in the camera's frame; it has no remote centre to be guarded."""
        T_world_camera = self._frames.between("world", camera)
        if T_world_camera is not None:
            self._goal = T_world_camera @ T_camera_tip
            self._send()

    def go_jaw(self, angle: float) -> None:
        """Open the grip so far."""
        self._grip = float(np.clip(angle, *GRIP))

    def keep(self) -> None:
        """Send the last command again when it was sent long ago, so that the proxy holds."""
        if self._goal is not None and time.monotonic() - self._sent > KEEP:
            self._send()

    def _send(self) -> None:
        assert self._goal is not None
        message = RigidBodyCmd(cartesian_cmd_type=RigidBodyCmd.TYPE_POSITION)
        message.header.stamp = rospy.Time.now()
        p, q = message.pose.position, message.pose.orientation
        p.x, p.y, p.z, q.x, q.y, q.z, q.w = matrix_pose7(self._goal).tolist()
        low, high = self._spec.limits
        message.joint_cmds = (low + self._grip * (high - low)).tolist()
        message.joint_cmds_types = [RigidBodyCmd.TYPE_POSITION] * len(low)
        self._publisher.publish(message)
        self._sent = time.monotonic()
