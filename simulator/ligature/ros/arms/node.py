"""All arms on ROS: readings at a steady rate, events as they happen, commands into the bus, frames on tf.

Runs on the thread of `ligature.ros.node`; commands and services come in on rospy's.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
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
from ligature.robots.arm import NO_COMMON_RATIO
from ligature.robots.commands import ArmCommand, SetBaseFrame, is_move
from ligature.robots.instruments import INSTRUMENTS
from ligature.ros.arms.bases import CART, BaseFrames
from ligature.ros.arms.challenge import ChallengeFace
from ligature.ros.arms.commands import listeners
from ligature.ros.arms.console import Console, console_topics
from ligature.ros.arms.events import StateStamps
from ligature.ros.arms.outlet import ArmOutlet, published_topics
from ligature.ros.arms.rivals import Rival, Rivals
from ligature.ros.arms.setup_joints import SetupJoints, setup_topics
from ligature.ros.master import NO_ANSWER
from ligature.ros.names import tf_topics
from ligature.ros.publisher import Publisher

PERIOD = 0.005
"""Seconds between two publications of a reading: 200 Hz, so that clients never find one older than 20 ms."""

BACKLOG = 0.01
"""Seconds of delay that are made up for: readings that were due before show the same state as the next one."""

TF_PERIODS = 4
FOLLOW_PERIODS = 20
HEARTBEAT = 0.3
"""Seconds between two publications of an operating state, switch or scale that does not change: clients take none that
is older than a second, and one that is queued waits for the processor of a busy machine."""

STALE = 0.1
"""Seconds after which a state counts as that of a resting simulation, and is reported with the time of now."""

QUEUE = 10

CONSOLE, SETUP = "console", "SUJ/"
"""Names of what may be another node's beside arms: the console, and before the name of an arm its set-up joints."""


