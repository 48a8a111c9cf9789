"""Draw calls: pieces of equal triangles and surface share their buffers and are drawn as instances of one call."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from ligature.render.geometry import Triangles
from ligature.render.legacy import LegacyBuffers
from ligature.render.programs import Program
from ligature.render.rays import VolumeRays
from ligature.render.surface import Surface
from ligature.render.visuals import Piece

Array = NDArray[np.float64]

INSTANCE = np.dtype([("model_view", "f4", (4, 4)), ("ids", "i4", 2)])
"""What the vertex shader knows of an instance; matrices stand column after column, as OpenGL wants them."""

_VERTEX = (("aPosition", 3), ("aNormal", 3), ("aTexCoord", 2), ("aTangent", 4))


STILL_AFTER = 300
"""Moments that something has to stay where it is, down to the last bit, before it stands still."""


class Batch:
    """Buffers of one set of triangles, and the pieces that are drawn with them.

    ``rows`` are its instances among those of all batches.
    """

    def __init__(self, context: moderngl.Context, pieces: Sequence[Piece], surface: Surface, first: int) -> None:
        self._context = context
        self.pieces = tuple(pieces)
        self.surface = surface
        self.closed = pieces[0].closed
        self.shaders = pieces[0].shaders
        self.primitive = pieces[0].primitive
        self.deforms = pieces[0].deforms
        self.marks: Array | None = None
        """Dark places of the surface in world axes, (n, 8) as `Marks.of` has them; None where there never are any."""
        self.rays: VolumeRays | None = None
        """Voxels through which rays draw it; the triangles then only say which pixels to try."""
        self.rows = slice(first, first + len(pieces))
        self._tangents = surface.normal_map is not None
        self._instances = context.buffer(reserve=len(pieces) * INSTANCE.itemsize, dynamic=True)
        self._before = context.buffer(reserve=len(pieces) * 64, dynamic=True)
        self._arrays: dict[tuple[Program, bool], moderngl.VertexArray] = {}
        self._loaded: Triangles | None = None
        self._legacy: LegacyBuffers | None = None
        self._past: moderngl.Buffer | None = None
        self.load(pieces[0].triangles)

    def load(self, triangles: Triangles) -> None:
        """Put ``triangles`` in the buffers, in place when they have the same faces as those that are there."""
        fresh = self._loaded is None or self._loaded.faces is not triangles.faces
        self._loaded = triangles
        data = triangles.interleaved(self._tangents).tobytes()
        if fresh:
            self._vertices = self._context.buffer(data or bytes(4))
            self._indices = self._context.buffer(
                np.ascontiguousarray(triangles.faces, dtype="i4").tobytes() or bytes(4)
            )
            self._some: moderngl.Buffer | None = None
            self._arrays, self._legacy = {}, None
        else:
            self._vertices.write(data)
            if self._legacy is not None:
                self._legacy.load(triangles)

    @property
    def opaque(self) -> bool:
        """Whether nothing behind shines through."""
        return self.surface.opaque and (self.rays is None or self.rays.opaque)

    @property
    def triangles(self) -> Triangles:
        """What is in the buffers."""
        assert self._loaded is not None
        return self._loaded

    def load_past(self, positions: Array) -> None:
        """Put where the vertices (n, 3) were in the picture before in a buffer of their own."""
        data = positions.astype("f4").tobytes()
        if self._past is None:
            self._past = self._context.buffer(data, dynamic=True)
        else:
            self._past.write(data)

    def draw(
        self,
        program: Program,
        instances: NDArray[np.void],
        before: NDArray[np.float32] | None = None,
        faces: NDArray[np.int32] | None = None,
    ) -> None:
        """Draw ``instances`` (n,) of `INSTANCE`; ``before`` (n, 4, 4) are their matrices one frame ago.

        ``faces`` (m, 3) are those of the triangles that are to be drawn, all when not given.
        """
        self._instances.write(instances.tobytes())
        if before is not None:
            self._before.write(before.tobytes())
        if faces is None:
            self.array(program).render(instances=len(instances))
            return
        if self._some is None:
            self._some = self._context.buffer(reserve=self._indices.size, dynamic=True)
        self._some.write(faces.tobytes())
        self.array(program, self._some).render(instances=len(instances), vertices=faces.size)

    def legacy(self, program: Program) -> moderngl.VertexArray:
        """The buffers bound to the attributes of a scene file's ``program``, which draws one piece at a time."""
        triangles = self.triangles if self.rays is None else self.rays.facets()
        if self._legacy is None or self._legacy.triangles.faces is not triangles.faces:
            self._legacy = LegacyBuffers(self._context, triangles)
        return self._legacy.array(program)

    def array(self, program: Program, indices: moderngl.Buffer | None = None) -> moderngl.VertexArray:
        """The buffers bound to the attributes that ``program`` reads, with all faces or those in ``indices``."""
        key = program, indices is None
        if key not in self._arrays:
            known = program.attributes
            wanted = [(name, size) for name, size in _VERTEX if name != "aTangent" or self._tangents]
            vertex = " ".join(f"{size}f" if name in known else f"{4 * size}x" for name, size in wanted)
            instance = "16f" + (" 2i" if "iIds" in known else " 8x") + "/i"
            content = [
                (self._vertices, vertex, *(name for name, _ in wanted if name in known)),
                (self._instances, instance, "iModelView", *(["iIds"] if "iIds" in known else [])),
            ]
            if "iBefore" in known:
                content.append((self._before, "16f/i", "iBefore"))
            if "aBefore" in known and self._past is not None:
                content.append((self._past, "3f", "aBefore"))
            linked = program.linked
            self._arrays[key] = self._context.vertex_array(linked, content, index_buffer=indices or self._indices)
        return self._arrays[key]


