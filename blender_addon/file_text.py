"""The text of a file from what was collected of it: only what changed in Blender changes; nothing of Blender."""

from __future__ import annotations

from .collecting import Collected, Part
from .in_file import object_element, top_values
from .ligature.adf import Element
from .ligature.adf.nodes import Mapping
from .ligature.adf.update import Item, given_values, new_text, unknown_values, updated
from .mesh_source import NEW_FOLDERS
from .placed_keys import placed_keys
from .schema_properties import unheld, unheld_in_lists


def text_of(found: Collected, meshes: dict[str, dict] | None = None, top: dict | None = None) -> str:
    """The text of the file as it is now.

    ``meshes`` are mesh keys by the key of their object, ``top`` keys of the file itself that differ for this export.
    """
    if not found.kind:
        return found.source
    root = found.root
    elements = [object_element(part.placed.kind, part.was or part.like, root) for part in found.parts]
    in_file = [{} if element is None else given_values(element) for element in elements]
    own = {} if root is None else top_values(found.kind, root)
    items = [
        _item(part, *before, root, (meshes or {}).get(part.key, {}))
        for part, *before in zip(found.parts, elements, in_file, strict=True)
    ]
    if root is None:
        folders = NEW_FOLDERS if found.kind == "model" and found.has_meshes else {}
        return new_text(found.kind, {**folders, **found.top, **(top or {})}, items)
    kept = {part.was for part in found.parts}
    removed = [key for key in found.imported_keys if key not in kept]
    return updated(
        found.source, found.kind, {**unheld(found.kind, own), **found.top, **(top or {})}, items, removed, root
    )


def _item(part: Part, element: Element | None, in_file: dict, root: Mapping | None, meshes: dict) -> Item:
    """The object as it is to stand in the file; a copy takes from its original what Blender does not hold."""
    kind = part.placed.kind
    kept, kept_in_lists = unheld(kind, in_file), unheld_in_lists(kind)
    before, unchanged = (None, set()) if element is None else (part.before, part.unchanged)
    placed = placed_keys(part.placed, before, unchanged, in_file)
    values = {**kept, **part.values, **placed, **meshes}
    if part.name and values.get("name") == in_file.get("name"):
        values["name"] = part.name
    values = {path: value for path, value in values.items() if value is not None}
    extra = {} if element is None or part.was else unknown_values(element)
    was = part.was if root is not None and part.was in root.entries else ""
    return Item(kind, part.key, values, was, extra, kept_in_lists)
