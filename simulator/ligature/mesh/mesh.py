"""What a mesh file holds: parts by material, in the mesh's own frame and units (metres by convention)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ligature.adf.diagnostics import AdfError, Diagnostic, Mark, Severity

Array = NDArray[np.float64]
Triple = tuple[float, float, float]

MAX_COORDINATE = 1e6
"""Largest coordinate in metres that a mesh may hold; beyond it Bullet loses all precision."""

MAX_TRIANGLES = 4_000_000
"""Most triangles of one file."""


class MeshError(AdfError):
    """A mesh file that cannot be used; ``diagnostics`` say where and why."""


@dataclass(frozen=True)
class Material:
    """A material of a mesh file; colours 0..1, ``alpha`` 1 is opaque; texture paths may not exist."""

    name: str
    ambient: Triple = (0.3, 0.3, 0.3)
    diffuse: Triple = (0.8, 0.8, 0.8)
    specular: Triple = (0.2, 0.2, 0.2)
    shininess: float = 32.0
    alpha: float = 1.0
    texture: Path | None = None
    normal_map: Path | None = None


@dataclass(frozen=True, eq=False)
class MeshPart:
    """The faces of one material: ``vertices`` (n, 3), ``faces`` (m, 3), per-vertex ``normals``, ``uvs``."""

    name: str
    vertices: Array
    faces: NDArray[np.int32]
    normals: Array | None = None
    uvs: Array | None = None
    material: Material | None = None


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh file: its parts in the order of its materials."""

    path: Path
    parts: tuple[MeshPart, ...]

    @property
    def vertices(self) -> Array:
        """All vertices (n, 3)."""
        return np.vstack([p.vertices for p in self.parts]) if self.parts else np.zeros((0, 3))


def failure(path: Path, message: str, line: int = 1, hint: str = "") -> MeshError:
    """A `MeshError` at a line of ``path``."""
    return MeshError(Diagnostic(Severity.ERROR, message, Mark(path, line, 1), hint, "mesh"))


def checked(vertices: Array, path: Path) -> Array:
    """``vertices`` unchanged, if all are finite and of sane size; raises `MeshError`."""
    if not np.isfinite(vertices).all():
        raise failure(path, "a vertex is not finite", hint="export the mesh again without nan or inf")
    if vertices.size and np.abs(vertices).max() > MAX_COORDINATE:
        raise failure(path, f"a vertex lies farther than {MAX_COORDINATE:g} m from the origin", hint="check the units")
    return vertices
