"""Documents and their elements: the values of a scene file, typed by the schema, with their places.

A value that cannot be read is a finding; the object that holds it is left out and the rest of the
file goes on (in strict mode the file is refused, as AMBF does).
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from ligature.adf import scalars
from ligature.adf.diagnostics import Diagnostic, Mark, Severity
from ligature.adf.nodes import Mapping, Node, Scalar, Sequence, plain
from ligature.adf.schema import BY_PATH, SCHEMA, Key, Status, Type

Vector = tuple[float, float, float]

LARGEST = 1e12
"""Largest magnitude of a number in a scene; .inf and .nan are numbers for YAML, but no scene can use them."""

_SCALARS = {
    Type.NUMBER: scalars.number,
    Type.INTEGER: scalars.integer,
    Type.UNSIGNED: scalars.unsigned,
    Type.FLAG: scalars.flag,
}


class BadValue(Exception):
    """A value of the wrong form: where, and what was expected."""

    def __init__(self, node: Node, expected: str) -> None:
        super().__init__(expected)
        self.node = node
        self.expected = expected


class Element:
    """One object of a document: a body, a joint, … or the document's own top level.

    Paths are dotted keys of the schema; a missing value is the schema's default.
    """

    def __init__(self, kind: str, key: str, node: Mapping, prefix: str = "") -> None:
        self.kind = kind
        self.key = key
        self.node = node
        self.mark = node.mark
        self._prefix = prefix
        self._values: dict[str, Any] = {}

    def has(self, path: str) -> bool:
        """Whether the file gives ``path``."""
        return self._node(path) is not None

    def mark_of(self, path: str) -> Mark:
        """Where ``path`` stands, or the element itself when it is absent."""
        node = self._node(path)
        return self.mark if node is None else node.mark

    def value(self, path: str) -> Any:
        """The typed value of ``path``; the schema's default, possibly None, when it is absent."""
        if path not in self._values:
            key = BY_PATH[self.kind][self._prefix + path]
            node = self._node(path)
            self._values[path] = key.default if node is None else convert(key, node)
        return self._values[path]

    def text(self, path: str) -> str:
        """A text value."""
        return cast(str, self.value(path) or "")

    def number(self, path: str) -> float:
        """A number."""
        return cast(float, self.value(path))

    def integer(self, path: str) -> int:
        """A whole number."""
        return cast(int, self.value(path))

    def flag(self, path: str) -> bool:
        """A truth value."""
        return cast(bool, self.value(path))

    def vector(self, path: str) -> Vector:
        """Three numbers: x y z, or r p y of an orientation."""
        return cast(Vector, self.value(path))

    def pose(self, path: str) -> tuple[Vector, Vector]:
        """Position x y z and orientation r p y."""
        return cast("tuple[Vector, Vector]", self.value(path))

    def numbers(self, path: str) -> tuple[float, ...]:
        """A list of numbers or whole numbers."""
        return cast("tuple[float, ...]", self.value(path) or ())

    def texts(self, path: str) -> tuple[str, ...]:
        """A list of texts."""
        return cast("tuple[str, ...]", self.value(path) or ())

    def children(self, path: str) -> tuple[Element, ...]:
        """The items of a list of blocks, as elements with paths below ``path[]``."""
        node = self._node(path)
        items = node.items if isinstance(node, Sequence) else []
        prefix = f"{self._prefix}{path}[]."
        return tuple(
            Element(self.kind, f"{self.key}.{path}[{i}]", item, prefix)
            for i, item in enumerate(items)
            if isinstance(item, Mapping)
        )

    def raw(self) -> Any:
        """The element as nested dicts, lists and strings, aliases expanded."""
        return plain(self.node)

    def raw_value(self, path: str) -> Any:
        """The value of ``path`` as nested dicts, lists and strings; None when it is absent."""
        node = self._node(path)
        return None if node is None else plain(node)

    def _node(self, path: str) -> Node | None:
        node: Node | None = self.node
        for part in path.split("."):
            node = node.get(part) if isinstance(node, Mapping) else None
        return node


