"""Which parts of bodies the elements of a rod do not touch. World axes, metres."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.suture.layout import Shapes
from ligature.suture.parting import BESIDE
from ligature.suture.rod import Rod

Flags = NDArray[np.bool_]

DEEP = 0.005
"""Depth of an element's axis in metres in a body at the start that is reported."""


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
    What starts inside a body, or was put there, does not collide with it until it has left it once:
    `ligature.suture.parting` draws it out.
    """

    def __init__(self, rod: Rod, shapes: Shapes) -> None:
        self._rod, self._shapes = rod, shapes
        self.of_scene = shapes.skip.copy()
        self._pads, self._inside = np.zeros((2, *shapes.skip.shape), dtype=np.bool_)
        self._never = self.of_scene.copy()
        self._any = False
        self._due, self._waits = np.ones(len(shapes.skip), dtype=np.bool_), True

    def look(self, parts: slice = slice(None)) -> None:
        """Look for overlaps with ``parts`` in the next tick: they, or the rod, were put somewhere."""
        self._due[parts], self._waits = True, True

    @property
    def idle(self) -> bool:
        """Whether `step` does nothing until something is put somewhere."""
        return not (self._waits or self._any)

    def step(self) -> list[tuple[int, int, float]]:
        """Find what is inside bodies after a move, and push it out; returns part, element, depth of deep overlaps."""
        found = self._find() if self._waits else []
        if self._any and self._rod.draw_out(self._never, self._inside):
            self._write()
        return found

    def _find(self) -> list[tuple[int, int, float]]:
        """Flag what is inside the parts that are due; returns what of an attached rod lies deep in them."""
        before = self._inside.copy()
        self._rod.find_inside(self._due, self._inside)
        self._due[:], self._waits = False, False
        self._write()
        if not self._rod.description.attachments:
            return []
        found = [(c, e, self._rod.depth(c, e)) for c, e in np.argwhere(self._inside & ~before).tolist()]
        return [overlap for overlap in found if overlap[2] > DEEP]

    def between_pads(self, parts: slice, elements: Flags | None) -> None:
        """Exclude ``elements`` (n,) from the parts of a jaw; None ends that."""
        wanted = False if elements is None else elements
        if not (self._pads[parts] == wanted).all():
            self._pads[parts] = wanted
            self._write()

    def _write(self) -> None:
        self._any = bool(self._inside.any())
        self._never[:] = self.of_scene | self._pads
        self._shapes.skip[:] = self._never | self._inside
        for k in range(1, BESIDE + 1):
            self._shapes.skip[:, k:] |= self._inside[:, :-k]
            self._shapes.skip[:, :-k] |= self._inside[:, k:]

    def restart(self) -> None:
        """Begin anew where the rod is now, between no pads."""
        self._pads[:], self._inside[:], self._due[:] = False, False, True
        self._waits = True
        self._write()

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        return {"pads": self._pads.copy(), "inside": self._inside.copy(), "due": self._due.copy()}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        self._pads[:], self._inside[:], self._due[:] = snapshot["pads"], snapshot["inside"], snapshot["due"]
        self._waits = bool(self._due.any())
        self._write()
