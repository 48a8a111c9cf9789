"""Finds what is wrong with a file: with its own keys, with unknown ones, and with the objects that it lists.

Keys are checked one by one (`checker`); where these are sound, those that concern each other are (`rules`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ligature.adf.checker import (
    MAX_FINDINGS,
    key_problems,
    missing_keys,
    problems,
    repeated_keys,
    suggestion,
)
from ligature.adf.diagnostics import Diagnostic, Severity, any_error
from ligature.adf.document import Element, ListedItem
from ligature.adf.nodes import Mapping, Node, Scalar, Sequence
from ligature.adf.rules import rule_findings
from ligature.adf.schema import BY_PATH, LISTS, NOT_SIMULATED, SCHEMA, Key, Type

REFUSING = ("value", "missing", "version")
"""Codes of the findings for which AMBF refuses a whole file."""

MODELS = "multibody configs"
"""Key of the list of model files of a launch file."""

_DEFAULTED = ("body", "camera", "light")
"""Kinds of which AMBF makes a default object when one is listed but not defined."""


def findings_of(own: Element, items: list[ListedItem], root: Mapping, strict: bool) -> tuple[Element, list[Diagnostic]]:
    """The own keys of a file without those that hold an error, and all that is wrong with the file.

    What is wrong with a listed object is added to its item in ``items``; an object with an error is taken from it. The
    list ends where a file has too many findings.
    ``strict`` rejects what AMBF rejects.
    """
    listed = {item.node.text for item in items if isinstance(item.node, Scalar)}
    unlisted = [name for name in root.entries if name not in BY_PATH[own.kind] and name not in listed]
    others = [_other_key(name, *root.entries[name], own.kind) for name in unlisted[: MAX_FINDINGS + 1]]
    top, found = _sound(own, root)
    count = len(found) + len(others)
    _extend(items, count, lambda item: _key_findings(item, root, unlisted, strict))
    _extend(items, count, _rule_findings)
    found += rule_findings(top)
    return top, [*found, *others, *(finding for item in items for finding in item.found)]


def refused(found: list[Diagnostic]) -> Diagnostic | None:
    """That AMBF refuses the whole file for one of the findings, and for which."""
    causes = [d for d in found if d.severity >= Severity.ERROR and d.code in REFUSING]
    if not causes:
        return None
    message = f"AMBF refuses the whole file for {len(causes)} of these errors"
    return Diagnostic(Severity.ERROR, message, causes[0].mark, causes[0].message, "refused")


def no_path(item: Node) -> Diagnostic:
    """That an item of the list of model files is not the path of one."""
    return _no_text(MODELS, item, "a path")


def _no_text(name: str, item: Node, what: str) -> Diagnostic:
    message = f"an item of '{name}' is not {what}"
    return Diagnostic(Severity.ERROR, message, item.mark, f"write {what} or remove the item", "value")


def _sound(own: Element, root: Mapping) -> tuple[Element, list[Diagnostic]]:
    """The file's own keys without those that hold an error, and the findings about their values."""
    found = [*repeated_keys(root), *missing_keys(own)]
    sound = {}
    for name, entry in own.node.entries.items():
        node, of_key = entry[1], list[Diagnostic]()
        if not isinstance(node, Sequence) or name not in (*LISTS, MODELS):
            of_key = key_problems(own, name)
        elif name == MODELS:  # items of other lists are judged with the objects that they name
            unnamed = [item for item in node.items if not isinstance(item, Scalar) or item.null]
            found += [no_path(item) for item in unnamed[:MAX_FINDINGS]]
        found += of_key
        if not any_error(of_key):
            sound[name] = entry
    return Element(own.kind, own.key, replace(own.node, entries=sound)), found


def _other_key(name: str, key: Scalar, node: Node, kind: str) -> Diagnostic:
    """The finding about a top-level key that is neither the file's own nor a listed object, such as a typing error."""
    meant = suggestion(name, [key.name for key in SCHEMA[kind] if _may_hold(key, node)])
    if _holds_anchor(node):
        return Diagnostic(Severity.DEBUG, f"'{name}' only holds values for aliases", key.mark, "", "unlisted")
    if isinstance(node, Mapping) and not meant:
        message = f"'{name}' is defined but not listed, so it does not exist"
        return Diagnostic(Severity.DEBUG, message, key.mark, "", "unlisted")
    message = f"unknown key '{name}' in {kind} file"
    return Diagnostic(Severity.WARNING, message, key.mark, meant or "it has no effect", "unknown")


