"""Reads all that an export of a collection needs from Blender; the only part of an export that looks at the scene.

Hidden objects count like all others. What has no place in a file is refused with the object's name.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from .collecting_meshes import has_mesh, mesh_sources
from .export_checks import check_ends, check_values, kept_joints, notes_of
from .folders import allowed_folders, own_files
from .ligature.adf.nodes import Mapping, parse
from .mesh_source import MeshSource
from .placed import Placed, State, unchanged_groups
from .placing import placed
from .properties import KIND_OF_ROLE
from .references import members, new_name
from .schema_properties import fetch, identifier
from .steps import Steps, part

FILE_KINDS = {"MODEL": "model", "WORLD": "world", "INPUT_DEVICES": "input devices"}


@dataclass(frozen=True, eq=False)
class Part:
    """One object of a file.

    Attributes
    ----------
    key, was, like
        Its key now and in the file, and that of the object it was copied from.
    name
        What it is called in Blender, if it was renamed there.
    values, placed
        Its properties by path, and where it stands.
    before, unchanged
        Its state just after the import, and the groups of keys that are still the same.
    """

    key: str
    was: str
    like: str
    name: str
    values: dict
    placed: Placed
    before: State | None
    unchanged: set[str]


@dataclass(frozen=True, eq=False)
class Collected:
    """A collection as plain data.

    Attributes
    ----------
    kind
        Of the file; empty for one that is kept as it is.
    source, path
        Text of the file as it was read or written last, and its path; empty for a new one.
    root
        The file as nodes; None for a new one, and for one that is kept as it is.
    top, parts
        Keys of the file itself, and its objects.
    has_meshes
        Whether an object has a visual mesh of its own.
    imported_keys
        Identifiers that the file had.
    meshes
        What the mesh files of each object are made of, for a model whose meshes were asked for.
    notes
        What the user should know before anything is written.
    folders, own
        Further folders that may be read, and digests of the files that the collection was opened from or wrote.
    """

    kind: str
    source: str
    path: str
    byte_order_mark: bool = False
    root: Mapping | None = None
    top: dict = field(default_factory=dict)
    parts: list[Part] = field(default_factory=list)
    has_meshes: bool = False
    imported_keys: list[str] = field(default_factory=list)
    meshes: list[MeshSource] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    folders: tuple[Path, ...] = ()
    own: dict[str, str] = field(default_factory=dict)


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
    names, kinds = [new_name(obj) for obj in objects], [KIND_OF_ROLE[obj.adf.role] for obj in objects]
    top = fetch(getattr(stored, identifier(kind)), kind)
    values = [fetch(getattr(obj.adf, identifier(own)), own) for obj, own in zip(objects, kinds, strict=True)]
    check_values(objects, values)
    places = []
    for number, obj in enumerate(objects):
        yield words, 0.5 * number / len(objects)
        places.append(placed(obj))
    states = [json.loads(obj.adf.imported) if obj.adf.imported else None for obj in objects]
    unchanged = [unchanged_groups(before, place.state()) for before, place in zip(states, places, strict=True)]
    check_ends(collection, objects, places, unchanged)
    notes = [f"'{obj.name}' {note}" for obj in objects for note in notes_of(obj)]
    notes += kept_joints(objects, places, states, unchanged)
    meshes = []
    if with_meshes and kind == "model":
        meshes = yield from part(mesh_sources(objects, words), 0.5, 1.0)
    parts = [
        Part(obj.adf.key, obj.adf.was, obj.adf.like, *rest)
        for obj, *rest in zip(objects, names, values, places, states, unchanged, strict=True)
    ]
    return Collected(
        kind,
        stored.source,
        stored.filepath,
        stored.byte_order_mark,
        parse(stored.source, Path(stored.filepath or "new.yaml")) if stored.source else None,
        top,
        parts,
        any(has_mesh(obj) for obj in objects),
        json.loads(stored.imported_keys or "[]"),
        meshes,
        notes,
        allowed_folders(),
        own_files(stored),
    )


def folder_of(collection: bpy.types.Collection) -> Path:
    """The folder of a collection's file."""
    return Path(bpy.path.abspath(collection.adf.filepath)).parent
