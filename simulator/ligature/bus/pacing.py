"""When the next update may run: against the wall clock, or at the clock edges of a client.

Times are seconds on a steady clock and are passed in; nothing here sleeps or looks at a clock.
"""

from __future__ import annotations

from dataclasses import dataclass

from ligature.model.messages import COUNT, FLAG, Message, Real, wire

WORLD = ("world", 0)
"""The object that world commands are for."""

DEFAULT_SKIP = 10
BACKLOG = 0.05
"""Delay in seconds that the loop catches up; a longer delay stays, and is reported."""

MOST_AHEAD = 10
"""Batches that a client's clock may be ahead, as many as a subscriber's queue holds; further edges are lost."""


@dataclass(frozen=True)
class Throttle(Message, code=6):
    """A world command (as in AMBF): step throttling, its clock, and updates per edge."""

    enabled: bool = wire(FLAG)
    clock: bool = wire(FLAG)
    skip: int = wire(COUNT)

    @property
    def object(self) -> tuple[str, int]:
        """The world."""
        return WORLD

    @property
    def slot(self) -> None:
        """None: each edge of the clock counts, so that no command replaces another."""

    @property
    def releases(self) -> bool:
        """Whether the command ends throttling."""
        return not self.enabled


MIN_SPEED, MAX_SPEED = 0.01, 100.0
"""Bounds of the speed, simulated over wall time, that a command may set."""


@dataclass(frozen=True)
class Pace(Message, code=10):
    """Simulated over wall time from now on."""

    speed: float = wire(Real(MIN_SPEED, MAX_SPEED), "the speed")


class Pacer:
    """Absolute deadlines of updates of ``period`` seconds of simulated time at ``speed``."""

    def __init__(self, period: float, speed: float = 1.0) -> None:
        self._period = period
        self._wall_period = period / speed if speed > 0 else 0.0
        self._next: float | None = None
        self.lost = 0.0
        self._throttled = False
        self._clock = False
        self._skip = DEFAULT_SKIP
        self._budget = 0

    def pace(self, command: Pace) -> None:
        """Change the speed; the delay so far is dropped."""
        self._wall_period = self._period / command.speed
        self._next = None

    def throttle(self, command: Throttle) -> None:
        """Take a world command; an edge of its clock allows ``skip`` more updates, also while others still run.

        Clients repeat a world command at 120 Hz without meaning to change anything: only what differs from the
        last one has an effect.
        """
        if command.skip > 0:
            self._skip = command.skip
        edge = command.clock != self._clock
        self._clock = command.clock
        if not command.enabled:
            if self._throttled:
                self._throttled, self._budget, self._next = False, 0, None
            return
        if not self._throttled:
            self._throttled, self._budget = True, 0
        if edge:
            self._budget = min(self._budget + self._skip, MOST_AHEAD * self._skip)

    def wait(self, now: float) -> float:
        """Seconds until the next update may run: 0 for now, infinity while a client's clock rests."""
        if self._throttled:
            return 0.0 if self._budget > 0 else float("inf")
        if self._next is None:
            self._next = now
        return max(self._next - now, 0.0)

    def done(self, now: float) -> None:
        """An update was run, after `wait` had reported that it may."""
        if self._throttled:
            self._budget -= 1
            return
        self._next = (now if self._next is None else self._next) + self._wall_period
        if now - self._next > BACKLOG:
            self.lost += now - self._next - BACKLOG
            self._next = now - BACKLOG
