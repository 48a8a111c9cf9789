"""The ROS process: AMBF's topics between the shared-memory bus and a ROS 1 master.

One thread publishes everything at absolute deadlines; commands come in on rospy's threads and go
into the ring of this process as they are, checked by the physics process.
"""

from __future__ import annotations

import heapq
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rospy
from ambf_msgs.msg import (
    ActuatorCmd,
    CameraCmd,
    ContactSensorCmd,
    GhostObjectCmd,
    LightCmd,
    RigidBodyCmd,
    SensorCmd,
    WorldCmd,
)
from std_msgs.msg import Empty

from ligature.bus import Block, Outbox, Throttle, Watchdog
from ligature.bus.codec import CodecError, Message
from ligature.model.commands import Release, Reset
from ligature.model.scene import Scene
from ligature.model.state import new_state
from ligature.ros import conversion, names
from ligature.ros.diagnostics import Diagnostics
from ligature.ros.master import MasterWatch
from ligature.ros.parameters import Parameters

QUEUE = 10
DEFAULT_LOW, DEFAULT_HIGH = 50, 1000
PHYSICS_SILENCE = 5.0
"""Seconds without a sign of life of the physics process after which this one ends."""

_COMMANDS = {
    "body": RigidBodyCmd,
    "ghost": GhostObjectCmd,
    "actuator": ActuatorCmd,
    "camera": CameraCmd,
    "light": LightCmd,
}


class _Outlet:
    """One published object: its template, its publisher, its rates and when it is due."""

    def __init__(self, template: Any, topic: str, low: float, high: float) -> None:
        self.template = template
        self.low, self.high = low, high
        self.key = (template.kind, template.index)
        self.publisher = rospy.Publisher(f"{topic}/State", type(template.message), queue_size=QUEUE)
        self.due = 0.0

    def period(self, commanded: bool) -> float:
        """Seconds between publications."""
        return 1.0 / (self.high if commanded else self.low)


