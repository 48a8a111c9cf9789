"""A run on a ROS master of others, where killed nodes are still registered: under its names, for its topics."""

from __future__ import annotations

import os
import random
import signal
import socket
import sys
import time
from collections.abc import Callable
from typing import Any
from xmlrpc.client import ServerProxy

import pytest
from ligature.ros.registrations import NameTaken, claim, dead_neighbours, lives, registrations
from ligature.ros.start import address_problem

from tests.ros.conftest import BIN, SMALL, Program, free_port
from tests.waiting import stays, until

pytestmark = pytest.mark.ros

OURS = ("/ligature", "/ligature_rivals")
OTHERS = ("/ambf", "/rqt_gui", "/dvrk_console")
PUBLISHED = {
    "/ambf/env/World/State": "ambf_msgs/WorldState",
    "/ambf/env/phantom/Needle/State": "ambf_msgs/RigidBodyState",
    "/PSM1/measured_cp": "geometry_msgs/PoseStamped",
    "/PSM1/operating_state": "crtk_msgs/operating_state",
    "/scene/of/before/State": "ambf_msgs/RigidBodyState",
}
SUBSCRIBED = ("/ambf/env/World/Command", "/PSM2/servo_cp", "/scene/of/before/Command", "/PSM1/measured_js")
SERVICES = ("query_cp", "local/query_cp")
"""Below the name of a node: of a service that two nodes register the master keeps the first one in part."""

INNOCENT = """
import rospy, time
from std_msgs.msg import String
rospy.init_node("innocent", disable_signals=True)
rospy.Publisher("/chatter", String, queue_size=1)
print("ready", rospy.get_node_uri(), flush=True)
while not rospy.is_shutdown(): time.sleep(0.05)
"""


def ask(env: dict[str, str], method: str, *arguments: Any) -> Any:
    code, text, value = getattr(ServerProxy(env["ROS_MASTER_URI"]), method)(*arguments)  # type: ignore[misc]
    assert code == 1, text
    return value


def listed(env: dict[str, str], node: str) -> list[str]:
    """Topics that the master has of a node as published, then as subscribed, then its services."""
    return [name for kind in ask(env, "getSystemState", "/test") for name, nodes in kind if node in nodes]


def registered(env: dict[str, str], node: str) -> set[str]:
    """`listed`, each once."""
    return set(listed(env, node))


def haunt(env: dict[str, str], node: str, uri: str, rng: random.Random) -> None:
    """Register some topics and services of a node that is missing."""
    for topic in rng.sample(list(PUBLISHED), rng.randint(1, len(PUBLISHED))):
        ask(env, "registerPublisher", node, topic, PUBLISHED[topic], uri)
    for topic in rng.sample(SUBSCRIBED, rng.randint(0, len(SUBSCRIBED))):
        ask(env, "registerSubscriber", node, topic, "*", uri)
    for service in rng.sample(SERVICES, rng.randint(0, len(SERVICES))):
        ask(env, "registerService", node, f"{node}/{service}", "rosrpc://127.0.0.1:1", uri)


def started(begin: Callable[..., Program]) -> Program:
    program = begin(BIN / "ligature", "run", SMALL, "-p", "200")
    program.wait_for("first state published", 250.0)
    return program


def heard(env: dict[str, str], begin: Callable[..., Program], topic: str) -> None:
    """Wait for a message that another program gets."""
    echo = begin("/usr/bin/rostopic", "echo", "-n", "1", topic)
    until(lambda: "---" in echo.output, f"a message on {topic}; {echo.output}", 20.0)


def innocent(begin: Callable[..., Program]) -> tuple[Program, str]:
    """A living node of another name, and its address."""
    program = begin(sys.executable, "-c", INNOCENT)
    program.wait_for("ready")
    return program, program.lines[-1].split()[1]


