"""Documents and their elements: the values of a scene file, typed by the schema, with their places."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, cast

from ligature.adf.diagnostics import Diagnostic, Mark, any_error
from ligature.adf.nodes import Mapping, Node, Scalar, Sequence, plain
from ligature.adf.schema import BY_PATH, LISTS, SCHEMA, Fault, Key, Status, Type
from ligature.adf.values import BadValue, Vector, convert


class Element:
    """One object of a document: a body, a joint, … or the document's own top level.

    ``kind`` is its table of the schema, ``key`` its name in the file, ``node`` its block, and ``prefix`` stands before
    the paths of a block within a list.

    Paths are dotted keys of the schema; a missing value is the schema's default. Values of an
    element that a document lists are checked: reading them raises nothing.
    """

    def __init__(self, kind: str, key: str, node: Mapping, prefix: str = "") -> None:
        self.kind = kind
        self.key = key
        self.node = node
        self.mark = node.mark
        self.prefix = prefix
        self._values: dict[str, Any] = {}

    def has(self, path: str) -> bool:
        """Whether the file gives ``path``."""
        return self._node(path) is not None

    def mark_of(self, path: str) -> Mark:
        """Where ``path`` stands, or the element itself when it is absent."""
        node = self._node(path)
        return self.mark if node is None else node.mark

    def value(self, path: str) -> Any:
        """The typed value of ``path``; the schema's default, possibly None, when it is absent.

        Raises `KeyError` for a path that the schema does not know.
        """
        if path not in self._values:
            self._values[path] = self._read(path)
        return self._values[path]

    def _read(self, path: str) -> Any:
        key = BY_PATH[self.kind][self.prefix + path]
        node = self._node(path)
        if node is None:
            return key.default
        try:
            return convert(key, node)
        except BadValue:
            if key.fault is Fault.VALUE or key.status is Status.IGNORED:  # the values of the latter are not checked
                return key.default
            raise

    def text(self, path: str) -> str:
        """A text value; empty when it is absent."""
        return cast(str, self.value(path) or "")

    def number(self, path: str) -> float:
        """A number, in the schema's unit."""
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
        """Position x y z in metres and orientation r p y in radians (as in AMBF)."""
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
        prefix = f"{self.prefix}{path}[]."
        return tuple(
            Element(self.kind, f"{self.key}.{path}[{i}]", item, prefix)
            for i, item in enumerate(items)
            if isinstance(item, Mapping)
        )

    def given(self) -> dict[str, Any]:
        """The typed value of every key of the schema that the file gives, by path; items of lists as such dicts.

        The lists that name a file's objects, and bad values, are left out.
        """
        values: dict[str, Any] = {}
        for path, key in _plain_keys(self.kind, self.prefix):
            if not self.has(path) or (key.type is Type.TEXTS and path in LISTS):
                continue
            if key.type is Type.MAPS:
                values[path] = tuple(child.given() for child in self.children(path))
            elif key.type is Type.NUMBER_OR_MAP and isinstance(self.raw_value(path), dict):
                continue
            else:
                try:
                    values[path] = self.value(path)
                except BadValue:
                    continue
        return values

    def unknown(self) -> dict[str, Any]:
        """The top-level keys that the schema does not know, as nested plain values."""
        known = BY_PATH[self.kind]
        return {name: plain(value) for name, (_, value) in self.node.entries.items() if name not in known}

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


def own_element(kind: str, root: Mapping, key: str = "") -> Element:
    """The file's own keys as an element called ``key``; ``kind`` is that of the file, ``root`` the whole file."""
    own = Mapping(root.mark, root.span, entries={n: e for n, e in root.entries.items() if n in BY_PATH[kind]})
    own.uses = root.uses
    return Element(kind, key or kind, own)


def object_element(kind: str, key: str, root: Mapping) -> Element | None:
    """The object of a ``kind`` that the file defines under ``key``; None when it defines none."""
    node = root.get(key)
    return Element(kind, key, node) if isinstance(node, Mapping) else None


@dataclass
class ListedItem:
    """An item of a list of objects.

    Attributes
    ----------
    list_name, node
        The list, and the item as it stands there.
    name
        The name that it is; None for an item that is no name.
    element
        The object of that name; None where the file does not define it as a block, or defines it with an error.
    first
        The first item of that name in the list, which may be this one.
    found
        What is wrong with the object.
    """

    list_name: str
    node: Node
    name: str | None = None
    element: Element | None = None
    first: ListedItem | None = None
    found: list[Diagnostic] = field(default_factory=list)

    @property
    def kind(self) -> str:
        """Kind of the objects of the list."""
        return LISTS[self.list_name]


def listed_items(kind: str, root: Mapping) -> list[ListedItem]:
    """All items of the lists of objects of a file of ``kind``, list by list, with the objects that they name."""
    items = []
    for list_name in LISTS:
        node = root.get(list_name) if list_name in BY_PATH[kind] else None
        firsts: dict[str, ListedItem] = {}
        for item_node in node.items if isinstance(node, Sequence) else []:
            item = ListedItem(list_name, item_node)
            if isinstance(item_node, Scalar) and not item_node.null:
                item.name = item_node.text
                item.first = firsts.setdefault(item.name, item)
                item.element = object_element(item.kind, item.name, root)
            items.append(item)
    return items


@cache
def _plain_keys(kind: str, prefix: str) -> list[tuple[str, Key]]:
    """The keys below a prefix that are not blocks, by their paths from there."""
    below = [(key.path[len(prefix) :], key) for key in SCHEMA[kind] if key.path.startswith(prefix)]
    return [(path, key) for path, key in below if "[]" not in path and key.type is not Type.MAP]


@dataclass
class Document:
    """One file, read: its elements by list, and the findings.

    Attributes
    ----------
    kind
        ``launch``, ``world``, ``model``, ``input devices`` or ``colors``.
    text
        The file's content as read.
    root
        The whole file as nodes, for patching and for objects that no list names.
    top
        The file's own keys as an element; those that hold an error are left out.
    refused
        AMBF refuses the whole file; set in strict mode only.
    """

    path: Path
    kind: str
    text: str
    root: Mapping
    top: Element
    lists: dict[str, tuple[Element, ...]] = field(default_factory=dict)
    diagnostics: list[Diagnostic] = field(default_factory=list)
    refused: bool = False

    @property
    def ok(self) -> bool:
        """Whether no error was found."""
        return not any_error(self.diagnostics)

    def elements(self, name: str) -> tuple[Element, ...]:
        """The usable listed objects of the list ``name``, in list order, repetitions kept."""
        return self.lists.get(name, ())
