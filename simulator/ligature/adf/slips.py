"""What to write instead of text at which YAML cannot be read on. Lines count from 0, as in YAML libraries."""

from __future__ import annotations

import re
from typing import Any

from ligature.adf.lines import lines_of

_BLANK = "[\u00a0\u2000-\u200b\u202f\u205f\u3000\ufeff]"
"""Characters that look like a blank, or like nothing, and are none for YAML."""

_SLIPS = (
    (re.compile(r" *\t"), "line {line} is indented by a tab; use blanks"),
    (re.compile(f".*{_BLANK}"), "line {line} has a no-break or wide blank; type it anew"),
    (re.compile(r"[^#'\"]*[\w)]:[-+.\w'\"][^:]*$"), "line {line} lacks a blank behind ':'; write 'key: value'"),
)
"""What is wrong with a line, as authors are often unaware of it."""

_REMEDIES = (
    ("mapping values", "indent it like the line before, or put a text that has ': ' in quotes"),
    ("found character", "put the text in quotes"),
    ("did not find expected ',' or", "close the bracket of line {opened}"),
    ("found unexpected end of stream", "close the quotation of line {opened}"),
    ("did not find expected key", "indent it like the keys before it"),
    ("could not find expected ':'", "write 'key: value'"),
)
"""Beginnings of what the YAML library says, and what is right."""


def remedy(text: str, error: Any) -> str:
    """What to do about a YAML ``error`` in ``text``, which has a problem and where it and its context are."""
    lines = lines_of(text)
    at = error.problem_mark or error.context_mark
    for number in (at.line, *_before(lines, at.line)):
        for slip, words in _SLIPS:
            if number < len(lines) and slip.match(lines[number]):
                return words.format(line=number + 1)
    opened = (error.context_mark or at).line + 1
    for beginning, words in _REMEDIES:
        if str(error.problem).startswith(beginning):
            return words.format(opened=opened)
    return str(error.context or "")


def _before(lines: list[str], line: int) -> list[int]:
    """The last line with text before ``line``, if there is one: YAML notices some slips only behind them."""
    return [n for n in range(min(line, len(lines)) - 1, -1, -1) if lines[n].strip()][:1]
