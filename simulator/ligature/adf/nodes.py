"""YAML as marked nodes: text and places only, no value is interpreted and no object constructed.

The first of two equal keys wins, only the first document of a stream is read, aliases share nodes.
Depth, size and alias expansion are limited. Lines and columns count from 1, offsets from 0; all
count characters.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from ligature.adf.diagnostics import AdfError, Diagnostic, Mark, Severity
from ligature.adf.lines import lines_of
from ligature.adf.relax import Relaxed, relax
from ligature.adf.slips import remedy

MAX_DEPTH = 64
MAX_NODES = 1_000_000
"""Most nodes of a document after alias expansion; the largest real file has 40 000."""

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_PROPERTIES = re.compile(r"([&!]\S*\s*)+")
"""Anchor and tag before a value."""

Span = tuple[int, int]
"""First offset and one past the last, in the text of the file."""


@dataclass(eq=False)
class Node:
    """One YAML node.

    ``span`` is what the value takes in the text, without anchor and tag; ``weight`` counts nodes
    with aliases expanded; ``anchor`` is the name it can be repeated by, if any.
    """

    mark: Mark
    span: Span
    weight: int = 1
    anchor: str = ""


@dataclass(eq=False)
class Scalar(Node):
    """A scalar: ``text`` after unquoting, and whether it was written plain."""

    text: str = ""
    plain: bool = True

    @property
    def null(self) -> bool:
        """Whether the scalar stands for nothing (``key:`` or ``~`` or ``null``)."""
        return self.plain and self.text in ("", "~", "null", "Null", "NULL")


@dataclass(eq=False)
class Sequence(Node):
    """A list of nodes; ``uses`` are the spans of the items as they stand here, aliases included."""

    items: list[Node] = field(default_factory=list)
    uses: list[Span] = field(default_factory=list)
    flow: bool = False


@dataclass(eq=False)
class Mapping(Node):
    """A mapping in file order.

    ``uses`` are the spans of the values as they stand here: of ``*alias`` where the value is one.
    ``duplicates`` are the key nodes that came second and have no effect.
    """

    entries: dict[str, tuple[Scalar, Node]] = field(default_factory=dict)
    uses: dict[str, Span] = field(default_factory=dict)
    duplicates: list[Scalar] = field(default_factory=list)
    flow: bool = False

    def get(self, key: str) -> Node | None:
        """The value of ``key``, or None."""
        entry = self.entries.get(key)
        return None if entry is None else entry[1]

    def aliased(self, key: str) -> bool:
        """Whether the value of ``key`` is written as an alias of one that stands elsewhere."""
        return self.uses[key] != self.entries[key][1].span


def parse(text: str, file: Path) -> Mapping:
    """Read the first document of ``text``; its root must be a mapping. Raises `AdfError`."""
    try:
        return _Composer(text, Relaxed(text), file).document()
    except yaml.YAMLError as strict_error:
        relaxed = relax(text)
        if relaxed.text == text:
            raise AdfError(_yaml_diagnostic(strict_error, Relaxed(text), file)) from strict_error
        try:
            return _Composer(text, relaxed, file).document()
        except yaml.YAMLError as error:
            raise AdfError(_yaml_diagnostic(error, relaxed, file)) from error


def _yaml_diagnostic(error: yaml.YAMLError, parsed: Relaxed, file: Path) -> Diagnostic:
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if mark is not None:
        column, _ = parsed.original(mark.line, mark.column, mark.index)
        place = Mark(file, mark.line + 1, column + 1)
        message = f"invalid YAML: {getattr(error, 'problem', None) or 'it ends too early'}"
        hint = remedy(parsed.text, error)
        return Diagnostic(Severity.ERROR, message, place, hint, "yaml")
    number = getattr(error, "character", None)
    what = f"character U+{number:04X}" if isinstance(number, int) else "a character"
    return Diagnostic(
        Severity.ERROR, f"invalid YAML: {what} is not allowed", _first_control(parsed, file), "remove it", "yaml"
    )


_CONTROL = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def _first_control(parsed: Relaxed, file: Path) -> Mark:
    """Place of the first character that YAML forbids."""
    found = _CONTROL.search(parsed.text)
    before = lines_of(parsed.text[: found.start() if found else 0])
    line, column = len(before) - 1, len(before[-1])
    return Mark(file, line + 1, parsed.original(line, column, 0)[0] + 1)


class _Composer:
    """Turns YAML events into nodes whose places are those of ``text``."""

    def __init__(self, text: str, parsed: Relaxed, file: Path) -> None:
        self._events: Iterator[Any] = yaml.parse(parsed.text, Loader=_LOADER)
        self._text = text
        self._parsed = parsed
        self._file = file
        self._anchors: dict[str, Node] = {}
        self._open: list[str] = []

    def document(self) -> Mapping:
        root: Node | None = None
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent):
                root = self._node(next(self._events), 0)[0]
                break
        if isinstance(root, Scalar) and root.null:
            root = None
        if root is None:
            raise self._error(Mark(self._file, 1, 1), "the file is empty", "a mapping of keys was expected")
        if not isinstance(root, Mapping):
            raise self._error(root.mark, "the top level of the file is not a mapping", "write 'key: value' lines")
        return root

    def _error(self, mark: Mark, message: str, hint: str = "") -> AdfError:
        return AdfError(Diagnostic(Severity.ERROR, message, mark, hint, "yaml"))

    def _mark(self, mark: Any) -> Mark:
        if not self._parsed.lines:
            return Mark(self._file, mark.line + 1, mark.column + 1)
        return Mark(self._file, mark.line + 1, self._parsed.original(mark.line, mark.column, mark.index)[0] + 1)

    def _offset(self, mark: Any) -> int:
        if not self._parsed.lines:
            return int(mark.index)
        return self._parsed.original(mark.line, mark.column, mark.index)[1]

    def _node(self, event: Any, depth: int) -> tuple[Node, Span]:
        """The node that begins with ``event``, and the span it takes here."""
        mark = self._mark(event.start_mark)
        if depth > MAX_DEPTH:
            raise self._error(
                mark, f"the file nests deeper than {MAX_DEPTH} levels", "close the inner brackets earlier"
            )
        span = (self._offset(event.start_mark), self._offset(event.end_mark))
        if isinstance(event, yaml.AliasEvent):
            return self._alias(self._name(event), mark), span
        if isinstance(event, yaml.ScalarEvent):
            node: Node = self._scalar(event, mark, span)
        else:
            self._open.append(self._name(event))
            if isinstance(event, yaml.SequenceStartEvent):
                node = self._sequence(event, mark, span[0], depth)
            else:
                node = self._mapping(event, mark, span[0], depth)
            self._open.pop()
            if node.weight > MAX_NODES:
                raise self._error(mark, f"aliases expand to more than {MAX_NODES} values", "use fewer aliases")
        if event.anchor:
            node.anchor = self._name(event)
            self._anchors[node.anchor] = node
        return node, node.span

    def _name(self, event: Any) -> str:
        """The anchor or alias of ``event`` as the file has it."""
        name = event.anchor or ""
        return self._parsed.anchors.get(name, name)

    def _scalar(self, event: Any, mark: Mark, span: Span) -> Scalar:
        start = self._content(event, span[0])
        if start != span[0]:
            mark = self._behind(mark, self._text[span[0] : start])
        return Scalar(mark, (min(start, span[1]), span[1]), 1, "", event.value, event.style in (None, ""))

    def _content(self, event: Any, start: int) -> int:
        """Where the value itself begins, behind its anchor and tag."""
        if not event.anchor and not event.tag:
            return start
        properties = _PROPERTIES.match(self._text, start)
        return properties.end() if properties else start

    @staticmethod
    def _behind(mark: Mark, text: str) -> Mark:
        """The place behind ``text``, which begins at ``mark``."""
        *before, last = lines_of(text)
        return Mark(mark.file, mark.line + len(before), len(last) + (1 if before else mark.column))

    def _alias(self, anchor: str, mark: Mark) -> Node:
        if anchor in self._open:
            raise self._error(mark, f"alias '*{anchor}' is inside the block that it names", "write the values out")
        if anchor not in self._anchors:
            raise self._error(mark, f"alias '*{anchor}' names no anchor", f"define '&{anchor}' before it")
        return self._anchors[anchor]

    def _sequence(self, start: Any, mark: Mark, at: int, depth: int) -> Sequence:
        node = Sequence(mark, (at, at), flow=bool(start.flow_style))
        while True:
            event = next(self._events)
            if isinstance(event, yaml.SequenceEndEvent):
                node.span = (self._content(start, at), self._offset(event.end_mark))
                return node
            item, span = self._node(event, depth + 1)
            node.items.append(item)
            node.uses.append(span)
            node.weight += item.weight

    def _mapping(self, start: Any, mark: Mark, at: int, depth: int) -> Mapping:
        node = Mapping(mark, (at, at), flow=bool(start.flow_style))
        while True:
            event = next(self._events)
            if isinstance(event, yaml.MappingEndEvent):
                node.span = (self._content(start, at), self._offset(event.end_mark))
                return node
            key, _ = self._node(event, depth + 1)
            value, span = self._node(next(self._events), depth + 1)
            node.weight += key.weight + value.weight
            if not isinstance(key, Scalar):
                raise self._error(key.mark, "a mapping key must be plain text", "write 'key: value'")
            if key.text in node.entries:
                node.duplicates.append(key)
            else:
                node.entries[key.text] = (key, value)
                node.uses[key.text] = span


def plain(node: Node) -> Any:
    """The node as nested dicts, lists and strings, aliases expanded; null becomes None."""
    if isinstance(node, Mapping):
        return {key: plain(value) for key, (_, value) in node.entries.items()}
    if isinstance(node, Sequence):
        return [plain(item) for item in node.items]
    assert isinstance(node, Scalar)
    return None if node.null else node.text
