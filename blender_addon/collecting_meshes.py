"""Reads the meshes of a collection's objects, the triangles of those alone whose files have to be written."""

from __future__ import annotations

from collections.abc import Collection

import bpy

from .materials import Textures, changed_textures, texture_names
from .mesh_reading import mesh_print, surfaces_of
from .mesh_source import HIGH, LOW, MeshSource
from .poses import SHAPED
from .properties import KIND_OF_ROLE
from .schema_properties import identifier
from .solids import Solid, solids_of
from .steps import Steps


def has_mesh(obj: bpy.types.Object) -> bool:
    """Whether an object has a visual mesh of its own."""
    return obj.adf.role in SHAPED and obj.type == "MESH"


def mesh_sources(objects: list[bpy.types.Object], words: str, own_files: Collection[str]) -> Steps[list[MeshSource]]:
    """The steps to the meshes of all objects, the triangles of those alone whose files have to be written.

    ``own_files`` are those that the collection was opened from or wrote.
    """
    shaped = [obj for obj in objects if obj.adf.role in SHAPED]
    own = {obj.name_full: _own(obj) for obj in shaped}
    solids = {obj.name_full: solids_of(obj) for obj in shaped}
    prints = {}
    for name, parts in solids.items():
        yield words, 0.5 * len(prints) / len(solids)
        prints[name] = mesh_print(parts)
    groups = {o.name_full: getattr(o.adf, o.adf.role.lower()) for o in bpy.data.objects if o.adf.role in SHAPED}
    names = {name: {g.mesh.lower(), g.collision_mesh.lower()} for name, g in groups.items()}
    pictures = texture_names()
    written: set[str] = set()
    found = []
    for obj in shaped:
        yield words, 0.5 + 0.5 * len(found) / len(shaped)
        now = prints[obj.name_full]
        source = MeshSource(
            key=obj.adf.key, name=obj.name, clean_name=bpy.path.clean_name(obj.name), type=obj.type, fingerprint=now,
            **own[obj.name_full],
        )  # fmt: skip
        if obj.adf.mesh_print != now:
            # a file that looks the same for all who use it is changed for all of them
            source.taken = set().union(*(used for name, used in names.items() if prints.get(name) != now))
            whole = obj.type == "MESH" and (now not in written or bool(source.mesh))
            _read_triangles(source, solids[obj.name_full], whole, Textures(pictures))
            written |= {now} if obj.type == "MESH" else set()
        elif obj.type == "MESH":
            source.textures = changed_textures(obj, pictures, own_files)
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
        "places": {
            HIGH: (getattr(own, "high_resolution_path", ""), own.mesh),
            LOW: (getattr(own, "low_resolution_path", ""), own.collision_mesh or own.mesh),
        },
    }


def _read_triangles(source: MeshSource, solids: list[Solid], whole: bool, textures: Textures) -> None:
    """Read the triangles of an object, where it has them and needs a file of its own, and of its convex parts."""
    source.changed = True
    if whole:
        source.surfaces = surfaces_of(solids[0], textures)
    source.hulls = [surfaces_of(hull, corners=False) for hull in solids[1:]]
    source.textures, source.problems = textures.files, textures.problems
