"""Voxels through which rays are marched: the textures that the shader ``march.glsl`` reads. Volume's frame, metres.

A sample is a voxel's value and a distance: how many voxels around it are empty, by which a ray leaps. The distance to
what was there at the start stays right while a burr only takes away, so that a cut writes no more than what it changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import product

import moderngl
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_cdt

from ligature.adf import AdfError, Diagnostic, Severity
from ligature.model.scene import Scene
from ligature.model.voxels import FULL, Rendering, Values, VolumeForm
from ligature.render.geometry import Triangles, box
from ligature.render.programs import Program
from ligature.render.visuals import Piece
from ligature.render.volume import VolumeSurface

VOLUME_UNIT, TRANSFER_UNIT, BEHIND_UNIT = 12, 13, 14
"""Texture units of the voxels, of the transfer function, and of the depth of what is opaque."""

_CORNERS = tuple(product((0, 1), repeat=3))


class VolumeRays:
    """One volume as rays see it; ``piece`` is what the scene draws of it: its box, whose faces look inwards.

    So they do not hide each other, and an eye in the box sees them too.

    Parameters
    ----------
    context
        Where the textures are.
    form
        The voxels at the start, and how they are drawn.
    rows
        Those of the state that are its voxels; None when they never change.
    piece
        What the scene draws of it as a mesh.
    """

    def __init__(self, context: moderngl.Context, form: VolumeForm, rows: slice | None, piece: Piece) -> None:
        self._form, self._rows, self._mesh = form, rows, piece
        self.opaque = form.look.rendering is Rendering.RAYS
        self._values = np.pad(form.values, 1)
        self._table = _transfer(form)
        self._busy = self._busy_cells(self._values)
        size = self._values.shape
        self._texture = context.texture3d((size[0], size[1], size[2]), 2)
        self._texture.repeat_x = self._texture.repeat_y = self._texture.repeat_z = False
        self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._transfer = context.texture((FULL + 1, 1), 4, self._table.tobytes(), dtype="f4")
        self._transfer.repeat_x = False
        self._measure()
        inside = box(form.size * (np.array(form.values.shape) + 1.0) / np.array(form.values.shape))
        inside = Triangles(inside.positions, inside.normals, inside.uvs, inside.faces[:, ::-1])
        surface = piece.surface if self.opaque else replace(piece.surface, physical=None)
        self.piece = replace(piece, geometry=("rays", id(self)), triangles=inside, closed=True, surface=surface)

    @property
    def defines(self) -> dict[str, int]:
        """Features of the shaders."""
        return {"MARCHED": 1 if self.opaque else 2}

    def update(self, values: Values) -> None:
        """Show the volume with the voxels of all volumes at ``values``; writes only what changed."""
        if self._rows is None:
            return
        inner = self._values[1:-1, 1:-1, 1:-1]
        own = values[self._rows].reshape(inner.shape)
        changed = own != inner
        if not changed.any():
            return
        part = tuple(_extent(changed.any(axis=others)) for others in ((1, 2), (0, 2), (0, 1)))
        inner[part] = own[part]
        around = tuple(slice(s.start, s.stop + 2) for s in part)  # of the padded values; of cells, one less
        cells = tuple(slice(s.start, s.stop - 1) for s in around)
        fresh = self._busy_cells(self._values[around]) & ~self._busy[cells]
        if fresh.any():
            self._busy[cells] |= fresh
            self._measure()
        else:
            self._write(tuple(slice(s.start + 1, s.stop + 1) for s in part))

    def facets(self) -> Triangles:
        """The surface as triangles, for programs that know no rays."""
        return self._surface.triangles(self._values[1:-1, 1:-1, 1:-1])

    @cached_property
    def _surface(self) -> VolumeSurface:
        return VolumeSurface(self._form, None, self._mesh)

    def bind(self, program: Program, behind: moderngl.Texture | None = None) -> None:
        """Fill the uniforms of ``program`` that are the volume's; ``behind`` is the depth of all that is opaque."""
        counts = np.array(self._values.shape)
        step = 1.0 / self._form.look.sampling
        self._texture.use(VOLUME_UNIT)
        self._transfer.use(TRANSFER_UNIT)
        program.set("uVolume", VOLUME_UNIT)
        program.set("uTransfer", TRANSFER_UNIT)
        program.set("uFromMetres", tuple((1.0 / (self._form.spacing * counts)).tolist()))
        program.set("uLevel", float(self._form.level / FULL))
        program.set("uStep", step)
        program.set("uMost", int(np.ceil(counts.max() / step)) + 2)
        if behind is not None:
            behind.use(BEHIND_UNIT)
            program.set("uBehind", BEHIND_UNIT)

    def _busy_cells(self, values: Values) -> NDArray[np.bool_]:
        """The cells between ``values``, one fewer along each axis, that may be visible."""
        shape = tuple(n - 1 for n in values.shape)
        corners = [values[tuple(slice(c, c + n) for c, n in zip(corner, shape, strict=True))] for corner in _CORNERS]
        low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
        seen = np.arange(FULL + 1) >= self._form.level if self.opaque else self._table[:, 3] > 0.0
        count = np.concatenate([[0], np.cumsum(seen)])
        busy: NDArray[np.bool_] = count[high.astype(np.int64) + 1] > count[low]
        return busy

    def _measure(self) -> None:
        """Compute the distance of each sample to the nearest visible cell, and write all samples."""
        empty = np.ones(self._values.shape, dtype=bool)
        empty[:-1, :-1, :-1] = ~self._busy
        if empty.all():
            self._away = np.full(empty.shape, FULL, dtype=np.uint8)
        else:
            self._away = np.minimum(distance_transform_cdt(empty, "chessboard"), FULL).astype(np.uint8)
        self._write((slice(None), slice(None), slice(None)))

    def _write(self, part: tuple[slice, ...]) -> None:
        samples = np.stack([self._values[part], self._away[part]], axis=-1).transpose(2, 1, 0, 3)
        starts = [s.indices(n)[0] for s, n in zip(part, self._values.shape, strict=True)]
        depth, height, width, _ = samples.shape
        self._texture.write(np.ascontiguousarray(samples).tobytes(), viewport=(*starts, width, height, depth))


