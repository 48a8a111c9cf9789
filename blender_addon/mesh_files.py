"""The mesh files of a model: their names and texts, and the keys that name them; nothing of Blender."""

from __future__ import annotations

import colorsys
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from .ligature.authoring.objfile import Paint, Surface, obj_texts

HIGH, LOW = "high resolution path", "low resolution path"
NEW_FOLDERS = {HIGH: "./high_res/", LOW: "./low_res/"}
"""Folders of a new model's meshes."""

NO_MESH = "its shape is a {}, which is not written; convert it to a mesh"

LIBRARY_WITHIN = 65536
"""Bytes of an OBJ file in which its material libraries are named."""

_LIBRARY = re.compile(rb"^mtllib\s+(.+)$", re.MULTILINE)

Files = dict[Path, bytes]


@dataclass(eq=False)
class MeshSource:
    """What the mesh files of one object are made of.

    Attributes
    ----------
    mesh, collision_mesh, high, low, scale, collision_type_given
        The object's own keys.
    clean_name, taken
        A name for files after the object, and names in lower case that other objects use.
    print
        A text that tells meshes apart.
    changed
        Whether the files have to be written again; those of any other object may have to move.
    surfaces, hulls
        Triangles of the object, None where an equal mesh has them, and of each convex part.
    """

    key: str
    name: str
    clean_name: str
    type: str
    print: str
    mesh: str
    collision_mesh: str
    scale: float
    collision_type_given: bool
    high: str
    low: str
    changed: bool = False
    taken: set[str] = field(default_factory=set)
    surfaces: list[Surface] | None = None
    hulls: list[list[Surface]] = field(default_factory=list)
    textures: dict[str, bytes] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)


