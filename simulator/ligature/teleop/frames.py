"""Poses of the arms' frames relative to each other, from arms, set-up joints and tf. Metres.

Each frame is known in one parent. What tf reports has preference over the set-up joints, which report the same frames.
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import inverse

Array = NDArray[np.float64]

DEEPEST = 32


class Frames:
    """A tree of frames by name; safe to use from several threads.

    Names are taken with or without a leading slash, and with or without ``prefix`` (such as ``left/``), which the
    frames of a simulator with a prefix have on ROS.
    """

    def __init__(self, prefix: str = "") -> None:
        self._prefix = prefix
        self._parents: dict[str, tuple[str, Array, int]] = {}
        self._lock = threading.Lock()

    def put(self, parent: str, child: str, T_parent_child: Array, rank: int = 0) -> None:
        """Learn where ``child`` is; what was reported with a lower ``rank`` counts more."""
        parent, child = self._bare(parent), self._bare(child)
        if parent == child or not np.isfinite(T_parent_child).all():
            return
        with self._lock:
            known = self._parents.get(child)
            if known is None or rank <= known[2]:
                self._parents[child] = (parent, T_parent_child, rank)

    def between(self, target: str, source: str) -> Array | None:
        """T_target_source (4, 4); None while nothing connects them."""
        target, source = self._bare(target), self._bare(source)
        if target == source:
            return np.eye(4)
        with self._lock:
            up, down = self._to_root(target), self._to_root(source)
        for name, T_source_up in down.items():
            if name in up:
                return np.asarray(inverse(up[name]) @ T_source_up)
        return None

    def has_prefix(self, name: str) -> bool:
        """Whether a frame's ``name`` on ROS begins with the prefix."""
        return name.lstrip("/").startswith(self._prefix)

    def _bare(self, name: str) -> str:
        return name.lstrip("/").removeprefix(self._prefix)

    def _to_root(self, name: str) -> dict[str, Array]:
        """Poses (4, 4) of frame ``name`` in itself and in all frames above."""
        found, T = {name: np.eye(4)}, np.eye(4)
        for _ in range(DEEPEST):
            entry = self._parents.get(name)
            if entry is None:
                break
            name, T = entry[0], entry[1] @ T
            found[name] = T
        return found
