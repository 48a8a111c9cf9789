"""What the file of a collection has: its own keys, its objects as elements, and their values; nothing of Blender."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from .collected import Collected
from .ligature.adf.document import Element, object_element, own_element
from .ligature.adf.nodes import Mapping, parse


@dataclass(frozen=True, eq=False)
class InFile:
    """The file of a collection as it was read or written last.

    Attributes
    ----------
    root
        The file as nodes; None for a new one, and for one that is kept as it is.
    top
        The file's own keys, by path.
    elements, values
        Of each part of the collection: what the file has of it, or of the part it was copied from, and its typed
        values by path.
    """

    root: Mapping | None = None
    top: dict = field(default_factory=dict)
    elements: list[Element | None] = field(default_factory=list)
    values: list[dict] = field(default_factory=list)


def in_file(found: Collected) -> InFile:
    """What the file has of a collection; raises `AdfError` for a text that is not readable."""
    if not found.kind or not found.source:
        return InFile(None, {}, [None] * len(found.parts), [{} for _ in found.parts])
    root = parse(found.source, Path(found.path or "new.yaml"))
    elements = [object_element(part.placed.kind, part.was or part.like, root) for part in found.parts]
    own = own_element(found.kind, root)
    values = [{} if element is None else element.given() for element in elements]
    return InFile(root, own.given(), elements, values)
