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


@compiled
def write_pose(T: Array, pose: Array) -> None:
    """Pose (7,) of ``T`` (4, 4), as `ligature.model.frames.matrix_pose7` has it."""
    squares = (T[0, 0] - T[1, 1] - T[2, 2], T[1, 1] - T[0, 0] - T[2, 2],
               T[2, 2] - T[0, 0] - T[1, 1], T[0, 0] + T[1, 1] + T[2, 2])  # fmt: skip
    i = 0
    for k in range(1, 4):
        if squares[k] > squares[i]:
            i = k
    q = pose[3:7]
    if i == 3:
        q[0], q[1], q[2] = T[2, 1] - T[1, 2], T[0, 2] - T[2, 0], T[1, 0] - T[0, 1]
        q[3] = 1.0 + squares[3]
    else:
        j, k = (i + 1) % 3, (i + 2) % 3
        q[i] = 1.0 + squares[i]
        q[j], q[k], q[3] = T[j, i] + T[i, j], T[k, i] + T[i, k], T[k, j] - T[j, k]
    length = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if q[3] < 0.0:
        length = -length
    for k in range(4):
        q[k] /= length
    pose[0], pose[1], pose[2] = T[0, 3], T[1, 3], T[2, 3]


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
