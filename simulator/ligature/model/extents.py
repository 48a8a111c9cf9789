"""Bounding boxes and centroids of shapes, from which masses are estimated that a file does not give.

Shapes are placed in the body frame B; metres.
"""

from __future__ import annotations

import numpy as np

from ligature.mesh import box_inertia
from ligature.model.frames import Array, frame, inverse
from ligature.model.shapes import Box, Capsule, Collider, Cone, Cylinder, Hull, Sphere, TriMesh

HULL_MARGIN_OF_ESTIMATE = 0.04
"""Bullet's default margin in metres; AMBF estimates the inertia of hulls with it."""


def estimated_moments(parts: tuple[Collider, ...], T_body_inertial: Array, margin: float, mass: float) -> Array:
    """Principal moments (3,) of a body that gives none: of a box of the size of its shapes."""
    size = estimate_size(parts, T_body_inertial, margin)
    return np.zeros(3) if size is None else box_inertia(mass, size)


def estimated_inertial(parts: tuple[Collider, ...]) -> Array:
    """Inertial frame (4, 4) in B of a body that gives none: at the centroid of its collision mesh."""
    centroid = mesh_centroid(parts)
    return np.eye(4) if centroid is None else frame(np.eye(3), centroid)


def estimate_size(parts: tuple[Collider, ...], T_body_inertial: Array, margin: float) -> Array | None:
    """Edge lengths (3,) of the box around all shapes along the axes of I; None without a finite shape.

    The boxes are those of Bullet, as in AMBF: the box of a rotated shape bounds the shape's own box, except for
    spheres and cones.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    to_inertial = inverse(T_body_inertial)
    for part in parts:
        T = to_inertial @ part.T_body_shape
        below, above = _cone_bounds(part.shape, T, margin) if isinstance(part.shape, Cone) else _bounds(part, T, margin)
        low, high = np.minimum(low, below), np.maximum(high, above)
    return high - low if np.isfinite(high - low).all() else None


def mesh_centroid(parts: tuple[Collider, ...]) -> Array | None:
    """Mean (3,) in B of the vertices of all meshes among the shapes; None without a mesh."""
    vertices = [part.shape.vertices for part in parts if isinstance(part.shape, Hull | TriMesh)]
    return np.concatenate(vertices).mean(axis=0) if vertices else None


def _bounds(part: Collider, T: Array, margin: float) -> tuple[Array, Array]:
    """Corners, each (3,), of the axis-aligned box around the own box of a shape at ``T`` (4, 4)."""
    shape = part.shape
    centre = np.zeros(3)
    if isinstance(shape, Sphere):
        return T[:3, 3] - shape.radius, T[:3, 3] + shape.radius
    if isinstance(shape, Box):
        half = shape.size / 2
    elif isinstance(shape, Capsule | Cylinder):
        half = np.array([shape.radius, shape.radius, shape.height / 2])
    elif isinstance(shape, Hull | TriMesh):
        below, above = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
        extra = margin + (HULL_MARGIN_OF_ESTIMATE if isinstance(shape, Hull) else 0.0)
        centre, half = (below + above) / 2, (above - below) / 2 + extra
    else:
        return np.full(3, -np.inf), np.full(3, np.inf)
    centre, half = T[:3, :3] @ centre + T[:3, 3], np.abs(T[:3, :3]) @ half
    return centre - half, centre + half


def _cone_bounds(shape: Cone, T: Array, margin: float) -> tuple[Array, Array]:
    """Corners, each (3,), of the box around a cone; Bullet adds the margin twice."""
    axis = T[:3, 2]
    apex, base = T[:3, 3] + axis * shape.height / 2, T[:3, 3] - axis * shape.height / 2
    rim = shape.radius * np.sqrt(np.maximum(1.0 - axis**2, 0.0))
    return np.minimum(apex, base - rim) - 2 * margin, np.maximum(apex, base + rim) + 2 * margin
