"""Bodies outside a rod that it meets, and what they hold of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Partner:
    """A body outside the rod that it may be attached to or touch.

    ``body`` is its index in the scene. The rod does not move ``fixed`` bodies, but they receive its reaction.
    ``gravity`` (3,) is the acceleration that the physics adds to its motion.
    """

    body: int
    mass: float
    inertia: Array
    T_body_inertial: Array
    gravity: Array
    fixed: bool = False


@dataclass(frozen=True, eq=False)
class JawPads:
    """The pads of a jaw that grasp whatever element of a rod passes between them.

    ``points`` (p, 3) are the contact points and ``normal`` (3,) points across them, in the inertial frame of the
    partner ``body``; ``limit`` is the maximum friction force in newtons, shared by the points.
    """

    body: int
    points: Array
    normal: Array
    limit: float

    def is_as(self, other: JawPads) -> bool:
        """Whether they differ from ``other`` pads by the limit at most."""
        return self.body == other.body and self.points is other.points and self.normal is other.normal


@dataclass(frozen=True, eq=False)
class PointConstraint:
    """Holds ``points`` (m, 2, 3), in the inertial frames of ``element`` and of the partner ``body``, together."""

    element: int
    body: int
    points: Array
