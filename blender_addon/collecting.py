"""Reads all that an export of a collection needs from Blender; the only part of an export that looks at the scene.

Hidden objects count like all others. What has no place in a file is refused with the object's name.
"""

from __future__ import annotations

import json
from pathlib import Path

import bpy

from .collected import Collected, Part
from .collecting_meshes import has_mesh, mesh_sources
from .export_checks import check_parts
from .folders import allowed_folders, own_files
from .placed import unchanged_groups
from .poses import placed
from .properties import KIND_OF_ROLE
from .references import members, new_name, owner_names
from .schema_properties import fetch, identifier
from .steps import Steps, part

FILE_KINDS = {"MODEL": "model", "WORLD": "world", "INPUT_DEVICES": "input devices"}


def collecting(collection: bpy.types.Collection, with_meshes: bool = False) -> Steps[Collected]:
    """The steps to everything that the file of a collection states.

    They raise ValueError and `ExportError` for what has no place.
    """
    words = f"Reading {collection.name}"
    yield words, 0.0
    stored = collection.adf
    if stored.kind == "OTHER":
        return Collected(
            "", stored.source, stored.filepath, stored.byte_order_mark,
            folders=allowed_folders(), own=own_files(stored),
        )  # fmt: skip
    kind, objects = FILE_KINDS[stored.kind], members(collection)
    names, owners = [new_name(obj) for obj in objects], [owner_names(obj) for obj in objects]
    kinds = [KIND_OF_ROLE[obj.adf.role] for obj in objects]
    top = fetch(getattr(stored, identifier(kind)), kind)
    values = [fetch(getattr(obj.adf, identifier(own)), own) for obj, own in zip(objects, kinds, strict=True)]
    places = []
    for number, obj in enumerate(objects):
        yield words, 0.5 * number / len(objects)
        places.append(placed(obj, owners[number]))
    states = [json.loads(obj.adf.imported) if obj.adf.imported else None for obj in objects]
    unchanged = [unchanged_groups(before, place.state()) for before, place in zip(states, places, strict=True)]
    parts = [
        Part(obj.adf.key, obj.adf.was, obj.adf.like, *rest)
        for obj, *rest in zip(objects, names, values, places, states, unchanged, strict=True)
    ]
    notes = check_parts(collection, objects, parts)
    has_meshes = any(has_mesh(obj) for obj in objects)
    meshes = []
    if with_meshes and kind == "model":
        meshes = yield from part(mesh_sources(objects, words, own_files(stored)), 0.5, 1.0)
    return Collected(
        kind,
        stored.source,
        stored.filepath,
        stored.byte_order_mark,
        top,
        parts,
        has_meshes,
        json.loads(stored.imported_keys or "[]"),
        meshes,
        notes,
        allowed_folders(),
        own_files(stored),
    )


def folder_of(collection: bpy.types.Collection) -> Path:
    """The folder of a collection's file."""
    return Path(bpy.path.abspath(collection.adf.filepath)).parent
