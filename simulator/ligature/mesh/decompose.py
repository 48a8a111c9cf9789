"""Convex decomposition of a concave mesh with CoACD, as an ADF-ready collision mesh.

The result is one OBJ with one material per convex part, which is how the format says that a
collision mesh is made of hulls (ADF specification §12.5). Metres.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import coacd
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ligature.mesh.cache import cache_folder
from ligature.mesh.collision import TrianglePart, collision_parts
from ligature.mesh.mesh import Mesh
from ligature.mesh.surface import hull_vertices

Array = NDArray[np.float64]

SAMPLES = 4000
"""Surface points for the distance figure."""


@dataclass(frozen=True, eq=False)
class Decomposition:
    """Convex parts, each (n, 3), and how well they fill the mesh.

    ``volume_error`` is |sum of hulls − mesh| / mesh volume; ``distance`` the largest distance in
    metres from sampled surface points of the hulls to the mesh's surface, relative figures by the
    caller.
    """

    hulls: tuple[Array, ...]
    volume_error: float
    distance: float


def decompose(mesh: Mesh, threshold: float = 0.05, max_hulls: int = -1, seed: int = 0) -> Decomposition:
    """Decompose all triangles of ``mesh``; lower ``threshold`` (0.01 to 1) follows the shape closer."""
    pieces = [p for p in collision_parts(mesh, "trimesh") if isinstance(p, TrianglePart)]
    if not pieces:
        raise ValueError("the mesh holds no triangle")
    offsets = np.cumsum([0] + [len(p.vertices) for p in pieces[:-1]])
    vertices = np.vstack([p.vertices for p in pieces])
    faces = np.vstack([p.faces + o for p, o in zip(pieces, offsets, strict=True)]).astype(np.int32)
    hulls = _cached_hulls(vertices, faces, threshold, max_hulls, seed)
    return Decomposition(hulls, *_quality(vertices, faces, hulls, seed))


def obj_text(hulls: Sequence[Array], library: str) -> tuple[str, str]:
    """OBJ and MTL text of one material per hull; ``library`` is the MTL file's name."""
    lines = [f"mtllib {library}", "o collision"]
    materials = []
    first = 1
    for number, points in enumerate(hulls):
        surface = trimesh.convex.convex_hull(points)
        name = f"part_{number:03d}"
        shade = 0.3 + 0.6 * np.random.default_rng(number).random(3)
        materials.append(f"newmtl {name}\nKd {shade[0]:.3f} {shade[1]:.3f} {shade[2]:.3f}\n")
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in surface.vertices.tolist()]
        lines.append(f"usemtl {name}")
        lines += [f"f {a} {b} {c}" for a, b, c in (surface.faces + first).tolist()]
        first += len(surface.vertices)
    return "\n".join(lines) + "\n", "\n".join(materials)


def _cached_hulls(
    vertices: Array, faces: NDArray[np.int32], threshold: float, max_hulls: int, seed: int
) -> tuple[Array, ...]:
    key = hashlib.sha256(vertices.tobytes() + faces.tobytes() + repr((threshold, max_hulls, seed)).encode())
    path: Path = cache_folder() / "decomposition" / f"{key.hexdigest()[:32]}.npz"
    try:
        with np.load(path, allow_pickle=False) as stored:
            return tuple(stored[name] for name in sorted(stored.files))
    except (OSError, ValueError, KeyError):
        pass
    coacd.set_log_level("error")
    parts = coacd.run_coacd(coacd.Mesh(vertices, faces), threshold=threshold, max_convex_hull=max_hulls, seed=seed)
    hulls = tuple(hull_vertices(np.asarray(v, dtype=float)) for v, _ in parts)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_name(path.name + ".part.npz")
        np.savez(part, **{f"{i:05d}": hull for i, hull in enumerate(hulls)})
        part.replace(path)
    except OSError:
        pass
    return hulls


def _quality(vertices: Array, faces: NDArray[np.int32], hulls: Sequence[Array], seed: int) -> tuple[float, float]:
    whole = trimesh.Trimesh(vertices, faces, process=False)
    solids = [trimesh.convex.convex_hull(h) for h in hulls]
    volume = abs(float(whole.volume))
    filled = sum(abs(float(s.volume)) for s in solids)
    error = abs(filled - volume) / volume if volume > 0 else float("inf")
    surface = trimesh.sample.sample_surface(whole, 4 * SAMPLES, seed=seed)[0]
    probe = trimesh.sample.sample_surface(trimesh.util.concatenate(solids), SAMPLES, seed=seed)[0]
    return error, float(cKDTree(surface).query(probe)[0].max())


CONVEX_ENOUGH = 0.02
"""Largest part of its hull's volume by which a solid may fall short of it and still count as convex."""


def convex_pieces(vertices: Array, faces: NDArray[np.int32]) -> list[Array]:
    """Convex pieces (n, 3) of a triangle mesh that moves: its hull when that is close, else a decomposition."""
    points = hull_vertices(vertices)
    try:
        hull = trimesh.convex.convex_hull(points)
    except Exception:
        return [points]
    solid = trimesh.Trimesh(vertices, faces, process=True)
    if not solid.is_watertight or abs(hull.volume - abs(solid.volume)) <= CONVEX_ENOUGH * hull.volume:
        return [points]
    return list(_cached_hulls(vertices, faces, 0.1, 32, 0))
