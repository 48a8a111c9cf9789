"""Reads all that an export of a collection needs from Blender; the only part of an export that looks at the scene.

Hidden objects count like all others. What has no place in a file is refused with the object's name.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path

import bpy

from .ligature.adf.references import merged
from .mesh_data import Solid, Textures, mesh_print, surfaces_of
from .mesh_files import MeshSource
from .placed import Placed, State, unchanged_groups
from .placing import SHAPED, children_with, owner_of, placed, shapes_of, solids_of
from .properties import KIND_OF_ROLE
from .references import file_of, qualified, topic_name
from .schema_properties import fetch, identifier

FILE_KINDS = {"MODEL": "model", "WORLD": "world", "INPUT_DEVICES": "input devices"}


class ExportError(Exception):
    """A collection that cannot be written; nothing was changed. The message names the object, ``obj`` if it is one."""

    def __init__(self, message: str, obj: bpy.types.Object | None = None) -> None:
        super().__init__(message)
        self.obj = obj


@dataclass(frozen=True, eq=False)
class Part:
    """One object of a file.

    Attributes
    ----------
    key, was, like
        Its key now and in the file, and that of the object it was copied from.
    name
        What it is called in Blender, if it was renamed there.
    values, placed, before
        Its properties by path, where it stands, and its state just after the import.
    """

    key: str
    was: str
    like: str
    name: str
    values: dict
    placed: Placed
    before: State | None


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
    notes
        What the user should know before anything is written.
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
    notes: list[str] = field(default_factory=list)


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
    states = [json.loads(obj.adf.imported) if obj.adf.imported else None for obj in objects]
    for one in zip(objects, places, states, strict=True):
        _check_ends(collection, objects, *one)
    parts = [
        Part(o.adf.key, o.adf.was, o.adf.like, _new_name(o), *rest)
        for o, *rest in zip(objects, values, places, states, strict=True)
    ]
    return Collected(
        kind, stored.source, stored.filepath, stored.byte_order_mark,
        fetch(getattr(stored, identifier(kind)), kind), parts, any(has_mesh(obj) for obj in objects),
        json.loads(stored.imported_keys or "[]"), _meshes(objects) if with_meshes and kind == "model" else [],
        [f"'{obj.name}' {note}" for obj in objects for note in notes_of(obj)] + _lost(objects, places, states),
    )  # fmt: skip


def _new_name(obj: bpy.types.Object) -> str:
    """The name for the file of an object that was renamed in Blender since it was opened or written."""
    if not obj.adf.called or obj.adf.called == obj.name:
        return ""
    return obj.name if obj.adf.role == "JOINT" else topic_name(obj.name)


def _lost(objects: list[bpy.types.Object], places: list[Placed], states: list[State | None]) -> list[str]:
    """Joints that were moved, of which the file keeps its own pose since not both bodies are open."""
    return [
        f"'{obj.name}' was moved, and joins a body that is not open: its pose in the file stays"
        for obj, place, before in zip(objects, places, states, strict=True)
        if place.ends is not None and place.frames is None and before and "pose" in before
        and "pose" not in unchanged_groups(before, place.state())
    ]  # fmt: skip


def notes_of(obj: bpy.types.Object) -> list[str]:
    """What surprises about an object that is not in the file yet."""
    if obj.adf.was or obj.adf.role not in SHAPED:
        return []
    if obj.type not in ("MESH", "EMPTY"):
        return [f"is a {obj.type.lower()}, whose shape is not written; convert it to a mesh"]
    if obj.adf.role == "BODY" and obj.type == "MESH" and collides_as_triangles(obj):
        return ["moves and collides as a triangle mesh; decompose it into convex pieces, or fit primitives"]
    return []


def collides_as_triangles(obj: bpy.types.Object) -> bool:
    """Whether a moving body has neither primitives nor convex pieces, nor a hull around its mesh."""
    own = obj.adf.body
    parts = shapes_of(obj, "COLLISION") or children_with(obj, "HULL")
    return not parts and own.collision_mesh_type == "CONCAVE_MESH" and own.mass > 0.0


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


def _check_ends(
    collection: bpy.types.Collection,
    objects: list[bpy.types.Object],
    obj: bpy.types.Object,
    place: Placed,
    before: State | None,
) -> None:
    """Refuse what cannot be written: instances of collections, and objects whose bodies were deleted."""
    if obj.instance_type == "COLLECTION" and obj.instance_collection is not None and obj.adf.role in SHAPED:
        words = f"'{obj.name}' shows the collection '{obj.instance_collection.name}', whose objects are not written"
        raise ExportError(f"{words}; use Object > Apply > Make Instances Real, and join them", obj)
    if place.ends is None:
        gone = deleted_owner(collection, objects, obj)
        if gone:
            raise ExportError(
                f"'{obj.name}' hangs on '{gone}', which was deleted; parent it to another, or delete it", obj
            )
        return
    for end in ("parent", "child"):
        gone = deleted_end(collection, objects, obj, end)
        if gone:
            words = f"'{obj.name}' joins '{gone}', which was deleted"
            raise ExportError(f"{words}; choose another {end} body in the Physics tab, or delete the joint", obj)
    if "ends" in unchanged_groups(before, place.state()):
        return
    for end, key in zip(("parent", "child"), place.ends, strict=True):
        if not key:
            raise ExportError(f"'{obj.name}' has no {end} body; choose one in the Physics tab, or delete it", obj)
    if place.frames is None and not obj.adf.was:
        raise ExportError(f"'{obj.name}' joins a body of a file that is not open, so that it has no place there", obj)


def deleted_end(
    collection: bpy.types.Collection, objects: list[bpy.types.Object], joint: bpy.types.Object, end: str
) -> str:
    """What a joint calls a body that is no more; empty when the body is there, or of a file that is not open."""
    body, text = getattr(joint.adf, f"{end}_object"), getattr(joint.adf, f"{end}_text")
    if body is None:
        return text if _was_here(collection, objects, text) else ""
    there = file_of(body)
    if there is None:  # its file was closed, or it was deleted from this one
        return body.name if not text or _was_here(collection, objects, text) else ""
    return "" if body in (objects if there is collection else members(there)) else body.name


def deleted_owner(collection: bpy.types.Collection, objects: list[bpy.types.Object], obj: bpy.types.Object) -> str:
    """What an object calls the body that it hung on and that is no more."""
    owner = owner_of(obj)
    if owner is not None:
        return "" if owner.users_collection else owner.name
    return obj.adf.parent_text if obj.adf.hung and _was_here(collection, objects, obj.adf.parent_text) else ""


def _was_here(collection: bpy.types.Collection, objects: list[bpy.types.Object], text: str) -> bool:
    """Whether a text names an object that the file had and that is no more."""
    now = [qualified(collection, obj) for obj in objects]
    space = getattr(getattr(collection.adf, collection.adf.kind.lower(), None), "namespace", "")
    had = [merged(space, "") + key for key in json.loads(collection.adf.imported_keys or "[]")]
    return bool(text) and any(n.endswith(text) for n in had) and not any(n.endswith(text) for n in now)


# --- meshes -----------------------------------------------------------------------------------


def _meshes(objects: list[bpy.types.Object]) -> list[MeshSource]:
    """The meshes of all objects; the triangles of those alone whose files have to be written."""
    shaped = [obj for obj in objects if obj.adf.role in SHAPED]
    solids = {obj.name_full: solids_of(obj) for obj in shaped}
    prints = {name: mesh_print(parts) for name, parts in solids.items()}
    groups = {o.name_full: getattr(o.adf, o.adf.role.lower()) for o in bpy.data.objects if o.adf.role in SHAPED}
    names = {name: {g.mesh.lower(), g.collision_mesh.lower()} for name, g in groups.items()}
    written: set[str] = set()
    found = []
    for obj in shaped:
        now = prints[obj.name_full]
        source = MeshSource(
            key=obj.adf.key, name=obj.name, clean_name=bpy.path.clean_name(obj.name), type=obj.type, print=now,
            **_own(obj),
        )  # fmt: skip
        if obj.adf.mesh_print != now:
            # a file that looks the same for all who use it is changed for all of them
            source.taken = set().union(*(used for name, used in names.items() if prints.get(name) != now))
            whole = obj.type == "MESH" and (now not in written or bool(source.mesh))
            _read_triangles(source, solids[obj.name_full], whole)
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
