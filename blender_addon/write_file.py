"""Writes a collection back to its file: only what changed in Blender changes in the text.

The scene is read, never touched. Everything is prepared and checked before the first file is
written, and a failure leaves files and scene as they were.
"""

from __future__ import annotations

import json
import os
from codecs import BOM_UTF8
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from math import isfinite
from pathlib import Path

import bpy

from .ligature.adf import AdfError, Element
from .ligature.adf.frames import pose_matrix
from .ligature.adf.nodes import Mapping, parse
from .ligature.adf.patch import PatchError
from .ligature.adf.schema import BY_PATH, SCHEMA
from .ligature.adf.update import Item, given_values, new_text, updated
from .ligature.authoring.objfile import MeshWriteError, obj_texts
from .ligature.authoring.placement import matrix_of, pose_of
from .ligature.authoring.save import SaveError, checked_text, save_all
from .mesh_data import Textures, mesh_print, surfaces_of
from .placing import SHAPED, children_with, clean, placed_keys, state_of, unchanged
from .properties import KIND_OF_ROLE
from .schema_properties import PLACED, fetch, identifier, keys_of, state_text, store

HIGH, LOW = "high resolution path", "low resolution path"
NO_MESH = "its shape is a {}, which is not written; convert it to a mesh"


class ExportError(Exception):
    """A collection that cannot be written; nothing was changed. The message names the object, ``obj`` if it is one."""

    def __init__(self, message: str, obj: bpy.types.Object | None = None) -> None:
        super().__init__(message)
        self.obj = obj


@dataclass
class Export:
    """What an export wrote, and what it noticed."""

    written: list[Path] = field(default_factory=list)
    text: str = ""
    problems: list[str] = field(default_factory=list)


def members(collection: bpy.types.Collection) -> list[bpy.types.Object]:
    """The objects of a file, in the order in which they were brought in or made; hidden ones too."""
    return [obj for obj in collection.all_objects if obj.adf.role in KIND_OF_ROLE and obj.adf.export]


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
        return _prepared(collection, path)
    except (ValueError, AdfError, SaveError, PatchError, MeshWriteError) as error:
        raise ExportError(str(error)) from error


def text_of(collection: bpy.types.Collection, meshes: dict[str, dict] | None = None) -> str:
    """The text of the file as it would be written now; raises ValueError for what has no place."""
    stored = collection.adf
    if stored.kind == "OTHER":
        return stored.source
    kind = _file_kind(stored.kind)
    group = getattr(stored, identifier(kind))
    root = parse(stored.source, Path(stored.filepath or "new.yaml")) if stored.source else None
    objects = members(collection)
    _check_keys(objects)
    _check_numbers(objects)
    _check_joints(objects)
    items = [_item(obj, root, (meshes or {}).get(obj.adf.key, {})) for obj in objects]
    top = fetch(group, kind)
    if root is None:
        top = {**top, **_default_paths(kind, top, objects)}
        return new_text(kind, top, items)
    top = {**unheld_top(kind, root), **top}
    kept = {obj.adf.was for obj in objects}
    removed = [key for key in json.loads(stored.imported_keys or "[]") if key not in kept]
    return updated(stored.source, kind, top, items, removed, root)


def variant_text(collection: bpy.types.Collection, variant: bpy.types.PropertyGroup) -> str:
    """The text of the same model under another namespace, moved as a whole; raises ValueError."""
    motion = pose_matrix(variant.location, variant.rotation)
    text = text_of(collection)
    root = parse(text, Path("variant.yaml"))
    top = {**_top_values("model", root), "namespace": variant.namespace}
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
    folder = Path(bpy.path.abspath(collection.adf.filepath)).parent
    try:
        texts = {folder / Path(v.filepath).name: variant_text(collection, v) for v in collection.adf.variants}
        return save_all({path: checked_text(text, path) for path, text in texts.items()})
    except (ValueError, AdfError, SaveError, PatchError) as error:
        raise ExportError(str(error)) from error


def after_export(collection: bpy.types.Collection, path: Path, text: str) -> None:
    """Remember the written text as the file's own, so that the next export changes it."""
    stored = collection.adf
    stored.filepath, stored.source = str(path), text
    objects = members(collection)
    if stored.kind == "OTHER":
        return
    root, kind = parse(text, path), _file_kind(stored.kind)
    store(getattr(stored, identifier(kind)), kind, _top_values(kind, root))  # folders and file names that were chosen
    for obj in objects:
        own, node = KIND_OF_ROLE[obj.adf.role], root.get(obj.adf.key)
        store(getattr(obj.adf, identifier(own)), own, given_values(Element(own, obj.adf.key, node)))
    stored.imported_keys = json.dumps([obj.adf.key for obj in objects])
    for obj in objects:
        obj.adf.was = obj.adf.key
        obj.adf.imported = state_text(state_of(obj))
        if obj.adf.role in SHAPED:
            obj.adf.mesh_print = mesh_print(obj)