class ArmsNode:
    """The arms of a scene on ROS.

    With a ``reference``, the name of an arm, poses of the others are in the frame of its tip. Topics and frames begin
    with the prefix of the scene; with ``challenge`` topics are there a second time, under the names of the suturing
    challenge's own node. What another node publishes already, or begins to publish, is left to it for the rest of the
    run: two who report one arm are worse than none.
    """

    def __init__(self, scene: Scene, block: Block, outbox: Outbox, challenge: bool, reference: str = "") -> None:
        self._block, self._outbox = block, outbox
        prefix = scene.world.root
        self._frame_prefix = scene.world.frame_prefix
        self._outlets: dict[int, ArmOutlet] = {}
        self.rejected = 0
        self._count = 0
        self._stamps = StateStamps(STALE)
        self._beat = 0.0
        self._due = -math.inf
        self._rivals = Rivals(_parts(scene, prefix))
        with suppress(*NO_ANSWER):
            self._rivals.look()
        taken = self._yielded()
        for index, description in enumerate(scene.arms):
            if description.name not in taken:
                outlet = ArmOutlet(index, description, f"{prefix}{description.name}", scene)
                self._outlets[index] = outlet
                self._subscribe(outlet)
        outlets = self.outlets
        self._tf = [Publisher(topic, TFMessage) for topic in tf_topics(scene.world, "tf")] if outlets else []
        self._console: Console | None = None
        self._setup_joints: SetupJoints | None = None
        if outlets:
            self._console = Console(prefix, outlets, self.push, CONSOLE in taken)
            self._setup_joints = SetupJoints(scene.world, outlets, [name.removeprefix(SETUP) for name in taken])
        self._challenge = ChallengeFace(scene, outlets, self.push) if challenge else None
        self._bases = BaseFrames(reference, outlets, self._frame_prefix, self.push) if reference else None

    @property
    def outlets(self) -> list[ArmOutlet]:
        """The arms that are published on ROS, in the order of the scene."""
        return list(self._outlets.values())

    @property
    def dropped(self) -> int:
        """Messages that slow clients missed."""
        return sum(outlet.dropped for outlet in self.outlets)

    @property
    def faults(self) -> dict[str, str]:
        """The arms in FAULT by name, each with its newest error."""
        return {outlet.description.name: outlet.events.error for outlet in self.outlets if outlet.events.failed}

    @property
    def rivals(self) -> Mapping[str, Rival]:
        """What is left to other nodes, by name."""
        return self._rivals.found

    def start(self, state: Any) -> None:
        """Report the operating states that a running simulation has already; events before this are old."""
        self._block.events.skip()
        for outlet in self.outlets:
            record = state["arm"][outlet.index]
            outlet.follow(record)
            outlet.events.publish("operating_state", [record["operating"], record["homed"], record["busy"]])
            v, a = record["ratio"].tolist()
            for name, ratio in (("ratio_v", v), ("ratio_a", a), ("ratio", v if v == a else NO_COMMON_RATIO)):
                outlet.events.publish(f"trajectory_j/{name}", ratio)
            if outlet.description.kind is ArmKind.PSM and int(record["tool"]) in INSTRUMENTS:
                outlet.events.publish("tool_type", INSTRUMENTS[int(record["tool"])].type)
        if self._outlets:
            self._rivals.start()

    # --- rivals -----------------------------------------------------------------------------

    def _yielded(self) -> list[str]:
        """Names of parts that another node took over since the last call; each is logged once."""
        found = self._rivals.take()
        for part, rival in found:
            rospy.logwarn(
                f"{part}: node {rival.node} publishes {rival.topic}; the simulated {part} stays silent and takes no "
                "commands for the rest of this run; '--no-masters' and '--only' leave arms out, '--ns' renames all"
            )
        return [part for part, _ in found]

    def _stop_publishing(self, part: str) -> None:
        """Stop publishing a part that another node publishes; the master is called on another thread."""
        if part == CONSOLE and self._console is not None:
            threading.Thread(target=self._console.close, daemon=True).start()
        elif self._setup_joints is not None:
            self._setup_joints.fall_silent(part.removeprefix(SETUP))
        for index, outlet in list(self._outlets.items()):
            if outlet.description.name == part:
                del self._outlets[index]
                threading.Thread(target=outlet.close, daemon=True).start()

    # --- readings ---------------------------------------------------------------------------

    def next_due(self) -> float:
        """When `publish` has something to do, on the monotonic clock."""
        return self._due if self._outlets else math.inf

    def publish(self, now: float, state: Any, refresh: Callable[[], Any]) -> int:
        """Readings, then events; returns how many readings were sent.

        ``state`` is an element of the node's state record, which ``refresh`` reads anew. Whoever hears that a move has
        ended finds readings that are no older than its end: the bus holds a state before it reports the state's events.
        """
        self._due = max(self._due + PERIOD, now + PERIOD / 5)
        if self._due < now - BACKLOG:
            self._due = now + PERIOD
        self._count += 1
        for part in self._yielded():
            self._stop_publishing(part)
        outlets = self.outlets
        events = [event for event in self._block.events.read() if event.arm != RUN]
        if events:
            refresh()
        settled = {event.arm for event in events if event.name == "operating_state"}
        stamp = self._stamps.of(rospy.Time.from_sec(float(state["stamp"])), rospy.Time.now())
        if self._count % FOLLOW_PERIODS == 0:
            for outlet in outlets:
                outlet.follow(state["arm"][outlet.index])
            if self._setup_joints is not None:
                self._setup_joints.publish(state, stamp)
        sent = 0
        for outlet in outlets:
            sent += outlet.publish(state["arm"][outlet.index], stamp, 0 if outlet.index in settled else self._count)
        for event in events:
            if event.arm in self._outlets:
                self._outlets[event.arm].events.publish(event.name, event.value)
        if now > self._beat:
            self._beat = now + HEARTBEAT
            for outlet in outlets:
                outlet.events.beat()
            if self._console is not None:
                self._console.beat()
            if self._setup_joints is not None:
                self._setup_joints.beat()
        if self._challenge is not None:
            self._challenge.publish(now, state, stamp)
        if self._count % TF_PERIODS == 0:
            if self._bases is not None:
                self._bases.follow(state)
            self._publish_tf(state, stamp)
        return sent

    def _publish_tf(self, state: Any, stamp: Any) -> None:
        heard = [topic for topic in self._tf if topic.heard]
        if not heard:
            return
        frames = []
        if self._bases is not None:
            world = matrix_pose7(np.eye(4))
            frames.append(_transform(f"{self._frame_prefix}world", f"{self._frame_prefix}{CART}", world, stamp))
        for outlet in self.outlets:
            body = outlet.description.base
            record = state["arm"][outlet.index]
            parent = record["reference"].decode("utf-8", "replace") or outlet.base_frame
            frames.append(_transform(parent, outlet.frame, record["measured_cp"], stamp))
            if outlet.description.kind is not ArmKind.MTM:
                pose = state["body_pose"][body] if body >= 0 else matrix_pose7(outlet.T_base)
                frames.append(_transform(f"{self._frame_prefix}world", outlet.base_frame, pose, stamp))
        for topic in heard:
            topic.publish(TFMessage(frames))

    # --- commands ---------------------------------------------------------------------------

    def _subscribe(self, outlet: ArmOutlet) -> None:
        for topic, type_, take in listeners(outlet.index, outlet.description.kind):
            listen = self._listener(outlet, topic, take)
            outlet.subscribers.append(
                rospy.Subscriber(f"{outlet.root}/{topic}", type_, listen, queue_size=QUEUE, tcp_nodelay=True)
            )

    def _listener(self, outlet: ArmOutlet, topic: str, take: Callable[[Any], ArmCommand]) -> Callable[[Any], None]:
        def listen(message: Any) -> None:
            try:
                command = take(message)
                if isinstance(command, SetBaseFrame) and command.reference == outlet.frame:
                    raise ValueError(f"'{outlet.frame}' is the frame of the tip; name the one in which the base stands")
                self.push(command)
            except (ValueError, CodecError) as error:
                self.rejected += 1
                outlet.events.publish("warning", f"{topic}: command rejected: {error}")
                if is_move(topic):
                    outlet.events.publish("goal_reached", False)

        return listen

    def push(self, command: Command) -> None:
        """Send a command to the physics; raises ValueError when it may not go there."""
        command.check()
        self._outbox.push(command)


def _parts(scene: Scene, prefix: str) -> dict[str, list[str]]:
    """Topics of each part that another node takes over as a whole: each arm, its set-up joints, the console."""
    parts = {arm.name: published_topics(arm, f"{prefix}{arm.name}") for arm in scene.arms}
    for arm in scene.arms:
        if arm.kind is not ArmKind.MTM:
            parts[SETUP + arm.name] = setup_topics(scene.world, arm.name)
    return {**parts, CONSOLE: console_topics(prefix)} if parts else {}


def _transform(parent: str, child: str, pose: Any, stamp: Any) -> TransformStamped:
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id, message.header.stamp = parent, stamp
    p, q = message.transform.translation, message.transform.rotation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = np.asarray(pose).tolist()
    return message
