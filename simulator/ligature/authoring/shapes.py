"""Primitive shapes of the format: as meshes to look at, as solids to weigh, fitted to points.

Shapes stand as in the format: centred in their own frame, round ones along ``axis``, a
cone with its apex towards it, a capsule with its caps in its height. Metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.adf.frames import Array, frame
from ligature.authoring.placement import AXIS_TURNS
from ligature.mesh.inertia import (
    MassProperties,
    box_properties,
    capsule_properties,
    combined,
    cone_properties,
    cylinder_properties,
    sphere_properties,
)

Faces = NDArray[np.int32]
KINDS = ("BOX", "SPHERE", "CYLINDER", "CAPSULE", "CONE", "PLANE")
ROUND = ("CYLINDER", "CAPSULE", "CONE")
SIDES, RINGS = 24, 6
PLANE_SIZE = 1.0
"""Edge of the square that stands for an infinite plane, in metres."""


@dataclass(frozen=True)
class Shape:
    """A primitive: ``size`` (3,) of a box, radius and height of a round one, normal and offset of a plane."""

    kind: str
    size: tuple[float, float, float] = (1.0, 1.0, 1.0)
    radius: float = 0.5
    height: float = 1.0
    axis: str = "Z"
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    offset: float = 0.0

    def geometry(self) -> dict[str, Any]:
        """The keys of the shape's geometry block, axis only where it is not Z."""
        if self.kind == "BOX":
            return dict(zip("xyz", self.size, strict=True))
        if self.kind == "PLANE":
            return {"normal": self.normal, "offset": self.offset}
        keys: dict[str, Any] = {"radius": self.radius}
        if self.kind != "SPHERE":
            keys["height"] = self.height
            if self.axis != "Z":
                keys["axis"] = self.axis
        return keys

    @classmethod
    def of(cls, kind: str, geometry: Mapping[str, Any]) -> Shape:
        """The shape of a geometry block's keys; what is absent has this class's default."""
        plain = cls(kind)
        x, y, z = plain.size
        return cls(
            kind,
            (float(geometry.get("x", x)), float(geometry.get("y", y)), float(geometry.get("z", z))),
            float(geometry.get("radius", plain.radius)),
            float(geometry.get("height", plain.height)),
            str(geometry.get("axis", plain.axis)),
            tuple(geometry.get("normal", plain.normal)),
            float(geometry.get("offset", plain.offset)),
        )


def shape_mesh(shape: Shape) -> tuple[Array, list[tuple[int, ...]]]:
    """Vertices (n, 3) and faces, outwards, that show a shape in its own frame."""
    if shape.kind == "BOX":
        return _box(np.asarray(shape.size))
    if shape.kind == "PLANE":
        return _plane(shape)
    profile = _profile(shape)
    vertices, faces = _turned(profile)
    turn = AXIS_TURNS[shape.axis] if shape.kind in ROUND else np.eye(3)
    return vertices @ turn.T, faces


def shape_properties(shape: Shape, density: float = 1.0) -> MassProperties:
    """Mass properties of a shape in its own frame; raises ValueError for a plane, which has none."""
    if shape.kind == "BOX":
        return box_properties(np.asarray(shape.size), density)
    if shape.kind == "SPHERE":
        return sphere_properties(shape.radius, density)
    if shape.kind == "PLANE":
        raise ValueError("a plane has no volume")
    makers = {"CYLINDER": cylinder_properties, "CAPSULE": capsule_properties, "CONE": cone_properties}
    return makers[shape.kind](shape.radius, shape.height, density).placed(frame(AXIS_TURNS[shape.axis], (0, 0, 0)))


def shapes_properties(placed: list[tuple[Shape, Array]], density: float = 1.0) -> MassProperties:
    """Mass properties of shapes at poses (4, 4) in a body; overlaps count twice."""
    return combined([shape_properties(shape, density).placed(T) for shape, T in placed])


