"""Wrong tokens: their address must wait, longer each time, and the terminal reports it. Seconds, monotonic clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

FREE = 3
"""Wrong tokens of an address without a pause: people mistype."""

FIRST_PAUSE, LONGEST_PAUSE = 0.5, 5.0
"""Seconds between two answers after those: doubled with each wrong token."""

FORGET = 300.0
"""Seconds without a wrong token after which an address begins anew."""

MOST_ADDRESSES = 1000
"""Most addresses that are remembered; then the one whose last token is the oldest is forgotten."""

REPORT_PAUSE = 10.0
"""Seconds between two lines of an address on the terminal."""


@dataclass
class _Caller:
    """State of one address: wrong tokens in all, those since the last log line, and when the next answer is due."""

    wrong: int = 0
    unreported: int = 0
    last: float = 0.0
    due: float = 0.0
    reported: float = float("-inf")


class Guesses:
    """Who showed wrong tokens; ``log`` receives a line for the terminal."""

    def __init__(self, log: Callable[[str], None]) -> None:
        self._log = log
        self._callers: dict[str, _Caller] = {}

    def wait(self, who: str, now: float) -> float | None:
        """Seconds before a token that address ``who`` shows at ``now`` may be looked at; None: it is not looked at.

        Tokens that are shown at the same time wait one after the other, so that many connections guess no faster.
        """
        caller = self._callers.get(who)
        if caller is None or caller.wrong < FREE:
            return 0.0
        if now - caller.last > FORGET:
            del self._callers[who]
            return 0.0
        due = max(caller.due, now) + min(FIRST_PAUSE * 2 ** min(caller.wrong - FREE, 10), LONGEST_PAUSE)
        if due - now > LONGEST_PAUSE:
            self._note(who, caller, now)
            return None
        caller.due = due
        return due - now

    def wrong(self, who: str, now: float) -> None:
        """A wrong token came from address ``who``."""
        if who not in self._callers and len(self._callers) >= MOST_ADDRESSES:
            del self._callers[min(self._callers, key=lambda address: self._callers[address].last)]
        self._note(who, self._callers.setdefault(who, _Caller()), now)

    def _note(self, who: str, caller: _Caller, now: float) -> None:
        caller.wrong += 1
        caller.unreported += 1
        caller.last = now
        if now - caller.reported >= REPORT_PAUSE:
            tokens = "a wrong token" if caller.unreported == 1 else f"{caller.unreported} wrong tokens"
            self._log(f"cockpit: {tokens} from {who}, {caller.wrong} in all")
            caller.reported, caller.unreported = now, 0
