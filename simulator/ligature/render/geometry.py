"""Triangles to draw: primitive shapes and mesh parts as arrays of positions, normals and texture coordinates.

Everything in metres, in the frame of the shape or mesh; triangles wind counter-clockwise seen from outside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.model.shapes import Box, Capsule, Cone, Cylinder, Hull, Plane, Shape, Sphere

Array = NDArray[np.float64]

SEGMENTS = 32
"""Facets around a round shape: 32 keeps the silhouette within 0.5 % of the radius."""

PLANE_SIZE = 100.0
"""Edge length in metres of the square that stands for an infinite plane, as in the reference."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """``positions`` and ``normals`` (n, 3), ``uvs`` (n, 2), ``faces`` (m, 3) of indices."""

    positions: Array
    normals: Array
    uvs: Array
    faces: NDArray[np.int32]

    def interleaved(self, tangents: bool = False) -> NDArray[np.float32]:
        """Vertices in the shaders' format: position, normal, uv, tangent if needed; (n, 8 or 12) float32."""
        columns = [self.positions, self.normals, self.uvs]
        return np.hstack([*columns, self.tangents()] if tangents else columns).astype("f4")

    def tangents(self) -> Array:
        """Direction of growing u at each vertex, and the handedness that makes v grow along w·(n x t); (n, 4).

        Lengyel, Foundations of Game Engine Development 2 (2019), §7.5: summed over the faces of a vertex.
        """
        corners, uvs = self.positions[self.faces], self.uvs[self.faces]
        (e1, e2), (d1, d2) = ((a[:, 1] - a[:, 0], a[:, 2] - a[:, 0]) for a in (corners, uvs))
        area = d1[:, 0] * d2[:, 1] - d2[:, 0] * d1[:, 1]
        inverse = np.divide(1.0, area, out=np.zeros_like(area), where=np.abs(area) > 1e-20)[:, None]
        along_u = (e1 * d2[:, 1:] - e2 * d1[:, 1:]) * inverse
        along_v = (e2 * d1[:, :1] - e1 * d2[:, :1]) * inverse
        u, v = np.zeros_like(self.positions), np.zeros_like(self.positions)
        for corner in range(3):
            np.add.at(u, self.faces[:, corner], along_u)
            np.add.at(v, self.faces[:, corner], along_v)
        n = self.normals
        u -= n * np.einsum("ij,ij->i", n, u)[:, None]
        length = np.linalg.norm(u, axis=1, keepdims=True)
        across = np.cross(n, np.eye(3)[np.argmin(np.abs(n), axis=1)])
        u = np.where(length > 1e-12, np.divide(u, length, out=np.zeros_like(u), where=length > 1e-12), across)
        handed = np.where(np.einsum("ij,ij->i", np.cross(n, u), v) < 0.0, -1.0, 1.0)
        return np.hstack([u, handed[:, None]])


def of_shape(shape: Shape) -> Triangles:
    """The surface of a primitive, a hull or a triangle mesh."""
    if isinstance(shape, Box):
        return box(shape.size)
    if isinstance(shape, Sphere):
        return revolve(*_arc(shape.radius, 0.0, -np.pi / 2, np.pi / 2))
    if isinstance(shape, Cylinder):
        r, h = shape.radius, shape.height / 2
        return revolve([(0, -h), (r, -h), (r, -h), (r, h), (r, h), (0, h)], _flat(0, -1, 1, 0, 0, 1))
    if isinstance(shape, Cone):
        r, h = shape.radius, shape.height / 2
        slope = np.array([shape.height, r]) / np.hypot(shape.height, r)
        return revolve([(0, -h), (r, -h), (r, -h), (0, h)], [(0, -1), (0, -1), slope, slope])
    if isinstance(shape, Capsule):
        half = max(shape.height / 2 - shape.radius, 0.0)
        low, high = _arc(shape.radius, -half, -np.pi / 2, 0.0), _arc(shape.radius, half, 0.0, np.pi / 2)
        return revolve(low[0] + high[0], low[1] + high[1])
    if isinstance(shape, Plane):
        return plane(shape.normal, shape.offset)
    if isinstance(shape, Hull):
        return hull(shape.vertices)
    return (smooth_shaded if shape.smooth else flat_shaded)(shape.vertices, shape.faces)


