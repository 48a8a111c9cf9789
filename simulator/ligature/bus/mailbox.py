"""The bounded, validated command mailbox of the physics process.

Takes what front ends pushed since the last update, keeps the newest command of each object, and
counts what it received, coalesced and rejected. A front end that falls silent has its commands
released.
"""

from __future__ import annotations

from collections.abc import Mapping

from ligature.bus.codec import CodecError, Message, decode
from ligature.bus.newest import Newest
from ligature.bus.pacing import WORLD, Throttle
from ligature.bus.ring import Ring
from ligature.model.commands import Release, object_counts
from ligature.model.scene import Scene

SILENCE = 0.5
"""Seconds without a sign of life after which a front end counts as dead."""


class Mailbox:
    """The commands of all front ends for one ``scene``, checked; ``rings`` are the front ends' rings by name."""

    def __init__(self, scene: Scene, rings: Mapping[str, Ring]) -> None:
        self._rings = rings
        self._counts = {**object_counts(scene), WORLD[0]: 1}
        self._owned: dict[str, set[tuple[str, int]]] = {name: set() for name in rings}
        self.received = self.coalesced = self.rejected = 0
        self.last_rejection = ""

    def take(self) -> list[Message]:
        """All commands of this update, the newest of each object, events in their order."""
        arrived = [(name, list(ring.drain()), ring.silence > SILENCE) for name, ring in self._rings.items()]
        valid = [(name, self._valid(commands), silent) for name, commands, silent in arrived]
        box = Newest()
        for name, messages, silent in valid:
            owned = self._owned[name]
            for message in messages:
                self.coalesced += box.put(message)
                if message.object is not None:
                    owned.discard(message.object) if message.releases else owned.add(message.object)
            if silent and owned:
                for item in sorted(owned):
                    box.put(Throttle(False, False, 0) if item == WORLD else Release(*item))
                owned.clear()
                self._rings[name].reset()
        return box.messages()

    def _valid(self, commands: list[bytes]) -> list[Message]:
        """The messages of these bytes; what is invalid is counted."""
        messages = []
        for data in commands:
            self.received += 1
            try:
                message = decode(data)
                message.check(self._counts)
            except (CodecError, ValueError) as error:
                self.reject(error)
                continue
            messages.append(message)
        return messages

    def reject(self, error: ValueError) -> None:
        """Count a command that is not carried out."""
        self.rejected += 1
        self.last_rejection = str(error)
