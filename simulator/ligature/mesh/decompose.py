"""Convex decomposition of concave meshes with CoACD: for ADF collision meshes, and for moving triangle meshes.

The ADF form is one OBJ file with one material per convex piece, which is how the format marks that
a collision mesh is made of hulls (as in AMBF). Metres. Method: Wei et al.,
"Approximate Convex Decomposition for 3D Meshes with Collision-Aware Concavity and Tree Search", 2022.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
import os
import signal
import subprocess
import time
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.cache import cache_folder, write_atomically
from ligature.mesh.inertia import hull_properties, mass_properties
from ligature.mesh.mesh import Array, Mesh
from ligature.mesh.surface import convex_surface, extent_rank, hull_vertices, joined, open_edges, shells
from ligature.process import program

CONVEX_ENOUGH = 0.02
"""Largest part of its hull's volume by which a solid may fall short of it and still count as convex."""

QUICK: dict[str, Any] = {
    "threshold": 0.15, "max_convex_hull": 16, "resolution": 200, "mcts_iterations": 6, "mcts_max_depth": 1,
    "mcts_nodes": 5, "seed": 0,
}  # fmt: skip
"""Coarse settings for meshes that a scene never decomposed: 4158 triangles in 6 s, CoACD's own take minutes.

They bound the search by iterations, so that the pieces are the same on a busy machine.
"""

SHELL: dict[str, Any] = {name: QUICK[name] for name in ("mcts_iterations", "mcts_max_depth", "mcts_nodes")}
"""Settings of the search for open meshes, which CoACD makes solid as thin shells: three triangles in 1 s.

A shell needs many pieces, and CoACD's own settings search minutes for each.
"""

MOST_SHELLS = 256
"""Most separate pieces of surface that are decomposed: CoACD compares all of them in pairs."""

MOST_FACES = 20000
"""Most triangles that `convex_pieces` hands to CoACD, whose time grows with them; finer meshes are simplified."""

FINEST_GRID = 256
"""Cells along the longest edge of a mesh's box in the first try of `simplified`."""

CPU_LIMIT = 1800
"""Seconds of processor time after which CoACD counts as hanging, so that other load of the machine does not matter."""

PROGRESS_SECONDS = 4.0
"""Seconds between two progress lines of a decomposition."""

_FROM_OUTSIDE = tuple(-s for s in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL, signal.SIGHUP))
_MACHINE_ERRORS = ("ImportError", "ModuleNotFoundError", "MemoryError", "OSError")
"""Ends of CoACD that do not depend on the mesh: another try may do better."""

_log = logging.getLogger(__name__)


class DecompositionError(ValueError):
    """A mesh that cannot be decomposed; the message is the reason.

    ``lasting`` is true when another try would end the same.
    """

    def __init__(self, message: str, lasting: bool = False) -> None:
        super().__init__(message)
        self.lasting = lasting


@dataclass(frozen=True, eq=False)
class Decomposition:
    """Convex pieces, each (n, 3), and how well they fill the mesh.

    ``volume_error`` is ``|sum of hulls − mesh| / mesh`` by volume, None for a mesh that is not closed;
    ``distance`` the Hausdorff distance in metres (see `hausdorff_distance`).
    """

    hulls: tuple[Array, ...]
    volume_error: float | None
    distance: float


def decompose(mesh: Mesh, threshold: float = 0.05, max_hulls: int = -1, seed: int = 0) -> Decomposition:
    """Decompose all triangles of ``mesh``.

    Lower ``threshold`` (0.01 to 1) follows the shape closer; ``max_hulls`` below 1 sets no limit;
    equal arguments give equal pieces. An open mesh is decomposed as a thin shell. Raises `DecompositionError`.
    """
    if not 0.01 <= threshold <= 1.0:
        raise DecompositionError(f"threshold is {threshold:g}; it must be from 0.01 to 1")
    vertices, faces = joined(mesh.parts)
    if not len(faces):
        raise DecompositionError("the mesh holds no triangle")
    settings: dict[str, Any] = {"threshold": threshold, "max_convex_hull": max(max_hulls, 0) or -1, "seed": seed}
    edges = open_edges(faces)
    if edges:
        _log.warning("%s is not closed (%d open edges): it is decomposed as a thin shell", mesh.path, edges)
        settings |= SHELL
    hulls = _cached_hulls(vertices, faces, settings, str(mesh.path))
    from ligature.mesh.quality import hausdorff_distance, volume_error  # compiled; pieces alone do without

    return Decomposition(hulls, volume_error(vertices, faces, hulls), hausdorff_distance(vertices, faces, hulls, seed))


