"""Gives a file new values by changing only what differs, and writes new files in canonical order.

An `Item` is one object as it is to stand in the file. Values are typed as the schema types them;
numbers count as equal when they are equal in single precision, which is what editors store.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ligature.adf import nodes
from ligature.adf.align import aligned
from ligature.adf.document import Document, Element, own_element
from ligature.adf.lines import BREAKS, break_of
from ligature.adf.patch import (
    Edit,
    PatchError,
    add_item,
    add_key,
    aliases_into,
    apply,
    insert_item,
    remove_item,
    remove_key,
    rename_key,
    set_value,
    spelled_out,
)
from ligature.adf.schema import BY_PATH, LISTS, PLURALS, SCHEMA, Key, Type
from ligature.adf.writer import entry_lines, text_scalar, write_document

MAX_ROUNDS = 200
"""Most times a file is read again while it is changed; changes behind aliases take one each."""

_POSE = ("position", "orientation")
_PARTS = {Type.VECTOR: ("x", "y", "z"), Type.RPY: ("r", "p", "y")}


@dataclass(frozen=True)
class Item:
    """One object of a file.

    Attributes
    ----------
    kind, key
        Kind of the schema, and the key that lists and defines it.
    values
        The value of every key that is given, by dotted path; blocks stand in the paths of their keys.
    was
        Its key in the file that is changed, when that is another one.
    extra
        Keys that the schema does not know, as nested plain values; written for new objects only.
    unheld
        Paths of the schema that the editor does not hold, such as ``wheels[].mesh``: they stay as they are.
    """

    kind: str
    key: str
    values: Mapping[str, Any]
    was: str = ""
    extra: Mapping[str, Any] = field(default_factory=dict)
    unheld: Collection[str] = ()


def items_of(document: Document) -> list[Item]:
    """The usable objects of a document, each once, in the order of its lists."""
    found = {e.key: e for elements in document.lists.values() for e in elements}
    return [Item(e.kind, e.key, e.given(), extra=e.unknown()) for e in found.values()]


def new_text(kind: str, top: Mapping[str, Any], items: Sequence[Item]) -> str:
    """The text of a new file of ``kind``, in canonical order. Raises `PatchError` when two items have one key."""
    values: dict[str, Any] = _nested(kind, top)
    for item in items:
        values.setdefault(PLURALS[item.kind], []).append(item.key)
    for item in items:
        if item.key in values:
            raise PatchError(f"'{item.key}' is the identifier of two objects; rename one of them")
        values[item.key] = {**_nested(item.kind, item.values), **item.extra}
    return write_document(kind, values)


def updated(
    text: str,
    kind: str,
    top: Mapping[str, Any],
    items: Sequence[Item],
    removed: Collection[str] = (),
    parsed: nodes.Mapping | None = None,
) -> str:
    """``text``, a file of ``kind``, with the changes that make it state ``top`` and hold ``items``.

    Objects whose keys are ``removed`` go; all others stay, also those that cannot be read. Keys that
    the schema does not know, comments, anchors and order stay. ``parsed`` are the nodes of ``text`` where they are
    known. Raises `PatchError`.
    """
    before, text = text, _renamed(text, kind, items)
    for _ in range(MAX_ROUNDS):
        root = parsed if parsed is not None and text == before else nodes.parse(text, Path())
        edits = _edits(text, root, kind, top, items, removed)
        if not edits:
            return text
        text = apply(text, edits)
    raise PatchError("cannot change the file: its aliases refer to each other in a cycle")


def _renamed(text: str, kind: str, items: Sequence[Item]) -> str:
    for item in items:
        if not item.was or item.was == item.key:
            continue
        root = nodes.parse(text, Path())
        if item.was not in root.entries:
            continue
        edits = [rename_key(root, item.was, item.key)]
        listed = root.get(PLURALS[item.kind])
        for use, entry in _list_entries(listed):
            if entry.text == item.was:
                edits.append(Edit(use, text_scalar(item.key)))
        text = apply(text, edits)
    return text


def _edits(
    text: str,
    root: nodes.Mapping,
    kind: str,
    top: Mapping[str, Any],
    items: Sequence[Item],
    removed: Collection[str],
) -> list[Edit]:
    """Edits of one round: those of values that are written in place; if there are none, one of an aliased value."""
    behind_alias: list[Edit] = []
    edits = list(_changes(text, root, own_element(kind, root), top, behind_alias))
    edits += _object_edits(text, root, kind, items, removed)
    for item in items:
        node = root.get(item.key)
        if isinstance(node, nodes.Mapping):
            edits += _changes(
                text, node, Element(item.kind, item.key, node), item.values, behind_alias, frozenset(item.unheld)
            )
    return edits or behind_alias[:1]


def _object_edits(
    text: str, root: nodes.Mapping, kind: str, items: Sequence[Item], removed: Collection[str]
) -> Iterator[Edit]:
    """Changes of the lists of objects, and of the blocks that define them."""
    for list_name, object_kind in LISTS.items():
        if list_name not in BY_PATH[kind]:
            continue
        node = root.get(list_name)
        listed = [entry.text for _, entry in _list_entries(node)]
        gone = [i for i, name in enumerate(listed) if name in removed]
        new = [i.key for i in items if i.kind == object_kind and i.key not in listed]
        if isinstance(node, nodes.Sequence) and node.items and len(gone) < len(listed):
            yield from (add_item(text, node, name) for name in new)
            if not new:
                yield from (remove_item(text, node, i) for i in (gone[:1] if node.flow else gone))
        elif gone or new:
            yield _list_edit(text, root, list_name, new)
    removals = [remove_key(text, root, name) for name in dict.fromkeys(removed) if name in root.entries]
    yield from removals
    for removal in removals:
        for alias in aliases_into(root, removal.span):
            if not any(other.span[0] <= alias.span[0] < other.span[1] for other in removals):
                yield alias
    for item in items:
        if item.key not in root.entries:
            yield _definition(text, item)


def _definition(text: str, item: Item) -> Edit:
    """The block of a new object, at the end of the file."""
    at = len(text)
    lines = entry_lines(item.key, {**_nested(item.kind, item.values), **item.extra})
    line_break = break_of(text)
    start = "" if text[-1:] in (*BREAKS, "") else line_break
    return Edit((at, at), start + line_break.join((*lines, "")))


def _list_edit(text: str, root: nodes.Mapping, name: str, keys: list[str]) -> Edit:
    """Edit that writes a whole list, in its place or after the other lists."""
    if name in root.entries:
        return set_value(text, root, name, keys)
    before = [other for other in LISTS if other in root.entries]
    if not before:
        return add_key(text, root, name, keys)
    last = nodes.Mapping(root.mark, root.span, entries={before[-1]: root.entries[before[-1]]})
    last.uses = root.uses
    return add_key(text, last, name, keys)


def _list_entries(node: nodes.Node | None) -> list[tuple[nodes.Span, nodes.Scalar]]:
    if not isinstance(node, nodes.Sequence):
        return []
    return [(u, i) for u, i in zip(node.uses, node.items, strict=True) if isinstance(i, nodes.Scalar)]


def _changes(
    text: str,
    owner: nodes.Mapping,
    element: Element,
    wanted: Mapping[str, Any],
    behind_alias: list[Edit],
    unheld: frozenset[str] = frozenset(),
) -> Iterator[Edit]:
    """Edits that give ``owner`` the wanted values; those of aliased values go to ``behind_alias``.

    Keys go when all others are there: what is added at the end of a block is put behind its last key.
    """
    edits = list(_additions(text, owner, element, wanted, behind_alias, unheld))
    yield from edits
    if edits:
        return
    old = element.given()
    gone = [path for path in old if path not in wanted and element.prefix + path not in unheld]
    yield from _removals(text, owner, element, gone)


def _additions(
    text: str,
    owner: nodes.Mapping,
    element: Element,
    wanted: Mapping[str, Any],
    behind_alias: list[Edit],
    unheld: frozenset[str],
) -> Iterator[Edit]:
    """Edits that give ``owner`` the wanted values that it does not have."""
    prefix = element.prefix
    old = element.given()
    known = BY_PATH[element.kind]
    additions: dict[str, dict[str, Any]] = {}
    for path, value in wanted.items():
        if path in old and same(old[path], value):
            continue
        key = known[prefix + path]
        if key.type is Type.MAPS and old.get(path) and value and len(old[path]) == len(_items_at(owner, path)):
            yield from _list_changes(text, owner, element, path, value, behind_alias, unheld)
            continue
        for inner, part in _pieces(owner, key, path, old.get(path), value):
            if _aliased(owner, inner):
                behind_alias.append(set_value(text, owner, inner, part))
                continue
            block = _missing_block(owner, inner)
            if block is None:
                yield set_value(text, owner, inner, part)
            else:
                _put(additions.setdefault(block, {}), inner[len(block) + 1 :], part)
    for block, values in additions.items():
        yield set_value(text, owner, block, values)


def _items_at(owner: nodes.Mapping, path: str) -> list[nodes.Node]:
    node: nodes.Node | None = owner
    for part in path.split("."):
        node = node.get(part) if isinstance(node, nodes.Mapping) else None
    return node.items if isinstance(node, nodes.Sequence) else []


def _list_changes(
    text: str,
    owner: nodes.Mapping,
    element: Element,
    path: str,
    wanted: Sequence[Mapping[str, Any]],
    behind_alias: list[Edit],
    unheld: frozenset[str],
) -> Iterator[Edit]:
    """Edits of a list of blocks, item by item: what differs in an item, else items that are new, else those that go."""
    *inner, name = path.split(".")
    parent = owner
    for part in inner:
        if parent.aliased(part):
            behind_alias.append(Edit(parent.uses[part], spelled_out(parent.entries[part][1])))
            return
        parent = parent.entries[part][1]  # type: ignore[assignment]
    listed = parent.entries[name][1]
    assert isinstance(listed, nodes.Sequence)
    if parent.aliased(name):
        behind_alias.append(Edit(parent.uses[name], spelled_out(listed)))
        return
    children = element.children(path)
    prefix = children[0].prefix
    held = [{p: v for p, v in child.given().items() if prefix + p not in unheld} for child in children]
    pairs = aligned(held, wanted, same)
    both = [(i, j) for i, j in pairs if i is not None and j is not None and not same(held[i], wanted[j])]
    for i, j in both:
        if listed.uses[i] != listed.items[i].span:
            behind_alias.append(Edit(listed.uses[i], spelled_out(listed.items[i])))
            continue
        yield from _changes(text, children[i].node, children[i], wanted[j], behind_alias, unheld)
    if both:
        return
    new = [(at, j) for at, (i, j) in enumerate(pairs) if i is None and j is not None]
    for at, j in new:
        value = _nested(element.kind, wanted[j], prefix)
        following = next((i for i, _ in pairs[at:] if i is not None), None)
        yield add_item(text, listed, value) if following is None else insert_item(text, listed, following, value)
    if new:
        return
    gone = [i for i, j in pairs if j is None and i is not None]
    yield from (remove_item(text, listed, i) for i in (gone[:1] if listed.flow else gone))


def _pieces(owner: nodes.Mapping, key: Key, path: str, old: Any, new: Any) -> Iterator[tuple[str, Any]]:
    """The values to write for one key: of a vector or pose that is there, the numbers that differ."""
    if old is not None and key.type is Type.POSE:
        for half, type_, before, after in zip(_POSE, (Type.VECTOR, Type.RPY), old, new, strict=True):
            if same(before, after):
                continue
            if _missing_block(owner, f"{path}.{half}.x") is None:
                yield from _different(f"{path}.{half}", _PARTS[type_], before, after)
            else:
                yield f"{path}.{half}", dict(zip(_PARTS[type_], after, strict=True))
    elif old is not None and key.type in _PARTS:
        yield from _different(path, _PARTS[key.type], old, new)
    else:
        yield path, _plain(key, new)


def _different(path: str, names: Sequence[str], before: Sequence[float], after: Sequence[float]) -> Iterator[Any]:
    for name, old, new in zip(names, before, after, strict=True):
        if not same(old, new):
            yield f"{path}.{name}", new


def _missing_block(owner: nodes.Mapping, path: str) -> str | None:
    """The outermost block on the way to ``path`` that is missing, so that its keys are added at once."""
    node: nodes.Node | None = owner
    parts = path.split(".")
    for depth, part in enumerate(parts[:-1]):
        node = node.get(part) if isinstance(node, nodes.Mapping) else None
        if node is None or (isinstance(node, nodes.Scalar) and node.null):
            return ".".join(parts[: depth + 1])
    return None


def _aliased(owner: nodes.Mapping, path: str) -> bool:
    node: nodes.Node | None = owner
    for part in path.split("."):
        if not isinstance(node, nodes.Mapping) or part not in node.entries:
            return False
        if node.aliased(part):
            return True
        node = node.get(part)
    return False


def _removals(text: str, owner: nodes.Mapping, element: Element, paths: list[str]) -> Iterator[Edit]:
    """Edits that remove keys, and blocks that would be left empty."""
    for path in _whole_blocks(owner, paths):
        *inner, name = path.split(".")
        parent: nodes.Node | None = owner
        for part in inner:
            parent = parent.get(part) if isinstance(parent, nodes.Mapping) else None
        if not isinstance(parent, nodes.Mapping) or name not in parent.entries:
            continue
        if inner and _aliased(owner, ".".join(inner)):
            raise PatchError(
                f"'{path}' of {element.kind} '{element.key}' comes from an alias and cannot be removed alone; "
                f"remove '{inner[0]}' or give it a value"
            )
        yield remove_key(text, parent, name)


def _whole_blocks(owner: nodes.Mapping, paths: list[str]) -> list[str]:
    """``paths``, in which a block replaces its keys when all of them are removed."""
    going = set(paths)
    for path in paths:
        block = path.rpartition(".")[0]
        while block:
            node: nodes.Node | None = owner
            for part in block.split("."):
                node = node.get(part) if isinstance(node, nodes.Mapping) else None
            if not isinstance(node, nodes.Mapping) or not all(f"{block}.{name}" in going for name in node.entries):
                break
            going -= {f"{block}.{name}" for name in node.entries}
            going.add(block)
            block = block.rpartition(".")[0]
    return [path for path in going if not any(path.startswith(f"{other}.") for other in going)]


def same(a: Any, b: Any) -> bool:
    """Whether two typed values are equal, numbers in single precision."""
    if isinstance(a, bool) or isinstance(b, bool):
        return a is b
    if isinstance(a, int | float) and isinstance(b, int | float):
        return a == b or _single(a) == _single(b)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    return bool(a == b)


def _single(value: float) -> float:
    return float(struct.unpack("f", struct.pack("f", value))[0])


def _nested(kind: str, values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Values by dotted path as nested blocks, in the order of the schema."""
    nested: dict[str, Any] = {}
    for key in SCHEMA[kind]:
        path = key.path[len(prefix) :]
        if key.path.startswith(prefix) and path in values:
            _put(nested, path, _plain(key, values[path], kind))
    unknown = [path for path in values if prefix + path not in BY_PATH[kind]]
    if unknown:
        raise KeyError(f"the schema knows no '{prefix}{unknown[0]}' of a {kind}")
    return nested


def _put(nested: dict[str, Any], path: str, value: Any) -> None:
    *inner, name = path.split(".")
    for part in inner:
        nested = nested.setdefault(part, {})
    nested[name] = value


def _plain(key: Key, value: Any, kind: str = "") -> Any:
    """A typed value as nested plain values, as files have it."""
    if key.type in _PARTS:
        return dict(zip(_PARTS[key.type], value, strict=True))
    if key.type is Type.POSE:
        kinds = (Type.VECTOR, Type.RPY)
        return {
            half: dict(zip(_PARTS[type_], part, strict=True))
            for half, type_, part in zip(_POSE, kinds, value, strict=True)
        }
    if key.type is Type.MAPS:
        kind = kind or next(k for k, keys in SCHEMA.items() if key in keys)
        return [_nested(kind, item, f"{key.path}[].") for item in value]
    if isinstance(value, tuple):
        return [list(item) if isinstance(item, tuple) else item for item in value]
    return value


__all__ = ["Item", "items_of", "new_text", "same", "updated"]
