"""Which file has an object, which object it is parented to, and how files name each other's objects."""

from __future__ import annotations

import re

import bpy

from .ligature.adf.references import merged
from .properties import KIND_OF_ROLE
from .schema_properties import identifier


def file_of(obj: bpy.types.Object | None) -> bpy.types.Collection | None:
    """The collection of a file that holds an object."""
    return next(
        (c for c in bpy.data.collections if c.adf.kind != "NONE" and obj is not None and obj.name in c.all_objects),
        None,
    )


def owner_of(obj: bpy.types.Object) -> bpy.types.Object | None:
    """The object of a file, if any, that an object is parented to."""
    parent = obj.parent
    return parent if parent is not None and parent.adf.role in KIND_OF_ROLE else None


def members(collection: bpy.types.Collection) -> list[bpy.types.Object]:
    """The objects of a file, in the order in which they were brought in or made; hidden ones too."""
    return [obj for obj in collection.all_objects if obj.adf.role in KIND_OF_ROLE and obj.adf.export]


def qualified(collection: bpy.types.Collection, obj: bpy.types.Object) -> str:
    """The object's identifier with its namespace (as in AMBF)."""
    own = getattr(obj.adf, identifier(KIND_OF_ROLE[obj.adf.role]))
    return merged(_namespace(collection), getattr(own, "namespace", "")) + obj.adf.key


def topic_name(name: str) -> str:
    """A name that ROS takes in topics: Blender counts copies behind a dot, which is none of theirs."""
    return re.sub(r"[^A-Za-z0-9_/ ]", "_", name)


def new_name(obj: bpy.types.Object) -> str:
    """The name for the file of an object that was renamed in Blender since it was opened or written."""
    if not obj.adf.called or obj.adf.called == obj.name:
        return ""
    return obj.name if obj.adf.role == "JOINT" else topic_name(obj.name)


def _namespace(collection: bpy.types.Collection | None) -> str:
    group = None if collection is None else getattr(collection.adf, collection.adf.kind.lower(), None)
    return getattr(group, "namespace", "")


def reference(obj: bpy.types.Object, other: bpy.types.Object, given: str = "") -> str:
    """How the file of ``obj`` names another object: with its namespace when it is of a file that has another one.

    ``given`` is what the file or the user states; it stays where it means that object and none of the own file.
    """
    here, there = file_of(obj), file_of(other)
    if there is None and given:  # its file is not open any more
        return given
    if here is None or there is None or there is here:
        return other.adf.key
    whole = qualified(there, other)
    for text in (given, other.adf.key if whole == _namespace(here) + other.adf.key else ""):
        if text and whole.endswith(text) and not any(own.adf.key == text for own in here.all_objects):
            return text
    return whole


def owner_names(obj: bpy.types.Object) -> tuple[str, ...]:
    """How the file names the owner of an object, or both bodies of a joint.

    A text that was never found among the open files stays.
    """
    own = obj.adf
    if own.role == "JOINT":
        ends = ((own.parent_object, own.parent_text), (own.child_object, own.child_text))
        return tuple(reference(obj, body, text) if body else text for body, text in ends)
    owner = owner_of(obj)
    if owner is not None:
        return (reference(obj, owner, own.parent_text),)
    return ("" if own.hung else own.parent_text,)