def _prepared(collection: bpy.types.Collection, path: Path) -> tuple[Export, dict[Path, bytes]]:
    done = Export()
    stored = collection.adf
    meshes: dict[str, dict] = {}
    files: dict[Path, bytes] = {}
    if stored.kind == "MODEL":
        meshes, files = _mesh_files(collection, path, done)
    done.text = text_of(collection, meshes)
    data = done.text.encode("utf-8") if done.text == stored.source else checked_text(done.text, path)
    if stored.byte_order_mark:
        data = BOM_UTF8 + data
    return done, {**files, path: data}


def _file_kind(kind: str) -> str:
    return {"MODEL": "model", "WORLD": "world", "INPUT_DEVICES": "input devices"}[kind]


def _check_keys(objects: list[bpy.types.Object]) -> None:
    users: dict[str, str] = {}
    for obj in objects:
        if not obj.adf.key:
            raise ExportError(f"'{obj.name}' has no identifier; give it one in the Physics tab", obj)
        if obj.adf.key in users:
            words = f"'{obj.name}' and '{users[obj.adf.key]}' have one identifier, '{obj.adf.key}'"
            raise ExportError(f"{words}; Check Scene can give the copy its own", obj)
        users[obj.adf.key] = obj.name


def _check_numbers(objects: list[bpy.types.Object]) -> None:
    for obj in objects:
        kind = KIND_OF_ROLE[obj.adf.role]
        for path, value in fetch(getattr(obj.adf, identifier(kind)), kind).items():
            numbers = value if isinstance(value, (tuple, list)) else (value,)
            if any(isinstance(v, float) and not isfinite(v) for v in numbers):
                raise ExportError(f"'{obj.name}' has a {path} that is not a finite number; give it one", obj)


def _check_joints(objects: list[bpy.types.Object]) -> None:
    """A joint whose body was deleted, or that has no place in a body of its file, cannot be written anew."""
    for obj in (o for o in objects if o.adf.role == "JOINT"):
        state = state_of(obj)
        if unchanged(obj, "ends", state):
            continue
        for end, key in zip(("parent", "child"), state["ends"], strict=True):
            if not key:
                raise ExportError(f"'{obj.name}' has no {end} body; choose one in the Physics tab, or delete it", obj)
        if "frames" not in state and not obj.adf.was:
            raise ExportError(
                f"'{obj.name}' joins a body of a file that is not open, so that it has no place there", obj
            )


def _item(obj: bpy.types.Object, root: Mapping | None, meshes: dict) -> Item:
    """The object as it is to stand in the file."""
    kind = KIND_OF_ROLE[obj.adf.role]
    node = root.get(obj.adf.was) if root is not None and obj.adf.was else None
    in_file = given_values(Element(kind, obj.adf.was, node)) if isinstance(node, Mapping) else {}
    unheld = {path: in_file[path] for path in _unheld_paths(kind) if path in in_file}
    values = {**unheld, **fetch(getattr(obj.adf, identifier(kind)), kind), **placed_keys(obj, in_file), **meshes}
    return Item(kind, obj.adf.key, values, was=obj.adf.was if node is not None else "")


@cache
def _unheld_paths(kind: str) -> list[str]:
    """Keys that neither properties nor placing hold: they stay as the file has them."""
    held = {key.path for key in keys_of(kind)}
    placed = PLACED.get(kind, ())
    return [
        key.path
        for key in SCHEMA[kind]
        if key.path not in held and not any(key.path == p or key.path.startswith(f"{p}.") for p in placed)
    ]


def unheld_top(kind: str, root: Mapping) -> dict:
    """The file's own keys that neither properties nor the scene hold: they stay as they are."""
    values = _top_values(kind, root)
    return {path: values[path] for path in _unheld_paths(kind) if path in values}


def _top_values(kind: str, root: Mapping) -> dict:
    own = Mapping(root.mark, root.span, entries={n: e for n, e in root.entries.items() if n in BY_PATH[kind]})
    own.uses = root.uses
    return given_values(Element(kind, kind, own))


def _default_paths(kind: str, top: dict, objects: list[bpy.types.Object]) -> dict:
    """Folders of a new model's meshes."""
    if kind != "model" or not any(has_mesh(obj) for obj in objects):
        return {}
    return {key: value for key, value in ((HIGH, "./high_res/"), (LOW, "./low_res/")) if key not in top}


def has_mesh(obj: bpy.types.Object) -> bool:
    """Whether an object has a visual mesh of its own."""
    return obj.adf.role in SHAPED and obj.type == "MESH"


