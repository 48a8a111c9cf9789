"""Frees simulations that nothing refers to any more, once there are many.

Each is a reference cycle of 30 to 100 MB, and Python's collector counts objects, not bytes.
"""

from __future__ import annotations

import gc
import weakref

MOST_UNREFERENCED = 8
"""Number of unreferenced simulations that may wait to be freed."""

simulations: weakref.WeakSet[object] = weakref.WeakSet()
"""All simulations in memory."""

_crowd = MOST_UNREFERENCED
"""Number of `simulations` at which unreferenced ones are freed."""


def count_in(simulation: object) -> None:
    """Free unreferenced simulations if there are many, and count a new ``simulation`` among those in memory."""
    global _crowd
    if len(simulations) >= _crowd:
        gc.collect()
        _crowd = len(simulations) + MOST_UNREFERENCED
    simulations.add(simulation)
