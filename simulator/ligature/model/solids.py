"""Closed surfaces of primitive shapes, for what needs triangles of every shape; metres."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.mesh.surface import convex_surface
from ligature.model.frames import Array
from ligature.model.shapes import Box, Capsule, Collider, Cone, Cylinder, Hull, Plane, Sphere, TriMesh

AROUND, UP = 32, 12
"""Points around the axis of a round shape, and from pole to pole of a sphere."""


def surface_of(collider: Collider) -> tuple[Array, NDArray[np.int32]] | None:
    """Vertices (n, 3) in B and outward faces (m, 3) of a shape; None for a plane."""
    shape, T = collider.shape, collider.T_body_shape
    if isinstance(shape, Plane):
        return None
    if isinstance(shape, TriMesh):
        vertices, faces = shape.vertices, shape.faces
    else:
        vertices, faces = convex_surface(_points(shape))
    return np.asarray(vertices @ T[:3, :3].T + T[:3, 3]), faces


def _points(shape: Box | Sphere | Cylinder | Capsule | Cone | Hull) -> Array:
    """Points (n, 3) whose convex hull is the shape, or nearly."""
    if isinstance(shape, Hull):
        return shape.vertices
    if isinstance(shape, Box):
        signs = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1).T
        return np.asarray(signs * shape.size)
    angles = (2.0 * np.pi * np.arange(AROUND) / AROUND).tolist()
    circle = np.array([(math.cos(angle), math.sin(angle), 0.0) for angle in angles])
    if isinstance(shape, Cylinder):
        up = np.array([0.0, 0.0, 0.5 * shape.height])
        return np.vstack([shape.radius * circle - up, shape.radius * circle + up])
    if isinstance(shape, Cone):
        up = np.array([0.0, 0.0, 0.5 * shape.height])
        return np.vstack([shape.radius * circle - up, up])
    height = np.pi * (np.arange(1, UP) / UP - 0.5)
    rings = [math.cos(h) * circle + [0.0, 0.0, math.sin(h)] for h in height]
    ball = shape.radius * np.vstack([*rings, [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]])
    if isinstance(shape, Sphere):
        return np.asarray(ball)
    middle = max(0.5 * shape.height - shape.radius, 0.0)
    return np.asarray(ball + np.where(ball[:, 2:] > 0.0, 1.0, -1.0) * [0.0, 0.0, middle])
