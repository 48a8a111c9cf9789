"""Writes a collection back to its file: only what changed in Blender changes in the text.

An export collects from the scene (`collecting`), converts plain data (`mesh_files`, `file_text`), and then writes. The
scene is read, never touched. Everything is prepared and checked before the first file is written, and a failure leaves
files and scene as they were.
"""

from __future__ import annotations

import json
from codecs import BOM_UTF8
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from .collecting import FILE_KINDS, Collected, ExportError, collect, folder_of, has_mesh, members
from .decimals import clean
from .file_text import text_of, top_values, unheld_top
from .ligature.adf import AdfError, Element
from .ligature.adf.frames import pose_matrix
from .ligature.adf.nodes import parse
from .ligature.adf.patch import PatchError
from .ligature.adf.update import Item, given_values, updated
from .ligature.authoring.objfile import MeshWriteError
from .ligature.authoring.placement import matrix_of, pose_of
from .ligature.authoring.save import SaveError, checked_text, save_all
from .mesh_data import mesh_print
from .mesh_files import NO_MESH, MeshFiles
from .placing import SHAPED, placed, solids_of
from .properties import KIND_OF_ROLE
from .schema_properties import identifier, state_text, store


@dataclass
class Export:
    """What an export wrote, and what it noticed."""

    written: list[Path] = field(default_factory=list)
    text: str = ""
    problems: list[str] = field(default_factory=list)


def export_file(collection: bpy.types.Collection, path: Path) -> Export:
    """Write a collection with its meshes; raises `ExportError`."""
    done, files = prepared(collection, path)
    try:
        done.written = save_all(files)
    except SaveError as error:
        raise ExportError(str(error)) from error
    return done


def prepared(collection: bpy.types.Collection, path: Path) -> tuple[Export, dict[Path, bytes]]:
    """A collection's file at ``path`` and its meshes, by path, checked and not yet written; raises `ExportError`."""
    try:
        return _converted(collect(collection, with_meshes=True), path)
    except (ValueError, AdfError, SaveError, PatchError, MeshWriteError) as error:
        raise ExportError(str(error)) from error


def _converted(found: Collected, path: Path) -> tuple[Export, dict[Path, bytes]]:
    meshes = MeshFiles(found.meshes, found.top, path, Path(found.path) if found.path else None)
    text = text_of(found, meshes.keys)
    data = text.encode("utf-8") if text == found.source else checked_text(text, path)
    if found.byte_order_mark:
        data = BOM_UTF8 + data
    return Export(text=text, problems=meshes.problems), {**meshes.files, path: data}


def current_text(collection: bpy.types.Collection) -> str:
    """The text of the file as it would be written now, but for new meshes; raises ValueError for what has no place."""
    return text_of(collect(collection))


def variant_text(collection: bpy.types.Collection, variant: bpy.types.PropertyGroup) -> str:
    """The text of the same model under another namespace, moved as a whole; raises ValueError."""
    motion = pose_matrix(variant.location, variant.rotation)
    text = current_text(collection)
    root = parse(text, Path("variant.yaml"))
    top = {**top_values("model", root), "namespace": variant.namespace}
    items = []
    for obj in members(collection):
        kind = KIND_OF_ROLE[obj.adf.role]
        values = given_values(Element(kind, obj.adf.key, root.get(obj.adf.key)))
        if kind == "body":
            values["location"] = clean(pose_of(motion @ matrix_of(values.get("location"))))
        items.append(Item(kind, obj.adf.key, values))
    return updated(text, "model", top, items)


def export_variants(collection: bpy.types.Collection) -> list[Path]:
    """Write the variants beside the model, whose meshes they share; raises `ExportError`."""
    folder = folder_of(collection)
    try:
        texts = {folder / Path(v.filepath).name: variant_text(collection, v) for v in collection.adf.variants}
        return save_all({path: checked_text(text, path) for path, text in texts.items()})
    except (ValueError, AdfError, SaveError, PatchError) as error:
        raise ExportError(str(error)) from error


def after_export(collection: bpy.types.Collection, path: Path, text: str) -> None:
    """Keep the written text as the file's own, so that the next export changes it."""
    stored = collection.adf
    stored.filepath, stored.source = str(path), text
    objects = members(collection)
    if stored.kind == "OTHER":
        return
    root, kind = parse(text, path), FILE_KINDS[stored.kind]
    store(getattr(stored, identifier(kind)), kind, top_values(kind, root))  # folders and file names that were chosen
    for obj in objects:
        own, node = KIND_OF_ROLE[obj.adf.role], root.get(obj.adf.key)
        store(getattr(obj.adf, identifier(own)), own, given_values(Element(own, obj.adf.key, node)))
    stored.imported_keys = json.dumps([obj.adf.key for obj in objects])
    for obj in objects:
        obj.adf.was = obj.adf.key
        obj.adf.imported = state_text(placed(obj).state())
        if obj.adf.role in SHAPED:
            obj.adf.mesh_print = mesh_print(solids_of(obj))


__all__ = [
    "NO_MESH", "Export", "ExportError", "after_export", "current_text", "export_file", "has_mesh", "members",
    "prepared", "unheld_top",
]  # fmt: skip
