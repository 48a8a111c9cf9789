"""Commands in the order of their arrival, the newest of each object alone; events keep their place."""

from __future__ import annotations

from collections.abc import Hashable

from ligature.model.messages import Message


class Newest:
    """A box of commands; `put` replaces an older command of the same object."""

    def __init__(self) -> None:
        self._box: dict[Hashable, Message] = {}
        self.events = 0

    def __len__(self) -> int:
        return len(self._box)

    def put(self, message: Message) -> bool:
        """Add a command; True when it takes the place of an older one."""
        slot = message.slot
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