def convert(key: Key, node: Node) -> Any:
    """The value of ``node`` as the schema's ``key`` wants it; raises `BadValue`."""
    kind = key.type
    if kind in _SCALARS or kind in (Type.TEXT, Type.PATH, Type.CHOICE):
        return _scalar(key, node)
    if kind is Type.VECTOR:
        return _numbers(node, "xyz")
    if kind is Type.RPY:
        return _numbers(node, "rpy")
    if kind is Type.POSE:
        return _pose(node)
    if kind is Type.TEXTS:
        return tuple(_text(item) for item in _items(node))
    if kind is Type.INTEGERS:
        return tuple(_read(scalars.integer, item) for item in _items(node, lenient=True))
    if kind is Type.MATRIX:
        return _matrix(node)
    if kind is Type.MAPS:
        return tuple(plain(item) for item in _items(node))
    return plain(node)


def _scalar(key: Key, node: Node) -> Any:
    if key.type in _SCALARS:
        return _read(_SCALARS[key.type], node)
    text = _text(node)
    if key.type is not Type.CHOICE:
        return text
    if text in key.choices:
        return key.choices[text]
    if key.lenient:
        return key.default
    close = difflib.get_close_matches(text, key.choices, 1)
    wanted = f"'{close[0]}'" if close else "one of " + ", ".join(sorted(set(key.choices.values())))
    raise BadValue(node, f"{wanted}, not '{text}'")


def _text(node: Node) -> str:
    if not isinstance(node, Scalar):
        raise BadValue(node, "a text")
    if node.null:
        raise BadValue(node, "a text; write '' for an empty one")
    return node.text


def _read(rule: Any, node: Node) -> Any:
    if not isinstance(node, Scalar):
        raise BadValue(node, "a single value")
    try:
        value = rule(node.text)
    except (ValueError, OverflowError) as error:
        raise BadValue(node, f"{error}, not '{node.text}'") from error
    if isinstance(value, float) and not abs(value) <= LARGEST:
        raise BadValue(node, f"a finite number below {LARGEST:g}, not '{node.text}'")
    return value


def _items(node: Node, lenient: bool = False) -> list[Node]:
    if isinstance(node, Sequence):
        return node.items
    if (isinstance(node, Scalar) and node.null) or lenient:
        return []
    raise BadValue(node, "a list")


def _numbers(node: Node, names: str) -> Vector:
    if not isinstance(node, Mapping):
        raise BadValue(node, "{" + ", ".join(f"{n}: …" for n in names) + "}")
    values = []
    for name in names:
        part = node.get(name)
        if part is None:
            raise BadValue(node, f"all of {', '.join(names)}; '{name}' is missing")
        values.append(_read(scalars.number, part))
    return (values[0], values[1], values[2])


def _pose(node: Node) -> tuple[Vector, Vector]:
    if isinstance(node, Scalar) and not node.null:
        raise BadValue(node, "{position: {x, y, z}, orientation: {r, p, y}}")
    get = node.get if isinstance(node, Mapping) else (lambda _: None)
    position, orientation = get("position"), get("orientation")
    zero = (0.0, 0.0, 0.0)
    return (
        zero if position is None else _numbers(position, "xyz"),
        zero if orientation is None else _numbers(orientation, "rpy"),
    )


def _matrix(node: Node) -> tuple[tuple[float, ...], ...]:
    rows = tuple(tuple(_read(scalars.number, cell) for cell in _items(row)) for row in _items(node))
    if len(rows) != 4 or any(len(row) != 4 for row in rows):
        raise BadValue(node, "four rows of four numbers")
    return rows


