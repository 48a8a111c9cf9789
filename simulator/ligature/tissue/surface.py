"""The shape of the surface around a point of it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import kernel

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@kernel
def mean_normal(x: Array, faces: Integers, at: Array, radius: float, side: Array, normal: Array) -> None:
    """Fill the mean outward ``normal`` (3,) of the faces around ``at`` (3,), of those that face like ``side`` (3,).

    A face (four corners among the positions ``x`` (n, 3), m) counts by its area and by ``exp(-(d / radius)²)`` of its
    distance d.
    """
    nx, ny, nz = 0.0, 0.0, 0.0
    for f in range(faces.shape[0]):
        i, j, k, m = faces[f, 0], faces[f, 1], faces[f, 2], faces[f, 3]
        ax, ay, az = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        bx, by, bz = x[m, 0] - x[j, 0], x[m, 1] - x[j, 1], x[m, 2] - x[j, 2]
        cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        if cx * side[0] + cy * side[1] + cz * side[2] <= 0.0:
            continue
        square = 0.0
        for a in range(3):
            square += (0.25 * (x[i, a] + x[j, a] + x[k, a] + x[m, a]) - at[a]) ** 2
        weight = math.exp(-square / radius**2)
        nx, ny, nz = nx + weight * cx, ny + weight * cy, nz + weight * cz
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    normal[0], normal[1], normal[2] = nx / size, ny / size, nz / size
