"""Whole scenes: the launch file on the Blender scene, with all files that it names as collections."""

from __future__ import annotations

import os
from codecs import BOM_UTF8
from pathlib import Path

import bpy

from .folders import allowed_folders, own_files, remember_written
from .in_file import top_values
from .ligature.adf import AdfError, Resolver, read_any, read_launch, read_world
from .ligature.adf.nodes import parse
from .ligature.adf.patch import PatchError
from .ligature.adf.update import given_values, new_text, updated
from .ligature.authoring.save import SaveError, checked_text, foreign
from .read_file import Import, import_file
from .schema_properties import fetch, store, unheld
from .write_file import Export, ExportError, after_export, prepared, write

WORLD_TEXT = "namespace: /ambf/env/\ngravity: {x: 0.0, y: 0.0, z: -9.8}\nmax iterations: 10\n"
DEVICES_TEXT = "input devices: []\n"
COLOURS_TEXT = "white: {r: 255, g: 255, b: 255, a: 255}\n"
"""What a launch file must name and the scene does not have."""


def import_launch(
    path: Path, scene: bpy.types.Scene, indices: tuple[int, ...] | None = None, roots: tuple[Path, ...] = ()
) -> list[Import]:
    """Bring a launch file in with all that it names, or the models of ``indices``; raises `AdfError`.

    Files that cannot be read are left out; their findings are in an `Import` of their own.
    """
    resolver = Resolver.for_file(path, (*roots, *allowed_folders()))
    launch = read_launch(path, resolver)
    stored = scene.adf
    stored.filepath, stored.source = str(path), launch.text
    stored.byte_order_mark = path.read_bytes().startswith(BOM_UTF8)
    remember_written(stored, {path: path.read_bytes()})
    store(stored.launch, "launch", given_values(launch.top))
    stored.world_path = launch.world.text if launch.world else ""
    stored.devices_path = launch.devices.text if launch.devices else ""
    stored.colours_path = launch.colours.text if launch.colours else ""
    stored.models.clear()
    done: list[Import] = []
    around = (*roots, *resolver.roots)
    for index, reference in enumerate(launch.models):
        entry = stored.models.add()
        entry.path = reference.text
        if indices is None or index in indices:
            made = _opened(reference, scene, done, around)
            entry.collection = made.collection if made else None
    for name in ("world", "devices", "colours"):
        reference = getattr(launch, name)
        made = _opened(reference, scene, done, around, name) if reference is not None else None
        setattr(stored, name, made.collection if made else None)
    stored.environment = _environment(stored.world, resolver, scene, done)
    return done


def _environment(
    world: bpy.types.Collection | None, resolver: Resolver, scene: bpy.types.Scene, done: list[Import]
) -> bpy.types.Collection | None:
    """The model that the world names as its surroundings, brought in."""
    if world is None or not world.adf.world.environment:
        return None
    try:
        path = resolver.resolve(world.adf.world.environment, Path(world.adf.filepath).parent)
        done.append(import_file(path, scene, resolver.roots))
    except (AdfError, OSError) as error:
        done.append(Import(scene.collection, problems=[str(error)]))
        return None
    return done[-1].collection


def _opened(
    reference, scene: bpy.types.Scene, done: list[Import], roots: tuple[Path, ...], name: str = ""
) -> Import | None:
    if reference.path is None:
        done.append(Import(scene.collection, problems=[str(reference.diagnostic)]))
        return None
    try:
        # a world with nothing but lights and cameras looks like a model by itself
        made = import_file(reference.path, scene, roots, reader=read_world if name == "world" else read_any)
    except AdfError as error:
        done.append(Import(scene.collection, problems=[str(error)]))
        return None
    done.append(made)
    return made


def export_scene(scene: bpy.types.Scene, path: Path, remember: bool = True, replace: bool = False) -> list[Path]:
    """Write the launch file, its world and all its models; raises `ExportError`, which names the file.

    ``remember`` makes the written files the scene's own; a copy for a simulation is not remembered. ``replace`` allows
    to replace files that are not the scene's own.
    """
    done, prepared_files = prepared_scene(scene, path)
    write(done, replace)
    if not remember:
        return done.written
    names = _Names(scene, path)
    for collection, file, content, files in prepared_files:
        after_export(collection, file, content)
        remember_written(collection.adf, files)
    names.store()
    scene.adf.filepath, scene.adf.source = str(path), done.text
    remember_written(scene.adf, done.files)
    return done.written


def prepared_scene(scene: bpy.types.Scene, path: Path) -> tuple[Export, list[tuple]]:
    """The launch file and all that it names, checked and not yet written; raises `ExportError`.

    Also each collection with its path, text and files.
    """
    stored, folder = scene.adf, path.parent
    names = _Names(scene, path)
    whole = Export(roots=(folder, *names.roots))
    parts = []
    for collection, name, top in names.targets():
        file = folder / name
        try:
            done = prepared(collection, file, file.parent if names.keeps(collection, file) else folder, top)
        except ExportError as error:
            raise ExportError(f"{collection.name}: {error}", error.obj) from error
        whole.files.update(done.files)
        whole.notes += done.notes
        whole.problems += done.problems
        parts.append((collection, file, done.text, done.files))
    for name, content in (
        (names.world, WORLD_TEXT), (names.devices, DEVICES_TEXT), (names.colours, COLOURS_TEXT),
    ):  # fmt: skip
        if name and folder / name not in whole.files and not (folder / name).exists():
            whole.files[folder / name] = content.encode()
    try:
        whole.text = launch_text(scene, names)
        data = checked_text(whole.text, path)
    except (SaveError, PatchError) as error:
        raise ExportError(str(error)) from error
    whole.files[path] = BOM_UTF8 + data if stored.byte_order_mark else data
    own = own_files(stored, *(part[0].adf for part in parts))
    whole.foreign = foreign(whole.files, own)
    return whole, parts


