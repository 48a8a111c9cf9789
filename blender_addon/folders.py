"""Which files and folders are the scene's: those outside that it may read from, and those that it wrote itself."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import bpy

from .ligature.authoring.save import digests

_session: dict[str, dict[str, str]] = {}
"""Digests of the files that each collection wrote since the blend file was opened: undo reverts no files."""


def allowed_folders() -> tuple[Path, ...]:
    """Folders outside the scenes' own from which the user allowed to read."""
    stored = [folder for scene in bpy.data.scenes for folder in json.loads(scene.adf.folders or "[]")]
    return tuple(Path(bpy.path.abspath(folder)) for folder in dict.fromkeys(stored))


def allow_folders(scene: bpy.types.Scene, folders: list[str]) -> None:
    """Let the scene's files read from further folders, now and whenever the blend file is opened."""
    scene.adf.folders = json.dumps(list(dict.fromkeys([*json.loads(scene.adf.folders or "[]"), *folders])))


def own_files(*stored: bpy.types.PropertyGroup) -> dict[str, str]:
    """Digests of the files that these collections or scenes were opened from or wrote, by path."""
    own: dict[str, str] = {}
    for group in stored:
        own.update(json.loads(group.written or "{}"))
        own.update(_session.get(group.id_data.name_full, {}))
    return own


def remember_opened(stored: bpy.types.PropertyGroup, files: Mapping[Path, bytes]) -> dict[str, str]:
    """Count files, with this content, as those of a collection or scene that was opened from them."""
    found = digests(files)
    stored.written = json.dumps({**json.loads(stored.written or "{}"), **found})
    return found


def remember_written(stored: bpy.types.PropertyGroup, files: Mapping[Path, bytes]) -> None:
    """Count files, with this content, as those of a collection or scene, which undo does not take back."""
    found = remember_opened(stored, files)
    _session.setdefault(stored.id_data.name_full, {}).update(found)


def forget_session() -> None:
    """Another blend file is open."""
    _session.clear()
