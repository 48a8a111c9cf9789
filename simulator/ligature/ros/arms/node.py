"""All arms on ROS: readings at a steady rate, events as they happen, commands into the bus, frames on tf.

Runs on the thread of `ligature.ros.node`; commands and services come in on rospy's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from ligature.bus import Block, Outbox
from ligature.bus.codec import CodecError
from ligature.bus.events import RUN
from ligature.model.commands import Command
from ligature.model.frames import matrix_pose7
from ligature.model.scene import ArmKind, Scene
from ligature.robots.commands import ArmCommand
from ligature.robots.instruments import INSTRUMENTS
from ligature.ros.arms.challenge import ChallengeFace
from ligature.ros.arms.commands import listeners
from ligature.ros.arms.console import Console, SetupJoints
from ligature.ros.arms.outlet import ArmOutlet
from ligature.ros.publisher import Publisher

PERIOD = 0.005
"""Seconds between two publications of a reading: 200 Hz, so that clients never find one older than 20 ms."""

TF_PERIODS = 4
FOLLOW_PERIODS = 20
HEARTBEAT = 0.7
"""Seconds between two publications of an operating state that does not change."""

STALE = 0.1
"""Seconds after which a state counts as that of a resting simulation, and is reported with the time of now."""

QUEUE = 10


class ArmsNode:
    """The arms of a scene on ROS.

    Topics and frames begin with the prefix of the scene; with ``challenge`` topics are there a second time, under
    the names of the suturing challenge's own node.
    """

    def __init__(self, scene: Scene, block: Block, outbox: Outbox, challenge: bool) -> None:
        self._block, self._outbox = block, outbox
        prefix = scene.world.root
        self._frame_prefix = scene.world.frame_prefix
        self._base_body = [arm.base for arm in scene.arms]
        self._outlets: list[ArmOutlet] = []
        self.rejected = 0
        self._count = 0
        self._beat = 0.0
        self._due = -math.inf
        for index, description in enumerate(scene.arms):
            outlet = ArmOutlet(index, description, f"{prefix}{description.name}", scene)
            self._outlets.append(outlet)
            self._subscribe(outlet)
        self._tf = Publisher("/tf", TFMessage) if self._outlets else None
        if self._outlets:
            self._console = Console(prefix, self._outlets, self.push)
            self._setup_joints = SetupJoints(scene.world, self._outlets)
        self._challenge = ChallengeFace(scene, self._outlets, self.push) if challenge else None

    @property
    def outlets(self) -> list[ArmOutlet]:
        """The arms in the order of the scene."""
        return self._outlets

    @property
    def dropped(self) -> int:
        """Messages that slow clients missed."""
        return sum(outlet.dropped for outlet in self._outlets)

    @property
    def faults(self) -> dict[str, str]:
        """The arms in FAULT by name, each with its newest error."""
        return {outlet.description.name: outlet.events.error for outlet in self._outlets if outlet.events.failed}

    def start(self, state: Any) -> None:
        """Report the operating states that a running simulation has already; events before this are old."""
        self._block.events.skip()
        for outlet, record in zip(self._outlets, state["arm"], strict=True):
            outlet.follow(record)
            outlet.events.publish("operating_state", [record["operating"], record["homed"], record["busy"]])
            outlet.events.publish("trajectory_j/ratio", float(record["ratio"][0]))
            if outlet.description.kind is ArmKind.PSM and int(record["tool"]) in INSTRUMENTS:
                outlet.events.publish("tool_type", INSTRUMENTS[int(record["tool"])].type)

    def next_due(self) -> float:
        """When `publish` has something to do, on the monotonic clock."""
        return self._due if self._outlets else math.inf

    def publish(self, now: float, state: Any, refresh: Callable[[], Any]) -> int:
        """Readings, then events; returns how many readings were sent.

        ``state`` is an element of the node's state record, which ``refresh`` reads anew. Whoever hears that a move has
        ended finds readings that are no older than its end: the bus holds a state before it reports the state's events.
        """
        self._due = max(self._due + PERIOD, now + PERIOD / 5)
        self._count += 1
        events = [event for event in self._block.events.read() if event.arm != RUN]
        if events:
            refresh()
        settled = {event.arm for event in events if event.name == "operating_state"}
        stamp = self._stamp(state)
        if self._count % FOLLOW_PERIODS == 0:
            for outlet in self._outlets:
                outlet.follow(state["arm"][outlet.index])
            self._setup_joints.publish(state, stamp)
        sent = 0
        for outlet in self._outlets:
            sent += outlet.publish(state["arm"][outlet.index], stamp, 0 if outlet.index in settled else self._count)
        for event in events:
            self._outlets[event.arm].events.publish(event.name, event.value)
        if now > self._beat:
            self._beat = now + HEARTBEAT
            for outlet in self._outlets:
                outlet.events.beat()
        if self._challenge is not None:
            self._challenge.publish(now, state, stamp)
        if self._count % TF_PERIODS == 0:
            self._publish_tf(state, stamp)
        return sent

    def _stamp(self, state: Any) -> Any:
        now, stamp = rospy.Time.now(), rospy.Time.from_sec(float(state["stamp"]))
        return now if (now - stamp).to_sec() > STALE else stamp

    def _publish_tf(self, state: Any, stamp: Any) -> None:
        if self._tf is None or not self._tf.heard:
            return
        frames = []
        for outlet, body in zip(self._outlets, self._base_body, strict=True):
            record, name = state["arm"][outlet.index], f"{self._frame_prefix}{outlet.description.name}"
            parent = record["reference"].decode("utf-8", "replace") or outlet.base_frame
            frames.append(_transform(parent, name, record["measured_cp"], stamp))
            if outlet.description.kind is not ArmKind.MTM:
                pose = state["body_pose"][body] if body >= 0 else matrix_pose7(outlet.T_base)
                frames.append(_transform(f"{self._frame_prefix}world", outlet.base_frame, pose, stamp))
        self._tf.publish(TFMessage(frames))

    # --- commands ---------------------------------------------------------------------------

    def _subscribe(self, outlet: ArmOutlet) -> None:
        for topic, type_, take in listeners(outlet.index, outlet.description.kind):
            listen = self._listener(outlet, topic, take)
            rospy.Subscriber(f"{outlet.root}/{topic}", type_, listen, queue_size=QUEUE, tcp_nodelay=True)

    def _listener(self, outlet: ArmOutlet, topic: str, take: Callable[[Any], ArmCommand]) -> Callable[[Any], None]:
        def listen(message: Any) -> None:
            try:
                self.push(take(message))
            except (ValueError, CodecError) as error:
                self.rejected += 1
                outlet.events.publish("warning", f"{topic}: command rejected: {error}")
                if topic.startswith("move"):
                    outlet.events.publish("goal_reached", False)

        return listen

    def push(self, command: Command) -> None:
        """Send a command to the physics; raises ValueError when it may not go there."""
        command.check()
        self._outbox.push(command)


def _transform(parent: str, child: str, pose: Any, stamp: Any) -> TransformStamped:
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id, message.header.stamp = parent, stamp
    p, q = message.transform.translation, message.transform.rotation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = np.asarray(pose).tolist()
    return message
