"""Adds the extension's classes to Blender, and takes every one of them away again."""

from __future__ import annotations

import bpy

from . import (
    adopt_operators,
    batch_operators,
    check_operators,
    collision_operators,
    decimation,
    decompose_operators,
    dialogs,
    file_operators,
    generator_operators,
    gizmos,
    key_panels,
    launch_operators,
    library_operators,
    menus,
    mirroring,
    object_operators,
    overlay,
    pose_operators,
    preview_operators,
    properties,
    quality,
    quality_overlay,
    robot_operators,
    schema_properties,
    sidebar,
    simulate_operators,
    tissue_operators,
)

MODULES = (
    file_operators,
    adopt_operators,
    launch_operators,
    object_operators,
    collision_operators,
    generator_operators,
    check_operators,
    decimation,
    decompose_operators,
    batch_operators,
    mirroring,
    library_operators,
    tissue_operators,
    robot_operators,
    dialogs,
    quality,
    preview_operators,
    pose_operators,
    simulate_operators,
    key_panels,
    sidebar,
    menus,
    overlay,
    quality_overlay,
    gizmos,
)


_undo: list = []
"""Functions that undo each registration, in the order of the registrations."""


def register() -> None:
    """Groups first, since classes refer to them; a failure takes back what was added before it."""
    try:
        for cls in (*schema_properties.classes(), *properties.CLASSES):
            _class(cls)
        properties.attach()
        _undo.append(properties.detach)
        for module in MODULES:
            for cls in module.CLASSES:
                _class(cls)
            module.attach()
            _undo.append(module.detach)
    except Exception:
        unregister()
        raise


def unregister() -> None:
    """Everything backwards."""
    while _undo:
        _undo.pop()()


def _class(cls: type) -> None:
    bpy.utils.register_class(cls)
    _undo.append(lambda: bpy.utils.unregister_class(cls))
