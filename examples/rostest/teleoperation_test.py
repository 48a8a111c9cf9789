#!/usr/bin/python3
"""Pushes the stick of a gamepad: the arm that it drives moves, and stays when the stick is let go."""

import unittest

import rospy
import rostest
from crtk_msgs.msg import OperatingState
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool

TIMEOUT = 200.0
COMPILING = 900.0
"""Seconds for the first state: the first start of a machine compiles."""
ARM = "/PSM1"


class Teleoperation(unittest.TestCase):
    def setUp(self):
        self.assertTrue(rospy.wait_for_message("/ligature/ready", Bool, COMPILING).data)
        self.axes, self.tip, self.homed = [0.0] * 8, None, False
        self.stick = rospy.Publisher("/joy", Joy, queue_size=1)
        rospy.Subscriber(f"{ARM}/measured_cp", PoseStamped, lambda m: setattr(self, "tip", m.pose.position))
        rospy.Subscriber(f"{ARM}/operating_state", OperatingState, lambda m: setattr(self, "homed", m.is_homed))
        rospy.Timer(rospy.Duration(0.02), lambda _: self.stick.publish(Joy(axes=self.axes, buttons=[0] * 12)))

    def moved(self, start):
        return ((self.tip.x - start.x) ** 2 + (self.tip.y - start.y) ** 2 + (self.tip.z - start.z) ** 2) ** 0.5

    def until(self, condition, what):
        end = rospy.get_time() + TIMEOUT
        while not condition():
            self.assertLess(rospy.get_time(), end, what)
            rospy.sleep(0.02)

    def test_the_arm_follows_the_stick_and_stays_without(self):
        self.until(lambda: self.tip is not None and self.homed, "teleoperation powers and homes its arm")
        start = self.tip
        self.axes = [1.0] + [0.0] * 7
        self.until(lambda: self.moved(start) > 0.005, "the arm follows")
        self.axes = [0.0] * 8
        rospy.sleep(1.0)
        still = self.tip
        rospy.sleep(0.5)
        self.assertLess(self.moved(still), 5e-4, "the stick was let go")


if __name__ == "__main__":
    rospy.init_node("teleoperation_test")
    rostest.rosrun("ligature", "teleoperation", Teleoperation)