@dataclass
class Document:
    """One file, read: its elements by list, and the findings.

    ``ok`` tells whether the file can be used. ``text`` is the file's content as read.
    """

    path: Path
    kind: str
    text: str
    top: Element
    lists: dict[str, tuple[Element, ...]] = field(default_factory=dict)
    diagnostics: list[Diagnostic] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Whether no error was found."""
        return all(d.severity < Severity.ERROR for d in self.diagnostics)

    def elements(self, name: str) -> tuple[Element, ...]:
        """The usable listed objects of the list ``name``, in list order, repetitions kept."""
        return self.lists.get(name, ())


def problems(element: Element) -> list[Diagnostic]:
    """Everything that is wrong with an element: bad values, missing sub-keys, unknown and ignored keys."""
    found: list[Diagnostic] = []
    known = BY_PATH[element.kind]
    _walk(element.node, "", element, known, found)
    return found


def _walk(node: Mapping, prefix: str, element: Element, known: dict[str, Key], found: list[Diagnostic]) -> None:
    for duplicate in node.duplicates:
        found.append(
            Diagnostic(
                Severity.WARNING,
                f"key '{duplicate.text}' stands twice",
                duplicate.mark,
                "the first one counts",
                "twice",
            )
        )
    for name, (key_node, value) in node.entries.items():
        path = prefix + name
        key = known.get(path)
        if key is None:
            if _inside_atomic(prefix, known):
                continue
            found.append(_unknown(name, prefix, key_node, element, known))
            continue
        if key.status is Status.IGNORED:
            message = f"key '{name}' of {element.kind} '{element.key}' has no effect"
            found.append(Diagnostic(Severity.DEBUG, message, key_node.mark, "", "ignored"))
            continue
        _check_value(key, value, path, element, known, found)
    _check_required(node, prefix, element, known, found)


def _check_value(
    key: Key, value: Node, path: str, element: Element, known: dict[str, Key], found: list[Diagnostic]
) -> None:
    if key.type is Type.MAP:
        if isinstance(value, Mapping):
            _walk(value, f"{path}.", element, known, found)
        elif isinstance(value, Scalar) and not value.null:
            found.append(_bad(element, path, BadValue(value, f"a block of keys, not '{value.text}'")))
        return
    try:
        convert(key, value)
    except BadValue as error:
        found.append(_bad(element, path, error))
        return
    if key.lenient and isinstance(value, Scalar) and value.text not in key.choices:
        found.append(_not_understood(key, value, path, element))
    if key.type is Type.MAPS and isinstance(value, Sequence):
        for item in value.items:
            if isinstance(item, Mapping):
                _walk(item, f"{path}[].", element, known, found)
            else:
                found.append(_bad(element, path, BadValue(item, "a block of keys")))
    elif key.type is Type.ANY and isinstance(value, Mapping) and f"{path}.linear" in known:
        _walk(value, f"{path}.", element, known, found)


def _check_required(
    node: Mapping, prefix: str, element: Element, known: dict[str, Key], found: list[Diagnostic]
) -> None:
    for key in SCHEMA[element.kind]:
        if not key.required or not key.path.startswith(prefix):
            continue
        name = key.path[len(prefix) :]
        if "." not in name and "[]" not in name and name not in node.entries:
            block = f" in '{prefix.rstrip('.')}'" if prefix else ""
            message = f"{element.kind} '{element.key}' lacks the key '{name}'{block}"
            found.append(Diagnostic(Severity.ERROR, message, node.mark, f"add {name}: {key.type.value}", "missing"))


def _inside_atomic(prefix: str, known: dict[str, Key]) -> bool:
    """Whether ``prefix`` is a block that the schema takes as one value, so that its keys are not its own."""
    key = known.get(prefix.rstrip("."))
    return key is not None and key.type is Type.ANY


def _bad(element: Element, path: str, error: BadValue) -> Diagnostic:
    message = f"'{path}' of {element.kind} '{element.key}' is not usable"
    return Diagnostic(Severity.ERROR, message, error.node.mark, f"expected {error.expected}", "value")


def _not_understood(key: Key, value: Scalar, path: str, element: Element) -> Diagnostic:
    """An empty text is what the Blender add-on writes for 'none'; any other is a slip."""
    severity = Severity.WARNING if value.text else Severity.DEBUG
    message = f"'{path}' of {element.kind} '{element.key}' is '{value.text}'; {key.default or 'the default'} is taken"
    return Diagnostic(
        severity,
        message,
        value.mark,
        "expected one of " + ", ".join(sorted(set(key.choices.values()))),
        "choice",
    )


def _unknown(name: str, prefix: str, node: Scalar, element: Element, known: dict[str, Key]) -> Diagnostic:
    siblings = [p[len(prefix) :] for p in known if p.startswith(prefix) and "." not in p[len(prefix) :]]
    close = difflib.get_close_matches(name, siblings, 1)
    hint = f"did you mean '{close[0]}'?" if close else "it has no effect"
    return Diagnostic(
        Severity.WARNING,
        f"unknown key '{prefix}{name}' in {element.kind} '{element.key}'",
        node.mark,
        hint,
        "unknown",
    )
