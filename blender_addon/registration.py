"""Adds the extension's classes to Blender, and takes every one of them away again."""

from __future__ import annotations

import bpy

from . import file_operators, generator_operators, object_operators, properties, schema_properties

MODULES = (file_operators, object_operators, generator_operators)


def register() -> None:
    """Groups first, since classes refer to them; then each module's classes and hooks."""
    for cls in (*schema_properties.classes(), *properties.CLASSES):
        bpy.utils.register_class(cls)
    properties.attach()
    for module in MODULES:
        for cls in module.CLASSES:
            bpy.utils.register_class(cls)
        module.attach()


def unregister() -> None:
    """The same backwards."""
    for module in reversed(MODULES):
        module.detach()
        for cls in reversed(module.CLASSES):
            bpy.utils.unregister_class(cls)
    properties.detach()
    for cls in (*reversed(properties.CLASSES), *reversed(schema_properties.classes())):
        bpy.utils.unregister_class(cls)