class MeshFiles:
    """The mesh files of the model at ``path``, which was at ``before``, and the keys that name them.

    Files are those of changed meshes, and of unchanged ones when the model goes to another folder. All of them lie
    below ``root``: where the model names a folder outside, another is named. ``read`` gives the content of a file that
    may be opened, else None.

    Attributes
    ----------
    keys
        Mesh keys by the key of their object.
    top
        Keys of the model itself that name other folders.
    """

    def __init__(
        self,
        sources: list[MeshSource],
        top: dict,
        path: Path,
        before: Path | None,
        root: Path,
        read: Callable[[Path], bytes | None],
    ) -> None:
        self.keys: dict[str, dict] = {}
        self.top: dict[str, str] = {}
        self.files: Files = {}
        self.problems: list[str] = []
        self._shared: dict[str, tuple[tuple[str, str], str]] = {}
        self._read, self._root = read, root.resolve()
        self._folder = path.parent.resolve()
        self._old = self._folder if before is None else before.parent.resolve()
        self._given = {key: top.get(key, NEW_FOLDERS[key] if before is None else "") for key in (HIGH, LOW)}
        self._moves = self._old != self._folder
        self._folders = {key: self._textual(self._folder, given) for key, given in self._given.items()}
        self._places: dict[Path, Path] = {}
        if self._moves:
            self._rename_folders(sources)
        for source in sources:
            if source.changed:
                self._write(source)
            elif self._moves:
                self._copy(source)

    @staticmethod
    def _textual(folder: Path, *parts: str) -> Path:
        """Parts joined as the format joins them."""
        return Path(os.path.normpath(os.path.join(folder, *parts)))

    def _inside(self, folder: Path) -> bool:
        return self._root in (folder.resolve(), *folder.resolve().parents)

    def _rename_folders(self, sources: list[MeshSource]) -> None:
        """Name folders below the root for those outside that meshes are copied from or written to."""
        for key in self._given:
            if self._inside(self._folders[key]):
                continue
            found = any(self._old_file(key, source) is not None for source in sources)
            if found or any(source.changed for source in sources):
                self.top[key] = NEW_FOLDERS[key]
                self._folders[key] = self._textual(self._folder, NEW_FOLDERS[key])

    def _own(self, key: str, source: MeshSource) -> tuple[str, str]:
        """The folder below the model's that an object states, and the name of its file there."""
        return (source.high, source.mesh) if key == HIGH else (source.low, source.collision_mesh or source.mesh)

    def _old_file(self, key: str, source: MeshSource) -> Path | None:
        """Where the mesh of an object was, if it is there and may be opened."""
        own, name = self._own(key, source)
        if not name:
            return None
        file = self._textual(self._old, self._given[key], own, name)
        return file if self._read(file) is not None else None

    def _place(self, key: str, folder: Path) -> Path:
        """The folder below the root for files that lie in ``folder``; each has one of its own."""
        if folder not in self._places:
            parts = Path(os.path.relpath(folder, self._textual(self._old, self._given[key]))).parts
            wanted = self._textual(self._folders[key], *(part for part in parts if part != ".."))
            if not self._inside(wanted):
                wanted = self._textual(self._folder, NEW_FOLDERS[key])
            place, number = wanted, 2
            while place in self._places.values():
                place, number = wanted.with_name(f"{wanted.name}_{number}"), number + 1
            self._places[folder] = place
        return self._places[folder]

    def _named(self, key: str, source: MeshSource, target: Path) -> str:
        """How an object names a file at ``target``."""
        own, given = self._own(key, source)
        top = self.top.get(key, self._given[key])
        if given and self._textual(self._folder, top, own, given) == target:
            return given  # in the file's own words
        return Path(os.path.relpath(target, self._textual(self._folder, top, own))).as_posix()

    def _copy(self, source: MeshSource) -> None:
        """Copies of an unchanged object's mesh files, and their names where these are others now."""
        keys = {}
        for key, name in ((HIGH, "mesh"), (LOW, "collision mesh")):
            old = self._old_file(key, source)
            if old is None:
                continue
            target = self._place(key, old.parent) / old.name
            self._add_companions(old, target.parent)
            named = self._named(key, source, target)
            if named != (source.mesh if key == HIGH else source.collision_mesh or keys.get("mesh", source.mesh)):
                keys[name] = named
        if keys:
            self.keys[source.key] = keys

    def _add_companions(self, old: Path, folder: Path) -> None:
        for name, data in self._with_companions(old):
            self.files[self._textual(folder, name)] = data

    def _write(self, source: MeshSource) -> None:
        """The files of a changed mesh."""
        self.keys[source.key] = {**self._whole(source), **self._hulls(source)}
        self._keep_collision(source)
        self.problems += source.problems

    def _target(self, key: str, source: MeshSource, end: str) -> Path:
        """Where a mesh of an object goes: where it was, unless that is outside the root or others use it."""
        own, name = self._own(key, source) if not end or source.collision_mesh else (source.low, "")
        folder = self._textual(self._folder, self.top.get(key, self._given[key]), own, os.path.dirname(name))
        if self._moves and name:
            folder = self._place(key, self._textual(self._old, self._given[key], own, os.path.dirname(name)))
        if not self._inside(folder):
            folder = self._textual(self._folder, NEW_FOLDERS[key])
        base = os.path.basename(name)
        if not base.lower().endswith(".obj") or name.lower() in source.taken or not self._free(folder, base):
            base = self._free_name(source, end, folder)
        return folder / base

    def _whole(self, source: MeshSource) -> dict:
        """The mesh that is seen; linked duplicates share one file."""
        if source.type != "MESH":
            return {}
        given, shared = (source.high, source.mesh), self._shared.get(source.print)
        if shared is not None and (source.surfaces is None or shared[0] == given):
            return {"mesh": shared[1]}
        assert source.surfaces is not None
        target = self._target(HIGH, source, "")
        name = self._named(HIGH, source, target)
        self._shared[source.print] = (given, name)
        self.files.update(_obj_files(target, source.surfaces, source.name, source.scale))
        self.files.update({target.parent / texture: data for texture, data in source.textures.items()})
        return {"mesh": name}

    def _hulls(self, source: MeshSource) -> dict:
        """The convex parts of the collision shape in one file."""
        if not source.hulls:
            return {}
        whole = ((source.low, source.collision_mesh), f"hulls of {source.print}")
        if source.collision_mesh and self._shared.get(whole[1], (None, ""))[0] == whole[0]:
            return {"collision mesh": self._shared[whole[1]][1]}
        target = self._target(LOW, source, "_collision")
        surfaces = [
            Surface(Paint(f"hull_{number:03d}", diffuse=_part_colour(number)), surface.vertices, surface.triangles)
            for number, hull in enumerate(source.hulls)
            for surface in hull
        ]
        self.files.update(_obj_files(target, surfaces, f"{source.name} collision", source.scale))
        name = self._named(LOW, source, target)
        self._shared[whole[1]] = (whole[0], name)
        given = {} if source.collision_type_given else {"collision mesh type": "CONVEX_HULL"}
        return {"collision mesh": name, **given}

    def _keep_collision(self, source: MeshSource) -> None:
        """Name the collision mesh that went by the name of a mesh that has another name now."""
        keys = self.keys[source.key]
        old = None if source.collision_mesh or not source.mesh else self._old_file(LOW, source)
        if old is None or "collision mesh" in keys or keys.get("mesh", source.mesh) == source.mesh:
            return
        target = old
        if self._moves:
            target = self._place(LOW, old.parent) / old.name
            self._add_companions(old, target.parent)
        keys["collision mesh"] = self._named(LOW, source, target)

    def _free(self, folder: Path, name: str) -> bool:
        """Whether this export writes no other file under a name, nor under that of its material file.

        Names that differ only in case count as one, since they are one file where disks fold case.
        """
        taken = {path.name.lower() for path in self.files if path.parent == folder}
        return not taken & {name.lower(), f"{Path(name).stem.lower()}.mtl"}

    def _free_name(self, source: MeshSource, end: str, folder: Path) -> str:
        """A mesh file's name after the object: one that no other object of this export, or of its file, has taken."""
        base = "_".join(source.clean_name.split()) + end
        name, number = f"{base}.OBJ", 2
        while name.lower() in source.taken or not self._free(folder, name):
            name, number = f"{base}_{number}.OBJ", number + 1
        return name

    def _with_companions(self, path: Path) -> Iterator[tuple[str, bytes]]:
        """A mesh file, its material libraries and the textures that these name: content by path from its folder.

        Textures that lie elsewhere come beside the mesh, and the library names them there.
        """
        data = self._read(path) or b""
        yield path.name, data
        libraries = [match.decode("utf-8", "replace").strip() for match in _LIBRARY.findall(data[:LIBRARY_WITHIN])]
        for library in dict.fromkeys([*libraries, path.with_suffix(".mtl").name, path.with_suffix(".MTL").name]):
            text = self._read(path.parent / library) if _stays(library) else None
            if text is None:
                continue
            lines = text.split(b"\n")
            for number, line in enumerate(lines):
                words = line.decode("utf-8", "replace").split(None, 1)
                if len(words) < 2 or not words[0].startswith("map_"):
                    continue
                name = words[1].strip()
                content = self._read(self._textual(path.parent, os.path.dirname(library), name))
                if content is None:
                    continue
                if not _stays(name):
                    end = b"\r" if line.endswith(b"\r") else b""
                    name = os.path.basename(name)
                    lines[number] = f"{words[0]} {name}".encode() + end
                yield os.path.join(os.path.dirname(library), name), content
            yield library, b"\n".join(lines)


def _stays(name: str) -> bool:
    """Whether a path stays below the folder that it is read from."""
    return not os.path.isabs(name) and not os.path.normpath(name).startswith("..")


def _part_colour(number: int) -> tuple[float, float, float]:
    """A colour of its own for each part, by the golden ratio around the colour circle."""
    return colorsys.hsv_to_rgb(number * 0.618034 % 1.0, 0.6, 0.9)


def _obj_files(path: Path, surfaces: list[Surface], name: str, scale: float) -> Files:
    library = path.with_suffix(".mtl")
    unscaled = [Surface(s.paint, s.vertices / scale, s.triangles, s.normals, s.uvs) for s in surfaces]
    obj, mtl = obj_texts(unscaled, library.name, name)
    return {path: obj.encode("utf-8"), library: mtl.encode("utf-8")}