def _mesh_files(
    collection: bpy.types.Collection, path: Path, done: Export
) -> tuple[dict[str, dict], dict[Path, bytes]]:
    """Mesh keys by object, and the files to write: changed meshes, and unchanged ones that move to another folder."""
    group = collection.adf.model
    high = (path.parent / (fetch(group, "model").get(HIGH) or "./high_res/")).resolve()
    low = (path.parent / (fetch(group, "model").get(LOW) or "./low_res/")).resolve()
    keys: dict[str, dict] = {}
    files: dict[Path, bytes] = {}
    shared: dict[str, str] = {}
    for obj in members(collection):
        if obj.adf.role not in SHAPED:
            continue
        own = getattr(obj.adf, identifier(KIND_OF_ROLE[obj.adf.role]))
        print_now = mesh_print(obj)
        if obj.adf.mesh_print == print_now:
            files.update(_moved(collection, obj, own, path))
            continue
        if obj.type not in ("MESH", "EMPTY"):
            done.problems.append(f"'{obj.name}': {NO_MESH.format(obj.type.lower())}")
        textures = Textures()
        keys[obj.adf.key] = dict(_object_meshes(obj, own, high, low, textures, files, shared, print_now))
        files.update({high / name: data for name, data in textures.files.items()})
        done.problems += textures.problems
    return keys, files


def _object_meshes(
    obj, own, high: Path, low: Path, textures: Textures, files: dict, shared: dict, print_now: str
) -> Iterator:
    """Mesh keys of one object; its OBJ and MTL files are put into ``files``."""
    scale = own.scale or 1.0
    if obj.type == "MESH":
        name = own.mesh or free_name(obj, "", high, low, files)
        if print_now in shared and not own.mesh:
            name = shared[print_now]  # linked duplicates share one file
        else:
            shared[print_now] = name
            files.update(_obj_files(high / name, surfaces_of(obj, textures=textures), obj.name, scale))
        yield "mesh", name
    hulls = children_with(obj, "HULL")
    if hulls:
        name = own.collision_mesh or free_name(obj, "_collision", high, low, files)
        surfaces = []
        for number, hull in enumerate(hulls):
            for surface in surfaces_of(hull, obj, corners=False):
                paint = type(surface.paint)(f"hull_{number:03d}", diffuse=_part_colour(number))
                surfaces.append(type(surface)(paint, surface.vertices, surface.triangles))
        files.update(_obj_files(low / name, surfaces, f"{obj.name} collision", scale))
        yield "collision mesh", name
        if not own.is_property_set("collision_mesh_type"):
            yield "collision mesh type", "CONVEX_HULL"


def _part_colour(number: int) -> tuple[float, float, float]:
    """A colour of its own for each part, by the golden ratio around the colour circle."""
    import colorsys

    return colorsys.hsv_to_rgb(number * 0.618034 % 1.0, 0.6, 0.9)


def _obj_files(path: Path, surfaces: list, name: str, scale: float) -> dict[Path, bytes]:
    library = path.with_suffix(".mtl")
    unscaled = [type(s)(s.paint, s.vertices / scale, s.triangles, s.normals, s.uvs) for s in surfaces]
    obj, mtl = obj_texts(unscaled, library.name, name)
    return {path: obj.encode("utf-8"), library: mtl.encode("utf-8")}


def free_name(obj: bpy.types.Object, end: str, high: Path, low: Path, files: dict) -> str:
    """A mesh file's name after the object: one that no other object of this export, or of its file, has taken.

    Names that differ only in case count as one, since they are one file where disks fold case.
    """
    groups = [getattr(o.adf, o.adf.role.lower()) for o in bpy.data.objects if o.adf.role in SHAPED and o is not obj]
    taken = {name.lower() for group in groups for name in (group.mesh, group.collision_mesh)}
    taken |= {path.name.lower() for path in files if path.parent in (high, low)}
    base = "_".join(bpy.path.clean_name(obj.name).split()) + end
    name, number = f"{base}.OBJ", 2
    while name.lower() in taken or f"{Path(name).stem.lower()}.mtl" in taken:
        name, number = f"{base}_{number}.OBJ", number + 1
    return name


def _moved(collection: bpy.types.Collection, obj, own, path: Path) -> dict[Path, bytes]:
    """Copies of an unchanged object's mesh files, when the file goes to another folder."""
    before = Path(collection.adf.filepath).parent if collection.adf.filepath else path.parent
    if before.resolve() == path.parent.resolve():
        return {}
    found: dict[Path, bytes] = {}
    for key, name in ((HIGH, own.mesh), (LOW, own.collision_mesh or own.mesh)):
        folder = os.path.join(getattr(collection.adf.model, identifier(key)), getattr(own, identifier(key)))
        source, target = before / folder / name, (path.parent / folder / name).resolve()
        if name and source.is_file() and source.resolve() != target:
            for file in _with_companions(source):
                found[target.parent / file.name] = file.read_bytes()
    return found


def _with_companions(path: Path) -> Iterator[Path]:
    """A mesh file, its material library and the textures that this names."""
    yield path
    library = next((p for p in (path.with_suffix(".mtl"), path.with_suffix(".MTL")) if p.is_file()), None)
    if library is None:
        return
    yield library
    for line in library.read_text("utf-8", "replace").splitlines():
        words = line.split(None, 1)
        if len(words) == 2 and words[0].startswith("map_"):
            texture = path.parent / words[1].strip()
            if texture.is_file():
                yield texture


__all__ = ["Export", "ExportError", "after_export", "export_file", "has_mesh", "members", "prepared", "text_of"]
