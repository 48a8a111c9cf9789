"""What the mesh files of an object are made of, as plain data; nothing of Blender."""

from __future__ import annotations

from dataclasses import dataclass, field

from .ligature.authoring.objfile import Surface

HIGH, LOW = "high resolution path", "low resolution path"
NEW_FOLDERS = {HIGH: "./high_res/", LOW: "./low_res/"}
"""Folders of a new model's meshes."""


@dataclass(eq=False)
class MeshSource:
    """What the mesh files of one object are made of.

    Attributes
    ----------
    key, name, type
        Those of the object in the model file and in Blender, and its type there.
    mesh, collision_mesh, scale, collision_type_given
        The object's own keys.
    places
        For `HIGH` and `LOW`: the folder below the model's that the object states, and the name of its file there.
    clean_name, taken
        A name for files after the object, and names in lower case that other objects use.
    fingerprint
        A text that tells meshes apart.
    changed
        Whether the files have to be written again; those of any other object may have to move.
    surfaces, hulls
        Triangles of the object, None where an equal mesh has them, and of each convex part.
    textures, problems
        Pictures of its materials by the names of their files, and what could not be written of them. Of an unchanged
        object: those of which the collection's own files have copies.
    """

    key: str
    name: str
    clean_name: str
    type: str
    fingerprint: str
    mesh: str
    collision_mesh: str
    scale: float
    collision_type_given: bool
    places: dict[str, tuple[str, str]]
    changed: bool = False
    taken: set[str] = field(default_factory=set)
    surfaces: list[Surface] | None = None
    hulls: list[list[Surface]] = field(default_factory=list)
    textures: dict[str, bytes] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
