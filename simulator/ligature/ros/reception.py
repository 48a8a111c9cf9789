"""Commands from ROS to the bus: checked, counted, watched over. Callbacks run on rospy's threads."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

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
from std_msgs.msg import Empty, String

from ligature.bus import Outbox, Throttle, Watchdog
from ligature.bus.codec import CodecError, Message
from ligature.model.commands import PHASE_TOPIC, Command, MarkPhase, Release, Reset
from ligature.model.scene import Scene
from ligature.process import REPEAT
from ligature.ros import conversion
from ligature.ros.schedule import Key

QUEUE = 10

WORLD: Key = ("world", 0)
RESETS = {"Reset": False, "Reset/Bodies": True, "ResetBodies": True}
"""Topics below the world's Command, and whether they reset bodies only."""

_RELEASED = ("body", "actuator", "camera", "light")
COMMANDS = {
    "body": RigidBodyCmd,
    "ghost": GhostObjectCmd,
    "actuator": ActuatorCmd,
    "camera": CameraCmd,
    "light": LightCmd,
}
"""Kinds of objects and the messages that command them; sensors have `SensorCmd` or `ContactSensorCmd`."""


class Reception:
    """Subscribes command topics and hands what comes in to ``outbox``.

    ``on_command(key, at_once)`` is called when an object begins to be commanded, and with ``at_once`` when a
    command made it report more of itself.
    """

    def __init__(self, scene: Scene, outbox: Outbox, on_command: Callable[[Key, bool], None]) -> None:
        self._scene, self._outbox, self._on_command = scene, outbox, on_command
        self._watchdog: Watchdog[Key] = Watchdog()
        self.rejected = 0

    def commanded(self, key: Key) -> bool:
        """Whether an object is being commanded."""
        return self._watchdog.alive(key)

    def subscribe(self, template: Any, topic: str) -> None:
        """Take commands for one object."""
        message = COMMANDS.get(template.kind)
        if message is None:
            message = ContactSensorCmd if isinstance(template, conversion.ContactTemplate) else SensorCmd
        self._listen(f"{topic}/Command", message, self._command_of(template))

    def subscribe_world(self) -> None:
        """Take step throttling, resets and marks of phases."""
        topic = f"{self._scene.world.topic}/Command"
        self._listen(topic, WorldCmd, self._throttle)
        for name, bodies_only in RESETS.items():
            self._listen(f"{topic}/{name}", Empty, self._reset(f"{topic}/{name}", Reset(bodies_only)))
        phase = f"{self._scene.world.root}{PHASE_TOPIC}"
        self._listen(phase, String, lambda message: self._mark(phase, message.data))

    def watch(self, now: float) -> None:
        """Clear what has not been commanded for too long, and send what waits in the outbox."""
        self._outbox.flush()
        for key in self._watchdog.expired(now):
            if key == WORLD:
                self._push(key[0], Throttle(False, False, 0))
            elif key[0] in _RELEASED:
                self._push(key[0], Release(*key))

    def _listen(self, topic: str, message: Any, take: Callable[[Any], None]) -> None:
        def receive(data: Any) -> None:
            try:
                take(data)
            except ValueError as error:
                self._refuse(topic, error)

        rospy.Subscriber(topic, message, receive, queue_size=QUEUE, tcp_nodelay=True)

    def _command_of(self, template: Any) -> Callable[[Any], None]:
        """What to do with a command for one object; a rejected one (ValueError) does not feed the watchdog."""
        key, topic = (template.kind, template.index), template.identity.topic

        def take(message: Any) -> None:
            command = self._convert(template, message)
            if command is not None:
                command.check()
                self._push(topic, command)
            self._feed(key, template.kind == "body" and template.ask(*conversion.wishes(message)))

        return take

    def _convert(self, template: Any, message: Any) -> Command | None:
        if template.kind == "body":
            return conversion.body_command(message, self._scene.bodies[template.index])
        if template.kind == "actuator":
            return conversion.actuator_command(message, template.index)
        if template.kind in ("camera", "light"):
            return conversion.place_command(message, template.kind, template.index)
        return None

    def _reset(self, topic: str, reset: Reset) -> Callable[[Any], None]:
        return lambda _: self._push(topic, reset)

    def _mark(self, topic: str, phase: str) -> None:
        self._push(topic, MarkPhase.of(phase))

    def _throttle(self, message: WorldCmd) -> None:
        self._push(WORLD[0], Throttle(message.enable_step_throttling, message.step_clock, message.n_skip_steps))
        self._feed(WORLD, False)

    def _feed(self, key: Key, more: bool) -> None:
        fresh = not self._watchdog.alive(key)
        self._watchdog.feed(key, time.monotonic())
        if fresh or more:
            self._on_command(key, more)

    def _push(self, topic: str, message: Message) -> None:
        try:
            self._outbox.push(message)
        except CodecError as error:
            self._refuse(topic, error)

    def _refuse(self, topic: str, error: ValueError) -> None:
        self.rejected += 1
        rospy.logwarn_throttle(REPEAT, f"{topic}: command rejected: {error}")
