"""Imports a module that prints from C code without letting it print."""

from __future__ import annotations

import ctypes
import importlib
import os
import sys


def import_quietly(name: str) -> None:
    """Import ``name`` with standard error closed; PyBullet prints its build date there."""
    if name in sys.modules:
        return
    if sys.stderr is None:  # closed, so that the file which has its number now is not to be touched
        importlib.import_module(name)
        return
    sys.stderr.flush()
    kept, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        importlib.import_module(name)
        ctypes.CDLL(None).fflush(None)
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(null)
