"""Writes a collection back to its file: only what changed in Blender changes in the text.

An export collects from the scene (`collecting`) and from the old files (`in_file`, `old_meshes`), converts plain data
(`mesh_files`, `file_text`), and then writes (`saving`). The scene is read, never touched. Everything is prepared and
checked before the first file is written, and a failure leaves files and scene as they were.
"""

from __future__ import annotations

import json
from codecs import BOM_UTF8
from pathlib import Path

import bpy
import numpy as np

from .collecting import FILE_KINDS, collecting, folder_of
from .collecting_meshes import has_mesh
from .export_checks import ExportError
from .file_text import text_of
from .folders import own_files, remember_written
from .in_file import in_file
from .ligature.adf import AdfError, Element, Resolver
from .ligature.adf.document import own_element
from .ligature.adf.frames import pose_matrix
from .ligature.adf.nodes import parse
from .ligature.adf.patch import PatchError
from .ligature.adf.update import Item, updated
from .ligature.authoring.motion import moved_pose
from .ligature.authoring.objfile import MeshWriteError
from .ligature.authoring.placement import matrix_of
from .ligature.authoring.save import SaveError, checked_text
from .mesh_files import NO_MESH, MeshFiles
from .mesh_reading import mesh_print
from .old_meshes import OldMeshes
from .placed import ZERO
from .poses import SHAPED, placed, shapes_of
from .properties import KIND_OF_ROLE
from .references import members, owner_names, owner_of
from .saving import Export, ForeignFiles, write
from .schema_properties import identifier, state_text, store
from .solids import solids_of
from .steps import Steps, finished, part

COLLECTED, PREPARED = 0.6, 0.65
"""Shares of what is prepared once the scene is read, and of an export once all is prepared."""


def export_file(collection: bpy.types.Collection, path: Path, replace: bool = False, remember: bool = True) -> Export:
    """Write a collection with its meshes; raises `ExportError`.

    ``replace`` allows to replace files that are not this export's own; ``remember`` makes what is written its own.
    """
    return finished(exporting(collection, path, replace, remember))


def exporting(
    collection: bpy.types.Collection, path: Path, replace: bool = False, remember: bool = True
) -> Steps[Export]:
    """The steps of `export_file`."""
    done = yield from preparing(collection, path)
    write(done, replace)
    if remember:
        remember_written(collection.adf, done.files)
    return done


def prepared(collection: bpy.types.Collection, path: Path, root: Path | None = None, top: dict | None = None) -> Export:
    """A collection's file at ``path`` and its meshes, checked and not yet written; raises `ExportError`."""
    return finished(preparing(collection, path, root, top))


def preparing(
    collection: bpy.types.Collection, path: Path, root: Path | None = None, top: dict | None = None
) -> Steps[Export]:
    """The steps of `prepared`.

    Nothing lies outside ``root``, the folder of the file by default. ``top`` are keys of the file that differ from the
    scene's for this export.
    """
    root, top = root or path.parent, top or {}
    try:
        found = yield from part(collecting(collection, with_meshes=True), 0.0, COLLECTED)
        words = f"Preparing {path.name}"
        yield words, COLLECTED
        before = Path(found.path) if found.path and found.source else None
        old = in_file(found)
        old_meshes = OldMeshes(found.meshes, found.top, path, before, Resolver.for_file(before or path, found.folders))
        yield words, 0.5 * (COLLECTED + 1.0)
        meshes = MeshFiles(found.meshes, old_meshes, path, root, found.own)
        yield words, 0.75 + 0.25 * COLLECTED
        text = text_of(found, old, meshes.keys, {**meshes.top, **top})
        data = text.encode("utf-8") if text == found.source else checked_text(text, path)
    except (ValueError, AdfError, SaveError, PatchError, MeshWriteError) as error:
        raise ExportError(str(error)) from error
    files = {**meshes.files, path: BOM_UTF8 + data if found.byte_order_mark else data}
    problems = list(dict.fromkeys(meshes.problems))
    return Export(files, (root,), text, found.notes, problems, found.own)


