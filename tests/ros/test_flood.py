"""A flood on every topic that the simulator listens to: of every message class, with every content, and far too long.

The topics and their types are asked of the master, so that a new command is flooded too.
"""

from __future__ import annotations

import io
import os
import random
import struct
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest
from ligature.bus import Block
from ligature.bus.leftovers import FOLDER
from ligature.model.state import new_state

from tests.fuzz.commands import _floats
from tests.ros.conftest import BIN, SMALL, Program
from tests.waiting import until

pytestmark = pytest.mark.ros
FLOAT = (0.0, -0.0, 5e-324, 1e-5, 1.0, -1.0, 0.3, 1e3, -1e6, 1e12, 1.7e308, float("inf"), float("-inf"), float("nan"))
NAMES = ("", "map", "/PSM1_base", "jaw", "yaw", "ünïcødé 🪡", "a/../b", "\0")
WORDS = (*NAMES, "enable", "disable", "home", "unhome", "pause", "resume", "adopt", "\0", "é" * 90, "x" * 5000)
LENGTHS = (0, 1, 3, 4, 6, 7, 8, 40, 500)
SHORT, FLOOD = 800, 75_000
"""Messages of the short form, and of the long one over both scenes."""

LONG = 1_000_000
GROWTH = 60
"""Megabytes by which the ROS process may grow while it connects some 190 publishers and refuses 190 MB."""


def filled(class_: Any, rng: random.Random, long: bool = False) -> Any:
    """A message with random content, in all its fields; ``long`` ones are far beyond what is taken."""
    message = class_()
    for name, type_ in zip(message.__slots__, message._slot_types, strict=True):
        setattr(message, name, _value(getattr(message, name), type_, rng, long))
    return message


def _value(default: Any, type_: str, rng: random.Random, long: bool) -> Any:
    base, _, rest = type_.partition("[")
    if rest:
        if "/" in base:
            return default
        count = int(rest[:-1]) if rest != "]" else LONG // 8 if long else rng.choice(LENGTHS)
        return bytes(count) if base in ("uint8", "char") else [_value(0, base, rng, False) for _ in range(count)]
    if hasattr(default, "_slot_types"):
        return filled(type(default), rng, long)
    if base in ("time", "duration"):
        return type(default)(*rng.choice(((0, 0), (1, 0), (2**31 - 1, 999_999_999))))
    if base.startswith("float"):
        return rng.choice(FLOAT[:-4]) if base == "float32" else rng.choice(FLOAT)
    if base == "string":
        return "x" * LONG if long else rng.choice(WORDS)
    if base == "bool":
        return rng.random() < 0.5
    if base.startswith(("int", "uint")):
        return rng.choice((0, 1, 2, 127))
    return default


@pytest.fixture(scope="module")
def simulator(start: Callable[..., Program]) -> Iterator[Program]:
    program = start(BIN / "ligature", "run", SMALL, "-p", "200")
    program.wait_for("first state published", 300.0)
    yield program
    program.end(30.0)


def commands(node: Any) -> dict[str, Any]:
    """Topics that the simulator subscribes, with the classes of their messages."""
    import rosgraph
    import roslib.message

    master = rosgraph.Master("/flood")
    types = dict(master.getTopicTypes())
    _, subscribers, _ = master.getSystemState()
    heard = [topic for topic, nodes in subscribers if "/ligature" in nodes]
    return {topic: roslib.message.get_message_class(types[topic]) for topic in heard}