def _may_hold(key: Key, node: Node) -> bool:
    """Whether the value is of a form that the key takes: a block of an unlisted object is not a misspelled list."""
    return isinstance(node, Mapping) == (key.type in (Type.MAP, Type.VECTOR, Type.POSE))


def _holds_anchor(node: Node) -> bool:
    if node.anchor:
        return True
    inner: list[Node] = []
    if isinstance(node, Mapping):
        inner = [value for name, (_, value) in node.entries.items() if not node.aliased(name)]
    elif isinstance(node, Sequence):
        inner = [item for item, use in zip(node.items, node.uses, strict=True) if use == item.span]
    return any(map(_holds_anchor, inner))


def _extend(items: list[ListedItem], count: int, findings: Callable[[ListedItem], list[Diagnostic]]) -> None:
    """Add findings to each item, as long as they are not too many with ``count`` others; the rest is left out."""
    for place, item in enumerate(items):
        if count > MAX_FINDINGS:
            message = f"more than {MAX_FINDINGS} findings; the rest of the file is not read"
            last = Diagnostic(Severity.ERROR, message, item.node.mark, "", "too many")
            items[place:] = [ListedItem(item.list_name, item.node, found=[last])]
            return
        item.found += findings(item)
        count += len(item.found)
        if any_error(item.found):
            item.element = None


def _key_findings(item: ListedItem, root: Mapping, unlisted: list[str], strict: bool) -> list[Diagnostic]:
    """What is wrong with the keys of an object, taken one by one; what is listed twice is checked once."""
    if item.name is None:
        return [_no_text(item.list_name, item.node, "the name of an object")]
    if item.first is not item:
        message = f"'{item.name}' is listed twice in '{item.list_name}', so it exists twice"
        return [Diagnostic(Severity.INFO, message, item.node.mark, "", "repeated")]
    if item.element is None:
        return [_undefined(item, item.name, root.get(item.name), unlisted)]
    found = problems(item.element)
    if item.kind != "joint":
        return found
    return [*found, *_lone_motor(item.element)] if strict else _typeless_is_revolute(item.element, found)


def _rule_findings(item: ListedItem) -> list[Diagnostic]:
    """What keys of an object that are sound one by one show together."""
    if item.element is None or item.first is not item:
        return []
    found = rule_findings(item.element)
    if item.kind in NOT_SIMULATED and not any_error(found):
        message = f"{item.kind} '{item.name}' is read and checked, but not simulated"
        found.append(Diagnostic(Severity.WARNING, message, item.element.mark, "", "not simulated"))
    return found


def _undefined(item: ListedItem, name: str, node: Node | None, unlisted: list[str]) -> Diagnostic:
    """AMBF makes a default body, camera or light, and refuses the file for a joint."""
    defaulted = item.kind in _DEFAULTED or (isinstance(node, Scalar) and node.null)
    severity = Severity.WARNING if defaulted else Severity.ERROR
    if node is not None:
        message, hint = f"{item.kind} '{name}' is listed, but its definition is not a block of keys", "it is left out"
        return Diagnostic(severity, message, node.mark, hint, "undefined")
    hint = suggestion(name, unlisted) or "define it or take it from the list"
    message = f"{item.kind} '{name}' is listed but not defined"
    return Diagnostic(severity, message, item.node.mark, hint, "missing" if item.kind == "joint" else "undefined")


def _lone_motor(element: Element) -> list[Diagnostic]:
    """AMBF evaluates 'enable feedback' when 'enable motor' is there, and fails without it."""
    if not element.has("enable motor") or element.has("enable feedback"):
        return []
    message = f"joint '{element.key}' has 'enable motor' without 'enable feedback'"
    return [Diagnostic(Severity.ERROR, message, element.mark_of("enable motor"), "remove 'enable motor'", "missing")]


def _typeless_is_revolute(element: Element, found: list[Diagnostic]) -> list[Diagnostic]:
    """A joint without type is an old revolute one."""
    if element.has("type"):
        return found
    others = [d for d in found if not (d.code == "missing" and "the key 'type'" in d.message)]
    message = f"joint '{element.key}' has no 'type'; using revolute"
    return [*others, Diagnostic(Severity.WARNING, message, element.mark, "add type: revolute", "type")]
