"""Paths that needles have cut: material points in order, from where the tip entered to where it came.

A path keeps the way open: what follows, the rest of the needle, its thread or another needle, feels friction alone
up to where the path was cut.
"""

from __future__ import annotations

import numpy as np

from ligature.tissue.layout import Paths


def begin_path(paths: Paths, point: int) -> int:
    """Begin a path at a point of the surface; returns its index.

    Raises
    ------
    RuntimeError
        When all paths are in use.
    """
    unused = np.flatnonzero(paths.count == 0)
    if not len(unused):
        raise RuntimeError(f"all {len(paths.count)} paths through the tissue are in use")
    path = int(unused[0])
    paths.count[path], paths.node[path, 0], paths.s[path, 0] = 1, point, 0.0
    paths.cut[path], paths.length[path] = 0.0, np.inf
    return path


def extend_path(paths: Paths, path: int, point: int, s: float) -> None:
    """Append a node at the length ``s``."""
    k = int(paths.count[path])
    paths.node[path, k], paths.s[path, k] = point, s
    paths.count[path] = k + 1


def remove_node(paths: Paths, point: int) -> None:
    """Take a point out of the path that it belongs to; a path without nodes is not in use any more."""
    for path in np.flatnonzero(paths.count).tolist():
        n = int(paths.count[path])
        at = np.flatnonzero(paths.node[path, :n] == point)
        if len(at):
            k = int(at[0])
            for array in (paths.node, paths.s):
                array[path, k : n - 1] = array[path, k + 1 : n]
            paths.count[path] = n - 1
