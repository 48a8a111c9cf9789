"""Writes documents from plain values, in the schema's order: the same values give the same bytes.

Values are nested dicts, lists, numbers, truth values and texts, keyed as in the file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from ligature.adf.schema import BY_PATH, LISTS, SCHEMA

_PLAIN = re.compile(r"[A-Za-z_./][A-Za-z0-9_./()\-]*( [A-Za-z0-9_./()\-]+)*\Z")
_LOOKS_LIKE_VALUE = {"true", "false", "yes", "no", "on", "off", "y", "n", "null", "~", ".inf", ".nan"}
_VECTORS = ({"x", "y", "z"}, {"r", "p", "y"}, {"r", "g", "b"}, {"r", "g", "b", "a"}, {"ix", "iy", "iz"})


class Literal(str):
    """A text that is written as it is, such as a number with the digits it had."""


def write_document(kind: str, values: Mapping[str, Any]) -> str:
    """The text of a document; ``kind`` is launch, world, model or input devices.

    Keys that the schema knows come in its order, then the objects in the order of their lists, then
    everything else as it came.
    """
    order = [key.path for key in SCHEMA[kind] if "." not in key.path]
    objects = _objects(kind, values)
    names = [name for name in order if name in values]
    names += [name for name in objects if name not in names]
    names += [name for name in values if name not in names]
    lines: list[str] = []
    for name in names:
        value = values[name]
        if name in objects and isinstance(value, Mapping):
            value = _ordered(objects[name], value)
        lines += entry_lines(name, value)
    return "\n".join(lines) + "\n"


def scalar_text(value: Any) -> str:
    """One scalar as the format writes it; a float keeps all its digits."""
    if isinstance(value, Literal):
        return str(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return _number(value)
    if value is None:
        return ""
    return text_scalar(str(value))


def text_scalar(text: str) -> str:
    """A text, quoted where YAML would read it as something else."""
    if _PLAIN.match(text) and text.lower() not in _LOOKS_LIKE_VALUE:
        return text
    return "'" + text.replace("'", "''") + "'" if text.isprintable() else _escaped(text)


def _key_text(name: str) -> str:
    """A key as text; ``y`` and ``n`` of vectors remain unquoted, as all ADF files have them."""
    return name if len(name) == 1 and name.isalpha() else text_scalar(name)


def _escaped(text: str) -> str:
    body = "".join(c if c.isprintable() and c not in '"\\' else f"\\U{ord(c):08x}" for c in text)
    return f'"{body}"'


def _number(value: float) -> str:
    if math.isnan(value):
        return ".nan"
    if math.isinf(value):
        return ".inf" if value > 0 else "-.inf"
    text = repr(value)
    return text if "e" not in text or "." in text else text.replace("e", ".0e")


def _objects(kind: str, values: Mapping[str, Any]) -> dict[str, str]:
    """Name and kind of every listed object, in list order."""
    found: dict[str, str] = {}
    for list_name, object_kind in LISTS.items():
        if list_name in BY_PATH[kind] and isinstance(values.get(list_name), Sequence):
            found.update({str(name): object_kind for name in values[list_name] if name in values})
    return found


def _ordered(kind: str, value: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """A block with its keys in schema order, inner blocks too."""
    known = [k.path[len(prefix) :] for k in SCHEMA[kind] if k.path.startswith(prefix)]
    order = [name for name in known if "." not in name and name in value]
    order += [name for name in value if name not in order]
    return {
        name: _ordered(kind, value[name], f"{prefix}{name}.") if isinstance(value[name], Mapping) else value[name]
        for name in order
    }


def entry_lines(name: str, value: Any, depth: int = 0) -> list[str]:
    """The lines of ``name: value`` at a depth of indentation; vectors in flow style, all else in blocks."""
    indent = "  " * depth
    key = f"{indent}{_key_text(str(name))}:"
    if isinstance(value, Mapping):
        if not value or set(value) in _VECTORS:
            return [f"{key} {flow_text(value)}"]
        return [key, *(line for inner, item in value.items() for line in entry_lines(inner, item, depth + 1))]
    if isinstance(value, Sequence) and not isinstance(value, str):
        if not value:
            return [f"{key} []"]
        return [key, *(line for item in value for line in _item(item, depth))]
    return [f"{key} {scalar_text(value)}".rstrip()]


def _item(value: Any, depth: int) -> list[str]:
    indent = "  " * depth
    if isinstance(value, Mapping) and value:
        inner = [line for name, item in value.items() for line in entry_lines(name, item, depth + 1)]
        return [f"{indent}- {inner[0][2 * (depth + 1) :]}", *inner[1:]]
    return [f"{indent}- {flow_text(value)}"]


def flow_text(value: Any) -> str:
    """A value in one line, as ``{a: 1, b: [2, 3]}``."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key_text(str(k))}: {flow_text(v)}" for k, v in value.items()) + "}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(flow_text(item) for item in value) + "]"
    return scalar_text(value) or "''"