class Instances:
    """All instances of all batches: whose they are, where on it, and how far they reach."""

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self.owners = np.array([piece.owner for piece in pieces], dtype=np.int64)
        self._T_owner_piece = np.array([piece.T_owner_piece for piece in pieces]).reshape(-1, 4, 4)
        bounds = np.array([_bounding_sphere(piece.triangles) for piece in pieces]).reshape(-1, 4)
        scales = np.linalg.norm(self._T_owner_piece[:, :3, 0], axis=1)
        self._centres, self.radii = bounds[:, :3], bounds[:, 3] * scales
        self._coarse = np.array([{None: 0, False: -1, True: 1}[piece.coarse] for piece in pieces], dtype=np.int8)
        self.ids = np.array([(piece.owner + 1, index + 1) for index, piece in enumerate(pieces)], dtype="i4")
        self.ids = self.ids.reshape(-1, 2)  # a scene may have nothing to see
        self.T_world_piece = np.full((len(pieces), 4, 4), np.nan)
        self._stayed = np.full(len(pieces), STILL_AFTER)  # what has never moved stands still

    @property
    def still(self) -> NDArray[np.bool_]:
        """Which instances stand still."""
        return self._stayed > STILL_AFTER

    @property
    def standing(self) -> Hashable:
        """What stands still, and where."""
        still = self.still
        return still.tobytes(), self.T_world_piece[still].tobytes()

    def place(self, T_world_owner: Array) -> None:
        """Move everything along with its owners (n, 4, 4)."""
        before, self.T_world_piece = self.T_world_piece, T_world_owner[self.owners] @ self._T_owner_piece
        moved = (before != self.T_world_piece).any(axis=(1, 2)) & ~np.isnan(before[:, 0, 0])
        self._stayed = np.where(moved, 0, self._stayed + 1)
        centres = np.einsum("nij,nj->ni", self.T_world_piece[:, :3, :3], self._centres)
        self.world_centres = centres + self.T_world_piece[:, :3, 3]

    def reach(self, row: int, triangles: Triangles) -> None:
        """Take the bounds of instance ``row`` from its new ``triangles``; it does not stand still."""
        self._stayed[row] = 0
        sphere = _bounding_sphere(triangles)
        self._centres[row], self.radii[row] = sphere[:3], sphere[3]
        self.world_centres[row] = self.T_world_piece[row, :3, :3] @ sphere[:3] + self.T_world_piece[row, :3, 3]

    def around(self, mask: NDArray[np.bool_]) -> tuple[Array, float]:
        """Centre (3,) and radius of a sphere in the world about the instances of ``mask``, which is not empty."""
        centres, radii = self.world_centres[mask], self.radii[mask, None]
        low, high = (centres - radii).min(axis=0), (centres + radii).max(axis=0)
        return (low + high) / 2, float(np.linalg.norm(high - low) / 2)

    def seen(self, view: Array, projection: Array, height: int, coarse_below: float) -> Seen:
        """The instances of which something may lie in a frustum; far ones coarse, near ones fine.

        ``coarse_below`` is the radius in pixels of a picture of ``height`` below which the coarse mesh is drawn.
        """
        eye = self.world_centres @ view[:3, :3].T + view[:3, 3]
        planes = projection[3] + np.concatenate([projection[:3], -projection[:3]])
        planes = planes / (np.linalg.norm(planes[:, :3], axis=1, keepdims=True) + 1e-30)
        inside = ((eye @ planes[:, :3].T + planes[:, 3]) > -self.radii[:, None]).all(axis=1)
        depth = -eye[:, 2]
        w = depth if projection[3, 3] == 0.0 else np.ones_like(depth)
        pixels = self.radii * abs(projection[1, 1]) * height / 2 / np.maximum(w, 1e-9)
        inside &= self._coarse * (coarse_below - pixels) >= 0.0
        instances = np.zeros(len(eye), dtype=INSTANCE)
        instances["model_view"] = (view @ self.T_world_piece).swapaxes(1, 2)
        instances["ids"] = self.ids
        return Seen(inside, depth, instances)


class Seen:
    """What a frustum holds: a mask over all instances, the depths of their middles, and their matrices."""

    def __init__(self, mask: NDArray[np.bool_], depth: Array, instances: NDArray[np.void]) -> None:
        self.mask, self.depth, self.instances = mask, depth, instances
        self._rows, self._before = np.flatnonzero(mask), [0, *np.cumsum(mask).tolist()]

    def rows(self, batch: Batch) -> NDArray[np.int64]:
        """Rows of the instances of ``batch`` that are seen."""
        return self._rows[self._before[batch.rows.start] : self._before[batch.rows.stop]]


def _bounding_sphere(triangles: Triangles) -> tuple[float, float, float, float]:
    """Centre and radius of a sphere about the box of ``triangles``; a point where there are none."""
    if not len(triangles.positions):
        return 0.0, 0.0, 0.0, 0.0
    low, high = triangles.positions.min(axis=0), triangles.positions.max(axis=0)
    centre = (low + high) / 2
    radius = float(np.linalg.norm(triangles.positions - centre, axis=1).max())
    return (*map(float, centre), radius)  # type: ignore[return-value]
