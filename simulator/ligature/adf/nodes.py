"""YAML as marked nodes: text and places only, no value is interpreted and no object constructed.

The first of two equal keys wins, only the first document of a stream is read, aliases share nodes.
Depth, size and alias expansion are limited. Lines and columns count from 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from ligature.adf.diagnostics import AdfError, Diagnostic, Mark, Severity
from ligature.adf.relax import relax

MAX_DEPTH = 64
MAX_NODES = 2_000_000
"""Most nodes of a document after alias expansion; the largest real file has 40 000."""

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(eq=False)
class Node:
    """One YAML node; ``end`` is one past its last character. ``weight`` counts nodes with aliases expanded."""

    mark: Mark
    end: tuple[int, int]
    weight: int = 1


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
    """A list of nodes."""

    items: list[Node] = field(default_factory=list)


@dataclass(eq=False)
class Mapping(Node):
    """A mapping in file order. ``duplicates`` are the key nodes that came second and have no effect."""

    entries: dict[str, tuple[Scalar, Node]] = field(default_factory=dict)
    duplicates: list[Scalar] = field(default_factory=list)
    flow: bool = False

    def get(self, key: str) -> Node | None:
        """The value of ``key``, or None."""
        entry = self.entries.get(key)
        return None if entry is None else entry[1]


def parse(text: str, file: Path) -> Mapping:
    """Read the first document of ``text``; its root must be a mapping. Raises `AdfError`."""
    try:
        return _Composer(text, file, None).document()
    except yaml.YAMLError as strict_error:
        relaxed, inserted = relax(text)
        if not inserted:
            raise AdfError(_yaml_diagnostic(strict_error, file)) from strict_error
        try:
            return _Composer(relaxed, file, inserted).document()
        except yaml.YAMLError:
            raise AdfError(_yaml_diagnostic(strict_error, file)) from strict_error


def _yaml_diagnostic(error: yaml.YAMLError, file: Path) -> Diagnostic:
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    place = Mark(file, mark.line + 1, mark.column + 1) if mark else Mark(file, 1, 1)
    problem = getattr(error, "problem", None) or str(error).splitlines()[0]
    return Diagnostic(Severity.ERROR, f"this is not YAML: {problem}", place, "", "yaml")


class _Composer:
    """Turns YAML events into nodes."""

    def __init__(self, text: str, file: Path, inserted: dict[int, int] | None) -> None:
        self._events: Iterator[Any] = yaml.parse(text, Loader=_LOADER)
        self._file = file
        self._inserted = inserted or {}
        self._anchors: dict[str, Node] = {}
        self._open: list[str | None] = []

    def document(self) -> Mapping:
        root: Node | None = None
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent):
                root = self._node(next(self._events), 0)
                break
        if isinstance(root, Scalar) and root.null:
            root = None
        if root is None:
            raise self._error(Mark(self._file, 1, 1), "the file is empty", "a mapping of keys was expected")
        if not isinstance(root, Mapping):
            raise self._error(root.mark, "the file does not hold a mapping", "write 'key: value' lines")
        return root

    def _place(self, mark: Any) -> tuple[int, int]:
        shift = self._inserted.get(mark.line, 0)
        return mark.line + 1, max(mark.column - shift, 0) + 1

    def _error(self, mark: Mark, message: str, hint: str = "") -> AdfError:
        return AdfError(Diagnostic(Severity.ERROR, message, mark, hint, "yaml"))

    def _node(self, event: Any, depth: int) -> Node:
        line, column = self._place(event.start_mark)
        mark = Mark(self._file, line, column)
        if depth > MAX_DEPTH:
            raise self._error(mark, f"the file nests deeper than {MAX_DEPTH} levels")
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event.anchor, mark)
        end = self._place(event.end_mark)
        if isinstance(event, yaml.ScalarEvent):
            node: Node = Scalar(mark, end, 1, event.value, event.style in (None, ""))
            if event.anchor:
                self._anchors[event.anchor] = node
            return node
        self._open.append(event.anchor)
        if isinstance(event, yaml.SequenceStartEvent):
            node = self._sequence(mark, end, depth)
        else:
            node = self._mapping(mark, end, depth, bool(event.flow_style))
        self._open.pop()
        if node.weight > MAX_NODES:
            raise self._error(mark, f"aliases expand to more than {MAX_NODES} values")
        if event.anchor:
            self._anchors[event.anchor] = node
        return node

    def _alias(self, anchor: str, mark: Mark) -> Node:
        if anchor in self._open:
            raise self._error(mark, f"alias '*{anchor}' stands inside what it names")
        if anchor not in self._anchors:
            raise self._error(mark, f"alias '*{anchor}' names no anchor", f"define '&{anchor}' before it")
        return self._anchors[anchor]

    def _sequence(self, mark: Mark, end: tuple[int, int], depth: int) -> Sequence:
        node = Sequence(mark, end)
        while True:
            event = next(self._events)
            if isinstance(event, yaml.SequenceEndEvent):
                node.end = self._place(event.end_mark)
                return node
            item = self._node(event, depth + 1)
            node.items.append(item)
            node.weight += item.weight

    def _mapping(self, mark: Mark, end: tuple[int, int], depth: int, flow: bool) -> Mapping:
        node = Mapping(mark, end, flow=flow)
        while True:
            event = next(self._events)
            if isinstance(event, yaml.MappingEndEvent):
                node.end = self._place(event.end_mark)
                return node
            key = self._node(event, depth + 1)
            value = self._node(next(self._events), depth + 1)
            node.weight += key.weight + value.weight
            if not isinstance(key, Scalar):
                raise self._error(key.mark, "a mapping key must be plain text")
            if key.text in node.entries:
                node.duplicates.append(key)
            else:
                node.entries[key.text] = (key, value)


def plain(node: Node) -> Any:
    """The node as nested dicts, lists and strings, aliases expanded; null becomes None."""
    if isinstance(node, Mapping):
        return {key: plain(value) for key, (_, value) in node.entries.items()}
    if isinstance(node, Sequence):
        return [plain(item) for item in node.items]
    assert isinstance(node, Scalar)
    return None if node.null else node.text
