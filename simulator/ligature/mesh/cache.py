"""Sanitised collision files by content: what Bullet is given instead of a user's file.

One OBJ file holds one ``o`` group per hull, or one triangle mesh. Files are named by the hash of
their text and written atomically, so that processes may share the folder.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

Array = NDArray[np.float64]

VARIABLE = "LIGATURE_CACHE"


def cache_folder() -> Path:
    """``LIGATURE_CACHE``, else ``ligature`` in the user's cache folder."""
    if VARIABLE in os.environ:
        return Path(os.environ[VARIABLE])
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(base) / "ligature"


class CollisionCache:
    """The folder of sanitised collision files; a temporary one when it cannot be written."""

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = _writable((folder or cache_folder()) / "collision")

    def hulls(self, hulls: Sequence[Array]) -> Path:
        """File with one group per convex hull of the points (n, 3) of ``hulls``."""
        lines: list[str] = []
        first = 1
        for number, points in enumerate(hulls):
            lines.append(f"o hull{number}")
            lines += _vertex_lines(points)
            lines += _face_lines(_surface(points), first)
            first += len(points)
        return self._store("\n".join(lines) + "\n")

    def triangles(self, vertices: Array, faces: NDArray[np.int32]) -> Path:
        """File with one triangle mesh of ``vertices`` (n, 3) and ``faces`` (m, 3)."""
        return self._store("\n".join(["o mesh", *_vertex_lines(vertices), *_face_lines(faces, 1)]) + "\n")

    def _store(self, text: str) -> Path:
        data = text.encode("ascii")
        path = self.folder / f"{hashlib.sha256(data).hexdigest()[:32]}.obj"
        if not path.exists():
            handle, name = tempfile.mkstemp(dir=self.folder, suffix=".part")
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            os.replace(name, path)
        return path


def _writable(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return Path(tempfile.mkdtemp(prefix="ligature-collision-"))


def _vertex_lines(points: Array) -> list[str]:
    return [f"v {float(x)!r} {float(y)!r} {float(z)!r}" for x, y, z in points]


def _face_lines(faces: NDArray[np.int32], first: int) -> list[str]:
    return [f"f {a} {b} {c}" for a, b, c in np.asarray(faces) + first]


def _surface(points: Array) -> NDArray[np.int32]:
    """Triangles that mention every point: Bullet takes the points that faces name and hulls them."""
    n = len(points)
    try:
        if n >= 4:
            hull = ConvexHull(points)
            if len(hull.vertices) == n:
                return hull.simplices.astype(np.int32)
    except QhullError:
        pass
    fan = np.arange(n)
    rows = np.column_stack([np.zeros(n, dtype=int), fan, np.roll(fan, -1)])
    return rows.astype(np.int32)