def volume_rays(
    context: moderngl.Context, scene: Scene, pieces: Sequence[Piece], problems: list[AdfError]
) -> list[VolumeRays]:
    """The volumes of a scene that rays draw, of ``pieces`` of the scene.

    ``problems`` takes those with more voxels along an edge than a texture may have; they are drawn as meshes.
    """
    of_body = {piece.owner: piece for piece in pieces}
    rows = {volume.body: volume.rows for volume in scene.volumes}
    most = context.info["GL_MAX_3D_TEXTURE_SIZE"] - 2
    found = []
    for body in scene.bodies:
        form = body.volume
        if form is None or form.look.rendering is Rendering.MESH or body.index not in of_body:
            continue
        if max(form.values.shape) > most:
            name, count = body.identity.identifier, max(form.values.shape)
            message = f"volume '{name}' has {count} voxels along an edge, rays take up to {most}: drawn as a mesh"
            problems.append(AdfError(Diagnostic(Severity.WARNING, message, code="render")))
            continue
        found.append(VolumeRays(context, form, rows.get(body.index), of_body[body.index]))
    return found


def _transfer(form: VolumeForm) -> NDArray[np.float32]:
    """Colour and extinction in 1/m by value, (256, 4)."""
    look, values = form.look, np.arange(FULL + 1) / FULL
    columns = [np.interp(values, look.transfer[:, 0], look.transfer[:, k]) for k in range(1, 5)]
    return np.stack([*columns[:3], look.extinction * columns[3]], axis=1).astype("f4")


def _extent(present: NDArray[np.bool_]) -> slice:
    places = np.flatnonzero(present)
    return slice(int(places[0]), int(places[-1]) + 1)
