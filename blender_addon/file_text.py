"""The text of a file from what was collected of it: only what changed in Blender changes; nothing of Blender."""

from __future__ import annotations

from pathlib import Path

from .collecting import Collected, Part
from .ligature.adf import Element
from .ligature.adf.nodes import Mapping, parse
from .ligature.adf.schema import BY_PATH
from .ligature.adf.update import Item, given_values, new_text, unknown_values, updated
from .mesh_files import NEW_FOLDERS
from .placed import placed_keys
from .schema_properties import unheld_in_lists, unheld_paths


def text_of(found: Collected, meshes: dict[str, dict] | None = None, top: dict | None = None) -> str:
    """The text of the file as it is now.

    ``meshes`` are mesh keys by the key of their object, ``top`` keys of the file itself that differ for this export.
    """
    if not found.kind:
        return found.source
    root = parse(found.source, Path(found.path or "new.yaml")) if found.source else None
    items = [_item(found, part, root, (meshes or {}).get(part.key, {})) for part in found.parts]
    if root is None:
        folders = NEW_FOLDERS if found.kind == "model" and found.has_meshes else {}
        return new_text(found.kind, {**folders, **found.top, **(top or {})}, items)
    top = {**unheld_top(found.kind, root), **found.top, **(top or {})}
    kept = {part.was for part in found.parts}
    removed = [key for key in found.imported_keys if key not in kept]
    return updated(found.source, found.kind, top, items, removed, root)


def _item(found: Collected, part: Part, root: Mapping | None, meshes: dict) -> Item:
    """The object as it is to stand in the file; a copy takes from its original what Blender does not hold."""
    kind = part.placed.kind
    was = part.was or part.like
    node = root.get(was) if root is not None and was else None
    in_file = given_values(Element(kind, was, node)) if isinstance(node, Mapping) else {}
    unheld = {path: in_file[path] for path in unheld_paths(kind) if path in in_file}
    before = part.before if isinstance(node, Mapping) else None
    values = {**unheld, **part.values, **placed_keys(part.placed, before, in_file), **meshes}
    if part.name and values.get("name") == in_file.get("name"):
        values["name"] = part.name
    values = {path: value for path, value in values.items() if value is not None}
    known = isinstance(node, Mapping)
    extra = unknown_values(Element(kind, was, node)) if known and not part.was else {}
    return Item(kind, part.key, values, part.was if node is not None else "", extra, unheld_in_lists(kind))


def unheld_top(kind: str, root: Mapping) -> dict:
    """The file's own keys that neither properties nor the scene hold: they stay as they are."""
    values = top_values(kind, root)
    return {path: values[path] for path in unheld_paths(kind) if path in values}


def top_values(kind: str, root: Mapping) -> dict:
    """The keys of a file itself, by path."""
    own = Mapping(root.mark, root.span, entries={n: e for n, e in root.entries.items() if n in BY_PATH[kind]})
    own.uses = root.uses
    return given_values(Element(kind, kind, own))
