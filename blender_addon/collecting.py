"""Reads all that an export of a collection needs from Blender; the only part of an export that looks at the scene.

Hidden objects count like all others. What has no place in a file is refused with the object's name.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path

import bpy

from .mesh_data import Solid, Textures, mesh_print, surfaces_of
from .mesh_files import MeshSource
from .placed import Placed, unchanged_groups
from .placing import SHAPED, placed, solids_of
from .properties import KIND_OF_ROLE
from .schema_properties import fetch, identifier

FILE_KINDS = {"MODEL": "model", "WORLD": "world", "INPUT_DEVICES": "input devices"}


class ExportError(Exception):
    """A collection that cannot be written; nothing was changed. The message names the object, ``obj`` if it is one."""

    def __init__(self, message: str, obj: bpy.types.Object | None = None) -> None:
        super().__init__(message)
        self.obj = obj


@dataclass(frozen=True, eq=False)
class Part:
    """One object of a file: its key now and in the file, its properties by path, where it stands."""

    key: str
    was: str
    values: dict
    placed: Placed
    same: set[str]
    """Groups of placed keys that state what the file states."""


@dataclass(frozen=True, eq=False)
class Collected:
    """A collection as plain data.

    Attributes
    ----------
    kind
        Of the file; empty for one that is kept as it is.
    source, path
        Text of the file as it was read or written last, and its path; empty for a new one.
    top, parts
        Keys of the file itself, and its objects.
    has_meshes
        Whether an object has a visual mesh of its own.
    imported_keys
        Identifiers that the file had.
    meshes
        What the mesh files of each object are made of, for a model whose meshes were asked for.
    """

    kind: str
    source: str
    path: str
    byte_order_mark: bool = False
    top: dict = field(default_factory=dict)
    parts: list[Part] = field(default_factory=list)
    has_meshes: bool = False
    imported_keys: list[str] = field(default_factory=list)
    meshes: list[MeshSource] = field(default_factory=list)


def members(collection: bpy.types.Collection) -> list[bpy.types.Object]:
    """The objects of a file, in the order in which they were brought in or made; hidden ones too."""
    return [obj for obj in collection.all_objects if obj.adf.role in KIND_OF_ROLE and obj.adf.export]


def has_mesh(obj: bpy.types.Object) -> bool:
    """Whether an object has a visual mesh of its own."""
    return obj.adf.role in SHAPED and obj.type == "MESH"


def collect(collection: bpy.types.Collection, with_meshes: bool = False) -> Collected:
    """Everything that the file of a collection states; raises ValueError and `ExportError` for what has no place."""
    stored = collection.adf
    if stored.kind == "OTHER":
        return Collected("", stored.source, stored.filepath, stored.byte_order_mark)
    kind, objects = FILE_KINDS[stored.kind], members(collection)
    _check_keys(objects)
    values = [_values(obj) for obj in objects]
    places = [placed(obj) for obj in objects]
    same = [_same(*pair) for pair in zip(objects, places, strict=True)]
    for one in zip(objects, places, same, strict=True):
        _check_joint(*one)
    return Collected(
        kind, stored.source, stored.filepath, stored.byte_order_mark,
        fetch(getattr(stored, identifier(kind)), kind),
        [Part(o.adf.key, o.adf.was, *rest) for o, *rest in zip(objects, values, places, same, strict=True)],
        any(has_mesh(obj) for obj in objects),
        json.loads(stored.imported_keys or "[]"),
        _meshes(objects) if with_meshes and kind == "model" else [],
    )  # fmt: skip


def _check_keys(objects: list[bpy.types.Object]) -> None:
    users: dict[str, str] = {}
    for obj in objects:
        if not obj.adf.key:
            raise ExportError(f"'{obj.name}' has no identifier; give it one in the Physics tab", obj)
        if obj.adf.key in users:
            words = f"'{obj.name}' and '{users[obj.adf.key]}' have one identifier, '{obj.adf.key}'"
            raise ExportError(f"{words}; Check Scene can give the copy its own", obj)
        users[obj.adf.key] = obj.name


def _values(obj: bpy.types.Object) -> dict:
    """The object's properties by path, all of them finite."""
    kind = KIND_OF_ROLE[obj.adf.role]
    found = fetch(getattr(obj.adf, identifier(kind)), kind)
    for path, value in found.items():
        numbers = value if isinstance(value, (tuple, list)) else (value,)
        if any(isinstance(v, float) and not isfinite(v) for v in numbers):
            raise ExportError(f"'{obj.name}' has a {path} that is not a finite number; give it one", obj)
    return found


