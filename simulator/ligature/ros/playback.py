"""Plays a bag into a running simulator: its commands as they were, or where joints were as where they shall be.

Radians, metres; times are the bag's.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import rosbag
import rospy
from crtk_msgs.msg import OperatingState, StringStamped
from sensor_msgs.msg import JointState

from ligature.ros.bags import BagError, messages, opened, topics
from ligature.ros.master import commanded_topics
from ligature.ros.start import start_node

TIMEOUT = 20.0
"""Seconds to wait for the simulator to be connected, and for an arm to get ready."""

_JOINTS = re.compile(r"(?P<arm>/[^/]+)(?P<jaw>/jaw)?/(?P<kind>measured|setpoint)_js\Z")
QUEUE = 100


class PlaybackError(RuntimeError):
    """The simulator does not take what a bag holds; the message gives the reason."""


def play(path: Path, joints: str, speed: float, log: Callable[[str], None]) -> int:
    """Play ``path``; returns how many messages were sent.

    With ``joints`` empty, these are the messages on topics that the simulator subscribes; with ``measured`` or
    ``setpoint``, the arms get ready, go to where the recorded joints begin, and follow them. Raises `BagError` and
    `PlaybackError`.
    """
    start_node("ligature_replay", several=True)
    taken = commanded_topics()
    with opened(path) as bag:
        found = sorted(topics(bag))
        routes = _joint_routes(found, joints, taken) if joints else {topic: topic for topic in found if topic in taken}
        if not routes:
            what = f"{joints} joints of an arm" if joints else "commands"
            raise BagError(
                f"{path}: contains no {what} for the running simulator; '--joints measured' plays joint states"
            )
        log(f"playing {', '.join(routes)}")
        types = {topic: message for topic, message, _ in _firsts(bag, routes)}
        publishers = {
            topic: rospy.Publisher(
                target, JointState if joints else type(types[topic]), queue_size=QUEUE, tcp_nodelay=True
            )
            for topic, target in routes.items()
            if topic in types
        }
        _connect(publishers)
        if joints:
            for topic, message in types.items():
                _begin(routes[topic], message)
        return _stream(bag, publishers, bool(joints), speed)


def _joint_routes(found: list[str], kind: str, taken: set[str]) -> dict[str, str]:
    """Joint topics of ``kind`` with the topics that they are sent to."""
    routes = {}
    for topic in found:
        match = _JOINTS.match(topic)
        target = f"{match['arm']}{match['jaw'] or ''}/servo_jp" if match and match["kind"] == kind else ""
        if target in taken:
            routes[topic] = target
    return routes


def _firsts(bag: rosbag.Bag, routes: dict[str, str]) -> Iterator[tuple[str, Any, float]]:
    """The first message of each topic."""
    waiting = set(routes)
    for row in messages(bag, list(routes)):
        if row[0] in waiting:
            waiting.remove(row[0])
            yield row
            if not waiting:
                return


def _connect(publishers: dict[str, rospy.Publisher]) -> None:
    deadline = time.monotonic() + TIMEOUT
    for publisher in publishers.values():
        while publisher.get_num_connections() == 0:
            if time.monotonic() > deadline:
                raise PlaybackError(f"nothing subscribes to {publisher.name} any more")
            time.sleep(0.01)


def _begin(target: str, first: Any) -> None:
    """Get the arm of a ``servo_jp`` ready, and move it to where the recording begins."""
    arm, jaw, _ = target.rpartition("/servo_jp")[0].partition("/jaw")
    if jaw:
        return
    command = rospy.Publisher(f"{arm}/state_command", StringStamped, queue_size=QUEUE)
    move = rospy.Publisher(f"{arm}/move_jp", JointState, queue_size=QUEUE)
    _connect({"": command, "move": move})
    for word in ("enable", "home"):
        command.publish(StringStamped(string=word))
    _wait_for(arm, "to be homed", lambda state: state.state == "ENABLED" and state.is_homed and not state.is_busy)
    move.publish(JointState(position=first.position))
    time.sleep(0.2)
    _wait_for(arm, "to reach the first joint values", lambda state: not state.is_busy)


def _wait_for(arm: str, what: str, ready: Callable[[Any], bool]) -> None:
    deadline = time.monotonic() + TIMEOUT
    newest: list[Any] = []
    subscriber = rospy.Subscriber(f"{arm}/operating_state", OperatingState, newest.append, queue_size=QUEUE)
    while not (newest and ready(newest[-1])):
        if time.monotonic() > deadline:
            raise PlaybackError(f"{arm} fails {what}")
        time.sleep(0.01)
    subscriber.unregister()


def _stream(bag: rosbag.Bag, publishers: dict[str, rospy.Publisher], joints: bool, speed: float) -> int:
    """Send everything at its time; a machine that is late sends at once, in the order of the bag."""
    begin, first, sent = time.monotonic(), None, 0
    for topic, message, stamp in messages(bag, list(publishers)):
        first = stamp if first is None else first
        nap = (stamp - first) / speed - (time.monotonic() - begin)
        if nap > 0.0:
            time.sleep(nap)
        if rospy.is_shutdown():
            break
        publishers[topic].publish(JointState(position=message.position) if joints else message)
        sent += 1
    time.sleep(0.2)
    return sent
