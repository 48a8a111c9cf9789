"""Lines of a text, which end as YAML 1.1 lets them end: as those of Unix, Windows, old Macs, or by Unicode's signs.

One file may have several kinds, as where two systems edited it.
"""

from __future__ import annotations

import re

BREAKS = "\n\r\x85\u2028\u2029"
"""Characters that end a line."""

_BREAK = re.compile(f"\r\n|[{BREAKS}]")
_KEPT = re.compile(f"(\r\n|[{BREAKS}])")


def lines_of(text: str) -> list[str]:
    """The lines of ``text`` without their breaks."""
    return _BREAK.split(text)


def lines_and_breaks(text: str) -> tuple[list[str], list[str]]:
    """The lines of ``text``, and the break behind each; that of the last is empty."""
    pieces = _KEPT.split(text)
    return pieces[::2], [*pieces[1::2], ""]


def line_begin(text: str, offset: int) -> int:
    """Where the line that holds ``offset`` begins."""
    while offset > 0 and text[offset - 1] not in BREAKS:
        offset -= 1
    return offset


def line_end(text: str, offset: int) -> int:
    """Where the line that holds ``offset`` ends, before its break."""
    if text[offset - 1 : offset + 1] == "\r\n":
        return offset - 1
    found = _BREAK.search(text, offset)
    return found.start() if found else len(text)


def next_line(text: str, offset: int) -> int:
    """Where the line behind the one that holds ``offset`` begins."""
    found = _BREAK.search(text, offset)
    return found.end() if found else len(text)


def break_of(text: str) -> str:
    """The first line break of ``text``, which lines that are added take."""
    found = _BREAK.search(text)
    return found[0] if found else "\n"