def _same(obj: bpy.types.Object, place: Placed) -> set[str]:
    return unchanged_groups(json.loads(obj.adf.imported) if obj.adf.imported else None, place.state())


def _check_joint(obj: bpy.types.Object, place: Placed, same: set[str]) -> None:
    """A joint whose body was deleted, or that has no place in a body of its file, cannot be written anew."""
    if place.ends is None or "ends" in same:
        return
    for end, key in zip(("parent", "child"), place.ends, strict=True):
        if not key:
            raise ExportError(f"'{obj.name}' has no {end} body; choose one in the Physics tab, or delete it", obj)
    if place.frames is None and not obj.adf.was:
        raise ExportError(f"'{obj.name}' joins a body of a file that is not open, so that it has no place there", obj)


# --- meshes -----------------------------------------------------------------------------------


def _meshes(objects: list[bpy.types.Object]) -> list[MeshSource]:
    """The meshes of all objects; the triangles of those alone whose files have to be written."""
    shaped = [obj for obj in objects if obj.adf.role in SHAPED]
    groups = {o.name_full: getattr(o.adf, o.adf.role.lower()) for o in bpy.data.objects if o.adf.role in SHAPED}
    names = {name: {g.mesh.lower(), g.collision_mesh.lower()} for name, g in groups.items()}
    written: set[str] = set()
    found = []
    for obj, solids in zip(shaped, [solids_of(obj) for obj in shaped], strict=True):
        now = mesh_print(solids)
        source = MeshSource(
            key=obj.adf.key, name=obj.name, clean_name=bpy.path.clean_name(obj.name), type=obj.type, print=now,
            **_own(obj),
        )  # fmt: skip
        if obj.adf.mesh_print != now:
            source.taken = set().union(*(used for name, used in names.items() if name != obj.name_full))
            whole = obj.type == "MESH" and (now not in written or bool(source.mesh))
            _read_triangles(source, solids, whole)
            written |= {now} if obj.type == "MESH" else set()
        found.append(source)
    return found


def _own(obj: bpy.types.Object) -> dict:
    """Names and scale of an object's mesh files, and the folders below the model's that it states."""
    own = getattr(obj.adf, identifier(KIND_OF_ROLE[obj.adf.role]))
    return {
        "mesh": own.mesh,
        "collision_mesh": own.collision_mesh,
        "scale": own.scale or 1.0,
        "collision_type_given": own.is_property_set("collision_mesh_type"),
        "high": getattr(own, "high_resolution_path", ""),
        "low": getattr(own, "low_resolution_path", ""),
    }


def _read_triangles(source: MeshSource, solids: list[Solid], whole: bool) -> None:
    """Read the triangles of an object, where it has them and needs a file of its own, and of its convex parts."""
    textures = Textures()
    source.changed = True
    if whole:
        source.surfaces = surfaces_of(solids[0], textures)
    source.hulls = [surfaces_of(hull, corners=False) for hull in solids[1:]]
    source.textures, source.problems = textures.files, textures.problems


def folder_of(collection: bpy.types.Collection) -> Path:
    """The folder of a collection's file."""
    return Path(bpy.path.abspath(collection.adf.filepath)).parent
