"""Whole scenes: the launch file on the Blender scene, with all files that it names as collections."""

from __future__ import annotations

import os
from codecs import BOM_UTF8
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from .folders import allowed_folders, own_files, remember_opened, remember_written
from .held_keys import unheld
from .ligature.adf import AdfError, Document, Resolver, read_any, read_launch, read_world
from .ligature.adf.document import own_element
from .ligature.adf.nodes import parse
from .ligature.adf.patch import PatchError
from .ligature.adf.reader import LaunchDocument, Reference
from .ligature.adf.update import new_text, updated
from .ligature.authoring.save import SaveError, checked_text
from .read_file import Import, importing
from .schema_properties import fetch, store
from .steps import Steps, all_or_nothing, finished, part
from .write_file import PREPARED, Export, ExportError, keeping, preparing, write

WORLD_TEXT = "namespace: /ambf/env/\ngravity: {x: 0.0, y: 0.0, z: -9.8}\nmax iterations: 10\n"
DEVICES_TEXT = "input devices: []\n"
COLOURS_TEXT = "white: {r: 255, g: 255, b: 255, a: 255}\n"
"""Files that are written when the scene has none: a launch file must name them."""


def import_launch(
    path: Path, scene: bpy.types.Scene, indices: tuple[int, ...] | None = None, roots: tuple[Path, ...] = ()
) -> list[Import]:
    """Bring a launch file in with all that it names, or the models of ``indices``; raises `AdfError`.

    Files that cannot be read are left out; their findings are in an `Import` of their own.
    """
    opened = finished(importing_launch(path, indices, roots))
    opened.add_to(scene)
    return opened.done


def importing_launch(
    path: Path, indices: tuple[int, ...] | None = None, roots: tuple[Path, ...] = ()
) -> Steps[OpenedLaunch]:
    """The steps of `import_launch`, without a scene; ended, they leave nothing."""
    yield f"Opening {path.name}", 0.0
    resolver = Resolver.for_file(path, (*roots, *allowed_folders()))
    opened = OpenedLaunch(path, path.read_bytes(), read_launch(path, resolver))
    launch, around = opened.launch, (*roots, *resolver.roots)
    chosen = [i for i in range(len(launch.models)) if indices is None or i in indices]
    named = (*chosen, *(name for name in OTHERS if getattr(launch, name) is not None))
    count = len(named) + 1
    with all_or_nothing():
        for number, which in enumerate(named):
            reference = getattr(launch, which) if isinstance(which, str) else launch.models[which]
            # a world with nothing but lights and cameras looks like a model by itself
            reader = read_world if which == "world" else read_any
            steps = _opening(reference, opened.done, around, reader)
            opened.files[which] = yield from part(steps, number / count, (number + 1) / count)
        surroundings = _environment(opened.collection("world"), resolver, opened.done)
        opened.files["environment"] = yield from part(surroundings, 1.0 - 1.0 / count, 1.0)
    return opened


OTHERS = ("world", "devices", "colours")
"""Files that a launch file names, other than its models."""


@dataclass
class OpenedLaunch:
    """A launch file with what was opened of it, models by index and others by name; part of no scene yet."""

    path: Path
    data: bytes
    launch: LaunchDocument
    files: dict[int | str, Import | None] = field(default_factory=dict)
    done: list[Import] = field(default_factory=list)

    def collection(self, which: int | str) -> bpy.types.Collection | None:
        """The collection of one of the files, if that was opened."""
        found = self.files.get(which)
        return None if found is None else found.collection

    def add_to(self, scene: bpy.types.Scene) -> None:
        """Make the launch file the scene's, and its files part of it."""
        for made in self.done:
            if made.collection is not None:
                scene.collection.children.link(made.collection)
        stored, launch = scene.adf, self.launch
        stored.filepath, stored.source = str(self.path), launch.text
        stored.byte_order_mark = self.data.startswith(BOM_UTF8)
        remember_opened(stored, {self.path: self.data})
        store(stored.launch, "launch", launch.top.given())
        stored.models.clear()
        for index, reference in enumerate(launch.models):
            entry = stored.models.add()
            entry.path, entry.collection = reference.text, self.collection(index)
        for name in OTHERS:
            reference = getattr(launch, name)
            setattr(stored, f"{name}_path", reference.text if reference else "")
            setattr(stored, name, self.collection(name))
        stored.environment = self.collection("environment")


