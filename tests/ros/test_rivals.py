"""Real masters and a real console on the simulator's ROS master: what they publish, the simulated ones leave to them."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.ros.conftest import BIN, Program
from tests.waiting import until

pytestmark = pytest.mark.ros

REAL = "/dvrk_console"
FIVE_MINUTES = pytest.param(300.0, marks=[pytest.mark.slow, pytest.mark.timeout(600)], id="five-minutes")
"""The experiment of docs/benchmarks.md: `python -m pytest -s tests/ros/test_rivals.py -k five-minutes`."""

CONFIG = """
camera: ECM
enabled: false
devices:
  MTMR: {kind: mtm}
pairs: {MTMR: [PSM1]}
"""

LISTENER = """
import sys, time
import rospy
rospy.init_node("listener", anonymous=True, disable_signals=True)
heard = []
topics = sys.argv[2:]
for topic in topics:
    rospy.Subscriber(
        topic, rospy.AnyMsg,
        lambda m, topic=topic: heard.append((time.monotonic(), topic, m._connection_header["callerid"])),
        queue_size=1000, tcp_nodelay=True,
    )
print("listening", flush=True)
end, complete = time.monotonic() + float(sys.argv[1]), False
while time.monotonic() < end:
    time.sleep(0.05)
    if not complete and {topic for _, topic, _ in list(heard)} >= {topic for topic in topics if "measured" in topic}:
        complete = True
        print("every arm was heard", flush=True)
for at, topic, who in heard:
    print("heard", at, topic, who, flush=True)
print("done", flush=True)
"""

TOPICS = [
    "/MTMR/measured_cp", "/MTMR/setpoint_cp", "/MTMR/measured_js", "/MTMR/gripper/measured_js", "/MTMR/operating_state",
    "/MTMR/measured_cv", "/console/teleop/enabled", "/system/volume",
]  # fmt: skip
OURS = ["/MTML/measured_cp", "/PSM1/measured_cp", "/PSM1/operating_state"]


def real_console(begin: Callable[..., Program], *arms: str) -> Program:
    console = begin(sys.executable, "-m", "tests.ros.real_console", *arms)
    console.wait_for("ready")
    return console


def simulator(begin: Callable[..., Program], scene: Path, *options: str) -> Program:
    program = begin(BIN / "ligature", "run", scene, "-p", "500", "--no-cameras", *options)
    program.wait_for("first state published")
    return program


def who_publishes(begin: Callable[..., Program], seconds: float) -> list[tuple[float, str, str]]:
    """Every message of `TOPICS` and `OURS` that another program hears: when, where, of whom."""
    listener = begin(sys.executable, "-c", LISTENER, seconds, *TOPICS, *OURS)
    listener.wait_for("done", seconds + 60.0)
    return [
        (float(at), topic, who)
        for at, topic, who in (line.split()[1:] for line in listener.lines if line.startswith("heard"))
    ]


@pytest.mark.parametrize("seconds", [6.0, FIVE_MINUTES])
def test_of_arms_that_are_there_already_no_message_is_ours(
    begin: Callable[..., Program], arms_scene: Path, seconds: float
) -> None:
    real_console(begin, "MTMR")
    program = simulator(begin, arms_scene)
    heard = who_publishes(begin, seconds)
    counts = Counter((topic, who) for _, topic, who in heard)
    sys.stdout.write(
        "\n".join(f"{topic:28} {who:14} {count:7d}" for (topic, who), count in sorted(counts.items())) + "\n"
    )
    senders = {topic: {who for _, where, who in heard if where == topic} for topic in TOPICS + OURS}
    assert {topic: who for topic, who in senders.items() if topic in TOPICS} == dict.fromkeys(TOPICS, {REAL})
    assert {topic: who for topic, who in senders.items() if topic in OURS} == dict.fromkeys(OURS, {"/ligature"})
    assert sum(where == "/MTMR/measured_cp" for _, where, _ in heard) > 100 * seconds
    assert "MTMR: node /dvrk_console publishes /MTMR/" in program.output
    assert "the simulated MTMR stays silent" in program.output
    assert "console: node /dvrk_console publishes" in program.output
    assert "MTML: node" not in program.output
    ready = next(line for line in program.lines if "ros ready" in line)
    assert "MTML" in ready and "MTMR" not in ready


def test_an_arm_falls_silent_when_a_real_one_appears(begin: Callable[..., Program], arms_scene: Path) -> None:
    program = simulator(begin, arms_scene)
    listener = begin(sys.executable, "-c", LISTENER, 12.0, *TOPICS, *OURS)
    listener.wait_for("every arm was heard")
    real_console(begin, "MTMR")
    program.wait_for("the simulated MTMR stays silent", 5.0)
    listener.wait_for("done", 60.0)
    heard = [line.split()[1:] for line in listener.lines if line.startswith("heard")]
    for topic in TOPICS:
        found = [(float(at), who) for at, where, who in heard if where == topic]
        first = min(at for at, who in found if who == REAL)
        late = [at - first for at, who in found if who != REAL and at > first + 0.5]
        assert not late, f"{topic}: {len(late)} of ours came up to {max(late):.2f} s after the first of the console"
    ours = [float(at) for at, where, who in heard if where == "/PSM1/measured_cp"]
    assert max(np.diff(ours)) < 1.0, "other arms went on meanwhile"
    assert {who for _, where, who in heard if where in OURS} == {"/ligature"}


def test_a_console_that_was_killed_is_none(begin: Callable[..., Program], arms_scene: Path) -> None:
    console = real_console(begin, "MTMR")
    console.process.kill()
    console.process.wait()
    program = simulator(begin, arms_scene)
    senders = {who for _, where, who in who_publishes(begin, 2.0) if where == "/MTMR/measured_cp"}
    assert senders == {"/ligature"}
    assert "stays silent" not in program.output


def test_services_of_a_real_arm_stay_its_own(begin: Callable[..., Program], arms_scene: Path, env: Any) -> None:
    import rosgraph

    real_console(begin, "MTMR")
    simulator(begin, arms_scene)
    _, subscribed, services = rosgraph.masterapi.Master("/look", env["ROS_MASTER_URI"]).getSystemState()
    assert dict(services)["/MTMR/operating_state"] == [REAL]
    assert "/ligature" not in dict(subscribed)["/MTMR/state_command"]
    assert dict(services)["/MTML/operating_state"] == ["/ligature"]


TELEOPERATE = """
import json, sys, time
import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Bool, String

