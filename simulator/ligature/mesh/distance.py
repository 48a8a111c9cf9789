"""Signed distance of points to convex shapes, compiled: for contacts of rods and overlaps of ghosts.

Shapes are given by a kind, sizes (3,) and, for hulls, planes (n, 4) of outward unit normal and
offset; points are in the shape's frame, metres. Distances are negative inside. Beside edges of a
hull the distance to the nearest plane is returned, which is smaller than the true one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import kernel

Array = NDArray[np.float64]

BOX, SPHERE, CYLINDER, CAPSULE, CONE, HULL, HALF_SPACE = range(7)


@kernel
def signed_distance(kind: int, size: Array, planes: Array, p: Array, normal: Array) -> float:
    """Distance of ``p`` (3,) to the shape; its outward direction is written to ``normal`` (3,)."""
    if kind == SPHERE:
        return _radial(p[0], p[1], p[2], size[0], normal)
    if kind == CAPSULE:
        half = max(0.5 * size[1] - size[0], 0.0)
        return _radial(p[0], p[1], p[2] - min(max(p[2], -half), half), size[0], normal)
    if kind == BOX:
        return _box(size, p, normal)
    if kind == CYLINDER:
        return _cylinder(size, p, normal)
    if kind == CONE:
        return _cone(size, p, normal)
    best = -1e30
    for i in range(planes.shape[0]):
        d = planes[i, 0] * p[0] + planes[i, 1] * p[1] + planes[i, 2] * p[2] - planes[i, 3]
        if d > best:
            best = d
            normal[0], normal[1], normal[2] = planes[i, 0], planes[i, 1], planes[i, 2]
    return best


@kernel
def _radial(x: float, y: float, z: float, radius: float, normal: Array) -> float:
    length = (x * x + y * y + z * z) ** 0.5
    if length < 1e-15:
        normal[0], normal[1], normal[2] = 1.0, 0.0, 0.0
    else:
        normal[0], normal[1], normal[2] = x / length, y / length, z / length
    return length - radius


@kernel
def _box(size: Array, p: Array, normal: Array) -> float:
    square, outside = 0.0, 0
    deepest, axis = -1e30, 0
    for i in range(3):
        d = abs(p[i]) - 0.5 * size[i]
        normal[i] = 0.0
        if d > 0.0:
            square += d * d
            outside += 1
            normal[i] = d if p[i] > 0.0 else -d
        if d > deepest:
            deepest, axis = d, i
    if outside > 1:  # over one face, the rule, neither root nor division is needed
        length = square**0.5
        for i in range(3):
            normal[i] /= length
        return length
    normal[axis] = 1.0 if p[axis] >= 0.0 else -1.0
    return deepest


@kernel
def _cylinder(size: Array, p: Array, normal: Array) -> float:
    r = (p[0] * p[0] + p[1] * p[1]) ** 0.5
    ux, uy = (p[0] / r, p[1] / r) if r > 1e-15 else (1.0, 0.0)
    up = 1.0 if p[2] >= 0.0 else -1.0
    radial, axial = r - size[0], abs(p[2]) - 0.5 * size[1]
    if radial > 0.0 and axial > 0.0:
        length = (radial * radial + axial * axial) ** 0.5
        normal[0], normal[1], normal[2] = radial / length * ux, radial / length * uy, axial / length * up
        return length
    if radial > axial:
        normal[0], normal[1], normal[2] = ux, uy, 0.0
        return radial
    normal[0], normal[1], normal[2] = 0.0, 0.0, up
    return axial


@kernel
def _cone(size: Array, p: Array, normal: Array) -> float:
    r = (p[0] * p[0] + p[1] * p[1]) ** 0.5
    ux, uy = (p[0] / r, p[1] / r) if r > 1e-15 else (1.0, 0.0)
    slope = size[0] / size[1]
    scale = 1.0 / (1.0 + slope * slope) ** 0.5
    side = (r - slope * (0.5 * size[1] - p[2])) * scale
    bottom = -p[2] - 0.5 * size[1]
    if side > bottom:
        normal[0], normal[1], normal[2] = scale * ux, scale * uy, scale * slope
        return side
    normal[0], normal[1], normal[2] = 0.0, 0.0, -1.0
    return bottom
