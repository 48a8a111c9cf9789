"""Compares the keys of an element with the schema: bad values, missing keys, unknown and ignored ones.

Codes of errors: ``value`` and ``missing`` where AMBF refuses the whole file, ``left out`` where it
leaves out the object, ``range`` where it takes a value that no scene can use.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection

from ligature.adf.diagnostics import Diagnostic, Mark, Severity
from ligature.adf.document import Element
from ligature.adf.nodes import Mapping, Node, Scalar, Sequence
from ligature.adf.schema import BY_PATH, SCHEMA, Fault, Key, Status, Type
from ligature.adf.values import BadValue, convert, shortened

MAX_FINDINGS = 2000
"""Most findings of one file; a file with more is not a scene."""

MAX_NAMED = 6
"""Most unknown keys of one vector or pose that are named: a flat {x, y, z, r, p, y}."""

MAX_HINTED = 40
"""Longest unknown key, in characters, for which a known one is looked for."""

_DECIMALS = re.compile(r"[0-9]+([eE][-+]?[0-9]+)?")
_VECTOR_KEYS = {
    Type.VECTOR: ("x", "y", "z"),
    Type.RPY: ("r", "p", "y"),
    Type.POSE: ("position", "orientation"),
}
_CHILDREN: dict[str, dict[str, tuple[Key, ...]]] = {}
for _kind, _keys in SCHEMA.items():
    _CHILDREN[_kind] = {}
    for _key in _keys:
        _CHILDREN[_kind][_key.block] = (*_CHILDREN[_kind].get(_key.block, ()), _key)


def problems(element: Element) -> list[Diagnostic]:
    """Everything that is wrong with an element, as far as single keys show."""
    found: list[Diagnostic] = []
    _check_block(element.node, "", element, found)
    return found


def key_problems(element: Element, name: str) -> list[Diagnostic]:
    """What is wrong with the value of one top-level key."""
    found: list[Diagnostic] = []
    key_node, value = element.node.entries[name]
    _check_entry(name, key_node, value, "", element, found)
    return found


def missing_keys(element: Element) -> list[Diagnostic]:
    """The required top-level keys that are absent."""
    found: list[Diagnostic] = []
    _check_required(element.node, "", element, found)
    return found


def suggestion(name: str, known: Collection[str]) -> str:
    """The known name that ``name`` was probably meant to be, as a hint; empty without one."""
    if len(name) > MAX_HINTED:
        return ""
    lowered = {text.lower(): text for text in known}
    close = difflib.get_close_matches(name.lower(), lowered, 1, 0.7)
    return f"did you mean '{lowered[close[0]]}'?" if close else ""


def repeated_keys(node: Mapping) -> list[Diagnostic]:
    """Keys that stand twice in one block."""
    message = "key '{}' appears twice"
    return [
        Diagnostic(Severity.WARNING, message.format(shortened(d.text)), d.mark, "the first one is used", "twice")
        for d in node.duplicates[:MAX_FINDINGS]
    ]


def _check_block(node: Mapping, prefix: str, element: Element, found: list[Diagnostic]) -> None:
    found += repeated_keys(node)
    for name, (key_node, value) in node.entries.items():
        if len(found) > MAX_FINDINGS:
            return
        _check_entry(name, key_node, value, prefix, element, found)
    _check_required(node, prefix, element, found)


def _check_entry(
    name: str, key_node: Scalar, value: Node, prefix: str, element: Element, found: list[Diagnostic]
) -> None:
    path = prefix + name
    key = None if "." in name or "[" in name else BY_PATH[element.kind].get(path)
    if key is None:
        found.append(_unknown(name, value, prefix, key_node.mark, element))
    elif key.status is Status.IGNORED:
        message = f"key '{path}' of {element.kind} '{element.key}' has no effect"
        found.append(Diagnostic(Severity.DEBUG, message, key_node.mark, key.doc, "ignored"))
    else:
        if key.status is Status.UNUSED:
            message = f"key '{path}' of {element.kind} '{element.key}' has no effect here, other than in AMBF"
            found.append(Diagnostic(Severity.DEBUG, message, key_node.mark, key.doc, "unused"))
        _check_value(key, value, element, found)


def _check_value(key: Key, value: Node, element: Element, found: list[Diagnostic]) -> None:
    if key.type in (Type.MAP, Type.POSE) and isinstance(value, Sequence):
        message = f"'{key.path}' of {element.kind} '{element.key}' is a list; a block of keys was expected"
        found.append(Diagnostic(Severity.WARNING, message, value.mark, "it is read as an empty block", "unknown"))
    if key.type is Type.MAP and _like_block(value):
        block = value if isinstance(value, Mapping) else Mapping(value.mark, value.span)
        _check_block(block, f"{key.path}.", element, found)
    elif key.type is Type.NUMBER_OR_MAP and isinstance(value, Mapping):
        _check_block(value, f"{key.path}.", element, found)
    else:
        _check_converted(key, value, element, found)


def _like_block(node: Node) -> bool:
    """Whether AMBF takes a node as a block: null and lists are empty ones."""
    return not isinstance(node, Scalar) or node.null


def _check_converted(key: Key, value: Node, element: Element, found: list[Diagnostic]) -> None:
    try:
        convert(key, value)
    except BadValue as error:
        found.append(_bad(element, key, error))
        return
    if key.type is Type.INTEGERS and isinstance(value, Scalar) and not value.null:
        message = f"'{key.path}' of {element.kind} '{element.key}' is one value; a list was expected"
        hint = f"write [{shortened(value.text)}]; as it stands it has no effect"
        found.append(Diagnostic(Severity.WARNING, message, value.mark, hint, "unknown"))
    if key.type is Type.MAPS and isinstance(value, Sequence):
        for item in value.items:
            if isinstance(item, Mapping):
                _check_block(item, f"{key.path}[].", element, found)
            else:
                found.append(_bad(element, key, BadValue(item, "a block of keys")))
    elif key.type in _VECTOR_KEYS and isinstance(value, Mapping):
        _check_vector(key, value, element, found)


def _check_vector(key: Key, value: Mapping, element: Element, found: list[Diagnostic]) -> None:
    """Check keys beside x y z, r p y, position and orientation that the schema has, and report the others."""
    known = BY_PATH[element.kind]
    for name, (_, beside) in value.entries.items():
        if name not in _VECTOR_KEYS[key.type] and f"{key.path}.{name}" in known:
            _check_value(known[f"{key.path}.{name}"], beside, element, found)
    _check_parts(key.path, _VECTOR_KEYS[key.type], value, element, found)
    if key.type is Type.POSE:
        for name, parts in (("position", Type.VECTOR), ("orientation", Type.RPY)):
            half = value.get(name)
            if isinstance(half, Mapping):
                _check_parts(f"{key.path}.{name}", _VECTOR_KEYS[parts], half, element, found)


def _check_parts(path: str, wanted: tuple[str, ...], value: Mapping, element: Element, found: list[Diagnostic]) -> None:
    """Report keys of a vector or pose that stand twice, and those that it does not have."""
    found += repeated_keys(value)
    known = BY_PATH[element.kind]
    unknown = [name for name in value.entries if name not in wanted and f"{path}.{name}" not in known]
    if unknown:
        names = ", ".join(f"'{path}.{shortened(name)}'" for name in unknown[:MAX_NAMED])
        more = f" and {len(unknown) - MAX_NAMED} more" if len(unknown) > MAX_NAMED else ""
        message = f"unknown key{'s' if len(unknown) > 1 else ''} {names}{more} in {element.kind} '{element.key}'"
        hint = f"{path.rpartition('.')[2]} holds {{{', '.join(wanted)}}}"
        hint = next(filter(None, (_comma(name, value.entries[name][1]) for name in unknown)), hint)
        found.append(Diagnostic(Severity.WARNING, message, value.entries[unknown[0]][0].mark, hint, "unknown"))


def _check_required(node: Mapping, prefix: str, element: Element, found: list[Diagnostic]) -> None:
    block = prefix.rstrip(".")
    for key in _CHILDREN[element.kind].get(block, ()):
        if key.required and key.name not in node.entries:
            place = f" in '{block}'" if block else ""
            message = f"{element.kind} '{element.key}' lacks the key '{key.name}'{place}"
            found.append(_fault(key, message, node.mark, f"add {key.name}: {key.type.value}", "missing"))


def _bad(element: Element, key: Key, error: BadValue) -> Diagnostic:
    message = f"'{key.path}' of {element.kind} '{element.key}' is not usable"
    if key.type is Type.CHOICE and isinstance(error.node, Scalar) and not error.node.text and key.fault is Fault.VALUE:
        message = f"'{key.path}' of {element.kind} '{element.key}' is empty"  # the Blender add-on writes '' for none
        return Diagnostic(Severity.DEBUG, message, error.node.mark, f"{key.default or 'the default'} is used", "choice")
    return _fault(key, message, error.node.mark, f"expected {error.expected}", "range" if error.unusable else "value")


def _fault(key: Key, message: str, mark: Mark, hint: str, code: str) -> Diagnostic:
    if key.fault is Fault.VALUE:
        default = "it is left out" if key.default in (None, ()) else f"{key.default} is taken"
        return Diagnostic(Severity.WARNING, message, mark, f"{hint}; {default}", "choice")
    if key.fault is Fault.OBJECT or (code == "value" and key.type is Type.CHOICE):
        code = "left out"
    return Diagnostic(Severity.ERROR, message, mark, hint, code)


def _comma(name: str, value: Node) -> str:
    """What to write where a key is the digits behind a decimal comma, as in ``{mass: 0,5}``; empty if it is not."""
    if isinstance(value, Scalar) and value.null and _DECIMALS.fullmatch(name):
        return f"a comma ends a number; write a point before '{shortened(name)}', as in 0.5"
    return ""


def _unknown(name: str, value: Node, prefix: str, mark: Mark, element: Element) -> Diagnostic:
    siblings = [key.name for key in _CHILDREN[element.kind].get(prefix.rstrip("."), ())]
    message = f"unknown key '{prefix}{shortened(name)}' in {element.kind} '{element.key}'"
    if name == "<<":
        return Diagnostic(Severity.WARNING, message, mark, "merge keys are not part of the format", "unknown")
    hint = _comma(name, value) or suggestion(name, siblings) or "it has no effect"
    return Diagnostic(Severity.WARNING, message, mark, hint, "unknown")