class Node:
    """The simulator on ROS."""

    def __init__(self, scene: Scene, bus: str, min_hz: int | None, max_hz: int | None, policy: str) -> None:
        self._scene = scene
        self._state = new_state(scene)
        self._block = Block.attach(bus, self._state.dtype)
        self._ring = self._block.rings["ros"]
        self._outbox = Outbox(self._ring)
        self._watchdog: Watchdog[tuple[str, int]] = Watchdog()
        self._malformed = 0
        self._hurry: list[_Outlet] = []
        rospy.init_node("ligature", disable_signals=True)
        self._world = conversion.WorldTemplate()
        self._outlets = self._advertise(min_hz, max_hz, policy)
        self._by_key = {outlet.key: outlet for outlet in self._outlets}
        self.topics = 2 * len(self._outlets)
        self._subscribe_world()
        self._diagnostics = Diagnostics(self._block)
        self._parameters = Parameters(scene)
        self._master = MasterWatch()

    # --- set-up -----------------------------------------------------------------------------

    def _advertise(self, min_hz: int | None, max_hz: int | None, policy: str) -> list[_Outlet]:
        outlets = [_Outlet(self._world, self._scene.world.topic, min_hz or DEFAULT_LOW, max_hz or DEFAULT_HIGH)]
        templates, hidden = conversion.templates(self._scene), []
        objects = [(template.kind, template.identity) for template in templates]
        for template, topic in zip(templates, names.topics(objects, policy, self._scene.world.topic), strict=True):
            identity = template.identity
            if topic is None:
                hidden.append(identity.topic)
                continue
            low = min_hz or max(identity.publish_low, 1)
            high = max_hz or max(identity.publish_high, 1)
            outlets.append(_Outlet(template, topic, low, high))
            self._subscribe(template, topic)
        if hidden:
            rospy.loginfo(f"not advertised under the name policy '{policy}': {', '.join(hidden)}")
        return outlets

    def _subscribe(self, template: Any, topic: str) -> None:
        message = _COMMANDS.get(template.kind)
        if message is None:
            message = ContactSensorCmd if isinstance(template, conversion.ContactTemplate) else SensorCmd
        rospy.Subscriber(f"{topic}/Command", message, self._receiver(template), queue_size=QUEUE, tcp_nodelay=True)

    def _receiver(self, template: Any) -> Callable[[Any], None]:
        """What to do with a command message of one object."""
        key = (template.kind, template.index)

        def receive(message: Any) -> None:
            try:
                command = self._command(template, message)
            except ValueError as error:
                self._malformed += 1
                rospy.logwarn_throttle(2.0, f"{template.identity.topic}/Command: {error}")
                return
            fresh = not self._watchdog.alive(key)
            self._watchdog.feed(key, time.monotonic())
            if command is not None:
                self._push(command)
            if fresh:
                self._wake(key)

        return receive

    def _command(self, template: Any, message: Any) -> Message | None:
        if template.kind == "body":
            template.ask(message.publish_children_names, message.publish_joint_names, message.publish_joint_positions)
            return conversion.body_command(message, self._scene.bodies[template.index])
        if template.kind == "actuator":
            return conversion.actuator_command(message, template.index)
        if template.kind in ("camera", "light"):
            return conversion.place_command(message, template.kind, template.index)
        return None

    def _subscribe_world(self) -> None:
        topic = self._scene.world.topic
        rospy.Subscriber(f"{topic}/Command", WorldCmd, self._throttle, queue_size=QUEUE, tcp_nodelay=True)
        for name, bodies_only in (("Reset", False), ("Reset/Bodies", True), ("ResetBodies", True)):
            rospy.Subscriber(
                f"{topic}/Command/{name}",
                Empty,
                lambda _, only=bodies_only: self._push(Reset(only)),
                queue_size=1,
            )

    def _throttle(self, message: WorldCmd) -> None:
        self._watchdog.feed(("world", 0), time.monotonic())
        self._push(Throttle(message.enable_step_throttling, message.step_clock, message.n_skip_steps))

    def _push(self, message: Message) -> None:
        try:
            self._outbox.push(message)
        except CodecError as error:
            self._malformed += 1
            rospy.logwarn_throttle(2.0, str(error))

    def _wake(self, key: tuple[str, int]) -> None:
        """Publish an object at its higher rate from now on, and with its new lists soon."""
        outlet = self._by_key.get(key)
        if outlet is not None:
            self._hurry.append(outlet)

    # --- running ----------------------------------------------------------------------------

    def run(self, stop: threading.Event, on_first: Callable[[], None]) -> None:
        """Publish until ``stop`` is set or the physics process is gone."""
        queue: list[tuple[float, int, _Outlet]] = []
        now = time.monotonic()
        for i, outlet in enumerate(self._outlets):
            outlet.due = now + i * 1e-4
            queue.append((outlet.due, i, outlet))
        heapq.heapify(queue)
        told, order, housekeeping = False, len(queue), 0.0
        while not stop.is_set() and not rospy.is_shutdown():
            now = time.monotonic()
            if now >= housekeeping:
                housekeeping = now + 0.1
                if not self._keep_house(now):
                    return
            order = self._wake_up(queue, now, order)
            if queue[0][0] > now:
                time.sleep(min(queue[0][0] - now, 0.05))
                continue
            order = self._publish_due(queue, now, order)
            if not told:
                told = True
                on_first()

    def _wake_up(self, queue: list[tuple[float, int, _Outlet]], now: float, order: int) -> int:
        while self._hurry:
            outlet = self._hurry.pop()
            if outlet.due > now + outlet.period(True):
                outlet.due = now
                heapq.heappush(queue, (now, order, outlet))
                order += 1
        return order

    def _publish_due(self, queue: list[tuple[float, int, _Outlet]], now: float, order: int) -> int:
        """Publish everything that is due from one reading of the state."""
        if not self._block.read(self._state):
            return order
        state = self._state[0]
        stamp = rospy.Time.from_sec(float(state["stamp"]))
        sent = late = 0
        while queue[0][0] <= now:
            due, _, outlet = heapq.heappop(queue)
            if due != outlet.due:
                continue
            outlet.publisher.publish(outlet.template.fill(state, stamp))
            period = outlet.period(self._watchdog.alive(outlet.key))
            outlet.due = due + period
            if outlet.due < now - period:
                late += int((now - outlet.due) / period)
                outlet.due = now
            heapq.heappush(queue, (outlet.due, order, outlet))
            order += 1
            sent += 1
        figures = self._block.figures
        figures["published"] += np.uint64(sent)
        figures["publish_late"] += np.uint64(late)
        return order

    def _keep_house(self, now: float) -> bool:
        """Watchdogs, diagnostics, parameters, the master; False when the physics process is gone."""
        self._ring.beat()
        self._outbox.flush()
        for kind, index in self._watchdog.expired(now):
            if kind == "world":
                self._push(Throttle(False, False, 0))
            elif kind in ("body", "actuator", "camera", "light"):
                self._push(Release(kind, index))
        figures = self._block.figures
        figures["malformed"] = self._malformed
        self._world.loop_hz = float(figures["loop_hz"][0])
        self._diagnostics.publish(now)
        self._parameters.poll(now, self._push)
        self._master.check(now)
        return self._block.age < PHYSICS_SILENCE
