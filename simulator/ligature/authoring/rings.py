"""Rings of capsules along the edges of holes: loops of edges, and capsules along them. Metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ligature.adf.frames import Array, frame, minimal_rotation
from ligature.authoring.shapes import Shape


def edge_loops(edges: Sequence[tuple[int, int]]) -> list[tuple[list[int], bool]]:
    """Vertices of each connected run of ``edges`` in order, and whether it closes.

    A closed run names its first vertex once. Raises ValueError where edges branch.
    """
    beside: dict[int, list[int]] = {}
    for a, b in edges:
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    if any(len(others) > 2 for others in beside.values()):
        raise ValueError("the edges branch; choose the edges of plain loops")
    ends = [vertex for vertex, others in beside.items() if len(others) == 1]
    found, seen = [], set()
    for start in [*ends, *beside]:
        if start in seen:
            continue
        run = [start]
        seen.add(start)
        while following := [vertex for vertex in beside[run[-1]] if vertex not in seen]:
            run.append(following[0])
            seen.add(following[0])
        found.append((run, start not in ends))
    return found


def capsules_along(points: Array, closed: bool, sides: int, radius: float) -> list[tuple[Shape, Array]]:
    """At most ``sides`` capsules of ``radius`` from point to point of a path (n, 3), and their poses (4, 4).

    A path of more sides is cut into equal lengths. Raises ValueError for a path without length.
    """
    path = np.vstack([points, points[:1]]) if closed else np.asarray(points, dtype=float)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    if length[-1] <= 0.0:
        raise ValueError("the edges have no length; select edges whose ends lie apart")
    if len(path) - 1 > sides:
        places = np.linspace(0.0, length[-1], sides + 1)
        path = np.column_stack([np.interp(places, length, path[:, i]) for i in range(3)])
    found = []
    for a, b in zip(path, path[1:], strict=False):
        along = b - a
        distance = float(np.linalg.norm(along))
        if distance > 0.0:
            shape = Shape("CAPSULE", radius=radius, height=distance + 2.0 * radius)
            found.append((shape, frame(minimal_rotation((0.0, 0.0, 1.0), along), (a + b) / 2.0)))
    return found
