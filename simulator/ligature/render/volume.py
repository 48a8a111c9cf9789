"""The drawn surface of a volume that plug-ins cut; only the chunks that changed are meshed anew. Frame of the volume.

A mesh, not rays through voxels: rasterised it has the depth, ids, lights and shadows of everything else, for one
sample in each pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ligature.model.scene import Scene
from ligature.model.voxels import Values, VolumeBody
from ligature.render.geometry import Triangles
from ligature.render.visuals import Piece

_Part = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int32]]


class VolumeSurface:
    """The surface of one volume, of which ``piece`` is what the scene draws at the start."""

    def __init__(self, volume: VolumeBody, piece: Piece) -> None:
        self._volume = volume
        self._values: Values = volume.form.values.copy()
        self._parts: list[_Part] = [volume.form.surface(self._values, k) for k in range(len(volume.form.chunks))]
        self._triangles = self._joined()
        # alone in its batch, and closed: none of its back faces is seen
        self.piece = replace(piece, geometry=("volume", id(self)), triangles=self._triangles, closed=True)

    def triangles(self, values: Values) -> Triangles:
        """The surface when the voxels of all volumes have ``values``; the same object for the same voxels."""
        own = values[self._volume.rows].reshape(self._values.shape)
        changed = self._volume.form.changed(self._values, own)
        if changed:
            for chunk in changed:
                self._parts[chunk] = self._volume.form.surface(own, chunk)
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
    """The surfaces of all volumes that plug-ins may cut and that are drawn, of ``pieces`` of the scene."""
    of_body = {piece.owner: piece for piece in pieces}
    return [VolumeSurface(volume, of_body[volume.body]) for volume in scene.volumes if volume.body in of_body]