def obj_text(hulls: Sequence[Array], library: str) -> tuple[str, str]:
    """OBJ and MTL text of one material per hull; ``library`` is the MTL file's name."""
    lines = [f"mtllib {library}", "o collision"]
    materials = []
    first = 1
    for number, points in enumerate(hulls):
        corners, faces = convex_surface(points)
        name = f"part_{number:03d}"
        shade = 0.3 + 0.6 * np.random.default_rng(number).random(3)
        materials.append(f"newmtl {name}\nKd {shade[0]:.3f} {shade[1]:.3f} {shade[2]:.3f}\n")
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in corners.tolist()]
        lines.append(f"usemtl {name}")
        lines += [f"f {a} {b} {c}" for a, b, c in (faces + first).tolist()]
        first += len(corners)
    return "\n".join(lines) + "\n", "\n".join(materials)


def convex_pieces(vertices: Array, faces: NDArray[np.int32], source: str = "") -> list[Array]:
    """Convex pieces (n, 3) of a triangle mesh that moves: its hull when that is close, else a decomposition.

    A mesh of more than `MOST_FACES` triangles is simplified first. When CoACD fails, the hull stands for the mesh and
    a warning names its file ``source``.
    """
    whole = hull_vertices(vertices)
    if _convex_enough(vertices, faces):
        return [whole]
    try:
        return list(_cached_hulls(*simplified(vertices, faces), QUICK, source))
    except DecompositionError as error:
        name = source or f"a moving mesh of {len(faces)} triangles"
        _log.warning("%s collides as its convex hull: %s; run 'ligature decompose' on it", name, error)
        return [whole]


def simplified(vertices: Array, faces: NDArray[np.int32], most: int = MOST_FACES) -> tuple[Array, NDArray[np.int32]]:
    """A triangle mesh of at most ``most`` triangles, the same one if it has no more.

    The vertices (n, 3) within each cell of a grid become one at their mean, triangles (m, 3) that collapse or
    coincide go; the grid is made coarser until few enough are left. Method: Rossignac and Borrel, "Multi-resolution
    3D approximations for rendering complex scenes", 1993. Equal arguments give equal bits.
    """
    cells, corners = float(FINEST_GRID), faces
    low = vertices.min(axis=0)
    size = float((vertices.max(axis=0) - low).max())
    points = vertices
    while len(corners) > most:
        places = np.floor((vertices - low) * (cells / size)).astype(np.int64)
        _, cell_of, counts = np.unique(places, axis=0, return_inverse=True, return_counts=True)
        cell_of = cell_of.reshape(-1)
        sums = [np.bincount(cell_of, vertices[:, axis], len(counts)) for axis in range(3)]
        points = np.column_stack(sums) / counts[:, None]
        corners = cell_of[faces]
        a, b, c = corners.T
        corners = corners[(a != b) & (b != c) & (c != a)]
        _, first = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)
        corners = corners[np.sort(first)].astype(np.int32)
        cells *= 0.8
    return points, corners


def _convex_enough(vertices: Array, faces: NDArray[np.int32]) -> bool:
    """Whether a mesh fills its hull, or has no hull with a volume."""
    try:
        hull = hull_properties(vertices).volume
    except ValueError:
        return True
    try:
        return hull - mass_properties(vertices, faces).volume <= CONVEX_ENOUGH * hull
    except ValueError:  # open: its volume is unknown
        return False


