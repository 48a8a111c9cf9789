#!/usr/bin/python3
"""Lifts the needle by a pose command; the simulator advances when the test asks for it, and not otherwise."""

import unittest

import rospy
import rostest
from ambf_msgs.msg import RigidBodyCmd, RigidBodyState, WorldCmd, WorldState
from std_msgs.msg import Bool

TIMEOUT = 120.0
COMPILING = 900.0
"""Seconds for the first state: the first start of a machine compiles."""
NEEDLE = "/ambf/env/phantom/Needle"
STEPS = 10
"""Updates between two edges of the clock."""


class World:
    """Steps the world by the edges of a clock; the newest state is in ``state``."""

    def __init__(self):
        self.state, self._clock = None, False
        self._command = rospy.Publisher("/ambf/env/World/Command", WorldCmd, queue_size=1)
        rospy.Subscriber("/ambf/env/World/State", WorldState, self._take)

    def _take(self, message):
        self.state = message

    def throttle(self, on=True):
        """Hold the world, which runs on by itself when it hears nothing for half a second, or let it run."""
        message = WorldCmd(enable_step_throttling=on, step_clock=self._clock, n_skip_steps=STEPS)
        while self._command.get_num_connections() == 0:
            rospy.sleep(0.01)
        self._command.publish(message)

    def step(self):
        """Advance by `STEPS` updates, and wait until that was done."""
        before = self.state.sim_step
        self._clock = not self._clock
        self.throttle()
        while self.state.sim_step < before + STEPS:
            rospy.sleep(0.001)

    def rest(self):
        """Wait until nothing is simulated any more; the step at which the world rests."""
        step = None
        while self.state is None or self.state.sim_step != step:
            step = None if self.state is None else self.state.sim_step
            for _ in range(10):
                self.throttle()
                rospy.sleep(0.1)
        return step


class Objects(unittest.TestCase):
    def setUp(self):
        self.assertTrue(rospy.wait_for_message("/ligature/ready", Bool, COMPILING).data)

    def test_a_needle_goes_where_it_is_commanded_step_by_step(self):
        world, command = World(), rospy.Publisher(f"{NEEDLE}/Command", RigidBodyCmd, queue_size=1)
        pose = rospy.wait_for_message(f"{NEEDLE}/State", RigidBodyState, TIMEOUT).pose
        goal = RigidBodyCmd(cartesian_cmd_type=RigidBodyCmd.TYPE_POSITION, pose=pose)
        goal.pose.position.z += 0.03
        start = world.rest()
        for _ in range(100):
            command.publish(goal)
            world.step()
        held = rospy.wait_for_message(f"{NEEDLE}/State", RigidBodyState, TIMEOUT)
        self.assertAlmostEqual(held.pose.position.z, goal.pose.position.z, delta=2e-3)
        self.assertEqual(world.rest(), start + 100 * STEPS, "nobody else steps")
        world.throttle(False)


if __name__ == "__main__":
    rospy.init_node("objects_test")
    rostest.rosrun("ligature", "objects", Objects)
