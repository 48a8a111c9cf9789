"""Tasks on ROS: takes the reports that participants of the suturing challenge send, publishes scores and measures.

Reports have the challenge's topics and types. What is published stands below
``/ligature/tasks/NAME``; docs/tasks.md lists it. SI units.
"""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped, PoseStamped
from numpy.typing import NDArray
from std_msgs.msg import Bool, Empty

from ligature.bus import Block
from ligature.bus.stop import Stop
from ligature.model.scene import Scene
from ligature.model.state import new_state
from ligature.ros.bags import REPORTS, reported_pose
from ligature.ros.master import NO_ANSWER, MasterWatch, node_name
from ligature.ros.start import start_node
from ligature.tasks.attempt import TASKS, Attempt

Array = NDArray[np.float64]

SAMPLING = 0.005
"""Wall seconds between two looks at the state; 100 Hz of simulated time is what the challenge's evaluation takes."""

PUBLISH_PERIOD, LOOK_PERIOD = 0.1, 0.2
"""Seconds between two publications of measures, and between two looks for new teams."""

QUEUE = 10


class TaskNode:
    """Judges one attempt after the other at ``task``; ``log`` receives lines for a person.

    Raises `ligature.tasks.MissingBodies`, and `ligature.ros.registrations.NameTaken`.
    """

    def __init__(self, scene: Scene, block: Block, task: str, log: Callable[[str], None]) -> None:
        self._attempt, self._log = Attempt(scene, task), log
        self._state = new_state(scene)
        self._block = block
        self._lock = threading.Lock()
        name = f"{node_name(scene.world.topic)}_tasks"
        start_node(name)
        root = f"{scene.world.root}ligature/tasks/{task}"
        self._score = rospy.Publisher(f"{root}/score", DiagnosticStatus, queue_size=QUEUE, latch=True)
        self._measures = rospy.Publisher(f"{root}/measures", DiagnosticStatus, queue_size=QUEUE)
        self._passages = rospy.Publisher(f"{root}/passages", PointStamped, queue_size=QUEUE)
        rospy.Subscriber(f"{root}/restart", Empty, self._restart, queue_size=QUEUE)
        self._teams: set[str] = set()
        self._published = 0

    def run(self, stop: Stop) -> None:
        """Watch until ``stop`` is set or the physics process is gone."""
        MasterWatch().start()
        publish_at, look_at, tick = 0.0, 0.0, -1
        while not stop.is_set() and not rospy.is_shutdown() and self._block.active:
            now = time.monotonic()
            if self._block.read(self._state) and int(self._state["tick"][0]) != tick:
                tick = int(self._state["tick"][0])
                with self._lock:
                    self._attempt.observe(self._state[0])
                    self._publish_passages()
            if now >= look_at:
                look_at = now + LOOK_PERIOD
                self._look_for_teams()
            if now >= publish_at:
                publish_at = now + PUBLISH_PERIOD
                self._publish_measures()
            time.sleep(SAMPLING)

    def _restart(self, message: Any) -> None:
        with self._lock:
            self._attempt.restart()

    def _look_for_teams(self) -> None:
        """Subscribe the reports of every team that has advertised them since the last look."""
        number = TASKS[self._attempt.task]
        wanted = re.compile(rf"{REPORTS}/(?P<team>[^/]+)/task{number}/?\Z")
        try:
            topics = [name for name, _ in rospy.get_published_topics(REPORTS)]
        except (*NO_ANSWER, rospy.ROSException):
            return
        for topic in topics:
            match = wanted.match(topic)
            if match is not None and match["team"] not in self._teams:
                self._teams.add(match["team"])
                self._subscribe(topic, match["team"])

    def _subscribe(self, topic: str, team: str) -> None:
        """Take the reports of ``team``."""
        if self._attempt.task == "pose_estimation":
            rospy.Subscriber(topic, PoseStamped, self._take_pose, team, queue_size=QUEUE)
        else:
            rospy.Subscriber(topic, Bool, self._take_end, team, queue_size=QUEUE)

    def _take_pose(self, message: PoseStamped, team: str) -> None:
        try:
            T_camera_needle = reported_pose(message)
        except ValueError as error:
            rospy.logwarn(f"{team}: {error}")
            return
        self._judge(team, T_camera_needle)

    def _take_end(self, message: Bool, team: str) -> None:
        if message.data:
            self._judge(team)

    def _judge(self, team: str, T_camera_needle: Array | None = None) -> None:
        """Score and publish; an unfinished task may be reported again."""
        try:
            with self._lock:
                score, measures = self._attempt.judge(T_camera_needle), self._attempt.monitor.measures()
        except ValueError as error:
            rospy.logwarn(f"{team}: {error}")
            return
        report = score.report()
        verdict = "done" if score.success else f"not done: {report['why']}"
        level = DiagnosticStatus.OK if score.success else DiagnosticStatus.WARN
        self._score.publish(_status(self._attempt.task, level, verdict, team, report))
        self._measures.publish(_status(self._attempt.task, level, "", "", measures.report()))
        for line in (f"{team}:", *score.lines(), *measures.lines()):
            self._log(line)

    def _publish_measures(self) -> None:
        with self._lock:
            report = self._attempt.monitor.measures().report()
        self._measures.publish(_status(self._attempt.task, DiagnosticStatus.OK, "", "", report))

    def _publish_passages(self) -> None:
        """Publish where the tip went through holes since the last time, each in the frame of its hole."""
        found = self._attempt.monitor.passages
        self._published = min(self._published, len(found))
        for passage in found[self._published :]:
            point = PointStamped()
            point.header.stamp = rospy.Time.now()
            point.header.frame_id = f"{'Exit' if passage.exit else 'Entry'}{passage.pair}"
            point.point.x, point.point.y = passage.lateral
            self._passages.publish(point)
        self._published = len(found)


def _status(name: str, level: int, message: str, who: str, report: Mapping[str, object]) -> DiagnosticStatus:
    """Figures as a status message; numbers are written so that reading them gives the same bits."""
    values = [
        KeyValue(key=key, value=value if isinstance(value, str) else repr(value)) for key, value in report.items()
    ]
    return DiagnosticStatus(name=name, level=level, message=message, hardware_id=who, values=values)