class _Names:
    """How a launch file at ``path`` names its files: as it does, or below its folder when it goes elsewhere."""

    def __init__(self, scene: bpy.types.Scene, path: Path) -> None:
        stored = self._stored = scene.adf
        self._folder = path.parent.resolve()
        here = Path(bpy.path.abspath(stored.filepath)).parent.resolve() if stored.filepath else None
        self._stays, self._is_new = here == self._folder, here is None
        self._new: dict[str, str] = {}
        self.world, self.devices, self.colours = (
            self._inside(name, collection)
            for name, collection in (
                (stored.world_path, stored.world),
                (stored.devices_path, stored.devices),
                (stored.colours_path, stored.colours),
            )
        )
        self.models = [self._inside(entry.path, entry.collection) for entry in stored.models]
        self.environment = ""
        if stored.environment is not None and stored.world is not None:
            around = os.path.dirname(self.world)
            given = os.path.normpath(os.path.join(around, stored.world.adf.world.environment))
            named = self._inside(given, stored.environment)
            self.environment = stored.world.adf.world.environment if named == given else os.path.relpath(named, around)
        self.roots = self._roots()

    def _inside(self, name: str, collection: bpy.types.Collection | None) -> str:
        """The name itself, or one below the folder that no other file has."""
        if name not in self._new:
            self._new[name] = self._renamed(name, collection)
        return self._new[name]

    def _renamed(self, name: str, collection: bpy.types.Collection | None) -> str:
        whole = Path(os.path.normpath(os.path.join(self._folder, name)))
        if not name or self._stays or whole.is_relative_to(self._folder):
            return name
        if self._is_new and collection is not None and self.in_place(collection, whole):
            return name  # a new launch file names files where they were opened from
        parts = [part for part in Path(name).parts if part not in ("..", Path(name).anchor)]
        wanted = found = Path(*parts[-2:]) if Path(name).is_absolute() else Path(*parts)
        taken, number = {os.path.normpath(new) for new in self._new.values()}, 2
        while os.path.normpath(found) in taken:
            found, number = wanted.with_name(f"{wanted.stem}_{number}{wanted.suffix}"), number + 1
        return found.as_posix()

    def targets(self) -> list[tuple[bpy.types.Collection, str, dict]]:
        """Every open file with its name, and keys that differ for this export."""
        stored = self._stored
        found = [(entry.collection, name, {}) for entry, name in zip(stored.models, self.models, strict=True)]
        world = {"environment": self.environment} if self.environment else {}
        found += [(stored.world, self.world, world), (stored.devices, self.devices, {})]
        found.append((stored.colours, self.colours, {}))
        if self.environment:
            file = os.path.normpath(os.path.join(os.path.dirname(self.world), self.environment))
            found.append((stored.environment, file, {}))
        return [(collection, name, top) for collection, name, top in found if collection is not None and name]

    def in_place(self, collection: bpy.types.Collection, file: Path) -> bool:
        """Whether a file goes to where its collection was opened from."""
        own = collection.adf.filepath
        return bool(own) and Path(bpy.path.abspath(own)).resolve() == file.resolve()

    def keeps(self, collection: bpy.types.Collection, file: Path) -> bool:
        """Whether a file is saved where it was opened from, and the launch file does not go elsewhere."""
        return (self._stays or self._is_new) and self.in_place(collection, file)

    def _roots(self) -> tuple[Path, ...]:
        """Folders of files that are saved where they were opened from, outside the launch file's own."""
        targets = [(collection, self._folder / name) for collection, name, _ in self.targets()]
        return tuple({file.parent.resolve(): None for c, file in targets if self.keeps(c, file)})

    def store(self) -> None:
        """Make these the names of the scene."""
        stored = self._stored
        stored.world_path, stored.devices_path, stored.colours_path = self.world, self.devices, self.colours
        for entry, name in zip(stored.models, self.models, strict=True):
            entry.path = name


def launch_text(scene: bpy.types.Scene, names: _Names) -> str:
    """The launch file as it would be written now."""
    stored = scene.adf
    named = {
        "world config": names.world,
        "input devices config": names.devices,
        "color config": names.colours,
        "multibody configs": tuple(names.models),
    }
    top = {**fetch(stored.launch, "launch"), **{key: value for key, value in named.items() if value}}
    if not stored.source:
        return new_text("launch", top, [])
    root = parse(stored.source, Path(stored.filepath))
    return updated(stored.source, "launch", {**unheld("launch", top_values("launch", root)), **top}, [], (), root)
