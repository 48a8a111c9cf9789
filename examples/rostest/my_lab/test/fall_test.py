#!/usr/bin/python3
"""A ball falls as far as Galilei says in the steps that the test makes, and not at all between them."""

import unittest

import rospy
import rostest
from ambf_msgs.msg import RigidBodyState, WorldCmd, WorldState
from std_msgs.msg import Bool

COMPILING = 900.0
"""Seconds for the first state: the first start of a machine compiles."""
STEPS, EDGES, RATE = 10, 20, 500.0
"""Updates between two edges of the clock, edges, updates a simulated second."""


class Fall(unittest.TestCase):
    def setUp(self):
        self.assertTrue(rospy.wait_for_message("/ligature/ready", Bool, COMPILING).data)
        self.world = self.ball = None
        self.clock = False
        self.command = rospy.Publisher("/ambf/env/World/Command", WorldCmd, queue_size=1)
        rospy.Subscriber("/ambf/env/World/State", WorldState, lambda m: setattr(self, "world", m))
        rospy.Subscriber("/ambf/env/Ball/State", RigidBodyState, lambda m: setattr(self, "ball", m))
        self.wait(lambda: self.world and self.ball and self.command.get_num_connections())

    def wait(self, condition):
        end = rospy.get_time() + 60.0
        while not condition():
            self.assertLess(rospy.get_time(), end, "the simulator does not answer")
            rospy.sleep(0.001)

    def throttle(self):
        """Hold the world, which runs on by itself when it hears nothing for half a second."""
        self.command.publish(WorldCmd(enable_step_throttling=True, step_clock=self.clock, n_skip_steps=STEPS))

    def edge(self):
        """Advance by `STEPS` updates."""
        before = self.world.sim_step
        self.clock = not self.clock
        self.throttle()
        self.wait(lambda: self.world.sim_step >= before + STEPS)

    def rest(self):
        """Wait until nothing is simulated any more; the step at which the world rests."""
        step = None
        while self.world.sim_step != step:
            step = self.world.sim_step
            for _ in range(10):
                self.throttle()
                rospy.sleep(0.1)
        return step

    def test_a_ball_falls_in_the_steps_of_the_test(self):
        self.edge()
        first, start = self.rest(), self.ball
        for _ in range(EDGES):
            self.edge()
        self.assertEqual(self.rest() - first, STEPS * EDGES, "the world waits for the test")
        time = (self.ball.sim_step - start.sim_step) / RATE
        fallen = start.pose.position.z + start.twist.linear.z * time - self.ball.pose.position.z
        self.assertAlmostEqual(fallen, 0.5 * 9.81 * time**2, delta=0.01)


if __name__ == "__main__":
    rospy.init_node("fall")
    rostest.rosrun("my_lab", "fall", Fall)
