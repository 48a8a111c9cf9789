"""When each object is published: deadlines on one common grid of the monotonic clock, in seconds.

Objects of one rate fall due together, so that one reading of the state serves them all and a client
sees one moment. A state that was sent already is repeated at the low rate only.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from ligature.ros.conversion import Record

Key = tuple[str, int]
"""Kind and index of an object."""

SLACK = 1e-6
"""Seconds by which a deadline may be early, for the rounding of floating-point time."""


class Sink(Protocol):
    """Where messages go: a `Publisher`."""

    @property
    def heard(self) -> bool:
        """Whether anybody listens."""

    def publish(self, message: Any) -> None:
        """Send a message."""


class Outlet:
    """One published object: its template, ROS name, publisher, its rates in Hz, and when it is due."""

    def __init__(self, template: Any, topic: str, publisher: Sink, low: float, high: float) -> None:
        self.template, self.topic, self.publisher = template, topic, publisher
        self.low, self.high = low, high
        self.key: Key = (template.kind, template.index)
        self.due = -math.inf
        self._sent_update = -1
        self._sent_due = -math.inf

    def send(self, state: Record, stamp: Any) -> bool:
        """Publish ``state`` if it has subscribers and is new; returns whether it was published."""
        update = int(state["update"])
        seen = update == self._sent_update and self.due < self._sent_due + 1.0 / self.low - SLACK
        if seen or not self.publisher.heard:
            return False
        self.publisher.publish(self.template.fill(state, stamp))
        self._sent_update, self._sent_due = update, self.due
        return True

    def settle(self, now: float, commanded: bool) -> int:
        """Set the next deadline; returns how many were missed."""
        period = 1.0 / (self.high if commanded else self.low)
        upcoming = (math.floor((now + SLACK) / period) + 1) * period
        missed = 0 if math.isinf(self.due) else max(int((upcoming - self.due) / period + 0.5) - 1, 0)
        self.due = upcoming
        return missed


class Schedule:
    """All outlets; ``commanded`` reports whether an object is being commanded."""

    def __init__(self, outlets: Sequence[Outlet], commanded: Callable[[Key], bool]) -> None:
        self._outlets = list(outlets)
        self._by_key = {outlet.key: outlet for outlet in outlets}
        self._commanded = commanded
        self._woken: deque[tuple[Key, bool]] = deque()

    def wake(self, key: Key, at_once: bool) -> None:
        """An object is commanded from now on, or (``at_once``) has more to report; for any thread."""
        self._woken.append((key, at_once))

    def next_due(self, now: float) -> float:
        """The earliest deadline, after `wake`."""
        while self._woken:
            key, at_once = self._woken.popleft()
            outlet = self._by_key.get(key)
            if outlet is not None:
                outlet.due = now if at_once else min(outlet.due, now + 1.0 / outlet.high)
        return min(outlet.due for outlet in self._outlets)

    def publish(self, now: float, state: Record, stamp: Any) -> tuple[int, int]:
        """Publish what is due; returns how many messages were sent and how many deadlines were missed."""
        sent = missed = 0
        for outlet in self._outlets:
            if outlet.due <= now:
                sent += outlet.send(state, stamp)
                missed += outlet.settle(now, self._commanded(outlet.key))
        return sent, missed
