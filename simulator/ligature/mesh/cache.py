"""Sanitised collision files by content: what Bullet is given instead of a user's file.

One OBJ file holds one ``o`` group per hull, or one triangle mesh. Files are named by the hash of
their text and written atomically, so that processes may share the folder. Metres.
"""

from __future__ import annotations

import atexit
import contextlib
import errno
import hashlib
import logging
import os
import shutil
import stat
import tempfile
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ligature.mesh.surface import convex_surface

Array = NDArray[np.float64]

VARIABLE = "LIGATURE_CACHE"

_log = logging.getLogger(__name__)


class CacheError(OSError):
    """Nothing can be kept, neither in the cache nor in the system's temporary folder."""


def cache_folder() -> Path:
    """Where everything is kept that is computed once: ``LIGATURE_CACHE``, else ``ligature`` in the user's cache folder.

    Where that cannot be written, a temporary folder that belongs to the user alone takes its place; a warning is
    logged once, and ``LIGATURE_CACHE`` hands the folder on to the processes of a run. Raises `CacheError` where
    there is none either.
    """
    if os.environ.get(VARIABLE):
        return _writable(Path(os.environ[VARIABLE]))
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return _writable(Path(base) / "ligature")


@lru_cache
def _writable(wanted: Path) -> Path:
    try:
        if not wanted.is_absolute() and str(wanted).startswith("~"):
            raise FileNotFoundError(errno.ENOENT, "the user has no home")
        wanted.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=wanted).close()
        return wanted
    except OSError as error:
        try:
            folder = _private_folder()
        except OSError as second:
            raise CacheError(f"neither {wanted} nor a temporary folder can be written: {second}") from second
        _log.warning(
            "%s cannot be written (%s): %s is used; set %s to choose another", wanted, error.strerror, folder, VARIABLE
        )
        os.environ[VARIABLE] = str(folder)
        return folder


def _private_folder() -> Path:
    """The user's own folder among the temporary ones, kept for the next start.

    What lies in it is run as code: where somebody else made it, this process gets one for itself.
    """
    if hasattr(os, "getuid"):
        folder = Path(tempfile.gettempdir()) / f"ligature-{os.getuid()}"
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        status = folder.lstat()
        if stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o077:
            return folder
    return _temporary_folder()


def write_atomically(path: Path, data: bytes) -> None:
    """Make ``path`` hold ``data``; other processes see the old file or the whole new one. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.chmod(name, 0o644)
        os.replace(name, path)
    except OSError:
        os.unlink(name)
        raise


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
                self.folder = _temporary_folder()
                path = _kept(self.folder / name, data)
            except OSError as second:
                raise CacheError(
                    f"collision files cannot be written to {failed} ({error.strerror}) nor to "
                    f"{tempfile.gettempdir()} ({second.strerror}); free some space or set {VARIABLE}"
                ) from second
            _log.warning("%s cannot be written (%s); %s is used until the end", failed, error.strerror, self.folder)
            return path


def _kept(path: Path, data: bytes) -> Path:
    """``path`` holding ``data``, written unless it does already; a damaged file is replaced."""
    try:
        if path.read_bytes() == data:
            return path
    except FileNotFoundError:
        pass
    write_atomically(path, data)
    return path


@lru_cache(maxsize=1)
def _temporary_folder() -> Path:
    folder, owner = tempfile.mkdtemp(prefix="ligature-"), os.getpid()

    def remove() -> None:
        if os.getpid() == owner:
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return Path(folder)


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
    """Corners, and triangles that mention each: Bullet takes the points that faces name and hulls them."""
    try:
        return convex_surface(points)
    except ValueError:
        fan = np.arange(len(points))
        return points, np.column_stack([np.zeros_like(fan), fan, np.roll(fan, -1)]).astype(np.int32)
