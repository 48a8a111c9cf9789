"""A console of the real kit as other nodes see it: master arms that a hand carries, states, pedals, frames.

Run as a program with the names of arms: ``python -m tests.ros.real_console MTMR``. It publishes what sawIntuitiveResearchKit
2.4 does: readings at 200 Hz, latched states with a heartbeat, services, pedals. ``hand`` below an
arm is where the operator's hand carries it. Poses are in HRSV. Metres, radians.
"""

from __future__ import annotations

import sys
import threading
import time
from typing import Any

import numpy as np
import rospy
from crtk_msgs.msg import OperatingState, StringStamped
from crtk_msgs.srv import TriggerOperatingState, TriggerOperatingStateResponse
from geometry_msgs.msg import PoseStamped, Quaternion, TransformStamped, TwistStamped, WrenchStamped
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Bool, Empty, Float64, String
from tf2_msgs.msg import TFMessage

RATE = 200.0
HEARTBEAT, TF = 0.7, 0.02
BUSY = 0.2
"""Seconds that a move takes."""

JOINTS = [
    "outer_yaw",
    "shoulder_pitch",
    "elbow_pitch",
    "wrist_platform",
    "wrist_pitch",
    "wrist_yaw",
    "wrist_roll",
]


class RealMaster:
    """One arm: it stands where the hand or a move has put it."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.pose = [0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0]
        self._state = OperatingState(state="DISABLED")
        self._lock = threading.Lock()
        latched = {"latch": True, "queue_size": 100}
        self._operating = rospy.Publisher(f"/{name}/operating_state", OperatingState, **latched)
        self._status = rospy.Publisher(f"/{name}/status", String, **latched)
        self._goal = rospy.Publisher(f"/{name}/goal_reached", Bool, **latched)
        steady = {"queue_size": 5, "tcp_nodelay": True}
        self._poses = [
            rospy.Publisher(f"/{name}/{topic}", PoseStamped, **steady)
            for topic in ("measured_cp", "setpoint_cp", "local/measured_cp", "local/setpoint_cp")
        ]
        self._joints = [
            rospy.Publisher(f"/{name}/{topic}", JointState, **steady) for topic in ("measured_js", "setpoint_js")
        ]
        self._gripper = rospy.Publisher(f"/{name}/gripper/measured_js", JointState, **steady)
        self._twist = rospy.Publisher(f"/{name}/measured_cv", TwistStamped, **steady)
        self._wrench = rospy.Publisher(f"/{name}/body/measured_cf", WrenchStamped, **steady)
        rospy.Service(
            f"/{name}/operating_state", TriggerOperatingState, lambda _: TriggerOperatingStateResponse(self._state)
        )
        rospy.Subscriber(f"/{name}/state_command", StringStamped, self._command)
        rospy.Subscriber(f"/{name}/move_cp", PoseStamped, self._move)
        rospy.Subscriber(f"/{name}/hand", PoseStamped, lambda m: self._put(m.pose), tcp_nodelay=True)
        for topic, type_ in (
            ("servo_cp", PoseStamped), ("body/servo_cf", WrenchStamped), ("lock_orientation", Quaternion),
            ("unlock_orientation", Empty), ("use_gravity_compensation", Bool), ("hold", Empty),
            ("body/set_cf_orientation_absolute", Bool),
        ):  # fmt: skip
            rospy.Subscriber(f"/{name}/{topic}", type_, lambda _: None)
        self.beat()

    def _command(self, message: Any) -> None:
        word = message.string
        state, homed = {
            "enable": ("ENABLED", self._state.is_homed),
            "home": ("ENABLED", True),
            "disable": ("DISABLED", False),
        }.get(word, (self._state.state, self._state.is_homed))
        self._become(state=state, is_homed=homed)

    def _move(self, message: Any) -> None:
        """A move: busy, then there."""
        self._become(is_busy=True)
        time.sleep(BUSY)
        self._put(message.pose)
        self._goal.publish(True)
        self._become(is_busy=False)

    def _put(self, pose: Any) -> None:
        p, q = pose.position, pose.orientation
        self.pose = [p.x, p.y, p.z, q.x, q.y, q.z, q.w]

    def _become(self, **changes: Any) -> None:
        for name, value in changes.items():
            setattr(self._state, name, value)
        self.beat()

    def beat(self) -> None:
        with self._lock:
            self._state.header.stamp = rospy.Time.now()
            self._operating.publish(self._state)

    def publish(self) -> None:
        """Every reading."""
        stamp = rospy.Time.now()
        for publisher in self._poses:
            message = PoseStamped()
            message.header.stamp = stamp
            message.header.frame_id = "HRSV" if publisher.name.count("local") == 0 else f"{self.name}_base"
            p, q = message.pose.position, message.pose.orientation
            p.x, p.y, p.z, q.x, q.y, q.z, q.w = self.pose
            publisher.publish(message)
        zeros = [0.0] * 7
        for publisher in self._joints:
            message = JointState(name=JOINTS, position=zeros, velocity=zeros, effort=zeros)
            message.header.stamp = stamp
            publisher.publish(message)
        gripper = JointState(name=["gripper"], position=[0.5])
        gripper.header.stamp = stamp
        self._gripper.publish(gripper)
        for publisher, message in ((self._twist, TwistStamped()), (self._wrench, WrenchStamped())):
            message.header.stamp = stamp
            publisher.publish(message)

    def frame(self) -> TransformStamped:
        """Where it stands, for tf."""
        transform = TransformStamped(child_frame_id=self.name)
        transform.header.frame_id, transform.header.stamp = "HRSV", rospy.Time.now()
        t, q = transform.transform.translation, transform.transform.rotation
        t.x, t.y, t.z, q.x, q.y, q.z, q.w = self.pose
        return transform


class Pedals:
    """The console's own topics."""

    def __init__(self) -> None:
        self._latched = [
            rospy.Publisher("/console/teleop/enabled", Bool, latch=True, queue_size=10),
            rospy.Publisher("/system/volume", Float64, latch=True, queue_size=10),
        ]
        self._latched[0].publish(False)
        self._latched[1].publish(0.5)
        rospy.Subscriber("/console/teleop/enable", Bool, lambda m: self._latched[0].publish(m.data))
        self._pedals = [
            rospy.Publisher(f"/console/{name}", Joy, latch=True, queue_size=10)
            for name in ("clutch", "camera", "operator_present")
        ]
        for publisher in self._pedals:
            event = Joy(buttons=[int(publisher.name.endswith("present"))])
            event.header.stamp = rospy.Time.now()
            publisher.publish(event)


def main(names: list[str]) -> None:
    """Publish until the node is asked to end."""
    rospy.init_node("dvrk_console")
    masters = [RealMaster(name) for name in names]
    pedals = Pedals()
    tf = rospy.Publisher("/tf", TFMessage, queue_size=10)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    start = time.monotonic()
    due = np.array([start, start, start])
    while not rospy.is_shutdown():
        now = time.monotonic()
        if now >= due[0]:
            due[0] += 1.0 / RATE
            for master in masters:
                master.publish()
        if now >= due[1]:
            due[1] = now + HEARTBEAT
            for master in masters:
                master.beat()
        if now >= due[2]:
            due[2] = now + TF
            tf.publish(TFMessage([master.frame() for master in masters]))
        time.sleep(max(0.0, due.min() - time.monotonic()))
    del pedals


if __name__ == "__main__":
    main(sys.argv[1:])
