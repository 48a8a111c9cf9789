"""Changes single values of a file's text and leaves every other byte alone, comments and anchors included.

Functions take the text and nodes read from that very text, and return edits; `apply` makes the new
text of them. A value that comes through an alias belongs to its anchor: the alias is replaced by
the changed value itself, so that other users of the anchor keep theirs.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from ligature.adf.lines import BREAKS, break_of, line_begin, line_end, next_line
from ligature.adf.nodes import Mapping, Node, Scalar, Sequence, Span
from ligature.adf.writer import Literal, entry_lines, flow_text, scalar_text, text_scalar


class PatchError(ValueError):
    """A change that cannot be made in place; the message is the reason."""


@dataclass(frozen=True, order=True)
class Edit:
    """Replacement of the text at ``span`` by ``text``."""

    span: Span
    text: str


def apply(text: str, edits: Iterable[Edit]) -> str:
    """The text with all edits made; raises `PatchError` when two of them meet.

    Several insertions at one place come in the order given, those into inner blocks first.
    """
    pieces: list[str] = []
    done = 0
    for edit in sorted(edits, key=lambda e: (e.span, _outwards(e.text))):
        start, end = edit.span
        if start < done:
            raise PatchError(f"two changes meet at offset {start}")
        pieces += (text[done:start], edit.text)
        done = end
    return "".join((*pieces, text[done:]))


def _outwards(text: str) -> tuple[int, bool]:
    """Sort key of lines inserted behind the same line: deeper indentation first, items of a list before keys."""
    line = text.lstrip(BREAKS)
    inner = line.lstrip(" ")
    return (len(inner) - len(line), not inner.startswith("-")) if line != text else (0, False)


def set_value(text: str, owner: Mapping, path: str, value: Any) -> Edit:
    """Make ``value`` stand at the dotted ``path`` below ``owner``; blocks on the way are added.

    ``value`` is a scalar, or nested mappings and lists of scalars. Raises `PatchError` when a single
    value stands where a block is needed.
    """
    parent = owner
    *inner, name = path.split(".")
    for depth, part in enumerate(inner):
        node = parent.get(part)
        rest = ".".join((*inner[depth + 1 :], name))
        if node is None:
            return add_key(text, parent, part, _nested(rest, value))
        if parent.aliased(part):
            return Edit(parent.uses[part], flow_text(_changed(node, rest, value)))
        if isinstance(node, Scalar) and node.null:
            return _replaced(text, parent, part, _nested(rest, value))
        if not isinstance(node, Mapping):
            raise PatchError(f"'{part}' at {node.mark} is not a block, so '{path}' cannot be inside it")
        parent = node
    if name not in parent.entries:
        return add_key(text, parent, name, value)
    return _replaced(text, parent, name, value)


def add_key(text: str, owner: Mapping, name: str, value: Any) -> Edit:
    """Add ``name: value`` at the end of the block ``owner``; raises `PatchError` when the key exists already."""
    if name in owner.entries:
        raise PatchError(f"'{name}' already exists, at {owner.entries[name][0].mark}")
    if owner.flow:
        at = len(text[: owner.span[1] - 1].rstrip())
        separator = "" if not owner.entries else " " if text[at - 1] == "," else ", "
        return Edit((at, at), f"{separator}{text_scalar(name)}: {flow_text(value)}")
    if not owner.entries:
        raise PatchError(f"the block at {owner.mark} is empty, so nothing can be added to it")
    column = next(iter(owner.entries.values()))[0].mark.column - 1
    at = line_end(text, content_end(owner))
    return Edit((at, at), _lines(text, ["", *_indented(entry_lines(name, value), column)]))


def remove_key(text: str, owner: Mapping, name: str) -> Edit:
    """Remove a key and its value from the block ``owner``, with the lines they take.

    Raises `PatchError` when the block has no such key.
    """
    if name not in owner.entries:
        raise PatchError(f"there is no '{name}' in the block at {owner.mark}")
    names = list(owner.entries)
    position = names.index(name)
    start, end = owner.entries[name][0].span[0], _use_end(owner, name)
    following = owner.entries[names[position + 1]][0].span[0] if position + 1 < len(names) else None
    if owner.flow:
        return Edit(_without_comma(text, (start, end), following, position > 0), "")
    begin = line_begin(text, start)
    if not text[begin:start].strip():
        return Edit((begin, next_line(text, end)), "")
    if following is None:  # the only key of an item of a list
        return Edit((start, end), "{}")
    return Edit((start, following), "")


def add_item(text: str, items: Sequence, value: Any) -> Edit:
    """Add ``value`` at the end of a list, written as the item before it."""
    if items.flow:
        at = len(text[: items.span[1] - 1].rstrip())
        separator = "" if not items.items else " " if text[at - 1] == "," else ", "
        return Edit((at, at), separator + flow_text(value))
    at = line_end(text, content_end(items))
    dash = _dash(text, items.uses[-1][0])
    return Edit((at, at), _lines(text, ["", *_item_lines(text, dash, items.items[-1], value)]))


def insert_item(text: str, items: Sequence, index: int, value: Any) -> Edit:
    """Add ``value`` before the item at ``index``, written as that one.

    Raises `PatchError` when that item shares its line with others.
    """
    start = items.uses[index][0]
    if items.flow:
        return Edit((start, start), flow_text(value) + ", ")
    dash = _dash(text, start)
    begin = line_begin(text, dash)
    if text[begin:dash].strip():
        raise PatchError(f"the item at {items.items[index].mark} shares its line, so nothing can be inserted before it")
    return Edit((begin, begin), _lines(text, [*_item_lines(text, dash, items.items[index], value), ""]))


def _item_lines(text: str, dash: int, beside: Node, value: Any) -> list[str]:
    """The lines of an item of a list in blocks, whose dashes stand below the one at offset ``dash``."""
    column = dash - line_begin(text, dash)
    if isinstance(beside, Mapping) and not beside.flow:
        return _indented(entry_lines("", [value])[1:], column)
    return [" " * column + "- " + flow_text(value)]


def spelled_out(node: Node) -> str:
    """The text of a value in one line, with all its keys and digits, for a place where an alias stood."""
    return flow_text(_literal(node))


def remove_item(text: str, items: Sequence, index: int) -> Edit:
    """Remove one item of a list, with the lines it takes."""
    start, end = items.uses[index][0], _item_end(items, index)
    if items.flow:
        following = items.uses[index + 1][0] if index + 1 < len(items.items) else None
        return Edit(_without_comma(text, (start, end), following, index > 0), "")
    begin = line_begin(text, _dash(text, start))  # the dash may stand on a line of its own
    return Edit((begin, next_line(text, end)), "")


def _dash(text: str, start: int) -> int:
    """Offset of the dash of the list item whose value begins at ``start``."""
    dash = text.rfind("-", 0, start)
    while dash > 0 and not (text[dash - 1].isspace() and text[dash + 1 : dash + 2].isspace()):
        dash = text.rfind("-", 0, dash)
    return max(dash, 0)


def rename_key(owner: Mapping, name: str, new: str) -> Edit:
    """Another key for the same value; raises `PatchError` when the new one is taken."""
    if new in owner.entries:
        raise PatchError(f"'{new}' already exists, at {owner.entries[new][0].mark}")
    return Edit(owner.entries[name][0].span, text_scalar(new))


def aliases_into(root: Node, span: Span) -> Iterator[Edit]:
    """Edits that spell out every alias, outside ``span``, of a value that stands inside it."""
    if isinstance(root, Mapping):
        uses = [(root.uses[name], value) for name, (_, value) in root.entries.items()]
    elif isinstance(root, Sequence):
        uses = list(zip(root.uses, root.items, strict=True))
    else:
        return
    for use, value in uses:
        if span[0] <= use[0] < span[1]:
            continue
        if use == value.span:
            yield from aliases_into(value, span)
        elif span[0] <= value.span[0] < span[1]:
            yield Edit(use, flow_text(_literal(value)))


def content_end(node: Node) -> int:
    """Offset behind the last character of a value, without blank lines and comments that follow it."""
    if isinstance(node, Mapping) and not node.flow and node.entries:
        return max(_use_end(node, name) for name in node.entries)
    if isinstance(node, Sequence) and not node.flow and node.items:
        return _item_end(node, len(node.items) - 1)
    return node.span[1]


def _use_end(owner: Mapping, name: str) -> int:
    return owner.uses[name][1] if owner.aliased(name) else content_end(owner.entries[name][1])


def _item_end(items: Sequence, index: int) -> int:
    aliased = items.uses[index] != items.items[index].span
    return items.uses[index][1] if aliased else content_end(items.items[index])


def _replaced(text: str, parent: Mapping, name: str, value: Any) -> Edit:
    """New value of an existing key, in the style of the old one."""
    node = parent.entries[name][1]
    if parent.aliased(name):
        return Edit(parent.uses[name], flow_text(value))
    start, end = node.span[0], content_end(node)
    if not isinstance(value, dict | list | tuple):
        new = scalar_text(value)
        return Edit((start, end), " " + new if start == end and text[start - 1] == ":" else new)
    if parent.flow or (isinstance(node, Mapping | Sequence) and node.flow):
        return Edit((start, end), flow_text(value))
    if not value:
        return Edit((parent.entries[name][0].span[1], end), ": " + flow_text(value))
    key = parent.entries[name][0]
    column = key.mark.column - 1
    first, *rest = _indented(entry_lines(name, value), column)
    behind = text[key.span[1] : start]
    anchor = f" {behind[1:].strip()}" if node.anchor else ""
    return Edit((key.span[0], end), _lines(text, [first[column:] + anchor, *rest]))


def _nested(path: str, value: Any) -> Any:
    for part in reversed(path.split(".")):
        value = {part: value}
    return value


def _changed(node: Node, path: str, value: Any) -> Any:
    """The plain value of ``node`` with ``value`` at ``path``."""
    whole = _literal(node)
    target = whole = whole if isinstance(whole, dict) else {}
    *inner, name = path.split(".")
    for part in inner:
        if not isinstance(target.get(part), dict):
            target[part] = {}
        target = target[part]
    target[name] = value
    return whole


def _literal(node: Node) -> Any:
    """A node as nested dicts, lists and strings; numbers remain as they are written."""
    if isinstance(node, Mapping):
        return {key: _literal(value) for key, (_, value) in node.entries.items()}
    if isinstance(node, Sequence):
        return [_literal(item) for item in node.items]
    assert isinstance(node, Scalar)
    return Literal(node.text) if node.plain else node.text


def _without_comma(text: str, span: Span, following: int | None, has_previous: bool) -> Span:
    """The span of an entry of a flow collection with one of the commas around it."""
    if following is not None:
        return span[0], following
    if has_previous:
        return text.rindex(",", 0, span[0]), span[1]
    return span


def _lines(text: str, lines: list[str]) -> str:
    """Lines joined by the line break that ``text`` uses."""
    return break_of(text).join(lines)


def _indented(lines: list[str], column: int) -> list[str]:
    return [" " * column + line for line in lines]
