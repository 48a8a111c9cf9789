"""A master on which another program left ``/use_sim_time``: the run keeps to the wall clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.ros.conftest import BIN, SMALL, Listener, Program
from tests.waiting import until

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def simulator(start: Callable[..., Program], node: Any) -> Iterator[Program]:
    import rosgraph

    master = rosgraph.Master("/ligature_tests")
    master.setParam("/use_sim_time", True)
    try:
        program = start(BIN / "ligature", "run", SMALL, "-p", "200", "--no-cameras")
        program.wait_for("first state published", 300.0)
        yield program
    finally:
        master.deleteParam("/use_sim_time")


@pytest.mark.parametrize("clock", [None, 100.0, 50.0, 4e9], ids=["silent", "running", "set back", "in the future"])
def test_states_are_stamped_by_the_wall_clock(simulator: Program, node: Any, clock: float | None) -> None:
    from crtk_msgs.msg import OperatingState
    from rosgraph_msgs.msg import Clock
    from sensor_msgs.msg import JointState

    states = Listener(node, "/PSM1/operating_state", OperatingState)
    joints = Listener(node, "/PSM1/measured_js", JointState)
    publisher = None if clock is None else node.Publisher("/clock", Clock, queue_size=1, latch=True)
    try:
        if publisher is not None:
            publisher.publish(Clock(node.Time.from_sec(clock)))
        for topic in (states, joints):
            for _ in range(3):
                topic.wait()
                topic.messages.clear()
                until(lambda topic=topic: topic.messages, "a message of the run", 20.0)
                assert abs(topic.messages[-1].header.stamp.to_sec() - time.time()) < 5.0
    finally:
        if publisher is not None:
            publisher.unregister()


def test_every_rejection_is_reported_though_no_clock_runs(simulator: Program, node: Any) -> None:
    """Their pauses are counted on a clock that runs."""
    from sensor_msgs.msg import JointState
    from std_msgs.msg import String

    move = node.Publisher("/PSM1/move_jp", JointState, queue_size=10)
    warnings = Listener(node, "/PSM1/warning", String)
    until(lambda: move.get_num_connections(), "the run listens", 20.0)

    def warned(times: int) -> bool:
        """Whether the run has reported so many rejections, one of which it is given another time."""
        move.publish(JointState(position=[0.0] * 6))
        return len(warnings.messages) >= times

    until(lambda: warned(1), "a warning that the arm is not ready", 20.0)
    until(lambda: warned(2), "another one after the pause", 20.0, every=0.2)
    assert {m.data for m in warnings.messages} == {"move_jp: PSM1 is DISABLED; arm not ready: send 'enable'"}
    logged = "/PSM1: move_jp: PSM1 is DISABLED"
    until(lambda: sum(logged in line for line in simulator.lines) >= 2, "both in the log", 20.0)


def test_the_run_reports_what_waits_for_a_clock(simulator: Program) -> None:
    simulator.wait_for("/use_sim_time is true: stamps of this run are of the wall clock", 30.0)