def _cached_hulls(
    vertices: Array, faces: NDArray[np.int32], settings: dict[str, Any], source: str
) -> tuple[Array, ...]:
    """The pieces of an earlier run of CoACD with the same arguments, else of a new one."""
    _check_surface(vertices, faces)
    stored = io.BytesIO()
    np.savez(stored, vertices=vertices, faces=faces)
    words = json.dumps(settings, sort_keys=True)
    key = hashlib.sha256(vertices.tobytes() + faces.astype(np.int32).tobytes() + words.encode()).hexdigest()
    path = cache_folder() / "decomposition" / f"{key[:32]}.npz"
    failure = path.with_suffix(".txt")
    hulls = _stored_hulls(path)
    if hulls:
        return hulls
    if failure.is_file():
        reason = failure.read_text("utf-8", "replace")
        raise DecompositionError(f"{reason} (in an earlier run; delete {failure} to try again)")
    name = source or "a mesh"
    _log.warning("decomposing %s, %d triangles, into convex pieces; this is done once", name, len(faces))
    try:
        data = _run_coacd(stored.getvalue(), words, name)
        hulls = _solid_hulls(data)
    except DecompositionError as error:
        if error.lasting:
            _keep(failure, str(error).encode())
        raise
    _keep(path, data)
    return hulls


def _check_surface(vertices: Array, faces: NDArray[np.int32]) -> None:
    """Raise `DecompositionError` for surfaces on which CoACD fails or does not end."""
    if not np.isfinite(vertices).all():
        raise DecompositionError("the mesh has vertices that are not finite")
    if extent_rank(vertices) < 3:
        raise DecompositionError("the mesh is flat: it has no volume to decompose; give it a thickness")
    count = int(shells(len(vertices), faces).max()) + 1
    if count > MOST_SHELLS:
        raise DecompositionError(
            f"the mesh has {count} separate pieces of surface, more than {MOST_SHELLS}; join them, or split the file"
        )


def _keep(path: Path, data: bytes) -> None:
    """Write the pieces to the cache, if it can be written."""
    try:
        write_atomically(path, data)
    except OSError as error:
        _log.warning("%s cannot be written (%s): the mesh will be decomposed again next time", path, error.strerror)


def _stored_hulls(path: Path) -> tuple[Array, ...]:
    """The pieces of a cache file; none when it is absent or damaged."""
    try:
        return _solid_hulls(path.read_bytes())
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return ()


def _solid_hulls(data: bytes) -> tuple[Array, ...]:
    """Corners of the pieces of an npz file, without those that are flat; raises ValueError."""
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        pieces = [np.asarray(arrays[name], dtype=float).reshape(-1, 3) for name in sorted(arrays.files)]
    hulls = []
    for piece in pieces:
        try:
            hulls.append(convex_surface(piece)[0])
        except ValueError:
            continue
    if not hulls:
        raise DecompositionError("CoACD found no piece with a volume", lasting=True)
    return tuple(hulls)


def _run_coacd(mesh: bytes, settings: str, name: str) -> bytes:
    """Content of the npz file of pieces that CoACD makes of the npz file ``mesh``; raises `DecompositionError`.

    Logs a line with the ``name`` of the mesh every few seconds.
    """
    words = (settings, str(os.getpid()), str(CPU_LIMIT))
    status, pieces, error = _wait(program("ligature.mesh.coacd_process", *words), mesh, name)
    if status == -signal.SIGXCPU:
        reason = f"CoACD took longer than {CPU_LIMIT} s of processor time; simplify the mesh"
        raise DecompositionError(reason, lasting=True)
    if status or not pieces:
        lasting = status not in _FROM_OUTSIDE and not error.startswith(_MACHINE_ERRORS)
        raise DecompositionError(f"CoACD ended with status {status}: {error}", lasting)
    return pieces


def _wait(command: Sequence[str], given: bytes | None, name: str) -> tuple[int, bytes, str]:
    """Exit status, output and last line of errors of a command that is given ``given``.

    Pipes, not files: whatever ends this process, nothing is left on the disk.
    """
    begin = time.monotonic()
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe) as process:
        try:
            while True:
                try:
                    output, errors = process.communicate(given, timeout=PROGRESS_SECONDS)
                    break
                except subprocess.TimeoutExpired:
                    given = None  # it goes on being written
                    _log.warning("still decomposing %s after %.0f s", name, time.monotonic() - begin)
        finally:
            process.kill()
    return process.returncode, output, " ".join(errors.decode("utf-8", "replace").strip().splitlines()[-1:])
