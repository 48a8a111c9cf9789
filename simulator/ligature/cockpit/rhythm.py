"""How regularly a browser answers, and how fast an arm may go while it is silent. Seconds.

An arm slows down while its operator's browser is silent for longer than is usual for it, and stands at a limit. The
limit goes with the answers that came: on a busy machine 80 ms are nothing to worry about, on a quiet one they are. It
never exceeds `MOST`, whatever the browser is used to.
"""

from __future__ import annotations

from collections import deque

LEAST, MOST = 0.07, 0.2
"""Silence after which an arm stands: with a browser that answers at once, and at most."""

FACTOR = 2.5
"""How many times its usual silence a browser is given."""

USUAL = 0.9
"""Share of the silences that are no longer than the usual one."""

KEPT = 50
"""Silences that count."""

RISE = 0.15
"""Seconds from standing to full speed when the browser answers again."""


class Pace:
    """Share 0..1 of the full speed of an arm; it falls over the second half of the silence that is allowed."""

    def __init__(self) -> None:
        self._share = 1.0

    def advance(self, silence: float, limit: float, dt: float) -> float:
        """The share after a ``silence`` of which ``limit`` are allowed, ``dt`` after the last call."""
        allowed = min(max(2.0 * (1.0 - silence / limit), 0.0), 1.0)
        self._share = min(allowed, self._share + dt / RISE)
        return self._share


class Rhythm:
    """Silences between answers, or the delays of answers, and the limit that follows from them."""

    def __init__(self) -> None:
        self._silences: deque[float] = deque(maxlen=KEPT)
        self._limit = LEAST
        self._pace = Pace()

    def note(self, silence: float) -> None:
        """A silence has ended."""
        self._silences.append(min(silence, 2.0 * MOST))  # one long absence is not a habit
        usual = sorted(self._silences)[int(USUAL * (len(self._silences) - 1))]
        self._limit = min(max(FACTOR * usual, LEAST), MOST)

    @property
    def limit(self) -> float:
        """Silence after which an arm stands."""
        return self._limit

    def pace(self, silence: float, dt: float) -> float:
        """Share 0..1 of the full speed, ``dt`` after the last call."""
        return self._pace.advance(silence, self._limit, dt)
