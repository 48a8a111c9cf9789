"""Topics of clients that have nobody at the other end: a line for each, with what to use instead.

A program for another version of the dVRK, for another scene, or for arms that a run lacks waits in silence for messages
that never come, and its commands go nowhere. Only the master knows of such topics.
"""

from __future__ import annotations

import difflib
import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

import rosgraph
import rospy

from ligature.ros.master import WATCHER
from ligature.ros.registrations import CALLER

PERIOD = 5.0
"""Seconds between two looks."""

LOOKS = 2
"""Looks in a row that find nobody before a topic is reported: programs of a session start one after the other."""

PICTURE_LOOKS = 6
"""The same of pictures, whose process starts last."""

MOST_LINES = 4
"""Lines for the topics of one node; more are counted."""

OURS = "/ligature"
"""How names of nodes begin that belong to a run."""

FAMILIES = re.compile(
    r"(?:dvrk/)?(?:(?:PSM|ECM|MTM|SUJ|IO|PID|CRTK)\w*|console|system|footpedals|endoscope_focus|ambf/env)/\S+"
)
"""Names that programs for the dVRK and for AMBF use."""

COMMAND = re.compile(
    r"(?:.*/)?(?:(?:servo|move|set|emulate|use|lock|unlock|select|unselect|cycle|power)(?:_\w+)?"
    r"|hold|free|home|beep|enable|state_command|string_to_speech|focus_in|focus_out|Command(?:/\w+)?)"
)
"""Names of commands: clients publish them, and subscribe all others. Who does the reverse is a robot or its driver."""

ARM = re.compile(r"(?:PSM|ECM|MTM)\w*")

PICTURES = ("ImageData", "ImageData/compressed", "CameraInfo", "DepthData", "DepthImage", "IdImage")

RENAMED = {
    "set_desired_state": "state_command", "set_robot_state": "state_command", "current_state": "operating_state",
    "robot_state": "operating_state", "state_joint_current": "measured_js", "position_joint_current": "measured_js",
    "state_joint_desired": "setpoint_js", "servoed_js": "setpoint_js", "position_cartesian_current": "measured_cp",
    "position_cartesian_desired": "setpoint_cp", "servoed_cp": "setpoint_cp",
    "position_cartesian_local_current": "local/measured_cp", "position_cartesian_local_desired": "local/setpoint_cp",
    "twist_body_current": "measured_cv", "wrench_body_current": "body/measured_cf", "jacobian_body": "body/jacobian",
    "jacobian_spatial": "spatial/jacobian", "state_jaw_current": "jaw/measured_js",
    "state_jaw_desired": "jaw/setpoint_js", "state_gripper_current": "gripper/measured_js",
    "gripper_closed_event": "gripper/closed", "set_position_joint": "servo_jp", "set_position_goal_joint": "move_jp",
    "set_position_cartesian": "servo_cp", "set_position_goal_cartesian": "move_cp", "set_effort_joint": "servo_jf",
    "set_wrench_body": "body/servo_cf", "set_wrench_spatial": "spatial/servo_cf",
    "set_wrench_body_orientation_absolute": "body/set_cf_orientation_absolute",
    "set_gravity_compensation": "use_gravity_compensation", "set_position_jaw": "jaw/servo_jp",
    "set_jaw_position": "jaw/servo_jp", "set_position_goal_jaw": "jaw/move_jp", "set_effort_jaw": "jaw/servo_jf",
    "set_joint_velocity_ratio": "trajectory_j/set_ratio_v",
    "set_joint_acceleration_ratio": "trajectory_j/set_ratio_a", "set_cartesian_impedance_gains": "servo_ci",
}  # fmt: skip
"""Names of the dVRK 1.x and early 2.x below an arm, and those of 2.4."""

LACKING: Sequence[tuple[str, str]] = (
    (r"(?:\w+/)?(?:IO|io|PID|pid)/", "the simulator has no controller boards"),
    (r"endoscope_focus/", "the simulated endoscope is always in focus"),
    (r"console/teleop/\w*psm", "run 'ligature teleop', which serves it"),
    (r"CRTK/", "run with '--src-crtk', which provides these names"),
    (r"ambf/env/(?:Needle|CameraFrame)/", "run with '--names src', which provides this name"),
    (
        rf"ambf/env/\S+/(?:{'|'.join(PICTURES)})\Z",
        "pictures need a run without '--no-cameras' that shows this camera, and begin with 'render ready'",
    ),
)
"""Patterns of names that a run does not have, and why or how it would."""

SIMILAR = 0.8
"""How similar a name must be to be suggested (`difflib`)."""

Topics = Iterable[tuple[str, Sequence[str]]]