def megabytes(pid: int) -> float:
    fields = Path(f"/proc/{pid}/statm").read_text().split()
    return int(fields[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def distinct(topics: dict[str, Any]) -> dict[str, Any]:
    """One topic of each message class and verb: the objects of a kind take theirs by the same code."""
    kinds = {(topic.rpartition("/")[2], class_): topic for topic, class_ in sorted(topics.items(), reverse=True)}
    return {topic: topics[topic] for topic in sorted(kinds.values())}


def flood(program: Program, node: Any, topics: dict[str, Any], scene: Path, messages: int, most_growth: float) -> None:
    """Send ``messages`` in all to the topics and see that the run is alive, finite, bounded, and answers."""
    rng = random.Random(7)
    assert any(topic.endswith("/trajectory_j/set_ratio") for topic in topics)
    pids = program.children()
    before = megabytes(pids["ros_process"])
    publishers = {topic: node.Publisher(topic, class_, queue_size=1000) for topic, class_ in topics.items()}
    for topic, publisher in publishers.items():
        until(publisher.get_num_connections, f"a connection to '{topic}'", 120.0)
    for topic, publisher in publishers.items():
        for _ in range(max(1, messages // len(topics))):
            publisher.publish(filled(topics[topic], rng))
        publisher.publish(filled(topics[topic], rng, long=True))
    time.sleep(1.0)
    for publisher in publishers.values():
        publisher.unregister()
    after = megabytes(pids["ros_process"])
    sys.stdout.write(f"{messages} messages on {len(topics)} topics: {before:.0f} MB before, {after:.0f} MB after\n")
    assert program.children() == pids, program.output
    assert after < before + most_growth
    assert "bytes; the maximum is" in program.output
    loaded = ligature.load(scene)
    (bus,) = FOLDER.glob(f"ligature-{program.process.pid}-*")
    state = new_state(loaded)
    block = Block.attach(bus.name, state.dtype)
    try:
        # a world command of the flood may have stopped its clock; the watchdog lets it go on
        assert block.read(state)
        tick = int(state["tick"][0])
        until(lambda tick=tick: block.read(state) and int(state["tick"][0]) > tick, "the clock goes on")
        for name, values in _floats(state):
            assert np.isfinite(values).all(), f"{name} is not finite"
    finally:
        block.close()
    for arm in loaded.arms:
        answers(node, arm.name)


def answers(node: Any, arm: str) -> None:
    """An arm takes a state command, whatever was sent before."""
    from crtk_msgs.msg import OperatingState, StringStamped
    from std_msgs.msg import String

    states: list[str] = []
    reasons: list[str] = []
    complaints = [
        node.Subscriber(f"/{arm}/{kind}", String, lambda m: reasons.append(m.data)) for kind in ("error", "warning")
    ]
    listener = node.Subscriber(f"/{arm}/operating_state", OperatingState, lambda m: states.append(m.state))
    publisher = node.Publisher(f"/{arm}/state_command", StringStamped, queue_size=10)
    for word, wanted in (("disable", "DISABLED"), ("enable", "ENABLED")):
        deadline = time.monotonic() + 20.0
        while states[-1:] != [wanted]:
            assert time.monotonic() < deadline, (
                f"{arm} does not answer '{word}': {states[-3:]} of {len(states)}, {reasons[-5:]}, {publisher.get_num_connections()} connections"
            )
            publisher.publish(StringStamped(string=word))
            time.sleep(0.2)
    for ours in (listener, publisher, *complaints):
        ours.unregister()


def test_nothing_that_a_client_sends_ends_the_run_or_fills_its_memory(simulator: Program, node: Any) -> None:
    topics = commands(node)
    assert len(topics) > 150 and all(topics.values())
    flood(simulator, node, distinct(topics), SMALL, SHORT, GROWTH)


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", ["suturing_small", "suturing"])
def test_seventy_five_thousand_messages_on_both_scenes(start: Callable[..., Program], node: Any, name: str) -> None:
    scene = SMALL.parents[1] / name / "launch.yaml"
    program = start(BIN / "ligature", "run", scene, "-p", "200")
    program.wait_for("first state published", 300.0)
    try:
        flood(program, node, commands(node), scene, FLOOD // 2, GROWTH)
    finally:
        program.end(30.0)


def test_a_ratio_that_no_trajectory_bears_and_homing_leave_the_run_alive(
    simulator: Program, listen: Callable[..., Any], publish: Callable[..., Any]
) -> None:
    from crtk_msgs.msg import OperatingState, StringStamped
    from std_msgs.msg import Float64

    state = listen("/PSM1/operating_state", OperatingState)
    publish("/PSM1/trajectory_j/set_ratio", Float64).publish(Float64(1e-5))
    words = publish("/PSM1/state_command", StringStamped)
    words.publish(StringStamped(string="disable"))
    state.wait(lambda message: message.state == "DISABLED", 20.0)
    words.publish(StringStamped(string="home"))
    state.wait(lambda message: message.state in ("FAULT", "ENABLED"), 20.0)
    assert simulator.process.poll() is None, simulator.output


class Connection:
    """What `read_bounded` uses of rospy's connection; the class of messages is `std_msgs/String`."""

    skipping, queue_size, resolved_name = 0, None, "/topic"

    def __init__(self) -> None:
        from std_msgs.msg import String

        self.recv_data_class = String


def test_long_messages_between_short_ones_are_passed_over_however_they_are_cut(node: Any) -> None:
    from ligature.ros import intake

    rng = random.Random(3)
    for _ in range(60):
        texts = ["x" * rng.choice((0, 5, 300, intake.MOST_BYTES - 4, 200_000)) for _ in range(6)]
        parts = [struct.pack("<II", len(text) + 4, len(text)) + text.encode() for text in texts]
        stream = b"".join(parts)
        connection, buffer, found, largest = Connection(), io.BytesIO(), [], 0
        while stream:
            size = rng.randrange(1, rng.choice((10, 5_000, 65_536)))
            size = max(size, len(stream) // 400)
            buffer.write(stream[:size])
            stream = stream[size:]
            if buffer.tell() >= 4:
                intake.read_bounded(connection, buffer, found, None)
            largest = max(largest, len(buffer.getvalue()))
        assert [len(m.data) for m in found] == [len(t) for t in texts if len(t) + 4 <= intake.MOST_BYTES]
        assert largest <= intake.MOST_BYTES + 65_536 + 4
