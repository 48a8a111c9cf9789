"""Voxels of a volume: its values, the metres that they stand for, and its surface in chunks.

The frame of a volume has its origin in the middle of its box; voxels fill the box. Metres.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ligature.mesh.isosurface import MARGIN, part_of_isosurface
from ligature.model.frames import Array

Values = NDArray[np.uint8]

FULL = 255
"""Value of a voxel that is as bright as a picture can be."""

CHUNK, MOST_CHUNKS = 16, 64
"""Least edge of a chunk in voxels, and most chunks of a volume; those of larger volumes have longer edges."""


class Rendering(enum.Enum):
    """How a volume is drawn: its surface as triangles or by rays, or all of it by a transfer function."""

    MESH = "MESH"
    RAYS = "RAYS"
    TRANSFER_FUNCTION = "TRANSFER FUNCTION"


@dataclass(frozen=True, eq=False)
class VolumeLook:
    """How a volume is drawn.

    Parameters
    ----------
    rendering
        By which method.
    sampling
        Samples of a ray for each voxel where there may be something.
    extinction
        Of a place with opacity 1, in 1/m: light falls by a factor e on a way of its inverse.
    transfer
        Points of the transfer function (k, 5), by rising value: value of voxels, 0 to 1, factors on red, green and blue
        of the volume's colour, opacity 0 to 1. Linear between them, level beyond.
    """

    rendering: Rendering = Rendering.RAYS
    sampling: float = 2.0
    extinction: float = 1e3
    transfer: Array = field(default_factory=lambda: np.array([[0.0, 1, 1, 1, 0], [1.0, 1, 1, 1, 1]]))


@dataclass(frozen=True, eq=False)
class VolumeForm:
    """What a volume is at the start of its scene.

    Parameters
    ----------
    values
        Values of the voxels (nx, ny, nz), 0 to `FULL`.
    level
        Voxels of at least this value are inside, above 0 up to `FULL`.
    size
        Edges of the box, (3,) m.
    look
        How it is drawn.
    """

    values: Values
    level: float
    size: Array
    look: VolumeLook = field(default_factory=VolumeLook)

    @property
    def spacing(self) -> Array:
        """Edges of a voxel, (3,) m."""
        edges: Array = self.size / np.array(self.values.shape)
        return edges

    @cached_property
    def axes(self) -> tuple[Array, Array, Array]:
        """Coordinates of the middles of voxels along x, y and z."""
        x, y, z = (
            ((np.arange(n) + 0.5) / n - 0.5) * edge
            for n, edge in zip(self.values.shape, self.size.tolist(), strict=True)
        )
        return x, y, z

    def placed(self, vertices: Array) -> Array:
        """Points (n, 3) from indices of voxels to metres."""
        points: Array = ((vertices + 0.5) / np.array(self.values.shape) - 0.5) * self.size
        return points

    @cached_property
    def chunks(self) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
        """First sample and the one after the last, along the three axes, of the edges that each chunk has."""
        last = np.array(self.values.shape)
        edge = CHUNK
        while np.prod(-(-(last + 1) // edge)) > MOST_CHUNKS:
            edge += 1
        starts = [range(-1, n, edge) for n in last.tolist()]
        ends = last.tolist()
        return tuple((low, tuple(min(a + edge, n) for a, n in zip(low, ends, strict=True))) for low in product(*starts))

    def surface(self, values: Values, chunk: int) -> tuple[Array, Array, NDArray[np.int32]]:
        """Vertices (v, 3) in metres, their normals (v, 3), and faces (t, 3) of a chunk when voxels have ``values``."""
        low, high = self.chunks[chunk]
        vertices, normals, faces = part_of_isosurface(values, self.level, low, high)
        spacing = self.spacing
        if not np.allclose(spacing, spacing[0], rtol=1e-9):  # normals were those of cubes
            normals = normals / spacing
            length = np.linalg.norm(normals, axis=1, keepdims=True)
            normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)
        return self.placed(vertices), normals, faces

    def changed(self, before: Values, after: Values) -> list[int]:
        """The chunks whose surface may differ between two states of the voxels, in order."""
        if np.array_equal(before, after):
            return []
        found = []
        for number, (low, high) in enumerate(self.chunks):
            part = tuple(slice(max(a - MARGIN, 0), b + MARGIN) for a, b in zip(low, high, strict=True))
            if not np.array_equal(before[part], after[part]):
                found.append(number)
        return found


@dataclass(frozen=True, eq=False)
class VolumeBody:
    """A volume of a scene that plug-ins may change: its ``index``, its ``body``, and its ``rows`` of the state."""

    index: int
    body: int
    rows: slice
    form: VolumeForm
