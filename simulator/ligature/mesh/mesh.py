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

REDUCE = "reduce it, in Blender by the modifier Decimate"
DAMAGED = "the file is damaged; export the mesh again"
"""Hints for files that are too large, and for those that no exporter writes."""

MAX_PARTS = 4096
"""Most materials of one file, each of which may become a collision hull."""

MAX_FINDINGS = 50
"""Most findings kept of one file; the first ones report what is wrong with the rest."""


class MeshError(AdfError):
    """A mesh file that cannot be used; ``diagnostics`` give places and reasons."""


@dataclass(frozen=True)
class Material:
    """A material of a mesh file; colours 0..1, ``alpha`` 1 is opaque; texture paths may not exist.

    ``occlusion_map`` is how much ambient light arrives, ``sphere_map`` what a ball of the material looks like.
    ``roughness``, ``metallic`` and ``coat`` (a clear film, of ``coat_roughness``) are None unless the file gives them.
    """

    name: str
    ambient: Triple = (0.3, 0.3, 0.3)
    diffuse: Triple = (0.8, 0.8, 0.8)
    specular: Triple = (0.2, 0.2, 0.2)
    shininess: float = 32.0
    alpha: float = 1.0
    texture: Path | None = None
    normal_map: Path | None = None
    emission: Triple = (0.0, 0.0, 0.0)
    roughness: float | None = None
    metallic: float | None = None
    coat: float | None = None
    coat_roughness: float = 0.1
    roughness_map: Path | None = None
    metallic_map: Path | None = None
    occlusion_map: Path | None = None
    sphere_map: Path | None = None


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
    """A mesh file: its parts in the order of its materials, and what was odd but did not prevent reading.

    ``points`` (n, 3) are the vertices as the file numbers them, None where that is the order of the parts.
    """

    path: Path
    parts: tuple[MeshPart, ...]
    diagnostics: tuple[Diagnostic, ...] = ()
    points: Array | None = None

    @property
    def vertices(self) -> Array:
        """All vertices (n, 3)."""
        return np.vstack([p.vertices for p in self.parts]) if self.parts else np.zeros((0, 3))


LOOK = "look"
"""Code of the findings that matter only where the mesh is drawn."""


class Findings:
    """Collects what is odd about a file, each message once, at most `MAX_FINDINGS`."""

    def __init__(self) -> None:
        self._found: dict[tuple[Path, str], Diagnostic] = {}

    def add(
        self,
        path: Path,
        message: str,
        line: int = 1,
        hint: str = "",
        severity: Severity = Severity.WARNING,
        code: str = "mesh",
    ) -> None:
        """Remember ``message`` about a line of ``path``, unless the same was stated of an earlier line."""
        if len(self._found) < MAX_FINDINGS:
            self._found.setdefault((path, message), Diagnostic(severity, message, Mark(path, line, 1), hint, code))

    def all(self) -> tuple[Diagnostic, ...]:
        """The findings in the order they were made."""
        return tuple(self._found.values())


def failure(path: Path, message: str, line: int = 1, hint: str = "") -> MeshError:
    """A `MeshError` at a line of ``path``."""
    return MeshError(Diagnostic(Severity.ERROR, message, Mark(path, line, 1), hint, "mesh"))


def checked(vertices: Array, path: Path, lines: list[int] | None = None) -> Array:
    """``vertices`` (n, 3) unchanged, if all are finite and of sane size; raises `MeshError`.

    ``lines`` (n,) are the lines of the file that hold them, when the format has lines.
    """
    sane = np.abs(vertices) <= MAX_COORDINATE  # False for nan too
    if sane.all():
        return vertices
    row = int(np.argmin(sane.all(axis=1)))
    line = 1 if lines is None else lines[row]
    if not np.isfinite(vertices[row]).all():
        raise failure(path, "a vertex is not finite", line, "export the mesh again without nan or inf")
    far = f"a vertex lies farther than {MAX_COORDINATE:g} m from the origin"
    raise failure(path, far, line, "check the units")