@pytest.fixture
def asked(env: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    """This process asks the master of ``env``."""
    monkeypatch.setenv("ROS_MASTER_URI", env["ROS_MASTER_URI"])


@pytest.mark.usefixtures("asked")
def test_what_killed_nodes_left_is_removed_under_the_own_name_and_reported_under_others(
    env: dict[str, str], begin: Callable[..., Program]
) -> None:
    program, reused = innocent(begin)
    nobody = f"http://127.0.0.1:{free_port()}/"
    for seed in range(30):
        rng = random.Random(seed)
        own, other = ({node for node in names if rng.random() < 0.6} for names in (OURS, OTHERS))
        for node in (*own, *other):
            haunt(env, node, rng.choice((nobody, reused)), rng)
        expected = sum(len(listed(env, node)) for node in own)
        line = claim("/ligature")
        assert (f"({expected} topics and services) were removed" in line) if expected else line == "", seed
        assert not any(registered(env, node) for node in own)
        lines = dead_neighbours("/ligature", [*PUBLISHED, *SUBSCRIBED])
        assert len(lines) == len(other)
        for node in other:
            (line,) = (line for line in lines if line.startswith(f"node {node} does not answer"))
            shared = registered(env, node) & {*PUBLISHED, *SUBSCRIBED}
            assert f"for {len(shared)} topics of this run" in line
            assert registered(env, node), "what belongs to others stays"
            for held in registrations([node]):
                held.remove()
    stays(lambda: program.process.poll() is None, "who was given the address of a killed node is not shut down", 0.5)
    assert lives("/innocent") and not lives("/ligature")
    with pytest.raises(NameTaken, match="node /innocent at http"):
        claim("/innocent")


NODE = """
import resource
from ligature.ros.registrations import NameTaken
from ligature.ros.start import MOST_FILES, start_node
most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
resource.setrlimit(resource.RLIMIT_NOFILE, (256, most))
try:
    start_node("ligature")
except NameTaken as error:
    raise SystemExit(f"taken: {error}")
import rospy
allowed = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
print("ready", rospy.get_name(), "with", "all" if allowed == min(most, MOST_FILES) else allowed, "files", flush=True)
rospy.spin()
"""


def test_a_namespace_of_the_environment_hides_no_simulator(env: dict[str, str], begin: Callable[..., Program]) -> None:
    """ROS would have the second one end the first."""
    words = ["env", "ROS_NAMESPACE=lab/left", sys.executable, "-c", NODE]
    first = begin(*words)
    first.wait_for("ready /ligature with all files")  # most shells allow 1024, of which topics take 400
    assert "ROS_NAMESPACE 'lab/left' has no effect" in first.output
    second = begin(*words)
    until(lambda: second.process.poll() is not None, "the second one ends", 20.0)
    assert "taken: another simulator runs on this ROS master (node /ligature at" in second.output
    stays(lambda: first.process.poll() is None, "the first one goes on", 0.5)


@pytest.mark.parametrize(("host", "master", "why"), [
    ("127.0.0.1", "localhost", ""), ("localhost", "127.0.0.1", ""), ("::1", "127.0.0.1", ""),
    ("192.0.2.1", "127.0.0.1", "'192.0.2.1', which is not an address of this machine"),
    ("no such host", "127.0.0.1", "'no such host', which is unknown to this machine"), ("..", "localhost", "is unknown"),
    ("127.0.0.1", "192.0.2.1", "is known on this machine alone, but the ROS master is on 192.0.2.1"),
])  # fmt: skip
def test_an_address_that_others_may_not_reach_is_reported(host: str, master: str, why: str) -> None:
    brackets = f"[{host}]" if ":" in host else host
    problem = address_problem(f"http://{brackets}:40000/", f"http://{master}:11311")
    assert why in problem and bool(problem) is bool(why), problem


@pytest.mark.usefixtures("asked")
def test_a_node_that_takes_connections_and_never_answers_counts_as_killed(env: dict[str, str]) -> None:
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        uri = f"http://127.0.0.1:{silent.getsockname()[1]}/"
        ask(env, "registerPublisher", "/ligature", "/ambf/env/World/State", "ambf_msgs/WorldState", uri)
        begin = time.monotonic()
        assert "(1 topics and services)" in claim("/ligature")
        assert time.monotonic() - begin < 10.0


def test_a_run_starts_among_registrations_of_killed_nodes(env: dict[str, str], begin: Callable[..., Program]) -> None:
    program, reused = innocent(begin)
    rng = random.Random(1)
    for node in ("/ligature", "/ligature_rivals", "/ambf"):
        haunt(env, node, reused, rng)
    ask(env, "registerPublisher", "/dvrk_console", "/PSM1/measured_cp", "geometry_msgs/PoseStamped", reused)
    run = started(begin)
    assert "node /ligature was killed; " in run.output
    run.wait_for("node /ambf does not answer, but the ROS master still has it for", 60.0)
    assert "node /dvrk_console publishes" not in run.output, "a ghost has no precedence"
    assert "/PSM1/measured_cp" in registered(env, "/ligature")
    assert not any(name.startswith("/scene/of/before") for name in registered(env, "/ligature"))
    heard(env, begin, "/ambf/env/World/State")
    assert program.process.poll() is None


def test_a_run_follows_one_that_was_killed_on_a_master_that_goes_on(
    env: dict[str, str], begin: Callable[..., Program]
) -> None:
    first = started(begin)
    children = first.children()
    os.kill(first.process.pid, signal.SIGSTOP)  # so that it restarts nothing
    for pid in children.values():
        os.kill(pid, signal.SIGKILL)
    os.kill(first.process.pid, signal.SIGKILL)
    before = registered(env, "/ligature")
    assert len(before) > 50
    second = started(begin)
    assert "node /ligature was killed; " in second.output
    assert registered(env, "/ligature") >= before
    heard(env, begin, "/PSM1/measured_cp")
    assert "does not answer" not in second.output
