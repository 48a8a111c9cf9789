"""Namespaces, and finding objects by text: exact, else the only one that contains it (as in AMBF)."""

from __future__ import annotations

import re
from collections.abc import Sequence

_SLASHES = re.compile(r"/+")


def merged(outer: str, inner: str) -> str:
    """Namespace of an object: ``inner`` alone when it is absolute, else plain concatenation."""
    outer, inner = _SLASHES.sub("/", outer), _SLASHES.sub("/", inner)
    return inner if inner.startswith("/") else outer + inner


def candidates(identifiers: Sequence[str], text: str) -> list[int]:
    """Indices that ``text`` may mean: the exact match alone, else all that contain it."""
    for index, identifier in enumerate(identifiers):
        if identifier == text:
            return [index]
    return [index for index, identifier in enumerate(identifiers) if text in identifier]


def find_by_text(identifiers: Sequence[str], text: str) -> int | None:
    """Index of the one identifier that ``text`` means; None for no match or several."""
    found = candidates(identifiers, text)
    return found[0] if len(found) == 1 else None
