"""The mesh files of a model: their names and texts, and the keys that name them; nothing of Blender."""

from __future__ import annotations

import colorsys
import os
from collections.abc import Collection
from pathlib import Path

from .ligature.authoring.objfile import Paint, Surface, obj_texts
from .mesh_source import HIGH, LOW, NEW_FOLDERS, MeshSource
from .old_meshes import OldMeshes, joined

NO_MESH = "its shape is a {}, which is not written; convert it to a mesh"

Files = dict[Path, bytes]


class MeshFiles:
    """The mesh files of the model at ``path``, and the keys that name them.

    Files are those of changed meshes, and of unchanged ones when the model goes to another folder. All of them lie
    below ``root``: where the model names a folder outside, another is named. ``old`` are the files that it had, ``own``
    those that it was opened from or wrote: of pictures among them the copies are renewed, also of unchanged meshes.

    Attributes
    ----------
    keys
        Mesh keys by the key of their object.
    top
        Keys of the model itself that name other folders.
    """

    def __init__(
        self, sources: list[MeshSource], old: OldMeshes, path: Path, root: Path, own: Collection[str] = ()
    ) -> None:
        self.keys: dict[str, dict] = {}
        self.top: dict[str, str] = {}
        self.files: Files = {}
        self.problems: list[str] = []
        self._shared: dict[str, tuple[tuple[str, str], str]] = {}
        self._old, self._root = old, root.resolve()
        self._folder = path.parent.resolve()
        self._folders = {key: joined(self._folder, given) for key, given in old.given.items()}
        self._places: dict[Path, Path] = {}
        if old.moves:
            self._rename_folders(sources)
        for source in sources:
            if source.changed:
                self._write(source)
            elif old.moves:
                self._copy(source)
            if not source.changed:
                self._renew_pictures(source, own)

    def _inside(self, folder: Path) -> bool:
        return self._root in (folder.resolve(), *folder.resolve().parents)

    def _rename_folders(self, sources: list[MeshSource]) -> None:
        """Name folders below the root for those outside that meshes are copied from or written to."""
        for key in self._old.given:
            if self._inside(self._folders[key]):
                continue
            found = any(self._old.files.get((key, source.key)) is not None for source in sources)
            if found or any(source.changed for source in sources):
                self.top[key] = NEW_FOLDERS[key]
                self._folders[key] = joined(self._folder, NEW_FOLDERS[key])

    def _place(self, key: str, folder: Path) -> Path:
        """The folder below the root for files that lie in ``folder``; each has one of its own."""
        if folder not in self._places:
            parts = Path(os.path.relpath(folder, joined(self._old.folder, self._old.given[key]))).parts
            wanted = joined(self._folders[key], *(part for part in parts if part != ".."))
            if not self._inside(wanted):
                wanted = joined(self._folder, NEW_FOLDERS[key])
            place, number = wanted, 2
            while place in self._places.values():
                place, number = wanted.with_name(f"{wanted.name}_{number}"), number + 1
            self._places[folder] = place
        return self._places[folder]

    def _named(self, key: str, source: MeshSource, target: Path) -> str:
        """How an object names a file at ``target``."""
        own, given = source.places[key]
        top = self.top.get(key, self._old.given[key])
        if given and joined(self._folder, top, own, given) == target:
            return given  # in the file's own words
        return Path(os.path.relpath(target, joined(self._folder, top, own))).as_posix()

    def _copy(self, source: MeshSource) -> None:
        """Copy the mesh files of an unchanged object, and set the keys whose file names change."""
        keys = {}
        for key, name in ((HIGH, "mesh"), (LOW, "collision mesh")):
            old = self._old.files.get((key, source.key))
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
        for name, data in self._old.contents[old].items():
            self.files[joined(folder, name)] = data

    def _renew_pictures(self, source: MeshSource, own: Collection[str]) -> None:
        """Copy those of an unchanged mesh again that this model copied beside it before."""
        folder, name = source.places[HIGH]
        before = joined(self._old.folder, self._old.given[HIGH], folder, os.path.dirname(name))
        target = self._place(HIGH, before) if self._old.moves else before
        for picture, data in source.textures.items():
            if str(before / picture) in own and self._inside(target):
                self.files[target / picture] = data

    def _write(self, source: MeshSource) -> None:
        """The files of a changed mesh."""
        self.keys[source.key] = {**self._whole(source), **self._hulls(source)}
        self._keep_collision(source)
        self.problems += source.problems

    def _target(self, key: str, source: MeshSource, end: str) -> Path:
        """Where a mesh of an object goes: where it was, unless that is outside the root or others use it."""
        own, name = source.places[key] if not end or source.collision_mesh else (source.places[LOW][0], "")
        folder = joined(self._folder, self.top.get(key, self._old.given[key]), own, os.path.dirname(name))
        if self._old.moves and name:
            folder = self._place(key, joined(self._old.folder, self._old.given[key], own, os.path.dirname(name)))
        if not self._inside(folder):
            folder = joined(self._folder, NEW_FOLDERS[key])
        base = os.path.basename(name)
        if not base.lower().endswith(".obj") or name.lower() in source.taken or not self._free(folder, base):
            base = self._free_name(source, end, folder)
        return folder / base

    def _whole(self, source: MeshSource) -> dict:
        """Write the visual mesh; linked duplicates share one file."""
        if source.type != "MESH":
            return {}
        given, shared = source.places[HIGH], self._shared.get(source.fingerprint)
        if shared is not None and (source.surfaces is None or shared[0] == given):
            return {"mesh": shared[1]}
        assert source.surfaces is not None
        target = self._target(HIGH, source, "")
        name = self._named(HIGH, source, target)
        self._shared[source.fingerprint] = (given, name)
        self.files.update(_obj_files(target, source.surfaces, source.name, source.scale))
        self.files.update({target.parent / texture: data for texture, data in source.textures.items()})
        return {"mesh": name}

    def _hulls(self, source: MeshSource) -> dict:
        """Write the convex parts of the collision shape to one file."""
        if not source.hulls:
            return {}
        whole = (source.places[LOW], f"hulls of {source.fingerprint}")
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
        """Set the key of a collision mesh that was implied by the visual mesh, when the name of that mesh changes."""
        keys = self.keys[source.key]
        old = None if source.collision_mesh or not source.mesh else self._old.files.get((LOW, source.key))
        if old is None or "collision mesh" in keys or keys.get("mesh", source.mesh) == source.mesh:
            return
        target = old
        if self._old.moves:
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


def _part_colour(number: int) -> tuple[float, float, float]:
    """Distinct colours of parts: hues a golden ratio apart."""
    return colorsys.hsv_to_rgb(number * 0.618034 % 1.0, 0.6, 0.9)


def _obj_files(path: Path, surfaces: list[Surface], name: str, scale: float) -> Files:
    library = path.with_suffix(".mtl")
    unscaled = [Surface(s.paint, s.vertices / scale, s.triangles, s.normals, s.uvs) for s in surfaces]
    obj, mtl = obj_texts(unscaled, library.name, name)
    return {path: obj.encode("utf-8"), library: mtl.encode("utf-8")}
