"""The surface of a volume as a mesh, of which only chunks that were cut are meshed anew. Volume's frame, metres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ligature.model.scene import Scene
from ligature.model.voxels import Values, VolumeForm
from ligature.render.geometry import Triangles
from ligature.render.visuals import Piece

_Part = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int32]]


class VolumeSurface:
    """The surface of one volume, of which ``piece`` is what the scene draws at the start."""

    def __init__(self, form: VolumeForm, rows: slice | None, piece: Piece) -> None:
        self._form, self._rows = form, rows
        self._values: Values = form.values.copy()
        self._parts: list[_Part] = [form.surface(self._values, k) for k in range(len(form.chunks))]
        self._triangles = self._joined()
        # alone in its batch, and closed: none of its back faces is seen
        self.piece = replace(piece, geometry=("volume", id(self)), triangles=self._triangles, closed=True)

    def update(self, values: Values) -> Triangles:
        """The surface when the voxels of all volumes have ``values``; the same object for the same voxels."""
        return self.triangles(values[self._rows].reshape(self._values.shape))

    def triangles(self, own: Values) -> Triangles:
        """The surface when its voxels (nx, ny, nz) are ``own``; the same object for the same voxels."""
        changed = self._form.changed(self._values, own)
        if changed:
            for chunk in changed:
                self._parts[chunk] = self._form.surface(own, chunk)
            self._values[...] = own
            self._triangles = self._joined()
        return self._triangles

    def _joined(self) -> Triangles:
        counts = [len(vertices) for vertices, _, _ in self._parts]
        firsts = np.cumsum([0, *counts[:-1]]).tolist()
        vertices, normals = (np.concatenate([part[k] for part in self._parts]) for k in (0, 1))
        faces = np.concatenate([part[2] + first for part, first in zip(self._parts, firsts, strict=True)])
        return Triangles(vertices, normals, np.zeros((len(vertices), 2)), faces.astype(np.int32))


def volume_surfaces(scene: Scene, pieces: Sequence[Piece]) -> list[VolumeSurface]:
    """The surfaces of all volumes that plug-ins may cut, as far as ``pieces`` of the scene are drawn as meshes."""
    of_body = {piece.owner: piece for piece in pieces}
    return [
        VolumeSurface(volume.form, volume.rows, of_body[volume.body])
        for volume in scene.volumes
        if volume.body in of_body
    ]
