"""Makes text readable that yaml-cpp reads and libyaml refuses: little indented flow collections, tabs, anchors.

YAML requires the lines of a ``{…}`` or ``[…]`` to be indented deeper than their key. yaml-cpp does not check this, and
real files rely on it (as in AMBF). Spaces are inserted only at line starts, so that every line and column
of the original can be computed. Lines and columns count from 0, as in YAML libraries.

YAML allows tabs in lines that are blank or a comment, which editors leave there; libyaml does not. Blanks replace them.

YAML's anchors may have any character but blanks and brackets in their names, as ``&psm.jaw`` and ``&größe``; libyaml
knows letters, digits, ``-`` and ``_``. Such names are replaced by others as long.
"""

from __future__ import annotations

import bisect
import itertools
import re
from dataclasses import dataclass, field
from operator import add

from ligature.adf.lines import lines_and_breaks

INDENT = 32
"""Spaces inserted before a line of a flow collection; more than any block mapping of a scene file has."""


@dataclass(frozen=True)
class Relaxed:
    """``text`` with spaces inserted before some ``lines``; `original` gives the places before the insertion.

    ``anchors`` are the names before of those that were replaced.
    """

    text: str
    lines: list[int] = field(default_factory=list)
    anchors: dict[str, str] = field(default_factory=dict)

    def original(self, line: int, column: int, index: int) -> tuple[int, int]:
        """Column and index, before the insertion, of a place in ``text``."""
        at = bisect.bisect_left(self.lines, line)
        here = min(INDENT, column) if at < len(self.lines) and self.lines[at] == line else 0
        return column - here, index - at * INDENT - here


def relax(text: str) -> Relaxed:
    """``text`` with the lines inside flow collections indented, and tabs in empty lines and odd anchors replaced."""
    text, anchors = _renamed(_TABS.sub(lambda found: " " * len(found[0]), text))
    lines, breaks = lines_and_breaks(text)
    inserted: list[int] = []
    depth = 0
    opens_value = False
    for number, line in enumerate(lines):
        stripped = line.lstrip(" \t")
        if depth > 0 or (opens_value and stripped[:1] in ("{", "[")):
            inserted.append(number)
            lines[number] = " " * INDENT + line
        depth = _depth_after(line, depth)
        if stripped and not stripped.startswith("#"):
            opens_value = depth == 0 and _ends_open(stripped)
    return Relaxed("".join(map(add, lines, breaks)), inserted, anchors)


_TABS = re.compile(r"(?<![^\r\n])[ \t]*\t[ \t]*(?=[#\r\n]|\Z)")
"""The beginning of a line that is blank or a comment, where it has a tab."""


def _renamed(text: str) -> tuple[str, dict[str, str]]:
    """``text`` with anchors that libyaml knows, each as long as before, and what they were called."""
    odd = {found["name"] for found in _TOKEN.finditer(text) if found["sign"] and not _KNOWN(found["name"])}
    taken = set(_WORD.findall(text)) if odd else set()
    free = {n: map("".join, itertools.product(_LETTERS, repeat=n)) for n in set(map(len, odd))}
    names = {name: next((other for other in free[len(name)] if other not in taken), name) for name in sorted(odd)}

    def replaced(found: re.Match[str]) -> str:
        sign, name = found["sign"], found["name"]
        return found[0] if sign is None else sign + names.get(name, name)

    return _TOKEN.sub(replaced, text) if names else text, {new: old for old, new in names.items()}


_TOKEN = re.compile(
    r"""(?<![^\s:,\[{-])(?:"(?:[^"\\]|\\.)*"|'(?:[^']|'')*'|\#[^\r\n]*|(?P<sign>[&*])(?P<name>[^\s,\[\]{}]+))""",
    re.DOTALL,
)
"""What is quoted, a comment, or an anchor or alias."""

_WORD = re.compile("[0-9A-Za-z_-]+")
_KNOWN = _WORD.fullmatch
_LETTERS = "abcdefghijklmnopqrstuvwxyz0123456789"


def _ends_open(line: str) -> bool:
    """Whether a line ends with ``key:`` or ``key: &anchor`` and its value follows on the next."""
    words = re.split(r"\s#", line, maxsplit=1)[0].split()
    if words and words[-1].startswith("&"):
        words.pop()
    return bool(words) and words[-1].endswith(":")


def _depth_after(line: str, depth: int) -> int:
    """Depth of open flow brackets after ``line``, not counting quotes and comments."""
    quote = ""
    previous = " "
    for character in line:
        if quote:
            if character == quote:
                quote = ""
        elif character in "'\"" and previous in " \t:,[{-":
            quote = character
        elif character == "#" and previous in " \t":
            break
        elif character in "{[" and (depth > 0 or previous in " \t:-"):
            depth += 1
        elif character in "}]" and depth > 0:
            depth -= 1
        previous = character
    return depth
