"""The bounded, validated command mailbox of the physics process.

Takes what front ends pushed since the last update, keeps the newest command of each object, and
counts what it received, coalesced and rejected. A front end that falls silent has its commands
released.
"""

from __future__ import annotations

from collections.abc import Mapping

from ligature.bus.bounds import check_bounds
from ligature.bus.codec import CodecError, Message, decode
from ligature.bus.newest import Newest
from ligature.bus.pacing import Pace, Throttle
from ligature.bus.recording import Recording, file_name
from ligature.bus.ring import Ring
from ligature.model.commands import Release, check, check_object, object_of, objects_of
from ligature.model.scene import Scene

SILENCE = 0.5
"""Seconds without a sign of life after which a front end counts as dead."""


WORLD = ("world", 0)


class Mailbox:
    """Commands from the ``rings`` of all front ends."""

    def __init__(self, scene: Scene, rings: Mapping[str, Ring]) -> None:
        self._rings = rings
        self._objects = objects_of(scene)
        self._owned: dict[str, set[tuple[str, int]]] = {name: set() for name in rings}
        self.received = self.coalesced = self.rejected = 0
        self.last_rejection = ""

    def take(self) -> list[Message]:
        """All commands of this update, the newest of each object, events in their order."""
        box = Newest()
        for name, ring in self._rings.items():
            for data in ring.drain():
                self.received += 1
                try:
                    message = decode(data)
                    self._check(message)
                except (CodecError, ValueError) as error:
                    self.reject(error)
                    continue
                self._put(box, name, message)
            self._bury(box, name, ring)
        return box.messages()

    def reject(self, error: ValueError) -> None:
        """Count a command that is not carried out."""
        self.rejected += 1
        self.last_rejection = str(error)

    def _put(self, box: Newest, producer: str, message: Message) -> None:
        owned = self._owned[producer]
        item = WORLD if isinstance(message, Throttle) else object_of(message)
        if item is not None:
            free = isinstance(message, Release) or (isinstance(message, Throttle) and not message.enabled)
            owned.discard(item) if free else owned.add(item)
        self.coalesced += box.put(message)

    def _bury(self, box: Newest, producer: str, ring: Ring) -> None:
        """Release what a dead front end commanded."""
        if self._owned[producer] and ring.silence > SILENCE:
            for item in sorted(self._owned[producer]):
                box.put(Throttle(False, False, 0) if item == WORLD else Release(*item))
            self._owned[producer].clear()
            ring.forget()

    def _check(self, message: Message) -> None:
        if isinstance(message, Throttle):
            return
        if isinstance(message, Recording):
            file_name(message.name)
            return
        if not isinstance(message, Pace):
            check(message)
        check_bounds(message)
        check_object(message, self._objects)
