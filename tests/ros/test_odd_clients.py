"""Clients that are odd but legal: wrong types, latched, many, forgetful, with odd services' arguments and parameters.

What they send is generated, for topics, services and parameters that are asked of the master. Afterwards the run answers
as before, its poses are finite, and its scene rests. Run it alone: what a process has advertised with a wrong type, rospy
offers again to every later test of that process, whose subscribers then wait for messages in vain.
"""

from __future__ import annotations

import random
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

from tests.ros.conftest import BIN, SMALL, Program
from tests.ros.test_flood import answers, commands, distinct, filled
from tests.waiting import stays, until

pytestmark = [pytest.mark.ros, pytest.mark.slow]
ODD: tuple[Any, ...] = (
    -1, 0, 1e308, -5e-324, 2**31 - 1, "", "nan", "ünïcødé 🪡", "x" * 100_000, True, [], [1, "a", {}], [[[]]], {"a": {}},
    "PERSPECTIVE", "/ambf/env/nothing",
)  # fmt: skip
RECONNECTIONS, PUBLISHERS, CALLS = 100, 30, 12


@pytest.fixture(scope="module")
def simulator(start: Callable[..., Program], node: Any) -> Program:
    program = start(BIN / "ligature", "run", SMALL, "-p", "200")
    program.wait_for("first state published", 300.0)
    return program


def unharmed(program: Program, node: Any, pids: dict[str, int]) -> None:
    """The run lives, both arms home and have finite poses, the needle rests, and nothing was raised."""
    from ambf_msgs.msg import RigidBodyState
    from geometry_msgs.msg import PoseStamped

    assert program.children() == pids, program.output
    assert "Traceback" not in program.output, program.output
    for arm in ("PSM1", "PSM2"):
        answers(node, arm)
        homes(node, arm)
        pose = node.wait_for_message(f"/{arm}/measured_cp", PoseStamped, 20.0).pose
        assert np.isfinite([pose.position.x, pose.position.y, pose.position.z, pose.orientation.w]).all()
    speeds: list[float] = []

    def note(message: Any) -> None:
        v = message.twist.linear
        speeds.append(float(np.linalg.norm([v.x, v.y, v.z])))

    needle = node.Subscriber("/ambf/env/phantom/Needle/State", RigidBodyState, note)
    until(lambda: len(speeds) > 20 and max(speeds[-20:]) < 0.05, lambda: f"the needle rests: {speeds[-5:]}", 60.0)
    needle.unregister()


def homes(node: Any, arm: str) -> None:
    """An arm homes, once its instrument is there and its trajectories have their speed again."""
    from crtk_msgs.msg import OperatingState, StringStamped
    from std_msgs.msg import Bool, Float64, String

    states: list[Any] = []
    complaints: list[str] = []
    listeners = [node.Subscriber(f"/{arm}/operating_state", OperatingState, states.append)]
    listeners += [
        node.Subscriber(f"/{arm}/{kind}", String, lambda m: complaints.append(m.data)) for kind in ("error", "warning")
    ]
    orders = [
        ("emulate_adapter_present", Bool(True)), ("emulate_tool_present", Bool(True)),
        ("trajectory_j/set_ratio", Float64(1.0)), ("state_command", StringStamped(string="home")),
    ]  # fmt: skip
    publishers = [node.Publisher(f"/{arm}/{name}", type(message), queue_size=1) for name, message in orders]
    for publisher, (name, message) in zip(publishers, orders, strict=True):
        until(publisher.get_num_connections, f"{arm} listens to {name}")
        publisher.publish(message)
    until(
        lambda: states and states[-1].is_homed and not states[-1].is_busy,
        lambda: f"{arm} homes: {states[-1:]}, {complaints[-5:]}", 60.0,
    )  # fmt: skip
    for ours in (*listeners, *publishers):
        ours.unregister()


