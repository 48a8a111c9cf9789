"""When pictures are due: every so many frames of one frame clock, the newest state each time.

Times are seconds on a steady clock and are passed in. All shutters of one interval open together, so that left
and right show one moment.
"""

from __future__ import annotations

import math

FRAME_RATE = 120.0
"""Frames a second of the clock that intervals count (as in AMBF)."""

REPEAT = 0.5
"""Seconds after which a state that was shown already is shown again, while a simulation rests."""

SLACK = 1e-6
"""Seconds by which a deadline may be early, for the rounding of floating-point time."""


class Shutter:
    """Opens every ``interval`` frames of the clock; what comes too late is left out."""

    def __init__(self, interval: int, frame_rate: float = FRAME_RATE) -> None:
        self._period = interval / frame_rate
        self._shown_update = -1
        self._shown_at = -math.inf
        self.due = -math.inf

    def missed(self, now: float) -> int:
        """Deadlines that have passed since the one that is due."""
        return 0 if math.isinf(self.due) else max(math.floor((now + SLACK - self.due) / self._period), 0)

    def open(self, now: float, update: int) -> bool:
        """Set the next deadline when one has come; whether ``update`` is to be shown: new, or shown long ago."""
        if now + SLACK < self.due:
            return False
        self.due = (math.floor((now + SLACK) / self._period) + 1) * self._period
        if update == self._shown_update and now < self._shown_at + REPEAT:
            return False
        self._shown_update, self._shown_at = update, now
        return True