class Use(NamedTuple):
    """What a node does with a topic; ``sends`` is whether it publishes or subscribes it."""

    node: str
    topic: str
    sends: bool


class Unserved:
    """Finds such topics in what a master knows; reports each once, and again for a node that left and came back.

    ``root`` is the beginning of the names of this run, ``/`` or ``/left/``, and ``arms`` the names of its arms.
    """

    def __init__(self, root: str, arms: Collection[str]) -> None:
        self._root, self._arms = root, tuple(arms)
        self._looks: Counter[Use] = Counter()
        self._reported: set[Use] = set()
        self._next = 0.0

    def poll(self, now: float) -> None:
        """Ask the master every `PERIOD` seconds of the clock ``now``, and log what is new.

        Raises one of `ligature.ros.master.NO_ANSWER`.
        """
        if now < self._next:
            return
        self._next = now + PERIOD
        published, subscribed, _ = rosgraph.Master(CALLER).getSystemState()
        for line in self.look(published, subscribed):
            rospy.logwarn(line)

    def look(self, published: Topics, subscribed: Topics) -> list[str]:
        """New lines for what a master knows: topics, each with the nodes that publish or subscribe it."""
        ends = _ends(published), _ends(subscribed)
        found = {use for use in _uses(*ends) if self._concerns(use.topic)}
        self._looks = Counter({use: self._looks[use] + 1 for use in found})
        new = sorted(use for use in found - self._reported if self._looks[use] >= _looks_needed(use.topic))
        here = {node for side in ends for nodes in side.values() for node in nodes}
        self._reported = {use for use in self._reported if use.node in here} | set(new)
        served = [{topic for topic, nodes in side.items() if any(map(_is_ours, nodes))} for side in ends]
        lines = []
        for node in dict.fromkeys(use.node for use in new):
            uses = [use for use in new if use.node == node]
            lines += [self._line(use, served[use.sends]) for use in uses[:MOST_LINES]]
            if len(uses) > MOST_LINES:
                lines.append(
                    f"node {node} uses {len(uses) - MOST_LINES} more topics of which nobody is at the other end"
                )
        return lines

    def _concerns(self, topic: str) -> bool:
        """Whether a name is one of those that a run may have, with or without its prefix."""
        return FAMILIES.fullmatch(topic.removeprefix(self._root).lstrip("/")) is not None

    def _line(self, use: Use, served: Collection[str]) -> str:
        doing, other = ("publishes", "subscribes") if use.sends else ("subscribes", "publishes")
        why = self._advice(use.topic, served)
        return f"node {use.node} {doing} {use.topic}, which nobody {other}{'; ' + why if why else ''}"

    def _advice(self, topic: str, served: Collection[str]) -> str:
        """What to use instead of a name, or why there is none; empty if neither is known."""
        name = topic.removeprefix(self._root).lstrip("/").removeprefix("dvrk/")
        own = self._root + name
        if own in served:
            return f"here it is {own}"
        owner, _, rest = name.partition("/")
        renamed = f"{self._root}{owner}/{RENAMED.get(rest, rest)}"
        if renamed in served:
            return f"since dVRK 2.x it is {renamed}"
        names = [each.removeprefix(self._root).lstrip("/") for each in served]
        for pattern, reason in LACKING:
            if re.match(pattern, name) and not any(re.match(pattern, each) for each in names):
                return reason
        arm = rest.partition("/")[0] if owner == "SUJ" else owner
        if ARM.fullmatch(arm) and arm not in self._arms:
            return f"this run has the arms {', '.join(self._arms)}" if self._arms else "this run has no arms"
        similar = difflib.get_close_matches(own, served, 1, SIMILAR)
        return f"a similar name is {similar[0]}" if similar else ""


def _is_ours(node: str) -> bool:
    return node.startswith(OURS)


def _ends(topics: Topics) -> dict[str, list[str]]:
    """Nodes by topic, without those that only watch who publishes."""
    return {topic: [node for node in nodes if not node.endswith(WATCHER)] for topic, nodes in topics}


def _uses(published: Mapping[str, Sequence[str]], subscribed: Mapping[str, Sequence[str]]) -> Iterable[Use]:
    """What clients do with topics that nobody has at the other end, and that none of our nodes has at the same."""
    for sends, mine, others in ((True, published, subscribed), (False, subscribed, published)):
        for topic, nodes in mine.items():
            of_client = (COMMAND.fullmatch(topic) is not None) is sends
            if of_client and not others.get(topic) and not any(map(_is_ours, nodes)):
                yield from (Use(node, topic, sends) for node in nodes)


def _looks_needed(topic: str) -> int:
    return PICTURE_LOOKS if topic.endswith(PICTURES) else LOOKS
