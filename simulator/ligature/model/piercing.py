"""Needles and the tissue holes that they pass through, as descriptions; SI units.

Frames as in `ligature.model.scene`: B body frame, I inertial frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Arc:
    """Centre line of a needle in its inertial frame.

    ``centre`` (3,), unit axes ``x`` and ``y`` (3,) of its plane, ``radius``, and angles ``begin`` < ``end`` from x
    towards y; the tip is at ``end``.
    """

    centre: Array
    x: Array
    y: Array
    radius: float
    begin: float
    end: float

    @property
    def length(self) -> float:
        """Length of the centre line."""
        return self.radius * (self.end - self.begin)

    def point(self, depth: float) -> Array:
        """The point (3,) from which ``depth`` metres of needle are left to the tip."""
        angle = self.end - depth / self.radius
        return np.asarray(self.centre + self.radius * (math.cos(angle) * self.x + math.sin(angle) * self.y))


@dataclass(frozen=True, eq=False)
class Needle:
    """A body that pierces tissue: its index in the scene and its centre line in its inertial frame."""

    body: int
    arc: Arc


@dataclass(frozen=True)
class Tissue:
    """How tissue holds what passes through it; None leaves a value to `ligature.suture.holes`.

    ``stiffness`` N/m sideways; ``strength`` N is the sideways force at which tissue tears and the
    puncture moves on; ``friction`` N along what passes; ``drag`` N s/m along it.
    """

    stiffness: float | None = None
    strength: float | None = None
    friction: float | None = None
    drag: float = 10.0


@dataclass(frozen=True, eq=False)
class Hole:
    """A place of a body through which needle and thread pass.

    ``T_body_hole`` (4, 4) is the hole in the body frame B: its opening lies in the xy plane and
    reaches ``half`` (2,) metres to either side. ``ghost`` is the ghost object that marks it.
    """

    index: int
    name: str
    ghost: int
    body: int
    T_body_hole: Array
    half: Array
    tissue: Tissue = Tissue()
