"""Whole scenes: the launch file on the Blender scene, with its world and models as collections."""

from __future__ import annotations

from pathlib import Path

import bpy

from .ligature.adf import AdfError, Resolver, read_launch
from .ligature.adf.patch import PatchError
from .ligature.adf.update import given_values, new_text, updated
from .ligature.authoring.save import SaveError, checked_text, save_all
from .read_file import Import, import_file
from .schema_properties import fetch, store
from .write_file import ExportError, after_export, export_file, unheld_top

DEVICES_TEXT = "input devices: []\n"
COLOURS_TEXT = "white: {r: 255, g: 255, b: 255, a: 255}\n"


def import_launch(path: Path, scene: bpy.types.Scene, indices: tuple[int, ...] | None = None) -> list[Import]:
    """Bring a launch file in with its world and models, or those of ``indices``; raises `AdfError`.

    Files that cannot be read are left out; their findings are in an `Import` of their own.
    """
    resolver = Resolver.for_file(path)
    launch = read_launch(path, resolver)
    stored = scene.adf
    stored.filepath, stored.source = str(path), launch.text
    store(stored.launch, "launch", given_values(launch.top))
    stored.world_path = launch.world.text if launch.world else ""
    stored.devices_path = launch.devices.text if launch.devices else ""
    stored.colours_path = launch.colours.text if launch.colours else ""
    stored.models.clear()
    done: list[Import] = []
    for index, reference in enumerate(launch.models):
        entry = stored.models.add()
        entry.path = reference.text
        if indices is None or index in indices:
            made = _opened(reference, scene, done)
            entry.collection = made.collection if made else None
    if launch.world is not None:
        made = _opened(launch.world, scene, done)
        stored.world = made.collection if made else None
    return done


def _opened(reference, scene: bpy.types.Scene, done: list[Import]) -> Import | None:
    if reference.path is None:
        done.append(Import(scene.collection, problems=[str(reference.diagnostic)]))
        return None
    try:
        made = import_file(reference.path, scene)
    except AdfError as error:
        done.append(Import(scene.collection, problems=[str(error)]))
        return None
    done.append(made)
    return made


def export_scene(scene: bpy.types.Scene, path: Path, remember: bool = True) -> list[Path]:
    """Write the launch file, its world and all its models; raises `ExportError`, which names the file.

    ``remember`` makes the written files the scene's own; a copy for a simulation is not remembered.
    """
    stored = scene.adf
    folder = path.parent
    written: list[Path] = []
    targets = [(entry.collection, entry.path) for entry in stored.models] + [(stored.world, stored.world_path)]
    texts: list[tuple[bpy.types.Collection, Path, str]] = []
    for collection, name in targets:
        if collection is None:
            continue
        try:
            result = export_file(collection, folder / name)
        except ExportError as error:
            raise ExportError(f"{collection.name}: {error}") from error
        written += result.written
        texts.append((collection, folder / name, result.text))
    try:
        text = launch_text(scene)
        extra = {folder / stored.devices_path: DEVICES_TEXT, folder / stored.colours_path: COLOURS_TEXT}
        files = {file: content.encode() for file, content in extra.items() if not file.exists()}
        written += save_all({**files, path: checked_text(text, path)})
    except (SaveError, PatchError) as error:
        raise ExportError(str(error)) from error
    if not remember:
        return written
    for collection, file, content in texts:
        after_export(collection, file, content)
    stored.filepath, stored.source = str(path), text
    return written


def launch_text(scene: bpy.types.Scene) -> str:
    """The launch file as it would be written now."""
    stored = scene.adf
    top = {
        **fetch(stored.launch, "launch"),
        "world config": stored.world_path,
        "input devices config": stored.devices_path,
        "color config": stored.colours_path,
        "multibody configs": tuple(entry.path for entry in stored.models),
    }
    if not stored.source:
        return new_text("launch", top, [])
    return updated(stored.source, "launch", {**unheld_top("launch", stored.source), **top}, [])
