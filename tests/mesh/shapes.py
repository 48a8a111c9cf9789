"""Closed surfaces with known properties, for the tests of this room. Metres."""

from __future__ import annotations

import numpy as np

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)


def ell(scale: float = 0.01) -> tuple[np.ndarray, np.ndarray]:
    """An L of three unit cubes, times ``scale``: vertices (12, 3), outward faces (20, 3)."""
    outline = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
    vertices = np.vstack([np.column_stack([outline, np.full(6, z)]) for z in (0.0, 1.0)])
    top = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = [(a, c, b) for a, b, c in top] + [(a + 6, b + 6, c + 6) for a, b, c in top]
    for i in range(6):
        j = (i + 1) % 6
        faces += [(i, j, j + 6), (i, j + 6, i + 6)]
    return scale * vertices, np.array(faces, dtype=np.int32)
