#!/usr/bin/python3
"""A participant of the challenge's first task, on ROS alone: looks, reports where the needle is, reads the score."""

import unittest

import numpy as np
import rospy
import rostest
from ambf_msgs.msg import RigidBodyState
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from std_msgs.msg import Bool

TIMEOUT = 90.0
COMPILING = 900.0
"""Seconds for the first state, and then for the judge: the first start from a new folder compiles the kernels."""

REPORT = "/surgical_robotics_challenge/completion_report/testers/task1/"
SCORE, MEASURES = (f"/ligature/tasks/pose_estimation/{name}" for name in ("score", "measures"))


def rows(status: DiagnosticStatus) -> dict[str, str]:
    return {row.key: row.value for row in status.values}


def turned(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Vector (3,) turned by a quaternion x y z w."""
    across = 2.0 * np.cross(q[:3], v)
    return v + q[3] * across + np.cross(q[:3], across)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Quaternion product, x y z w."""
    return np.append(a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3]), a[3] * b[3] - a[:3] @ b[:3])


def seen(name: str) -> tuple[np.ndarray, np.ndarray]:
    pose = rospy.wait_for_message(f"/ambf/env/{name}/State", RigidBodyState, TIMEOUT).pose
    p, q = pose.position, pose.orientation
    return np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])


class FirstTask(unittest.TestCase):
    def setUp(self) -> None:
        self.assertTrue(rospy.wait_for_message("/ligature/ready", Bool, COMPILING).data)
        self.scores: list[DiagnosticStatus] = []
        rospy.Subscriber(SCORE, DiagnosticStatus, self.scores.append, queue_size=10)
        self.report = rospy.Publisher(REPORT, PoseStamped, queue_size=1)
        end = rospy.get_time() + COMPILING  # the judge's clock runs from the first state that it sees
        while float(rows(rospy.wait_for_message(MEASURES, DiagnosticStatus, COMPILING))["time"]) == 0.0:
            self.assertLess(rospy.get_time(), end, "the judge's clock stands")

    def judged(self, position: np.ndarray, q: np.ndarray) -> dict[str, str]:
        """The score for a report of the needle's pose in the camera's frame."""
        end = rospy.get_time() + COMPILING
        while self.report.get_num_connections() == 0:
            self.assertLess(rospy.get_time(), end, "nobody judges")
            rospy.sleep(0.05)
        before, end = len(self.scores), rospy.get_time() + TIMEOUT
        message = PoseStamped(pose=Pose(Point(*position), Quaternion(*q)))
        message.header.frame_id = "CameraFrame"
        self.report.publish(message)
        while len(self.scores) == before:
            self.assertLess(rospy.get_time(), end, "no score")
            rospy.sleep(0.02)
        self.assertEqual(self.scores[-1].level, DiagnosticStatus.OK)
        self.assertEqual(self.scores[-1].hardware_id, "testers")
        return rows(self.scores[-1])

    def test_from_launch_file_to_score(self) -> None:
        (camera, camera_q), (needle, needle_q) = seen("CameraFrame"), seen("Needle")
        back = camera_q * [-1, -1, -1, 1]
        position, q = turned(back, needle - camera), product(back, needle_q)
        exact = self.judged(position, q)
        self.assertEqual(set(exact), {"success", "completion_time", "E_base", "E_mid", "E_tip", "total"})
        self.assertLess(float(exact["total"]), 3e-4)
        self.assertGreater(float(exact["completion_time"]), 0.0)
        off = self.judged(position + [0.003, 0.0, 0.0], q)
        for point in ("E_base", "E_mid", "E_tip"):
            self.assertAlmostEqual(float(off[point]), 0.003, delta=2e-4)


if __name__ == "__main__":
    rospy.init_node("score_test")
    rostest.rosrun("ligature", "score", FirstTask)
