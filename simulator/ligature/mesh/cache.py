"""Sanitised collision files by content: what Bullet is given instead of a user's file.

One OBJ file holds one ``o`` group per hull, or one triangle mesh. Files are named by the hash of
their text and written atomically, so that processes may share the folder. Metres.
"""

from __future__ import annotations

import hashlib
import logging
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ligature.cache import VARIABLE, CacheError, cache_folder, temporary_folder, write_atomically
from ligature.mesh.surface import convex_surface

Array = NDArray[np.float64]

_log = logging.getLogger(__name__)


class CollisionCache:
    """The folder of sanitised collision files.

    When it cannot be written (read-only, full), a temporary folder takes its place until the
    process ends, and a warning is logged once.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = (folder or cache_folder()) / "collision"

    def hulls(self, hulls: Sequence[Array]) -> Path:
        """File with one group per convex hull of the points (n, 3) of ``hulls``; raises `CacheError`."""
        lines: list[str] = []
        first = 1
        for number, points in enumerate(hulls):
            corners, faces = _surface(_finite(points))
            lines.append(f"o hull{number}")
            lines += _vertex_lines(corners)
            lines += _face_lines(faces, first)
            first += len(corners)
        return self._store(lines)

    def triangles(self, vertices: Array, faces: NDArray[np.int32]) -> Path:
        """File with one triangle mesh of ``vertices`` (n, 3) and ``faces`` (m, 3); raises `CacheError`.

        Triangles without area are left out: Bullet would divide by it.
        """
        a, b, c = (_finite(vertices)[faces[:, i]] for i in range(3))
        solid = np.any(np.cross(b - a, c - a) != 0.0, axis=1)
        return self._store(["o mesh", *_vertex_lines(vertices), *_face_lines(faces[solid], 1)])

    def _store(self, lines: list[str]) -> Path:
        data = ("\n".join(lines) + "\n").encode("ascii")
        name = f"{hashlib.sha256(data).hexdigest()[:32]}.obj"
        try:
            return _kept(self.folder / name, data)
        except OSError as error:
            failed = self.folder
            try:
                self.folder = temporary_folder()
                path = _kept(self.folder / name, data)
            except OSError as second:
                raise CacheError(
                    f"collision files cannot be written to {failed} ({error.strerror}) nor to "
                    f"{tempfile.gettempdir()} ({second.strerror}); free some space or set {VARIABLE}"
                ) from second
            _log.warning("%s cannot be written (%s); %s is used until the end", failed, error.strerror, self.folder)
            return path


def _kept(path: Path, data: bytes) -> Path:
    """Write ``data`` to ``path`` unless the file has this content already; returns ``path``."""
    try:
        if path.read_bytes() == data:
            return path
    except FileNotFoundError:
        pass
    write_atomically(path, data)
    return path


def _finite(points: Array) -> Array:
    """``points``, which must be finite: Bullet hangs on what is not."""
    if not np.isfinite(points).all():
        raise ValueError("a collision vertex is not finite")
    return points


def _vertex_lines(points: Array) -> list[str]:
    return [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]


def _face_lines(faces: NDArray[np.int32], first: int) -> list[str]:
    return [f"f {a} {b} {c}" for a, b, c in (faces + first).tolist()]


def _surface(points: Array) -> tuple[Array, NDArray[np.int32]]:
    """Vertices and triangles that use each of them: Bullet builds the hull of the vertices that faces use."""
    try:
        return convex_surface(points)
    except ValueError:
        fan = np.arange(len(points))
        return points, np.column_stack([np.zeros_like(fan), fan, np.roll(fan, -1)]).astype(np.int32)