def box(size: Array) -> Triangles:
    """A box with edge lengths ``size`` (3,), four vertices a face."""
    positions, normals, uvs = [], [], []
    for axis in range(3):
        u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        for sign in (1.0, -1.0):
            n = sign * np.eye(3)[axis]
            corners = [n - sign * u - v, n + sign * u - v, n + sign * u + v, n - sign * u + v]
            positions += [c * np.asarray(size) / 2 for c in corners]
            normals += [n] * 4
            uvs += [(0, 0), (1, 0), (1, 1), (0, 1)]
    quads = np.arange(24).reshape(6, 4)
    faces = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    return Triangles(np.array(positions), np.array(normals), np.array(uvs, dtype=float), faces)


def revolve(profile: list[tuple[float, float]], normals: list[tuple[float, float]]) -> Triangles:
    """Surface of revolution about Z of ``profile`` points (r, z) with ``normals`` (n_r, n_z)."""
    angles = np.linspace(0, 2 * np.pi, SEGMENTS + 1)
    cos, sin = np.cos(angles), np.sin(angles)
    rings = len(profile)
    r, z = np.array(profile, dtype=float).T
    nr, nz = np.array(normals, dtype=float).T
    positions = np.stack([np.outer(r, cos), np.outer(r, sin), np.repeat(z[:, None], len(cos), 1)], -1)
    normal = np.stack([np.outer(nr, cos), np.outer(nr, sin), np.repeat(nz[:, None], len(cos), 1)], -1)
    u, v = np.meshgrid(np.linspace(0, 1, len(cos)), np.linspace(0, 1, rings))
    index = np.arange(rings * len(cos)).reshape(rings, len(cos))
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    flat = positions.reshape(-1, 3)
    edge1, edge2 = flat[faces[:, 1]] - flat[faces[:, 0]], flat[faces[:, 2]] - flat[faces[:, 0]]
    solid = np.linalg.norm(np.cross(edge1, edge2), axis=1) > 0
    return Triangles(flat, normal.reshape(-1, 3), np.stack([u, v], -1).reshape(-1, 2), faces[solid].astype(np.int32))


def plane(normal: Array, offset: float) -> Triangles:
    """A large square in the plane n·p = ``offset``."""
    n = np.asarray(normal, dtype=float)
    u = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    u /= np.linalg.norm(u)
    v, half = np.cross(n, u), PLANE_SIZE / 2
    corners = [-u - v, u - v, u + v, -u + v]
    positions = np.array([offset * n + half * c for c in corners])
    uvs = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float) * PLANE_SIZE
    return Triangles(positions, np.tile(n, (4, 1)), uvs, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))


def hull(vertices: Array) -> Triangles:
    """The convex hull of ``vertices`` (n, 3), flat shaded."""
    import trimesh

    surface = trimesh.convex.convex_hull(np.asarray(vertices, dtype=float))
    return flat_shaded(np.asarray(surface.vertices), np.asarray(surface.faces))


def flat_shaded(vertices: Array, faces: NDArray[np.int32]) -> Triangles:
    """Triangles that share no vertex, each with its own normal."""
    corners = np.asarray(vertices, dtype=float)[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    n = 3 * len(faces)
    return Triangles(
        corners.reshape(n, 3),
        np.repeat(normal, 3, axis=0),
        np.zeros((n, 2)),
        np.arange(n, dtype=np.int32).reshape(-1, 3),
    )


def smooth_shaded(vertices: Array, faces: NDArray[np.int32]) -> Triangles:
    """Triangles that share their vertices, whose normals are means over the triangles around, by area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    areas, normal = np.cross(b - a, c - a), np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normal, faces[:, k], areas)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    return Triangles(np.asarray(vertices, dtype=float), normal, np.zeros((len(vertices), 2)), faces)


def _arc(
    radius: float, z: float, start: float, end: float
) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Points and normals of a circular profile about (0, z) from elevation ``start`` to ``end``."""
    angles = np.linspace(start, end, SEGMENTS // 2 + 1 if end - start > 2 else SEGMENTS // 4 + 1)
    normals = [(max(float(np.cos(a)), 0.0), float(np.sin(a))) for a in angles]
    return [(radius * r, z + radius * s) for r, s in normals], normals


def _flat(*values: float) -> list[tuple[float, float]]:
    """Profile normals, each given once for the two ends of its segment."""
    pairs = list(zip(values[::2], values[1::2], strict=True))
    return [pair for pair in pairs for _ in range(2)]
