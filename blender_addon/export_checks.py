"""What of a collection cannot be written, and what surprises about it. Errors name the object."""

from __future__ import annotations

import json
from math import isfinite

import bpy

from .collected import Part
from .ligature.adf.references import merged
from .poses import SHAPED, children_with, scene_of, shapes_of
from .references import file_of, members, owner_of, qualified

TRIANGLES = "moves and collides as a triangle mesh; decompose it into convex pieces, or fit primitives"


class ExportError(Exception):
    """A collection that cannot be written; nothing was changed. The message names the object, ``obj`` if it is one."""

    def __init__(self, message: str, obj: bpy.types.Object | None = None) -> None:
        super().__init__(message)
        self.obj = obj


def check_parts(collection: bpy.types.Collection, objects: list[bpy.types.Object], parts: list[Part]) -> list[str]:
    """What the user should know about the objects of a file; raises `ExportError` for what cannot be written."""
    _check_values(objects, parts)
    for obj, part in zip(objects, parts, strict=True):
        if obj.instance_type == "COLLECTION" and obj.instance_collection is not None and obj.adf.role in SHAPED:
            words = f"'{obj.name}' shows the collection '{obj.instance_collection.name}', whose objects are not written"
            raise ExportError(f"{words}; use Object > Apply > Make Instances Real, and join them", obj)
        if part.placed.ends is None:
            gone = deleted_owner(collection, objects, obj)
            if gone:
                raise ExportError(
                    f"'{obj.name}' has the parent '{gone}', which was deleted; parent it to another, or delete it", obj
                )
        else:
            _check_joint(collection, objects, obj, part)
    notes = [f"'{obj.name}' {note}" for obj in objects for note in notes_of(obj)]
    scenes = {obj: scene_of(obj) for obj in objects if not obj.adf.was}
    notes += [f"'{scene.name}': {note}" for scene in dict.fromkeys(scenes.values()) for note in unit_notes(scene)]
    return notes + [
        f"'{obj.name}' was moved, and joins a body that is not open: its pose in the file stays"
        for obj, part in zip(objects, parts, strict=True)
        if _keeps_pose(part)
    ]


def _check_values(objects: list[bpy.types.Object], parts: list[Part]) -> None:
    """Raise `ExportError` unless every object has an identifier of its own, and finite numbers."""
    users: dict[str, str] = {}
    for obj in objects:
        if not obj.adf.key:
            raise ExportError(f"'{obj.name}' has no identifier; give it one in the Physics tab", obj)
        if obj.adf.key in users:
            words = f"'{obj.name}' and '{users[obj.adf.key]}' have one identifier, '{obj.adf.key}'"
            raise ExportError(f"{words}; Check Scene can give the copy its own", obj)
        users[obj.adf.key] = obj.name
    for obj, part in zip(objects, parts, strict=True):
        for path, value in part.values.items():
            numbers = value if isinstance(value, (tuple, list)) else (value,)
            if any(isinstance(v, float) and not isfinite(v) for v in numbers):
                raise ExportError(f"'{obj.name}' has a {path} that is not a finite number; give it one", obj)


def _check_joint(
    collection: bpy.types.Collection,
    objects: list[bpy.types.Object],
    obj: bpy.types.Object,
    part: Part,
) -> None:
    """Raise `ExportError` for a joint without two bodies that the file can name."""
    for end in ("parent", "child"):
        gone = deleted_end(collection, objects, obj, end)
        if gone:
            words = f"'{obj.name}' joins '{gone}', which was deleted"
            raise ExportError(f"{words}; choose another {end} body in the Physics tab, or delete the joint", obj)
    if "ends" in part.unchanged:
        return
    for end, key in zip(("parent", "child"), part.placed.ends, strict=True):
        if not key:
            raise ExportError(f"'{obj.name}' has no {end} body; choose one in the Physics tab, or delete it", obj)
    if part.placed.frames is None and not obj.adf.was:
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
    """Whether a text names an object that the file had and that was deleted since."""
    now = [qualified(collection, obj) for obj in objects]
    space = getattr(getattr(collection.adf, collection.adf.kind.lower(), None), "namespace", "")
    had = [merged(space, "") + key for key in json.loads(collection.adf.imported_keys or "[]")]
    return bool(text) and any(n.endswith(text) for n in had) and not any(n.endswith(text) for n in now)


