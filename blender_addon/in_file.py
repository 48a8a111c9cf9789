"""What a file gives: its own keys and its objects as elements, and their typed values; nothing of Blender."""

from __future__ import annotations

from .ligature.adf import Element
from .ligature.adf.nodes import Mapping
from .ligature.adf.schema import BY_PATH
from .ligature.adf.update import given_values


def object_element(kind: str, key: str, root: Mapping | None) -> Element | None:
    """The object of a ``kind`` that the file defines under ``key``, if it does."""
    node = root.get(key) if root is not None and key else None
    return Element(kind, key, node) if isinstance(node, Mapping) else None


def top_values(kind: str, root: Mapping) -> dict:
    """The file's own keys, by path."""
    own = Mapping(root.mark, root.span, entries={n: e for n, e in root.entries.items() if n in BY_PATH[kind]})
    own.uses = root.uses
    return given_values(Element(kind, kind, own))