rospy.init_node("operator", anonymous=True, disable_signals=True)
seen = {}
counts = {}
def keep(name, value):
    counts[name] = counts.get(name, 0) + 1
    seen[name] = value
rospy.Subscriber("/MTMR_PSM1/following", Bool, lambda m: keep("following", m.data))
rospy.Subscriber("/MTMR_PSM1/status", String, lambda m: seen.setdefault("status", []).append(m.data))
rospy.Subscriber("/MTMR/measured_cp", PoseStamped, lambda m: keep("hand", m.pose), tcp_nodelay=True)
rospy.Subscriber("/PSM1/setpoint_cp", PoseStamped, lambda m: keep("tip", m.pose), tcp_nodelay=True)
enable = rospy.Publisher("/console/teleop/enable", Bool, queue_size=1)
hand = rospy.Publisher("/MTMR/hand", PoseStamped, queue_size=1, tcp_nodelay=True)
def until(condition, what, every=0.01):
    end = time.monotonic() + 40
    while not condition():
        if time.monotonic() > end:
            sys.exit(f"{what}: {seen.get('status')}")
        time.sleep(every)
until(hand.get_num_connections, "connections")
def follows():
    # again until it does: how many others hear it does not say whether teleoperation is among them
    enable.publish(True)
    return seen.get("following")
until(follows, "following", 0.2)
time.sleep(0.5)
p = lambda pose: np.array([pose.position.x, pose.position.y, pose.position.z])
start, tip, pose = p(seen["hand"]), p(seen["tip"]), seen["hand"]
for k in range(1, 201):
    message = PoseStamped()
    message.pose.orientation = pose.orientation
    message.pose.position.x, message.pose.position.y, message.pose.position.z = start + [0.05 * k / 200, 0, 0]
    hand.publish(message)
    time.sleep(0.005)
try:
    until(lambda: abs(np.linalg.norm(p(seen["tip"]) - tip) - 0.01) < 1e-4, "the tip follows")
except SystemExit as error:
    print(error)
print("moved", float(np.linalg.norm(p(seen["hand"]) - start)), float(np.linalg.norm(p(seen["tip"]) - tip)))
print("status", json.dumps(seen["status"]), counts)
"""


def test_teleoperation_by_the_steps_of_the_docs(
    begin: Callable[..., Program], arms_scene: Path, tmp_path: Path
) -> None:
    """The steps of docs/teleoperation.md, *Master arms*: one master, the console beside the simulator, a file."""
    real_console(begin, "MTML", "MTMR")
    simulator(begin, arms_scene, "--no-masters")
    file = tmp_path / "teleop.yaml"
    file.write_text(CONFIG)
    teleop = begin(BIN / "ligature", "teleop", file, "--timeout", 2)  # a busy machine keeps messages waiting
    teleop.wait_for("driving:")
    operator = begin(sys.executable, "-c", TELEOPERATE)
    until(lambda: operator.process.poll() is not None, "the operator is done", 90.0)
    assert operator.process.returncode == 0, operator.output + teleop.output
    line = next(line for line in operator.lines if line.startswith("moved"))
    moved, followed = map(float, line.split()[1:])
    assert moved == pytest.approx(0.05, abs=1e-3)
    assert followed == pytest.approx(0.2 * moved, rel=0.02), operator.output + teleop.output
    assert "leapt" not in operator.output + teleop.output


def test_arms_are_left_out_by_name_and_kind(begin: Callable[..., Program], arms_scene: Path, env: Any) -> None:
    import rosgraph

    def topics() -> set[str]:
        published, _, _ = rosgraph.masterapi.Master("/look", env["ROS_MASTER_URI"]).getSystemState()
        return {topic.split("/")[1] for topic, _ in published if topic.endswith("/measured_js")}

    program = simulator(begin, arms_scene, "--only", "PSM1, ECM")
    assert topics() == {"PSM1", "ECM", "SUJ"}
    assert program.end() == 0
    program = simulator(begin, arms_scene, "--no-masters")
    assert topics() == {"PSM1", "PSM2", "ECM", "SUJ"}
    assert program.end() == 0
    program = begin(BIN / "ligature", "run", arms_scene, "--only", "PSM7")
    assert program.process.wait(30) == 2
    assert "the scene has no arm 'PSM7'; it has PSM1, PSM2, ECM, MTML, MTMR" in program.output
