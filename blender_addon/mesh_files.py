"""The mesh files of a model: their names and texts, and the keys that name them; nothing of Blender."""

from __future__ import annotations

import colorsys
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from .ligature.authoring.objfile import Paint, Surface, obj_texts

HIGH, LOW = "high resolution path", "low resolution path"
NO_MESH = "its shape is a {}, which is not written; convert it to a mesh"

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
    """The mesh files of the model at ``path``, which was at ``before``, and mesh keys by the key of their object.

    Files are those of changed meshes, and of unchanged ones that move to another folder.
    """

    def __init__(self, sources: list[MeshSource], top: dict, path: Path, before: Path | None) -> None:
        self.keys: dict[str, dict] = {}
        self.files: Files = {}
        self.problems: list[str] = []
        self._shared: dict[str, str] = {}
        folders = [top.get(HIGH), top.get(LOW)]
        self._high, self._low = (
            (path.parent / (given or default)).resolve()
            for given, default in zip(folders, ("./high_res/", "./low_res/"), strict=True)
        )
        for source in sources:
            if source.changed:
                self._write(source)
            else:
                self.files.update(_moved(source, [given or "" for given in folders], before or path, path))

    def _write(self, source: MeshSource) -> None:
        """The files of a changed mesh."""
        if source.type not in ("MESH", "EMPTY"):
            self.problems.append(f"'{source.name}': {NO_MESH.format(source.type.lower())}")
        self.keys[source.key] = {**self._whole(source), **self._hulls(source)}
        self.files.update({self._high / name: data for name, data in source.textures.items()})
        self.problems += source.problems

    def _whole(self, source: MeshSource) -> dict:
        """The mesh that is seen; linked duplicates share one file."""
        if source.type != "MESH":
            return {}
        if source.surfaces is None:
            return {"mesh": self._shared[source.print]}
        name = source.mesh or self._free_name(source, "")
        self._shared[source.print] = name
        self.files.update(_obj_files(self._high / name, source.surfaces, source.name, source.scale))
        return {"mesh": name}

    def _hulls(self, source: MeshSource) -> dict:
        """The convex parts of the collision shape in one file."""
        if not source.hulls:
            return {}
        name = source.collision_mesh or self._free_name(source, "_collision")
        surfaces = [
            Surface(Paint(f"hull_{number:03d}", diffuse=_part_colour(number)), surface.vertices, surface.triangles)
            for number, hull in enumerate(source.hulls)
            for surface in hull
        ]
        self.files.update(_obj_files(self._low / name, surfaces, f"{source.name} collision", source.scale))
        given = {} if source.collision_type_given else {"collision mesh type": "CONVEX_HULL"}
        return {"collision mesh": name, **given}

    def _free_name(self, source: MeshSource, end: str) -> str:
        """A mesh file's name after the object: one that no other object of this export, or of its file, has taken.

        Names that differ only in case count as one, since they are one file where disks fold case.
        """
        taken = source.taken | {path.name.lower() for path in self.files if path.parent in (self._high, self._low)}
        base = "_".join(source.clean_name.split()) + end
        name, number = f"{base}.OBJ", 2
        while name.lower() in taken or f"{Path(name).stem.lower()}.mtl" in taken:
            name, number = f"{base}_{number}.OBJ", number + 1
        return name


def _part_colour(number: int) -> tuple[float, float, float]:
    """A colour of its own for each part, by the golden ratio around the colour circle."""
    return colorsys.hsv_to_rgb(number * 0.618034 % 1.0, 0.6, 0.9)


def _obj_files(path: Path, surfaces: list[Surface], name: str, scale: float) -> Files:
    library = path.with_suffix(".mtl")
    unscaled = [Surface(s.paint, s.vertices / scale, s.triangles, s.normals, s.uvs) for s in surfaces]
    obj, mtl = obj_texts(unscaled, library.name, name)
    return {path: obj.encode("utf-8"), library: mtl.encode("utf-8")}


def _moved(source: MeshSource, folders: list[str], before: Path, path: Path) -> Files:
    """Copies of an unchanged object's mesh files, when the file goes to another folder."""
    if before.parent.resolve() == path.parent.resolve():
        return {}
    found: Files = {}
    names = ((source.mesh, source.high), (source.collision_mesh or source.mesh, source.low))
    for top, (name, own) in zip(folders, names, strict=True):
        folder = os.path.join(top, own)
        file, target = before.parent / folder / name, (path.parent / folder / name).resolve()
        if name and file.is_file() and file.resolve() != target:
            for companion in _with_companions(file):
                found[target.parent / companion.name] = companion.read_bytes()
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
