"""Makes flow collections that leave their indentation readable, as yaml-cpp reads them.

YAML wants the lines of a ``{…}`` or ``[…]`` to be indented deeper than the key they belong to;
yaml-cpp does not mind, and real files rely on it (ADF specification §1.1). Blanks are inserted at
line starts only, so that lines stay lines and columns can be counted back.
"""

from __future__ import annotations

INDENT = 32
"""Blanks put before a flow line; deeper than any block mapping of a scene file."""


def relax(text: str) -> tuple[str, dict[int, int]]:
    """``text`` with flow lines indented, and how many blanks each line (from 0) was given."""
    lines = text.split("\n")
    inserted: dict[int, int] = {}
    depth = 0
    opens_value = False
    for number, line in enumerate(lines):
        stripped = line.lstrip(" \t")
        if depth > 0 or (opens_value and stripped[:1] in ("{", "[")):
            inserted[number] = INDENT
            lines[number] = " " * INDENT + line
        depth = _depth_after(line, depth)
        if stripped and not stripped.startswith("#"):
            opens_value = depth == 0 and _ends_open(stripped)
    return "\n".join(lines), inserted


def _ends_open(line: str) -> bool:
    """Whether a line ends with ``key:`` or ``key: &anchor`` and its value follows on the next."""
    words = line.split(" #", 1)[0].rstrip().split()
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
