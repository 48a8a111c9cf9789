"""Which objects have not been commanded for too long (as in AMBF); time is an argument."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Generic, TypeVar

TIMEOUT = 0.5
"""Seconds without a command after which an object's command is cleared."""

Object = TypeVar("Object", bound=Hashable)


class Watchdog(Generic[Object]):
    """Keeps the time of the last command of each object."""

    def __init__(self, timeout: float = TIMEOUT) -> None:
        self._timeout = timeout
        self._last: dict[Object, float] = {}

    def feed(self, item: Object, now: float) -> None:
        """``item`` was commanded at ``now`` (seconds on any steady clock)."""
        self._last[item] = now

    def alive(self, item: Object) -> bool:
        """Whether ``item`` is being commanded."""
        return item in self._last

    def expired(self, now: float) -> list[Object]:
        """The objects whose last command is too old; each is reported once."""
        late = [item for item, last in list(self._last.items()) if now - last > self._timeout]
        for item in late:
            self._last.pop(item, None)
        return late
