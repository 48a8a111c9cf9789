"""The bounded, validated command mailbox of the physics process.

Takes what front ends pushed since the last update, keeps the newest command of each object, and
counts what it received, coalesced and rejected. A front end that falls silent has its commands
released.
"""

from __future__ import annotations

from collections.abc import Mapping

from ligature.bus.codec import CodecError, Message, decode
from ligature.bus.pacing import Throttle
from ligature.bus.ring import Ring
from ligature.model.commands import ActuatorCommand, BodyCommand, PlaceCommand, Release, check
from ligature.model.scene import Scene

SILENCE = 0.5
"""Seconds without a sign of life after which a front end counts as dead."""


class Mailbox:
    """Commands from the ``rings`` of all front ends."""

    def __init__(self, scene: Scene, rings: Mapping[str, Ring]) -> None:
        self._rings = rings
        self._limits = {
            "body": len(scene.bodies),
            "actuator": len(scene.actuators),
            "camera": len(scene.cameras),
            "light": len(scene.lights),
        }
        self._owned: dict[str, set[tuple[str, int]]] = {name: set() for name in rings}
        self.received = self.coalesced = self.rejected = 0
        self.last_rejection = ""

    def take(self) -> list[Message]:
        """All commands of this update, the newest of each object, events in their order."""
        box: dict[object, Message] = {}
        for name, ring in self._rings.items():
            for data in ring.drain():
                self.received += 1
                try:
                    message = decode(data)
                    self._check(message)
                except (CodecError, ValueError) as error:
                    self.rejected += 1
                    self.last_rejection = str(error)
                    continue
                self._put(box, name, message)
            self._bury(box, name, ring)
        return list(box.values())

    def _put(self, box: dict[object, Message], producer: str, message: Message) -> None:
        key = _object(message)
        if key is None:
            box[len(box), "event"] = message
            return
        kind, index = key
        owned = self._owned[producer]
        owned.discard(key) if isinstance(message, Release) else owned.add(key)
        slot: object = (kind, index, message.actuate) if isinstance(message, ActuatorCommand) else key
        if box.pop(slot, None) is not None:
            self.coalesced += 1
        box[slot] = message

    def _bury(self, box: dict[object, Message], producer: str, ring: Ring) -> None:
        """Release what a dead front end commanded."""
        if self._owned[producer] and ring.silence > SILENCE:
            for kind, index in sorted(self._owned[producer]):
                box[kind, index] = Release(kind, index)
            box["throttle", producer] = Throttle(False, False, 0)
            self._owned[producer].clear()
            ring.forget()

    def _check(self, message: Message) -> None:
        if isinstance(message, Throttle):
            return
        check(message)
        key = _object(message)
        if key is not None and not 0 <= key[1] < self._limits.get(key[0], 0):
            raise ValueError(f"there is no {key[0]} number {key[1]}")


def _object(message: Message) -> tuple[str, int] | None:
    """Kind and index of the object that a command is for; None for events."""
    if isinstance(message, BodyCommand):
        return "body", message.body
    if isinstance(message, ActuatorCommand):
        return "actuator", message.actuator
    if isinstance(message, PlaceCommand | Release):
        return message.kind, message.index
    return None
