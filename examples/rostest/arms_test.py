#!/usr/bin/python3
"""Powers and homes an arm, moves its joints, and steps its tip: CRTK's messages alone."""

import unittest

import rospy
import rostest
from crtk_msgs.msg import OperatingState, StringStamped
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

TIMEOUT = 120.0
COMPILING = 900.0
"""Seconds for the first state: the first start of a machine compiles."""
ARM = "/PSM1"


class Arm:
    """The newest readings of an arm, and its commands."""

    def __init__(self):
        self.state = self.joints = self.tip = None
        rospy.Subscriber(f"{ARM}/operating_state", OperatingState, lambda m: setattr(self, "state", m))
        rospy.Subscriber(f"{ARM}/measured_js", JointState, lambda m: setattr(self, "joints", m))
        rospy.Subscriber(f"{ARM}/measured_cp", PoseStamped, lambda m: setattr(self, "tip", m))
        self.commands = {
            name: rospy.Publisher(f"{ARM}/{name}", kind, queue_size=1)
            for name, kind in (("state_command", StringStamped), ("move_jp", JointState), ("move_cp", PoseStamped))
        }

    def send(self, name, message):
        """Send a command once somebody listens."""
        publisher = self.commands[name]
        while publisher.get_num_connections() == 0:
            rospy.sleep(0.01)
        publisher.publish(message)


def until(condition, seconds=TIMEOUT):
    """Wait for a condition; whether it came."""
    end = rospy.get_time() + seconds
    while not condition() and rospy.get_time() < end:
        rospy.sleep(0.01)
    return condition()


class Arms(unittest.TestCase):
    def test_an_arm_homes_moves_and_steps(self):
        self.assertTrue(rospy.wait_for_message("/ligature/ready", Bool, COMPILING).data)
        arm = Arm()
        self.assertTrue(until(lambda: arm.state and arm.joints and arm.tip))
        for command, done in (("enable", lambda: arm.state.state == "ENABLED"), ("home", lambda: arm.state.is_homed)):
            arm.send("state_command", StringStamped(string=command))
            self.assertTrue(until(done), f"{command}: {arm.state}")
        goal = [0.1, -0.1, 0.12, 0.2, 0.1, -0.1]
        arm.send("move_jp", JointState(position=goal))
        self.assertTrue(until(lambda: max(abs(a - b) for a, b in zip(arm.joints.position, goal)) < 1e-3))
        self.assertTrue(until(lambda: not arm.state.is_busy))
        step = PoseStamped(pose=arm.tip.pose)
        step.pose.position.z += 0.01
        wanted = step.pose.position.z
        arm.send("move_cp", step)
        self.assertTrue(until(lambda: abs(arm.tip.pose.position.z - wanted) < 5e-4))


if __name__ == "__main__":
    rospy.init_node("arms_test")
    rostest.rosrun("ligature", "arms", Arms)