def current_text(collection: bpy.types.Collection) -> Steps[str]:
    """The steps to the text of the file as it would be written now, but for new meshes.

    They raise ValueError for what has no place.
    """
    found = yield from collecting(collection)
    return text_of(found, in_file(found))


def variant_text(text: str, collection: bpy.types.Collection, variant: bpy.types.PropertyGroup) -> str:
    """The text of a model under another namespace, moved as a whole; ``text`` is its own."""
    motion = pose_matrix(variant.location, variant.rotation)
    root = parse(text, Path("variant.yaml"))
    top = {**own_element("model", root).given(), "namespace": variant.namespace}
    items = []
    for obj in members(collection):
        kind = KIND_OF_ROLE[obj.adf.role]
        values = Element(kind, obj.adf.key, root.get(obj.adf.key)).given()
        if kind == "body":
            was = values.get("location", (ZERO, ZERO))
            T = matrix_of(was)
            values["location"] = moved_pose(was, T, motion @ T, float(np.abs(motion[:3, 3]).max()))
        items.append(Item(kind, obj.adf.key, values))
    return updated(text, "model", top, items)


def preparing_variants(collection: bpy.types.Collection) -> Steps[Export]:
    """The steps to the variants beside the model, whose meshes they share; they raise `ExportError`."""
    folder, variants = folder_of(collection), collection.adf.variants
    files = {}
    try:
        text = yield from part(current_text(collection), 0.0, COLLECTED)
        for number, variant in enumerate(variants):
            yield f"Preparing {variant.filepath}", COLLECTED + (1.0 - COLLECTED) * number / len(variants)
            path = folder / Path(variant.filepath).name
            files[path] = checked_text(variant_text(text, collection, variant), path)
    except (ValueError, AdfError, SaveError, PatchError) as error:
        raise ExportError(str(error)) from error
    return Export(files, (folder,), own=own_files(collection.adf))


def keeping(collection: bpy.types.Collection, path: Path, text: str) -> Steps[None]:
    """The steps that keep the written text as the file's own, so that the next export changes it."""
    words = f"Wrote {path.name}"
    yield words, 0.0
    stored = collection.adf
    stored.filepath, stored.source = str(path), text
    objects = members(collection)
    if stored.kind == "OTHER":
        return
    root, kind = parse(text, path), FILE_KINDS[stored.kind]
    top = own_element(kind, root).given()  # with folders and file names that were chosen
    store(getattr(stored, identifier(kind)), kind, top)
    for number, obj in enumerate(objects):
        yield words, 0.5 * number / len(objects)
        own, node = KIND_OF_ROLE[obj.adf.role], root.get(obj.adf.key)
        store(getattr(obj.adf, identifier(own)), own, Element(own, obj.adf.key, node).given())
    stored.imported_keys = json.dumps([obj.adf.key for obj in objects])
    for number, obj in enumerate(objects):
        yield words, 0.5 + 0.5 * number / len(objects)
        obj.adf.was, obj.adf.like, obj.adf.called = obj.adf.key, "", obj.name
        obj.adf.hung = obj.adf.hung or owner_of(obj) is not None
        for use in ("COLLISION", "VISUAL"):
            for order, shape in enumerate(shapes_of(obj, use)):
                shape.adf.shape.order = order
        obj.adf.imported = state_text(placed(obj, owner_names(obj)).state())
        if obj.adf.role in SHAPED:
            obj.adf.mesh_print = mesh_print(solids_of(obj))


__all__ = [
    "NO_MESH", "Export", "ExportError", "ForeignFiles", "current_text", "export_file", "exporting", "has_mesh",
    "keeping", "members", "prepared", "preparing", "preparing_variants", "write",
]  # fmt: skip
