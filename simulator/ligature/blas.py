"""Makes OpenBLAS compute the same bits on every x86-64 processor with AVX2: NumPy and SciPy multiply and solve with it.

OpenBLAS has routines for each kind of processor. They add products in different orders, so that last bits differ.
`pin` selects those for `CORE`, which every processor with AVX2 and FMA can run; those for AMD's Zen are the same.
"""

from __future__ import annotations

import ctypes
import logging
import os
import platform
import sys
from pathlib import Path

CORE = "Haswell"
VARIABLE = "OPENBLAS_CORETYPE"
"""The environment variable in which OpenBLAS looks for the kind of processor when it is loaded."""

CPUS = Path("/proc/cpuinfo")

_log = logging.getLogger(__name__)


def pin() -> None:
    """Select the routines for `CORE`, in this process and in those that it starts.

    A processor without AVX2 keeps its own routines, and a user who has set `VARIABLE` keeps what it says. An OpenBLAS
    that is loaded already selects anew; this takes microseconds, in which no other thread may multiply matrices.
    """
    if VARIABLE in os.environ or not _has_avx2():
        return
    os.environ[VARIABLE] = CORE
    if "numpy" in sys.modules or "scipy" in sys.modules:
        for path in loaded():
            _select_anew(path)


def loaded() -> list[str]:
    """The paths of the OpenBLAS libraries that this process has loaded: NumPy's and SciPy's wheels bring one each."""
    maps = Path("/proc/self/maps").read_text().splitlines()
    return sorted({line.split(maxsplit=5)[5] for line in maps if "openblas" in line})


def core(path: str) -> str:
    """The kind of processor whose routines the loaded library at ``path`` uses."""
    name = ctypes.CDLL(path).gotoblas_corename
    name.restype = ctypes.c_char_p
    return str(name().decode())


def _select_anew(path: str) -> None:
    """What OpenBLAS does when it is loaded, once more.

    `ctypes.PyDLL` holds Python's lock, so that no other thread starts a product between the two calls.
    """
    try:
        library = ctypes.PyDLL(path)
        forget, select = library.gotoblas_dynamic_quit, library.gotoblas_dynamic_init
    except (AttributeError, OSError):
        _log.info("%s chooses its routines by the processor: last bits can differ between machines", path)
        return
    forget()
    select()


def _has_avx2() -> bool:
    """Whether the processor runs the routines for `CORE`."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return False
    flags = next((line for line in CPUS.read_text().splitlines() if line.startswith("flags")), "").split()
    return "avx2" in flags and "fma" in flags
