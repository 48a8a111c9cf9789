"""Mass properties: exact for closed surfaces and hulls, and Bullet's estimate from a bounding box.

Lengths in metres, masses in kilograms, inertia tensors in kg·m².
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MassProperties:
    """Volume, mass, centre of mass (3,) and inertia tensor (3, 3) about the centre of mass."""

    volume: float
    mass: float
    centre: Array
    inertia: Array

    def principal(self) -> tuple[Array, Array]:
        """Principal moments (3,), ascending, and axes (3, 3) as columns of a right-handed frame."""
        moments, axes = np.linalg.eigh(self.inertia)
        if np.linalg.det(axes) < 0:
            axes = axes * np.array([1.0, 1.0, -1.0])
        return moments, axes


def mass_properties(vertices: Array, faces: NDArray[np.int32], density: float = 1.0) -> MassProperties:
    """Mass properties of the solid inside a closed surface of uniform ``density`` (kg/m³)."""
    found = trimesh.triangles.mass_properties(np.asarray(vertices)[faces], density=density)
    return MassProperties(float(found["volume"]), float(found["mass"]), found["center_mass"], found["inertia"])


def hull_properties(points: Array, density: float = 1.0) -> MassProperties:
    """Mass properties of the convex hull of ``points`` (n, 3); raises ValueError when it is flat."""
    try:
        hull = trimesh.convex.convex_hull(np.asarray(points))
    except Exception as error:
        raise ValueError("the points are coplanar: they enclose no volume") from error
    return mass_properties(np.asarray(hull.vertices), np.asarray(hull.faces), density)


def combined(parts: Sequence[MassProperties]) -> MassProperties:
    """Mass properties of several solids together, by the parallel-axis theorem."""
    mass = sum(p.mass for p in parts)
    centre = np.asarray(sum(p.mass * p.centre for p in parts) / mass)
    inertia = np.zeros((3, 3))
    for p in parts:
        d = p.centre - centre
        inertia += p.inertia + p.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return MassProperties(sum(p.volume for p in parts), mass, centre, inertia)


def box_inertia(mass: float, size: Array) -> Array:
    """Principal moments (3,) of a solid box with edge lengths ``size`` (3,): Bullet's compound estimate."""
    x, y, z = np.asarray(size, dtype=float) ** 2
    return mass / 12.0 * np.array([y + z, x + z, x + y])