def _keeps_pose(part: Part) -> bool:
    """Whether a joint was moved and keeps its pose in the file, since not both of its bodies are open."""
    place, before = part.placed, part.before
    return (
        place.ends is not None
        and place.frames is None
        and bool(before)
        and "pose" in before
        and "pose" not in part.unchanged
    )


def notes_of(obj: bpy.types.Object) -> list[str]:
    """What surprises about an object that is not in the file yet."""
    if obj.adf.was:
        return []
    if obj.adf.role in SHAPED:
        return [note for note in (_shape_note(obj), _instances_note(obj)) if note]
    maker = {("CAMERA", "CAMERA"): _camera_notes, ("LIGHT", "LIGHT"): _light_notes}.get((obj.adf.role, obj.type))
    return maker(obj) if maker else []


def unit_notes(scene: bpy.types.Scene) -> list[str]:
    """What surprises about the units of a scene: lengths are written in metres."""
    units = scene.unit_settings
    if units.system == "NONE" or abs(units.scale_length - 1.0) <= 1e-6:
        return []
    return [
        f"its unit scale is {units.scale_length:g}, and lengths are written as metres; "
        "set it to 1 and apply the scale to the objects"
    ]


def _shape_note(obj: bpy.types.Object) -> str:
    if obj.type not in ("MESH", "EMPTY"):
        return f"is a {obj.type.lower()}, whose shape is not written; convert it to a mesh"
    if obj.adf.role == "BODY" and obj.type == "MESH" and collides_as_triangles(obj):
        return TRIANGLES
    return ""


def _instances_note(obj: bpy.types.Object) -> str:
    seen = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()) if obj.visible_get() else obj
    shows = (obj.instance_type in ("VERTS", "FACES") and obj.children) or any(
        system.settings.render_type in ("OBJECT", "COLLECTION") for system in obj.particle_systems
    )
    if shows or (any(modifier.type == "NODES" for modifier in obj.modifiers) and seen.is_instancer):
        return "shows instances, which are not written; use Object > Apply > Make Instances Real, and join them"
    return ""


def _camera_notes(obj: bpy.types.Object) -> list[str]:
    camera, notes = obj.data, []
    if camera.type == "PANO" or (camera.type == "ORTHO" and not obj.adf.camera.orthographic_view_width):
        kind = {"PANO": "panoramic", "ORTHO": "orthographic"}[camera.type]
        hint = {"PANO": "make it one", "ORTHO": "set its Orthographic View Width in the Physics tab"}[camera.type]
        notes.append(f"is {kind}, and is written as a perspective camera; {hint}")
    if camera.shift_x or camera.shift_y:
        notes.append("is shifted, which the format does not have; turn it instead")
    return notes


def _light_notes(obj: bpy.types.Object) -> list[str]:
    if obj.data.type == "SPOT":
        return []
    kind = {"SUN": "sun", "AREA": "area light", "POINT": "point light"}.get(obj.data.type, obj.data.type.lower())
    return [f"is a {kind}, and is written as a spot light at its place; make it a spot to see its cone"]


def collides_as_triangles(obj: bpy.types.Object) -> bool:
    """Whether a moving body has neither primitives nor convex pieces, nor a hull around its mesh."""
    own = obj.adf.body
    parts = shapes_of(obj, "COLLISION") or children_with(obj, "HULL")
    return not parts and own.collision_mesh_type == "CONCAVE_MESH" and own.mass > 0.0
