"""The text of a file from what was collected of it: only what changed in Blender changes; nothing of Blender."""

from __future__ import annotations

from .collected import Collected, Part
from .held_keys import unheld, unheld_in_lists
from .in_file import InFile
from .ligature.adf import Element
from .ligature.adf.nodes import Mapping
from .ligature.adf.schema import BY_PATH
from .ligature.adf.update import Item, new_text, updated
from .mesh_source import NEW_FOLDERS
from .placed_keys import placed_keys


def text_of(found: Collected, old: InFile, meshes: dict[str, dict] | None = None, top: dict | None = None) -> str:
    """The text of the file as it is now; ``old`` is the file before.

    ``meshes`` are mesh keys by the key of their object, ``top`` keys of the file itself that differ for this export.
    """
    if not found.kind:
        return found.source
    items = [
        _item(part, *before, old.root, (meshes or {}).get(part.key, {}))
        for part, *before in zip(found.parts, old.elements, old.values, strict=True)
    ]
    if old.root is None:
        folders = NEW_FOLDERS if found.kind == "model" and found.has_meshes else {}
        return new_text(found.kind, {**folders, **found.top, **(top or {})}, items)
    kept = {part.was for part in found.parts}
    removed = [key for key in found.imported_keys if key not in kept]
    own = {**unheld(found.kind, old.top), **found.top, **(top or {})}
    return updated(found.source, found.kind, own, items, removed, old.root)


def _item(part: Part, element: Element | None, in_file: dict, root: Mapping | None, meshes: dict) -> Item:
    """The object as it is to stand in the file; a copy takes from its original what Blender does not hold."""
    kind = part.placed.kind
    kept, kept_in_lists = unheld(kind, in_file), unheld_in_lists(kind)
    before, unchanged = (None, set()) if element is None else (part.before, part.unchanged)
    placed = placed_keys(part.placed, before, unchanged, in_file)
    values = {**kept, **part.values, **placed, **meshes}
    if part.name and "name" in BY_PATH[kind] and values.get("name") == in_file.get("name"):
        values["name"] = part.name
    values = {path: value for path, value in values.items() if value is not None}
    extra = {} if element is None or part.was else element.unknown()
    was = part.was if root is not None and part.was in root.entries else ""
    return Item(kind, part.key, values, was, extra, kept_in_lists)