def fitted(kind: str, points: Array, axis: str = "") -> tuple[Shape, Array]:
    """The smallest shape of ``kind`` along the points' axes that holds ``points`` (n, 3), and its pose (4, 4).

    ``axis`` is that of a round shape; when it is empty, the one that leaves the smallest volume.
    Raises ValueError when the points span no volume.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    size, centre = high - low, (low + high) / 2.0
    if not (size > 0.0).any():
        raise ValueError("all points lie in one place; select a part with some extent")
    T = frame(np.eye(3), centre)
    if kind == "BOX":
        return Shape(kind, _triple(np.maximum(size, 1e-4 * size.max()))), T
    if kind == "SPHERE":
        return Shape(kind, radius=float(np.linalg.norm(points - centre, axis=1).max())), T
    candidates = [_fitted_round(kind, points - centre, name) for name in (axis or "XYZ")]
    return min(candidates, key=lambda s: shape_properties(s).volume), T


def oriented(points: Array) -> Array:
    """Pose (4, 4) of the principal axes of ``points`` (n, 3), the longest along Z, at their mean."""
    centre = points.mean(axis=0)
    axes = np.linalg.svd(points - centre, full_matrices=False)[2][::-1].T
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] = -axes[:, 0]
    return frame(axes, centre)


def _fitted_round(kind: str, points: Array, axis: str) -> Shape:
    local = points @ AXIS_TURNS[axis]
    across = np.hypot(local[:, 0], local[:, 1])
    radius, height = float(across.max()), float(2.0 * np.abs(local[:, 2]).max())
    least = 1e-4 * max(radius, height)
    radius, height = max(radius, least), max(height, least)
    if kind == "CONE":
        # the base circle must reach every point: at height z the cone is radius * (1/2 - z/h) wide
        height *= 1.5
        room = np.maximum(0.5 - local[:, 2] / height, 1e-3)
        radius = max(float((across / room).max()), least)
    if kind == "CAPSULE":
        over = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
        height = max(2.0 * radius, 2.0 * float((np.abs(local[:, 2]) + radius - over).max()))
    return Shape(kind, radius=radius, height=height, axis=axis)


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = map(float, values)
    return x, y, z


def _box(size: Array) -> tuple[Array, list[tuple[int, ...]]]:
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
    return corners, [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def _plane(shape: Shape) -> tuple[Array, list[tuple[int, ...]]]:
    normal = np.asarray(shape.normal, dtype=float)
    normal /= np.linalg.norm(normal)
    side = np.cross(normal, [1.0, 0.0, 0.0] if abs(normal[0]) < 0.9 else [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    other = np.cross(normal, side)
    half = PLANE_SIZE / 2.0
    corners = [shape.offset * normal + half * (a * side + b * other) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return np.array(corners), [(0, 1, 2, 3)]


def _profile(shape: Shape) -> Array:
    """Radius and height (n, 2) of a round shape's outline, from bottom to top."""
    r, h = shape.radius, shape.height / 2.0
    bend = np.linspace(-np.pi / 2.0, 0.0, RINGS)
    if shape.kind == "SPHERE":
        bend = np.linspace(-np.pi / 2.0, np.pi / 2.0, 2 * RINGS + 1)
        return np.column_stack([r * np.cos(bend), r * np.sin(bend)])
    if shape.kind == "CYLINDER":
        return np.array([[0.0, -h], [r, -h], [r, h], [0.0, h]])
    if shape.kind == "CONE":
        return np.array([[0.0, -h], [r, -h], [0.0, h]])
    straight = max(h - r, 0.0)
    cap = np.column_stack([r * np.cos(bend), r * np.sin(bend) - straight])
    return np.vstack([cap, cap[::-1] * [1.0, -1.0]])


def _turned(profile: Array) -> tuple[Array, list[tuple[int, ...]]]:
    """The surface that ``profile`` sweeps about Z; its first and last points are on the axis."""
    angle = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    rings = [np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(SIDES, z)]) for r, z in profile[1:-1]]
    vertices = np.vstack([[[0.0, 0.0, profile[0, 1]]], *rings, [[0.0, 0.0, profile[-1, 1]]]])
    top = len(vertices) - 1
    around = [(i, (i + 1) % SIDES) for i in range(SIDES)]
    faces: list[tuple[int, ...]] = [(0, 1 + b, 1 + a) for a, b in around]
    for ring in range(len(rings) - 1):
        low, up = 1 + ring * SIDES, 1 + (ring + 1) * SIDES
        faces += [(low + a, low + b, up + b, up + a) for a, b in around]
    last = top - SIDES
    faces += [(last + a, last + b, top) for a, b in around]
    return vertices, faces
