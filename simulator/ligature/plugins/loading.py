"""Imports the class of a plug-in from a file or from an installed package."""

from __future__ import annotations

import importlib.util
import sys
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType

from ligature.model.plugins import PluginEntry
from ligature.plugins.plugin import Plugin

GROUP = "ligature.plugins"
"""Group of entry points in which packages offer plug-ins."""


def plugin_class(entry: PluginEntry, number: int) -> type[Plugin]:
    """The class of a plug-in; raises whatever its code raises, LookupError and TypeError.

    A file becomes a module of its own, also where two entries name the same one.
    """
    if entry.path is not None:
        return _only_class(_module(entry.path, f"ligature_plugin_{number}_{entry.path.stem}"))
    offered = {point.name: point for point in entry_points(group=GROUP)}
    if entry.entry_point not in offered:
        known = ", ".join(sorted(offered)) or "none"
        raise LookupError(
            f"no installed package offers '{entry.entry_point}' in the group '{GROUP}' (available: {known}); "
            "a file's name ends with .py"
        )
    loaded = offered[entry.entry_point].load()
    if not (isinstance(loaded, type) and issubclass(loaded, Plugin)):
        raise TypeError(f"'{entry.entry_point}' is not a subclass of ligature.plugins.Plugin")
    return loaded


def _module(path: Path, name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None, "a Python file has a loader"
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def _only_class(module: ModuleType) -> type[Plugin]:
    found = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Plugin) and value.__module__ == module.__name__
    ]
    if len(found) != 1:
        names = ", ".join(cls.__name__ for cls in found) or "none"
        raise TypeError(f"the file must define one subclass of ligature.plugins.Plugin; it defines {names}")
    return found[0]
