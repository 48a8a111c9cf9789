"""Writes a collection back to its file: only what changed in Blender changes in the text.

An export collects from the scene (`collecting`), converts plain data (`mesh_files`, `file_text`), and then writes. The
scene is read, never touched. Everything is prepared and checked before the first file is written, and a failure leaves
files and scene as they were.
"""

from __future__ import annotations

import json
from codecs import BOM_UTF8
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import bpy
import numpy as np

from .collecting import FILE_KINDS, Collected, ExportError, collect, folder_of, has_mesh, members
from .file_text import text_of, top_values, unheld_top
from .folders import allowed_folders, own_files, remember_written
from .ligature.adf import AdfError, Element, Resolver
from .ligature.adf.frames import pose_matrix
from .ligature.adf.nodes import parse
from .ligature.adf.patch import PatchError
from .ligature.adf.update import Item, given_values, updated
from .ligature.authoring.motion import moved_pose
from .ligature.authoring.objfile import MeshWriteError
from .ligature.authoring.placement import matrix_of
from .ligature.authoring.save import SaveError, checked_text, foreign, save_all
from .mesh_data import mesh_print
from .mesh_files import NO_MESH, MeshFiles
from .placed import ZERO
from .placing import SHAPED, owner_of, placed, shapes_of, solids_of
from .properties import KIND_OF_ROLE
from .schema_properties import identifier, state_text, store


@dataclass
class Export:
    """What an export writes, and what it noticed.

    Attributes
    ----------
    files
        All files with their content, also those that have it already.
    roots
        Folders outside which nothing is written.
    notes
        What the user should know before anything is written.
    foreign
        Existing files that would be replaced and that are not this export's own.
    """

    files: dict[Path, bytes] = field(default_factory=dict)
    roots: tuple[Path, ...] = ()
    text: str = ""
    notes: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    foreign: list[Path] = field(default_factory=list)
    written: list[Path] = field(default_factory=list)


class ForeignFiles(ExportError):
    """An export that would replace files that are not its own; nothing was written."""

    def __init__(self, files: list[Path]) -> None:
        listed = ", ".join(f"'{file}'" for file in files[:8]) + (
            f" and {len(files) - 8} more" if len(files) > 8 else ""
        )
        super().__init__(
            f"{listed} would be replaced, and the scene neither was opened from there nor wrote that; allow it with "
            "'Replace Files', or choose an empty folder"
        )
        self.files = files


def export_file(collection: bpy.types.Collection, path: Path, replace: bool = False, remember: bool = True) -> Export:
    """Write a collection with its meshes; raises `ExportError`.

    ``replace`` allows to replace files that are not this export's own; ``remember`` makes what is written its own.
    """
    done = prepared(collection, path)
    write(done, replace)
    if remember:
        remember_written(collection.adf, done.files)
    return done


def write(done: Export, replace: bool = False) -> None:
    """Write what was prepared, all of it or nothing; raises `ExportError`."""
    if done.foreign and not replace:
        raise ForeignFiles(done.foreign)
    try:
        done.written = save_all(done.files, done.roots)
    except SaveError as error:
        raise ExportError(str(error)) from error


def prepared(collection: bpy.types.Collection, path: Path, root: Path | None = None, top: dict | None = None) -> Export:
    """A collection's file at ``path`` and its meshes, checked and not yet written; raises `ExportError`.

    Nothing lies outside ``root``, the folder of the file by default. ``top`` are keys of the file that differ from the
    scene's for this export.
    """
    try:
        found = collect(collection, with_meshes=True)
        done = _converted(found, path, root or path.parent, top or {})
    except (ValueError, AdfError, SaveError, PatchError, MeshWriteError) as error:
        raise ExportError(str(error)) from error
    done.foreign = foreign(done.files, own_files(collection.adf))
    return done


def _converted(found: Collected, path: Path, root: Path, top: dict) -> Export:
    before = Path(found.path) if found.path and found.source else None
    resolver = Resolver.for_file(before or path, allowed_folders())
    meshes = MeshFiles(found.meshes, found.top, path, before, root, _reader(resolver))
    text = text_of(found, meshes.keys, {**meshes.top, **top})
    data = text.encode("utf-8") if text == found.source else checked_text(text, path)
    if found.byte_order_mark:
        data = BOM_UTF8 + data
    problems = list(dict.fromkeys(meshes.problems))
    return Export({**meshes.files, path: data}, (root,), text, found.notes, problems)


def _reader(resolver: Resolver) -> Callable[[Path], bytes | None]:
    """Reads files that the scene may open; None for others."""

    @cache
    def read(path: Path) -> bytes | None:
        try:
            return resolver.read_bytes(path)
        except (AdfError, OSError):
            return None

    return read


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
    "members", "prepared", "prepared_variants", "unheld_top", "write",
]  # fmt: skip
