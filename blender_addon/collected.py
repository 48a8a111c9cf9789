"""What an export collected from the Blender scene, as plain data; nothing of Blender."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from .mesh_source import MeshSource
from .placed import Placed, State


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
    top: dict = field(default_factory=dict)
    parts: list[Part] = field(default_factory=list)
    has_meshes: bool = False
    imported_keys: list[str] = field(default_factory=list)
    meshes: list[MeshSource] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    folders: tuple[Path, ...] = ()
    own: dict[str, str] = field(default_factory=dict)