def test_topics_that_others_advertise_with_another_type_are_left_alone(simulator: Program, node: Any) -> None:
    """`rostopic pub` with the wrong type, latched or not: refused at the connection, and the right type goes on."""
    from std_msgs.msg import Float64MultiArray, String

    pids, topics, rng = simulator.children(), distinct(commands(node)), random.Random(1)
    publishers = []
    for topic, right in topics.items():
        wrong = Float64MultiArray if right is String else String
        publishers.append(node.Publisher(topic, wrong, queue_size=1, latch=rng.random() < 0.5))
        publishers[-1].publish(filled(wrong, rng))
    heard = [node.Subscriber(topic, String) for topic in ("/PSM1/measured_js", "/ambf/env/World/State")]
    stays(
        lambda: not any(publisher.get_num_connections() for publisher in publishers), "the wrong type is refused", 1.0
    )
    for ours in (*publishers, *heard):
        ours.unregister()
    for topic, right in topics.items():  # the master keeps the type of the last who advertised it
        node.Publisher(topic, right, queue_size=1).unregister()
    unharmed(simulator, node, pids)


def test_many_latched_publishers_that_come_and_go_leave_the_arm_to_its_client(simulator: Program, node: Any) -> None:
    pids, rng = simulator.children(), random.Random(2)
    topics = distinct(commands(node))
    chosen = rng.sample(sorted(topics), PUBLISHERS)
    publishers = [node.Publisher(topic, topics[topic], queue_size=1, latch=True) for topic in chosen]
    for publisher, topic in zip(publishers, chosen, strict=True):
        publisher.publish(filled(topics[topic], rng))
    for publisher in publishers:
        until(publisher.get_num_connections, "a latched publisher is connected", 60.0)
        publisher.unregister()
    topic = "/PSM1/servo_jp"
    for _ in range(RECONNECTIONS):
        publisher = node.Publisher(topic, topics.get(topic) or commands(node)[topic], queue_size=1)
        publisher.publish(filled(publisher.data_class, rng))
        publisher.unregister()
    unharmed(simulator, node, pids)


def test_services_take_any_arguments(simulator: Program, node: Any) -> None:
    import rosgraph
    import rosservice

    pids, rng = simulator.children(), random.Random(3)
    _, _, services = rosgraph.Master("/odd").getSystemState()
    ours = [name for name, nodes in services if "/ligature" in nodes and not name.endswith(("loggers", "logger_level"))]
    assert len(ours) > 5
    for name in ours:
        class_ = rosservice.get_service_class_by_name(name)
        call = node.ServiceProxy(name, class_)
        for number in range(CALLS):
            with suppress(node.ServiceException):
                call(filled(class_._request_class, rng, long=number == 0))
    if "/ligature/pause" in ours:
        from std_srvs.srv import SetBool

        node.ServiceProxy("/ligature/pause", SetBool)(False)
    unharmed(simulator, node, pids)


def test_parameters_may_have_any_value(simulator: Program, node: Any) -> None:
    pids, rng = simulator.children(), random.Random(4)
    names = [name for name in node.get_param_names() if name.startswith(("/ambf", "/ligature"))]
    before = {name: node.get_param(name) for name in names}
    assert len(before) > 10
    try:
        for name in names:
            node.set_param(name, rng.choice(ODD))
        unharmed(simulator, node, pids)
    finally:
        for name, value in before.items():
            node.set_param(name, value)


def test_clients_on_many_threads_send_odd_messages_at_once(simulator: Program, node: Any) -> None:
    pids, topics = simulator.children(), distinct(commands(node))
    publishers = {topic: node.Publisher(topic, class_, queue_size=10) for topic, class_ in topics.items()}
    for topic, publisher in publishers.items():
        until(publisher.get_num_connections, f"a connection to '{topic}'", 120.0)

    def send(seed: int) -> None:
        rng = random.Random(seed)
        for _ in range(150):
            topic = rng.choice(sorted(topics))
            publishers[topic].publish(filled(topics[topic], rng))

    threads = [threading.Thread(target=send, args=(seed,)) for seed in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for publisher in publishers.values():
        publisher.unregister()
    unharmed(simulator, node, pids)
