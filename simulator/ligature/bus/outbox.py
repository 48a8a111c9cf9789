"""The front end's side of its ring: commands that do not fit wait, the newest for each object.

A physics process that is held up for a moment must not lose a front end's last command: the release of
an arm whose client is gone, or a reset, is sent only once.
"""

from __future__ import annotations

import threading

from ligature.bus.codec import Message, encode
from ligature.bus.newest import Newest
from ligature.bus.ring import Ring

MOST_EVENTS = 100
"""Most events (resets, clock edges) that wait; further ones are dropped and counted."""


class Outbox:
    """Pushes commands into ``ring``; may be used from several threads."""

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self._waiting = Newest()
        self._lock = threading.Lock()

    def push(self, message: Message) -> None:
        """Send a command, or keep it until there is room; raises `CodecError` when it fits no slot."""
        data = encode(message)
        with self._lock:
            self._flush()
            if len(self._waiting) or not self._ring.push(data):
                self._keep(message)

    def flush(self) -> None:
        """Send what waits, as far as there is room."""
        with self._lock:
            self._flush()

    def _flush(self) -> None:
        if not len(self._waiting):
            return
        messages = self._waiting.messages()
        self._waiting.clear()
        for i, message in enumerate(messages):
            if not self._ring.push(encode(message)):
                for rest in messages[i:]:
                    self._waiting.put(rest)
                return

    def _keep(self, message: Message) -> None:
        if self._waiting.events >= MOST_EVENTS or self._waiting.put(message):
            self._ring.drop()
