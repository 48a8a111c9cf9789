"""Changes single values of a file's text and leaves every other byte alone, comments and anchors included.

Functions take the text and nodes read from that very text, and return the new text. A value that
comes through an alias belongs to its anchor: changing it there would change every user of it, so it
is refused with the place of the anchor.
"""

from __future__ import annotations

from typing import Any

from ligature.adf.nodes import Mapping, Node, Scalar, Sequence
from ligature.adf.writer import scalar_text, text_scalar


class PatchError(ValueError):
    """A change that cannot be made in place; the message says why."""


def set_scalar(text: str, owner: Mapping, path: str, value: Any) -> str:
    """Replace the scalar at the dotted ``path`` below ``owner``; raises `PatchError`."""
    parent, node = _find(owner, path)
    if not isinstance(node, Scalar):
        raise PatchError(f"'{path}' at {node.mark} is a block, not a single value")
    _own(parent, node, path)
    start, end = _offset(text, node.mark.line, node.mark.column), _offset(text, *node.end)
    new = scalar_text(value)
    if start == end and start > 0 and text[start - 1] == ":":
        new = " " + new
    return text[:start] + new + text[end:]


def add_key(text: str, owner: Mapping, name: str, value: Any) -> str:
    """Add ``name: value`` at the end of the block ``owner``; raises `PatchError` when it is there already."""
    if name in owner.entries:
        raise PatchError(f"'{name}' is there already, at {owner.entries[name][0].mark}")
    entry = f"{text_scalar(name)}: {scalar_text(value)}"
    if owner.flow:
        at = _offset(text, *owner.end) - 1
        separator = ", " if owner.entries else ""
        return text[:at].rstrip() + separator + entry + text[at:]
    if not owner.entries:
        raise PatchError(f"the block at {owner.mark} is empty; write it as '{{{entry}}}'")
    last = max(_last_line(value_) for _, value_ in owner.entries.values() if _inside(owner, value_))
    column = next(iter(owner.entries.values()))[0].mark.column
    lines = text.split("\n")
    lines.insert(last, " " * (column - 1) + entry)
    return "\n".join(lines)


def remove_key(text: str, owner: Mapping, name: str) -> str:
    """Remove a key and its value from the block ``owner``; raises `PatchError` for flow blocks with others."""
    if name not in owner.entries:
        raise PatchError(f"there is no '{name}' in the block at {owner.mark}")
    key, value = owner.entries[name]
    if owner.flow:
        raise PatchError(f"'{name}' at {key.mark} stands in a flow block; rewrite the block")
    last = _last_line(value) if _inside(owner, value) else key.mark.line
    lines = text.split("\n")
    del lines[key.mark.line - 1 : max(last, key.mark.line)]
    return "\n".join(lines)


def _find(owner: Mapping, path: str) -> tuple[Mapping, Node]:
    parent = owner
    *inner, name = path.split(".")
    for part in inner:
        node = parent.get(part)
        if not isinstance(node, Mapping):
            raise PatchError(f"there is no block '{part}' on the way to '{path}' at {parent.mark}")
        _own(parent, node, part)
        parent = node
    found = parent.get(name)
    if found is None:
        raise PatchError(f"there is no '{path}' in the block at {owner.mark}")
    return parent, found


def _own(parent: Mapping, node: Node, path: str) -> None:
    if not _inside(parent, node):
        raise PatchError(f"'{path}' is an alias of the value at {node.mark}; change it there or replace the alias")


def _inside(parent: Node, node: Node) -> bool:
    start = (parent.mark.line, parent.mark.column)
    return start <= (node.mark.line, node.mark.column) <= parent.end


def _last_line(node: Node) -> int:
    """The last line, from 1, that holds something of a node."""
    inner: list[Node] = []
    if isinstance(node, Mapping):
        inner = [value for _, value in node.entries.values() if _inside(node, value)]
        inner += [key for key, _ in node.entries.values()]
    elif isinstance(node, Sequence):
        inner = [item for item in node.items if _inside(node, item)]
    if isinstance(node, Mapping) and not node.flow and inner:
        return max(_last_line(child) for child in inner)
    if isinstance(node, Sequence) and inner and node.end[1] == 1:
        return max(_last_line(child) for child in inner)
    return node.end[0]


def _offset(text: str, line: int, column: int) -> int:
    """Position in ``text`` of a line and column, both from 1."""
    at = 0
    for _ in range(line - 1):
        at = text.index("\n", at) + 1
    return at + column - 1
