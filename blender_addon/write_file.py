"""Writes a collection back to its file: only what changed in Blender changes in the text.

An export collects from the scene (`collecting`) and from the old files (`old_meshes`), converts plain data
(`mesh_files`, `file_text`), and then writes (`saving`). The scene is read, never touched. Everything is prepared and
checked before the first file is written, and a failure leaves files and scene as they were.
"""

from __future__ import annotations

import json
from codecs import BOM_UTF8
from pathlib import Path

import bpy
import numpy as np

from .collecting import FILE_KINDS, collect, folder_of
from .collecting_meshes import has_mesh
from .export_checks import ExportError
from .file_text import text_of
from .folders import own_files, remember_written
from .in_file import top_values
from .ligature.adf import AdfError, Element, Resolver
from .ligature.adf.frames import pose_matrix
from .ligature.adf.nodes import parse
from .ligature.adf.patch import PatchError
from .ligature.adf.update import Item, given_values, updated
from .ligature.authoring.motion import moved_pose
from .ligature.authoring.objfile import MeshWriteError
from .ligature.authoring.placement import matrix_of
from .ligature.authoring.save import SaveError, checked_text, foreign
from .mesh_data import mesh_print
from .mesh_files import NO_MESH, MeshFiles
from .old_meshes import OldMeshes
from .placed import ZERO
from .placing import SHAPED, owner_of, placed, shapes_of
from .properties import KIND_OF_ROLE
from .references import members
from .saving import Export, ForeignFiles, write
from .schema_properties import identifier, state_text, store
from .solids import solids_of


def export_file(collection: bpy.types.Collection, path: Path, replace: bool = False, remember: bool = True) -> Export:
    """Write a collection with its meshes; raises `ExportError`.

    ``replace`` allows to replace files that are not this export's own; ``remember`` makes what is written its own.
    """
    done = prepared(collection, path)
    write(done, replace)
    if remember:
        remember_written(collection.adf, done.files)
    return done


def prepared(collection: bpy.types.Collection, path: Path, root: Path | None = None, top: dict | None = None) -> Export:
    """A collection's file at ``path`` and its meshes, checked and not yet written; raises `ExportError`.

    Nothing lies outside ``root``, the folder of the file by default. ``top`` are keys of the file that differ from the
    scene's for this export.
    """
    root, top = root or path.parent, top or {}
    try:
        found = collect(collection, with_meshes=True)
        before = Path(found.path) if found.path and found.source else None
        old = OldMeshes(found.meshes, found.top, path, before, Resolver.for_file(before or path, found.folders))
        meshes = MeshFiles(found.meshes, old, path, root)
        text = text_of(found, meshes.keys, {**meshes.top, **top})
        data = text.encode("utf-8") if text == found.source else checked_text(text, path)
    except (ValueError, AdfError, SaveError, PatchError, MeshWriteError) as error:
        raise ExportError(str(error)) from error
    files = {**meshes.files, path: BOM_UTF8 + data if found.byte_order_mark else data}
    problems = list(dict.fromkeys(meshes.problems))
    return Export(files, (root,), text, found.notes, problems, foreign(files, found.own))


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
            was = values.get("location", (ZERO, ZERO))
            T = matrix_of(was)
            values["location"] = moved_pose(was, T, motion @ T, float(np.abs(motion[:3, 3]).max()))
        items.append(Item(kind, obj.adf.key, values))
    return updated(text, "model", top, items)


def prepared_variants(collection: bpy.types.Collection) -> Export:
    """The variants beside the model, whose meshes they share, not yet written; raises `ExportError`."""
    folder = folder_of(collection)
    try:
        texts = {folder / Path(v.filepath).name: variant_text(collection, v) for v in collection.adf.variants}
        files = {path: checked_text(text, path) for path, text in texts.items()}
    except (ValueError, AdfError, SaveError, PatchError) as error:
        raise ExportError(str(error)) from error
    return Export(files, (folder,), foreign=foreign(files, own_files(collection.adf)))


def export_variants(collection: bpy.types.Collection, replace: bool = False) -> list[Path]:
    """Write the variants beside the model; raises `ExportError`."""
    done = prepared_variants(collection)
    write(done, replace)
    remember_written(collection.adf, done.files)
    return done.written


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
        obj.adf.was, obj.adf.like, obj.adf.called = obj.adf.key, "", obj.name
        obj.adf.hung = obj.adf.hung or owner_of(obj) is not None
        for use in ("COLLISION", "VISUAL"):
            for order, shape in enumerate(shapes_of(obj, use)):
                shape.adf.shape.order = order
        obj.adf.imported = state_text(placed(obj).state())
        if obj.adf.role in SHAPED:
            obj.adf.mesh_print = mesh_print(solids_of(obj))


__all__ = [
    "NO_MESH", "Export", "ExportError", "ForeignFiles", "after_export", "current_text", "export_file", "has_mesh",
    "members", "prepared", "prepared_variants", "write",
]  # fmt: skip
