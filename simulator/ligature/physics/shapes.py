"""Collision shapes for Bullet, made from sanitised pieces only (never from a user's file)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.mesh import CollisionCache
from ligature.mesh.decompose import convex_pieces
from ligature.model.frames import matrix_quaternion
from ligature.model.shapes import Box, Capsule, Collider, Cone, Cylinder, Hull, Plane, Sphere, TriMesh

Array = NDArray[np.float64]

CONE_FACETS = 24
NO_SHAPE = -1


def create(
    client: int, cache: CollisionCache, parts: Sequence[Collider], T_link_body: Array, moving: bool, margin: float
) -> int:
    """One Bullet shape of all ``parts`` of a body, placed at ``T_link_body`` in the link frame; -1 for none."""
    kinds: list[int] = []
    columns: dict[str, list[Any]] = {
        "radii": [], "halfExtents": [], "lengths": [], "fileNames": [], "planeNormals": [], "flags": [],
        "collisionFramePositions": [], "collisionFrameOrientations": [],
    }  # fmt: skip
    for kind, values, T in _rows(cache, parts, moving):
        place = T_link_body @ T
        kinds.append(kind)
        columns["radii"].append(values.get("radius", 0.0))
        columns["halfExtents"].append(values.get("half", [0.0, 0.0, 0.0]))
        columns["lengths"].append(values.get("length", 0.0))
        columns["fileNames"].append(values.get("file", ""))
        columns["planeNormals"].append(values.get("normal", [0.0, 0.0, 1.0]))
        columns["flags"].append(values.get("flags", 0))
        columns["collisionFramePositions"].append(place[:3, 3].tolist())
        columns["collisionFrameOrientations"].append(matrix_quaternion(place[:3, :3]).tolist())
    if not kinds:
        return NO_SHAPE
    shape = int(pybullet.createCollisionShapeArray(shapeTypes=kinds, physicsClientId=client, **columns))
    _set_margin(client, shape, margin)
    return shape


def _set_margin(client: int, shape: int, margin: float) -> None:
    """Give every part of ``shape`` its collision margin, while it is for a moment the base of a body.

    Bullet's default of 1 mm turns parts thinner than twice that inside out, so that bodies fall through them;
    on a link it cannot be changed any more.
    """
    uid = pybullet.createMultiBody(0, shape, physicsClientId=client)
    pybullet.changeDynamics(uid, -1, collisionMargin=margin, physicsClientId=client)
    pybullet.removeBody(uid, physicsClientId=client)


def _rows(cache: CollisionCache, parts: Sequence[Collider], moving: bool) -> list[tuple[int, dict[str, Any], Array]]:
    rows: list[tuple[int, dict[str, Any], Array]] = []
    hulls: dict[bytes, tuple[Array, list[Array]]] = {}
    for part in parts:
        shape, T = part.shape, part.T_body_shape
        if isinstance(shape, Box):
            rows.append((pybullet.GEOM_BOX, {"half": (shape.size / 2).tolist()}, T))
        elif isinstance(shape, Sphere):
            rows.append((pybullet.GEOM_SPHERE, {"radius": shape.radius}, T))
        elif isinstance(shape, Cylinder):
            rows.append((pybullet.GEOM_CYLINDER, {"radius": shape.radius, "length": shape.height}, T))
        elif isinstance(shape, Capsule):
            length = max(shape.height - 2 * shape.radius, 0.0)
            rows.append((pybullet.GEOM_CAPSULE, {"radius": shape.radius, "length": length}, T))
        elif isinstance(shape, Plane):
            shifted = T.copy()
            shifted[:3, 3] += T[:3, :3] @ (shape.normal * shape.offset)
            rows.append((pybullet.GEOM_PLANE, {"normal": shape.normal.tolist()}, shifted))
        elif isinstance(shape, TriMesh) and not moving:
            file = str(cache.triangles(shape.vertices, shape.faces))
            rows.append((pybullet.GEOM_MESH, {"file": file, "flags": pybullet.GEOM_FORCE_CONCAVE_TRIMESH}, T))
        else:
            hulls.setdefault(T.tobytes(), (T, []))[1].extend(hull_points(shape))
    for T, points in hulls.values():
        rows.append((pybullet.GEOM_MESH, {"file": str(cache.hulls(points))}, T))
    return rows


def hull_points(shape: Cone | Hull | TriMesh) -> list[Array]:
    """Corner points (n, 3) of the convex pieces that stand for a shape in the shape's frame."""
    if isinstance(shape, Hull):
        return [shape.vertices]
    if isinstance(shape, Cone):
        angles = np.linspace(0, 2 * np.pi, CONE_FACETS, endpoint=False).tolist()
        base = shape.radius * np.array([(math.cos(angle), math.sin(angle)) for angle in angles])
        ring = np.column_stack([base, np.full(CONE_FACETS, -shape.height / 2)])
        return [np.vstack([ring, [0.0, 0.0, shape.height / 2]])]
    return convex_pieces(shape.vertices, shape.faces, shape.source)
