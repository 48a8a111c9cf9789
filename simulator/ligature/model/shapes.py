"""Shapes that collide, and looks that are drawn: what the bodies and ghosts of a `Scene` consist of.

Units are metres; a shape's own frame is where its `Collider` places it in the body frame. Everything here is immutable.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Mark

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Box:
    """Box with full edge lengths ``size`` (3,) metres, centred."""

    size: Array


@dataclass(frozen=True, eq=False)
class Sphere:
    """Sphere of ``radius`` metres, centred."""

    radius: float


@dataclass(frozen=True, eq=False)
class Cylinder:
    """Cylinder along local Z, centred; the ADF axis is folded into the shape's pose."""

    radius: float
    height: float


@dataclass(frozen=True, eq=False)
class Capsule:
    """Capsule along local Z, centred; ``height`` is the total length including both caps."""

    radius: float
    height: float


@dataclass(frozen=True, eq=False)
class Cone:
    """Cone along local Z, apex towards +Z, origin at half height."""

    radius: float
    height: float


@dataclass(frozen=True, eq=False)
class Plane:
    """Static half space below the plane n·p = offset; ``normal`` (3,) is a unit vector."""

    normal: Array
    offset: float


@dataclass(frozen=True, eq=False)
class Hull:
    """Convex hull of ``vertices`` (n, 3)."""

    vertices: Array


@dataclass(frozen=True, eq=False)
class TriMesh:
    """Triangle mesh: ``vertices`` (n, 3), ``faces`` (m, 3) of int32 indices; ``source`` is its file, for messages.

    A ``smooth`` one is drawn without edges.
    """

    vertices: Array
    faces: NDArray[np.int32]
    source: str = ""
    smooth: bool = False


Shape = Box | Sphere | Cylinder | Capsule | Cone | Plane | Hull | TriMesh


@dataclass(frozen=True, eq=False)
class Collider:
    """One collision shape of a body, placed at ``T_body_shape`` (4, 4) in the body frame B."""

    shape: Shape
    T_body_shape: Array


# --- looks ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Colour:
    """Material override of an ADF colour block; every component in 0..1, ``alpha`` 1 is opaque."""

    diffuse: tuple[float, float, float] = (0.7, 0.7, 0.7)
    ambient: tuple[float, float, float] = (0.3, 0.3, 0.3)
    specular: tuple[float, float, float] = (1.0, 1.0, 1.0)
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shininess: int = 64
    alpha: float = 1.0


@dataclass(frozen=True)
class ShaderFiles:
    """A shader program named by a scene file at ``mark``; paths are resolved but may not exist."""

    vertex: Path
    fragment: Path
    mark: Mark | None = field(default=None, compare=False)


@dataclass(frozen=True, eq=False)
class Visual:
    """What is drawn for a body or ghost: a mesh file, or primitive shapes in the body frame."""

    mesh: Path | None = None
    low_resolution_mesh: Path | None = None
    scale: float = 1.0
    shapes: tuple[Collider, ...] = ()
    colour: Colour | None = None
    visible: bool = True
    shaders: ShaderFiles | None = None
