"""Composition of poses x y z qx qy qz qw, compiled: what every tick does many times."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import compiled

Array = NDArray[np.float64]


@compiled
def compose(parent: Array, local: Array, out: Array) -> None:
    """Write the pose ``local`` (7,), given in the frame ``parent`` (7,), into ``out`` (7,); aliasing is fine."""
    x, y, z, w = parent[3], parent[4], parent[5], parent[6]
    px, py, pz = local[0], local[1], local[2]
    # v' = v + 2 u x (u x v + w v), u the vector part of a unit quaternion
    cx, cy, cz = y * pz - z * py + w * px, z * px - x * pz + w * py, x * py - y * px + w * pz
    a, b, c, d = local[3], local[4], local[5], local[6]
    out[0] = parent[0] + px + 2.0 * (y * cz - z * cy)
    out[1] = parent[1] + py + 2.0 * (z * cx - x * cz)
    out[2] = parent[2] + pz + 2.0 * (x * cy - y * cx)
    out[3] = w * a + x * d + y * c - z * b
    out[4] = w * b - x * c + y * d + z * a
    out[5] = w * c + x * b - y * a + z * d
    out[6] = w * d - x * a - y * b - z * c


@compiled
def compose_rows(parents: Array, locals_: Array, rows: NDArray[np.int64], out: Array) -> None:
    """Compose row i of ``parents`` and ``locals_`` (n, 7) into row ``rows[i]`` of ``out``."""
    for i in range(rows.shape[0]):
        compose(parents[i], locals_[i], out[rows[i]])


def pose7_matrices(poses: Array) -> Array:
    """Homogeneous matrices (n, 4, 4) of ``poses`` (n, 7); quaternions are normalised."""
    q = poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    v, w = q[:, :3], q[:, 3]
    T = np.zeros((len(poses), 4, 4))
    T[:, :3, :3] = 2.0 * v[:, :, None] * v[:, None, :]
    T[:, [0, 1, 2], [0, 1, 2]] += (w * w - np.einsum("ni,ni->n", v, v))[:, None]
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        T[:, i, j] -= 2.0 * w * v[:, k]
        T[:, j, i] += 2.0 * w * v[:, k]
    T[:, :3, 3] = poses[:, :3]
    T[:, 3, 3] = 1.0
    return T
