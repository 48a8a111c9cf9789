"""Divides triangles, so that a surface can bend where its mesh has no vertices, or open where it has no edges.

Neighbours divide a common edge alike, also where they share no vertices, so that no cracks come about. Metres.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.render.geometry import Triangles

Array = NDArray[np.float64]

ON_PLANE = 1e-8
"""Metres off a plane below which a vertex lies in it."""

_PARTS: dict[int, list[tuple[int, int, int]]] = {
    0: [(0, 1, 2)],
    1: [(0, 3, 2), (3, 1, 2)],
    2: [(3, 1, 4), (0, 3, 4), (0, 4, 2)],
    3: [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
}
"""Parts of a triangle by the number of its divided edges: 0 to 2 are its corners, 3 to 5 the points on the edges 01, 12
and 20. One divided edge is 01; two are 01 and 12."""

_TURN = {0: 0, 1: 0, 2: 1, 4: 2, 3: 0, 6: 1, 5: 2, 7: 0}
"""By which corner a triangle begins, so that its divided edges (bits for 01, 12, 20) are those of `_PARTS`."""


def split_edges(triangles: Triangles, length: float, most: int) -> Triangles:
    """``triangles`` with all edges at most ``length`` long, or as many of them as ``most`` faces allow."""
    while 0 < len(triangles.faces) <= most // 4:
        edges, of_face = _edges(triangles)
        ends = triangles.positions[edges]
        long = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > length
        if not long.any():
            break
        triangles = _divided(triangles, edges, of_face, np.where(long, 0.5, np.nan))
    return triangles


def split_at(triangles: Triangles, axis: int, place: float) -> Triangles:
    """``triangles`` of which none passes through the plane at ``place`` of ``axis``."""
    edges, of_face = _edges(triangles)
    height = triangles.positions[:, axis] - place
    height[np.abs(height) < ON_PLANE] = 0.0
    first, second = height[edges].T
    crossing = first * second < 0.0
    share = np.divide(first, first - second, out=np.full(len(edges), np.nan), where=crossing)
    if not crossing.any():
        return triangles
    divided = _divided(triangles, edges, of_face, share)
    divided.positions[len(height) :, axis] = place
    return divided


def faces_of(triangles: Triangles, keep: NDArray[np.bool_]) -> Triangles:
    """The faces ``keep`` (m,) of ``triangles``, with the vertices that they have."""
    used, faces = np.unique(triangles.faces[keep], return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int32)
    return Triangles(triangles.positions[used], triangles.normals[used], triangles.uvs[used], faces)


def _edges(triangles: Triangles) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Distinct edges (e, 2), and those of each face, 01, 12, 20, (m, 3)."""
    corners = triangles.faces.astype(np.int64)
    pairs = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, of_face = np.unique(pairs, axis=0, return_inverse=True)
    return edges, of_face.reshape(-1, 3)


def _divided(triangles: Triangles, edges: NDArray[np.int64], of_face: NDArray[np.int64], share: Array) -> Triangles:
    """Triangles whose ``edges`` have a new vertex at ``share`` (e,) of their length; NaN for none."""
    split = np.isfinite(share)
    number = np.full(len(edges), -1, dtype=np.int64)
    number[split] = len(triangles.positions) + np.arange(np.count_nonzero(split))
    first, second = edges[split].T
    at = share[split, None]

    def between(values: Array) -> Array:
        return np.vstack([values, (1.0 - at) * values[first] + at * values[second]])

    normals = between(triangles.normals)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    six = np.hstack([triangles.faces, number[of_face]])
    which = (split[of_face] * [1, 2, 4]).sum(axis=1)
    parts = [triangles.faces[which == 0].astype(np.int64)]
    for bits in range(1, 8):
        of_kind, turn = six[which == bits], _TURN[bits]
        turned = of_kind[:, [(c + turn) % 3 for c in range(3)] + [3 + (c + turn) % 3 for c in range(3)]]
        parts += [turned[:, part] for part in _PARTS[bin(bits).count("1")]]
    return Triangles(between(triangles.positions), normals, between(triangles.uvs), np.vstack(parts).astype(np.int32))
