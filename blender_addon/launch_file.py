"""Whole scenes: the launch file on the Blender scene, with all files that it names as collections."""

from __future__ import annotations

from codecs import BOM_UTF8
from pathlib import Path

import bpy

from .ligature.adf import AdfError, Resolver, read_any, read_launch, read_world
from .ligature.adf.nodes import parse
from .ligature.adf.patch import PatchError
from .ligature.adf.update import given_values, new_text, updated
from .ligature.authoring.save import SaveError, checked_text, save_all
from .read_file import Import, import_file
from .schema_properties import fetch, store
from .write_file import ExportError, after_export, prepared, unheld_top

WORLD_TEXT = "namespace: /ambf/env/\ngravity: {x: 0.0, y: 0.0, z: -9.8}\nmax iterations: 10\n"
DEVICES_TEXT = "input devices: []\n"
COLOURS_TEXT = "white: {r: 255, g: 255, b: 255, a: 255}\n"
"""What a launch file must name and the scene does not have."""


def import_launch(path: Path, scene: bpy.types.Scene, indices: tuple[int, ...] | None = None) -> list[Import]:
    """Bring a launch file in with all that it names, or the models of ``indices``; raises `AdfError`.

    Files that cannot be read are left out; their findings are in an `Import` of their own.
    """
    resolver = Resolver.for_file(path)
    launch = read_launch(path, resolver)
    stored = scene.adf
    stored.filepath, stored.source = str(path), launch.text
    stored.byte_order_mark = path.read_bytes().startswith(BOM_UTF8)
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
    for name in ("world", "devices", "colours"):
        reference = getattr(launch, name)
        made = _opened(reference, scene, done, name) if reference is not None else None
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
        done.append(import_file(path, scene))
    except (AdfError, OSError) as error:
        done.append(Import(scene.collection, problems=[str(error)]))
        return None
    return done[-1].collection


def _opened(reference, scene: bpy.types.Scene, done: list[Import], name: str = "") -> Import | None:
    if reference.path is None:
        done.append(Import(scene.collection, problems=[str(reference.diagnostic)]))
        return None
    try:
        # a world with nothing but lights and cameras looks like a model by itself
        made = import_file(reference.path, scene, reader=read_world if name == "world" else read_any)
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
    targets = [(entry.collection, entry.path) for entry in stored.models]
    targets += [(getattr(stored, name), getattr(stored, f"{name}_path")) for name in ("world", "devices", "colours")]
    if stored.environment is not None and stored.world is not None:
        targets.append((stored.environment, Path(stored.world_path).parent / stored.world.adf.world.environment))
    files: dict[Path, bytes] = {}
    texts: list[tuple[bpy.types.Collection, Path, str]] = []
    for collection, name in targets:
        if collection is None or not name:
            continue
        try:
            done, own = prepared(collection, folder / name)
        except ExportError as error:
            raise ExportError(f"{collection.name}: {error}") from error
        files.update(own)
        texts.append((collection, folder / name, done.text))
    for name, content in (
        (stored.world_path, WORLD_TEXT), (stored.devices_path, DEVICES_TEXT), (stored.colours_path, COLOURS_TEXT),
    ):  # fmt: skip
        if name and folder / name not in files and not (folder / name).exists():
            files[folder / name] = content.encode()
    try:
        text = launch_text(scene)
        data = checked_text(text, path)
        written = save_all({**files, path: BOM_UTF8 + data if stored.byte_order_mark else data})
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
    named = {
        "world config": stored.world_path,
        "input devices config": stored.devices_path,
        "color config": stored.colours_path,
        "multibody configs": tuple(entry.path for entry in stored.models),
    }
    top = {**fetch(stored.launch, "launch"), **{key: value for key, value in named.items() if value}}
    if not stored.source:
        return new_text("launch", top, [])
    root = parse(stored.source, Path(stored.filepath))
    return updated(stored.source, "launch", {**unheld_top("launch", root), **top}, [], (), root)
