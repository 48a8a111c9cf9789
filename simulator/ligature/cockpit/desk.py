"""Who operates: one browser at a time, known by a key that it keeps across reloads. Seconds on any steady clock."""

from __future__ import annotations

import hmac
import secrets

GRACE = 15.0
"""Seconds for which the desk is kept for an operator whose browser is gone: a reload, or a bad network."""


class Desk:
    """The operator's seat."""

    def __init__(self) -> None:
        self.operator: int | None = None
        self._key = ""
        self._left = float("-inf")

    def claim(self, client: int, now: float, key: str = "") -> str | None:
        """Seat ``client``; the key by which it reconnects, None when the desk is occupied or reserved.

        Who has the key of the last operator may sit down in any case: it is the same browser in another tab.
        """
        if not self._fits(key) and (self.operator is not None or self.kept(now) > 0.0):
            return None
        self.operator, self._key = client, secrets.token_urlsafe(16)
        return self._key

    def comes_back(self, client: int, key: str, now: float) -> bool:
        """Seat ``client`` again when it has the key of the operator who left, and the desk was kept."""
        if self.operator is not None or self.kept(now) <= 0.0 or not self._fits(key):
            return False
        self.operator = client
        return True

    def _fits(self, key: str) -> bool:
        return bool(key and self._key) and hmac.compare_digest(key.encode(), self._key.encode())

    def leaves(self, client: int, now: float) -> bool:
        """The browser of ``client`` is gone; True when it was the operator's."""
        if client != self.operator:
            return False
        self.operator, self._left = None, now
        return True

    def releases(self, client: int) -> bool:
        """``client`` gives the desk up; True when it had it."""
        if client != self.operator:
            return False
        self.operator, self._key, self._left = None, "", float("-inf")
        return True

    def kept(self, now: float) -> float:
        """Seconds for which an empty desk is still kept for who left it."""
        return max(self._left + GRACE - now, 0.0) if self.operator is None and self._key else 0.0
