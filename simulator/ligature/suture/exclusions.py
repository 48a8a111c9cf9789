"""Which parts of bodies the elements of a rod do not touch. World axes, metres."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.mesh.distance import signed_distance
from ligature.model.frames import pose7_matrix, quaternion_matrix
from ligature.suture.layout import Shapes
from ligature.suture.rod import Rod

Flags = NDArray[np.bool_]

DEEP = 0.005
"""Depth of an element's axis in metres from which contact does not push an attached rod out."""

CHECK_INTERVAL = 50
"""Ticks between two checks whether elements that started inside bodies have left them."""

SAMPLES = (0.0, 0.5, 1.0)
"""Places along an element at which its depth is measured."""


class Exclusions:
    """The pairs of parts and elements of one rod that do not collide: three reasons, one table.

    Parameters
    ----------
    rod, shapes
        The rod, and the parts as it sees them; what `Shapes.skip` holds now belongs to the scene and stays.

    Attributes
    ----------
    of_scene
        (parts, n) the pairs that never collide.

    Notes
    -----
    An attached rod that starts deep inside a body is held there, so that contacts and attachment would fight.
    Such pairs do not collide until they have parted, as bodies that joints hold inside each other.
    """

    def __init__(self, rod: Rod, shapes: Shapes) -> None:
        self._rod, self._shapes = rod, shapes
        self.of_scene = shapes.skip.copy()
        self._pads, self._inside = np.zeros((2, *shapes.skip.shape), dtype=np.bool_)
        self._tick = 0

    def step(self) -> list[tuple[int, int, float]]:
        """Look at the start of a run, and later at what has parted; returns part, element, depth of new overlaps."""
        tick, self._tick = self._tick, self._tick + 1
        if tick == 0 and self._rod.description.attachments:
            return self._begin()
        if tick % CHECK_INTERVAL == 0 and self._inside.any():
            for c, e in np.argwhere(self._inside).tolist():
                self._inside[c, e] = self._depth(c, e) > -self._rod.description.radius[e]
            self._write()
        return []

    def _begin(self) -> list[tuple[int, int, float]]:
        rod, shapes = self._rod, self._shapes
        found = []
        for c in np.flatnonzero(shapes.node >= 0).tolist():
            low, high = shapes.box[c]
            near = ((rod.positions > low - DEEP) & (rod.positions < high + DEEP)).all(axis=1)
            for e in np.flatnonzero(near & ~self.of_scene[c]).tolist():
                depth = self._depth(c, e)
                if depth > DEEP:
                    self._inside[c, e] = True
                    found.append((c, e, depth))
        self._write()
        return found

    def _depth(self, part: int, element: int) -> float:
        """How deep the axis of an element is in a part; below 0 outside."""
        rod, shapes = self._rod, self._shapes
        T = pose7_matrix(shapes.pose[part])
        planes = shapes.planes[slice(*shapes.plane_range[part])]
        ends = rod.description.ends[element] @ quaternion_matrix(rod.orientations[element]).T + rod.positions[element]
        normal, deepest = np.zeros(3), -np.inf
        for s in SAMPLES:
            p = (ends[0] + s * (ends[1] - ends[0]) - T[:3, 3]) @ T[:3, :3]
            deepest = max(deepest, -signed_distance(shapes.kind[part], shapes.size[part], planes, p, normal))
        return float(deepest)

    def between_pads(self, parts: slice, elements: Flags | None) -> None:
        """Exclude ``elements`` (n,) from the parts of a jaw; None ends that."""
        self._pads[parts] = False if elements is None else elements
        self._write()

    def _write(self) -> None:
        self._shapes.skip[:] = self.of_scene | self._pads | self._inside

    def restart(self) -> None:
        """Begin anew where the rod is now, between no pads."""
        self._pads[:], self._inside[:], self._tick = False, False, 0
        self._write()

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        return {"pads": self._pads.copy(), "inside": self._inside.copy(), "tick": self._tick}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        self._pads[:], self._inside[:], self._tick = snapshot["pads"], snapshot["inside"], snapshot["tick"]
        self._write()
