"""Mass properties: exact for closed surfaces, hulls and primitives, and Bullet's estimate from a box.

Lengths in metres, masses in kilograms, densities in kg/m³, inertia tensors in kg·m². Primitives
stand as in the format: centred, along local Z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.mesh.surface import convex_surface, open_edges, weld

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

    def placed(self, T: Array) -> MassProperties:
        """The same solid moved by the rigid transform ``T`` (4, 4)."""
        R, p = T[:3, :3], T[:3, 3]
        return MassProperties(self.volume, self.mass, R @ self.centre + p, R @ self.inertia @ R.T)

    def with_mass(self, mass: float) -> MassProperties:
        """The same solid with another density, so that it has ``mass``."""
        return MassProperties(self.volume, mass, self.centre, self.inertia * (mass / self.mass))


def mass_properties(vertices: Array, faces: NDArray[np.int32], density: float = 1.0) -> MassProperties:
    """Mass properties of the solid inside a closed surface, oriented outwards or inwards throughout.

    Integrates over the tetrahedra between each triangle and one point: with s = a + b + c and
    d = a·(b × c), volume d/6, first moment d s/24, second moment d (s sᵀ + a aᵀ + b bᵀ + c cᵀ)/120
    (Blow and Binstock, "How to find the inertia tensor (or other mass properties) of a 3D solid
    body represented by a triangle mesh", 2004). Raises ValueError when the surface is open or flat.

    Parameters
    ----------
    vertices
        Corners (n, 3) in metres.
    faces
        Indices (m, 3) of the corners of each triangle.
    density
        In kg/m³.

    Returns
    -------
    MassProperties
        In m³, kg, metres and kg m².
    """
    vertices, faces = weld(np.asarray(vertices, dtype=float), np.asarray(faces))
    if not len(faces):
        raise ValueError("the surface has no triangle")
    gaps = open_edges(faces)
    if gaps:
        raise ValueError(f"the surface is not closed: {gaps} edges lack a neighbour of the same orientation")
    origin = vertices.mean(axis=0)  # near the solid, so that little is lost in differences
    corners = (vertices - origin)[faces]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    d = np.einsum("ij,ij->i", a, np.cross(b, c))
    volume = float(d.sum() / 6.0)
    if abs(volume) <= 1e-12 * float(np.prod(np.ptp(vertices, axis=0))) or volume == 0.0:
        raise ValueError("the surface encloses no volume")
    s = a + b + c
    centre = d @ s / 24.0 / volume
    second = np.einsum("i,ij,ik->jk", d, s, s) + np.einsum("i,ikj,ikl->jl", d, corners, corners)
    spread = (second / 120.0 - volume * np.outer(centre, centre)) * np.sign(volume)
    inertia = np.trace(spread) * np.eye(3) - spread
    return MassProperties(abs(volume), density * abs(volume), centre + origin, density * inertia)


def hull_properties(points: Array, density: float = 1.0) -> MassProperties:
    """Mass properties of the convex hull of ``points`` (n, 3), metres, with ``density`` in kg/m³.

    Raises ValueError when it is flat.
    """
    return mass_properties(*convex_surface(np.asarray(points, dtype=float)), density)


def combined(parts: Sequence[MassProperties]) -> MassProperties:
    """Mass properties of several solids together, by the parallel-axis theorem; overlaps count twice.

    Raises ValueError when their total mass is not above 0.
    """
    mass = sum(p.mass for p in parts)
    if not mass > 0.0:
        raise ValueError("solids without mass have no centre of mass")
    centre = np.asarray(sum(p.mass * p.centre for p in parts) / mass)
    inertia = np.zeros((3, 3))
    for p in parts:
        d = p.centre - centre
        inertia += p.inertia + p.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return MassProperties(sum(p.volume for p in parts), mass, centre, inertia)


def box_properties(size: Array, density: float = 1.0) -> MassProperties:
    """A box with edge lengths ``size`` (3,)."""
    volume = float(np.prod(size))
    return _primitive(volume, density, 0.0, box_inertia(1.0, size))


def sphere_properties(radius: float, density: float = 1.0) -> MassProperties:
    """A ball."""
    return _primitive(4.0 / 3.0 * np.pi * radius**3, density, 0.0, np.full(3, 0.4 * radius**2))


def cylinder_properties(radius: float, height: float, density: float = 1.0) -> MassProperties:
    """A cylinder of full length ``height``."""
    across = radius**2 / 4.0 + height**2 / 12.0
    return _primitive(np.pi * radius**2 * height, density, 0.0, np.array([across, across, radius**2 / 2.0]))


def capsule_properties(radius: float, height: float, density: float = 1.0) -> MassProperties:
    """A capsule of total length ``height``, both caps included."""
    length = max(height - 2.0 * radius, 0.0)
    tube, caps = np.pi * radius**2 * length, 4.0 / 3.0 * np.pi * radius**3
    volume = tube + caps
    along = 0.5 * tube * radius**2 + 0.4 * caps * radius**2
    across = tube * (length**2 / 12.0 + radius**2 / 4.0)
    across += caps * (0.4 * radius**2 + length**2 / 4.0 + 3.0 / 8.0 * length * radius)
    return _primitive(volume, density, 0.0, np.array([across, across, along]) / volume)


def cone_properties(radius: float, height: float, density: float = 1.0) -> MassProperties:
    """A cone with its apex towards +Z and its origin at half height."""
    across = 3.0 / 80.0 * (4.0 * radius**2 + height**2)
    gyration = np.array([across, across, 0.3 * radius**2])
    return _primitive(np.pi * radius**2 * height / 3.0, density, -height / 4.0, gyration)


def _primitive(volume: float, density: float, z: float, gyration: Array) -> MassProperties:
    """A solid with its centre of mass at ``z`` and moments per mass ``gyration`` (3,)."""
    mass = density * volume
    return MassProperties(float(volume), float(mass), np.array([0.0, 0.0, z]), np.diag(mass * gyration))


def box_inertia(mass: float, size: Array) -> Array:
    """Principal moments (3,), kg m², of a solid box of ``mass`` (kg) with edge lengths ``size`` (3,), metres.

    Bullet estimates the inertia of a compound so, from its bounding box.
    """
    x, y, z = np.asarray(size, dtype=float) ** 2
    return mass / 12.0 * np.array([y + z, x + z, x + y])
