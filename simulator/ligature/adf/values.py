"""Turns nodes into values of the types that the schema names; every error names the place and what was expected."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from typing import Any

import numpy as np

from ligature.adf import scalars
from ligature.adf.nodes import Mapping, Node, Scalar, Sequence, plain
from ligature.adf.schema import Key, Type

Vector = tuple[float, float, float]

LARGEST = 1e12
"""Largest magnitude of a number in a scene; .inf and .nan are numbers for YAML, but no scene can use them."""

_SCALARS: dict[Type, Callable[[str], Any]] = {
    Type.NUMBER: scalars.number,
    Type.INTEGER: scalars.integer,
    Type.UNSIGNED: scalars.unsigned,
    Type.FLAG: scalars.flag,
}


class BadValue(Exception):
    """A value of the wrong form: where, and what was expected.

    ``unusable`` holds when the form is right, so that AMBF takes the value, but no scene can use it.
    """

    def __init__(self, node: Node, expected: str, unusable: bool = False) -> None:
        super().__init__(expected)
        self.node = node
        self.expected = expected
        self.unusable = unusable


def convert(key: Key, node: Node) -> Any:
    """The value of ``node`` in the type that the schema's ``key`` requires; raises `BadValue`."""
    value = _CONVERTERS[key.type](key, node)
    if key.least is not None and isinstance(value, int | float) and not _reaches(value, key.least, key.above):
        raise BadValue(node, f"{'above' if key.above else 'at least'} {key.least:g}, not {value:g}", unusable=True)
    if key.most is not None:
        numbers = value[0] if key.type is Type.POSE else value if isinstance(value, tuple) else (value,)
        beyond = [n for n in numbers if isinstance(n, int | float) and abs(n) > key.most]
        if beyond:
            unit = f" {key.unit.split(',')[0]}" if key.unit else ""
            raise BadValue(node, f"at most {key.most:g}{unit}, not {beyond[0]:g}", unusable=True)
    return value


def _reaches(value: float, least: float, above: bool) -> bool:
    return value > least if above else not value < least


def _scalar(key: Key, node: Node) -> Any:
    return _read(_SCALARS[key.type], node)


def _text(key: Key, node: Node) -> str:
    return _plain_text(node)


def _choice(key: Key, node: Node) -> str:
    text = _plain_text(node)
    if text in key.choices:
        return key.choices[text]
    close = difflib.get_close_matches(text, key.choices, 1)
    wanted = f"'{close[0]}'" if close else "one of " + ", ".join(sorted(set(key.choices.values())))
    raise BadValue(node, f"{wanted}, not '{text}'")


def _vector(key: Key, node: Node) -> Vector:
    return _named_numbers(node, "xyz")


def _rpy(key: Key, node: Node) -> Vector:
    return _named_numbers(node, "rpy")


def _pose(key: Key, node: Node) -> tuple[Vector, Vector]:
    if isinstance(node, Scalar) and not node.null:
        raise BadValue(node, "{position: {x, y, z}, orientation: {r, p, y}}")
    position = node.get("position") if isinstance(node, Mapping) else None
    orientation = node.get("orientation") if isinstance(node, Mapping) else None
    zero = (0.0, 0.0, 0.0)
    return (
        zero if position is None else _named_numbers(position, "xyz"),
        zero if orientation is None else _named_numbers(orientation, "rpy"),
    )


def _block(key: Key, node: Node) -> Any:
    if isinstance(node, Scalar) and not node.null:
        raise BadValue(node, f"a block of keys, not '{node.text}'")
    return plain(node)


def _blocks(key: Key, node: Node) -> tuple[Any, ...]:
    return tuple(plain(item) for item in _items(node))


def _number_or_block(key: Key, node: Node) -> Any:
    return plain(node) if isinstance(node, Mapping) else _read(scalars.number, node)


def _texts(key: Key, node: Node) -> tuple[str, ...]:
    return tuple(_plain_text(item) for item in _items(node))


def _integers(key: Key, node: Node) -> tuple[int, ...]:
    """A single value instead of a list is ignored (as in AMBF)."""
    return tuple(_read(scalars.integer, item) for item in _items(node)) if isinstance(node, Sequence) else ()


def _matrix(key: Key, node: Node) -> tuple[tuple[float, ...], ...]:
    rows = tuple(tuple(_read(scalars.number, cell) for cell in _items(row)) for row in _items(node))
    if len(rows) != 4 or any(len(row) != 4 for row in rows):
        raise BadValue(node, "four rows of four numbers")
    if np.linalg.matrix_rank(np.array(rows)) < 4:
        raise BadValue(node, "four linearly independent rows; this matrix has no inverse", unusable=True)
    return rows


def _anything(key: Key, node: Node) -> Any:
    return plain(node)


_CONVERTERS: dict[Type, Callable[[Key, Node], Any]] = {
    **{type_: _scalar for type_ in _SCALARS},
    Type.TEXT: _text,
    Type.PATH: _text,
    Type.CHOICE: _choice,
    Type.VECTOR: _vector,
    Type.RPY: _rpy,
    Type.POSE: _pose,
    Type.MAP: _block,
    Type.MAPS: _blocks,
    Type.NUMBER_OR_MAP: _number_or_block,
    Type.TEXTS: _texts,
    Type.INTEGERS: _integers,
    Type.MATRIX: _matrix,
    Type.ANY: _anything,
}


def _plain_text(node: Node) -> str:
    if not isinstance(node, Scalar):
        raise BadValue(node, "a text")
    if node.null:
        raise BadValue(node, "a text; write '' for an empty one")
    return node.text


def _read(rule: Callable[[str], Any], node: Node) -> Any:
    if not isinstance(node, Scalar):
        raise BadValue(node, "a single value")
    try:
        value = rule(node.text)
    except (ValueError, OverflowError) as error:
        if node.null:
            raise BadValue(node, f"{error}, but no value stands here; remove the key to have its default") from error
        raise BadValue(node, f"{error}, not '{shortened(node.text)}'") from error
    if isinstance(value, float) and not abs(value) <= LARGEST:
        raise BadValue(node, f"a finite number below {LARGEST:g}, not '{shortened(node.text)}'", unusable=True)
    return value


def _items(node: Node) -> list[Node]:
    if isinstance(node, Sequence):
        return node.items
    if isinstance(node, Scalar) and node.null:
        return []
    raise BadValue(node, "a list")


def _named_numbers(node: Node, names: str) -> Vector:
    if not isinstance(node, Mapping):
        raise BadValue(node, "{" + ", ".join(f"{n}: …" for n in names) + "}")
    values = []
    for name in names:
        part = node.get(name)
        if part is None:
            raise BadValue(node, f"all of {', '.join(names)}; '{name}' is missing")
        values.append(_read(scalars.number, part))
    return (values[0], values[1], values[2])


def shortened(text: str) -> str:
    """A text of the file, short enough for a message."""
    return text if len(text) <= 60 else text[:57] + "…"
