"""Commands in the order of their arrival, the newest of each object alone; events keep their place."""

from __future__ import annotations

from collections.abc import Hashable

from ligature.bus.codec import Message
from ligature.model.commands import STREAMED, ActuatorCommand, ArmCommand, ParentCommand, object_of


def _slot(message: Message) -> Hashable | None:
    """What a command replaces the last one of; None for what must not be lost.

    Grasping and letting go are different things to do with one actuator: neither replaces the other. Arms are
    streamed set-points of each kind, and told other things one by one.
    """
    item = object_of(message)
    if isinstance(message, ActuatorCommand):
        return item, message.actuate
    if isinstance(message, ArmCommand):
        return (item, message.verb) if message.verb in STREAMED else None
    return (item, "parent") if isinstance(message, ParentCommand) else item


class Newest:
    """A box of commands; `put` replaces an older command of the same object."""

    def __init__(self) -> None:
        self._box: dict[Hashable, Message] = {}
        self.events = 0

    def __len__(self) -> int:
        return len(self._box)

    def put(self, message: Message) -> bool:
        """Add a command; True when it takes the place of an older one."""
        slot = _slot(message)
        if slot is None:
            self.events += 1
            self._box["event", self.events] = message
            return False
        replaced = self._box.pop(slot, None) is not None
        self._box[slot] = message
        return replaced

    def messages(self) -> list[Message]:
        """The commands, oldest first."""
        return list(self._box.values())

    def clear(self) -> None:
        """Empty the box."""
        self._box.clear()
        self.events = 0