def _environment(world: bpy.types.Collection | None, resolver: Resolver, done: list[Import]) -> Steps[Import | None]:
    """The steps that bring in the model that the world names as its surroundings."""
    if world is None or not world.adf.world.environment:
        return None
    try:
        path = resolver.resolve(world.adf.world.environment, Path(world.adf.filepath).parent)
        made = yield from importing(path, resolver.roots)
    except (AdfError, OSError) as error:
        done.append(Import(None, problems=[str(error)]))
        return None
    done.append(made)
    return made


def _opening(
    reference: Reference, done: list[Import], roots: tuple[Path, ...], reader: Callable[[Path, Resolver], Document]
) -> Steps[Import | None]:
    """The steps that bring one file of a launch file in."""
    if reference.path is None:
        done.append(Import(None, problems=[str(reference.diagnostic)]))
        return None
    try:
        made = yield from importing(reference.path, roots, reader)
    except AdfError as error:
        done.append(Import(None, problems=[str(error)]))
        return None
    done.append(made)
    return made


def export_scene(scene: bpy.types.Scene, path: Path, remember: bool = True, replace: bool = False) -> list[Path]:
    """Write the launch file, its world and all its models; raises `ExportError`, which names the file.

    ``remember`` makes the written files the scene's own; a copy for a simulation is not remembered. ``replace`` allows
    to replace files that are not the scene's own.
    """
    return finished(exporting_scene(scene, path, remember, replace))


def exporting_scene(
    scene: bpy.types.Scene, path: Path, remember: bool = True, replace: bool = False
) -> Steps[list[Path]]:
    """The steps of `export_scene`."""
    whole = yield from part(preparing_scene(scene, path), 0.0, PREPARED if remember else 1.0)
    write(whole.export, replace)
    if remember:
        yield from part(keeping_scene(scene, path, whole), PREPARED, 1.0)
    return whole.export.written


@dataclass
class WholeScene:
    """A launch file and all that it names: what is written, and each collection with its path, text and files."""

    export: Export
    names: _Names
    parts: list[tuple[bpy.types.Collection, Path, str, dict[Path, bytes]]]


def keeping_scene(scene: bpy.types.Scene, path: Path, whole: WholeScene) -> Steps[None]:
    """The steps that make what was written the scene's own."""
    for number, (collection, file, text, files) in enumerate(whole.parts):
        yield from part(keeping(collection, file, text), number / len(whole.parts), (number + 1) / len(whole.parts))
        remember_written(collection.adf, files)
    whole.names.store()
    scene.adf.filepath, scene.adf.source = str(path), whole.export.text
    remember_written(scene.adf, whole.export.files)


def preparing_scene(scene: bpy.types.Scene, path: Path) -> Steps[WholeScene]:
    """The steps that prepare the launch file and all that it names, checked and not yet written.

    They raise `ExportError`.
    """
    stored, folder = scene.adf, path.parent
    names = _Names(scene, path)
    whole = Export(roots=(folder, *names.roots))
    parts = []
    targets = names.targets()
    for number, (collection, name, top) in enumerate(targets):
        file = folder / name
        steps = preparing(collection, file, file.parent if names.keeps(collection, file) else folder, top)
        try:
            done = yield from part(steps, number / len(targets), (number + 1) / len(targets))
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
    whole.own = own_files(stored, *(collection.adf for collection, *_ in parts))
    return WholeScene(whole, names, parts)


class _Names:
    """File names in a launch file at ``path``: unchanged, or below its folder when it is written to another folder."""

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
    kept = unheld("launch", own_element("launch", root).given())
    return updated(stored.source, "launch", {**kept, **top}, [], (), root)
