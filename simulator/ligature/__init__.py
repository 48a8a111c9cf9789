"""Ligature: an open simulator for robot-assisted suturing."""

import os
import sys

if (
    sys.argv[:1] == ["-m"]  # `python -m ligature`: what lies in the working folder is imported first, a `yaml.py` too
    and sys.orig_argv[-len(sys.argv)].removeprefix("-m").partition(".")[0] == "ligature"
    and not getattr(sys.flags, "safe_path", False)
    and sys.path[0] != os.path.dirname(os.path.dirname(__file__))
):
    del sys.path[0]

import importlib
from typing import TYPE_CHECKING, Any

from ligature import blas

if TYPE_CHECKING:
    from ligature.camera_simulation import Simulation
    from ligature.model.load import SceneError, load
    from ligature.model.scene import Scene

blas.pin()  # before NumPy is imported, where it is not yet

__version__ = "0.2.0"

__all__ = ["Scene", "SceneError", "Simulation", "load"]

_HOMES = {
    "Scene": "ligature.model.scene",
    "SceneError": "ligature.model.load",
    "Simulation": "ligature.camera_simulation",
    "load": "ligature.model.load",
}


def __getattr__(name: str) -> Any:
    """Import the simulator at its first use: `ligature.client` runs where none of its engines is installed."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    """The public names, for completion in a shell."""
    return [*__all__, "__version__", "__doc__"]
