"""What a rod needs of the rigid bodies: their motion and impulses on them; `ligature.physics.World` implements it.

World axes, SI units; poses are x y z qx qy qz qw.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Bodies(Protocol):
    """The rigid bodies around a rod."""

    def motion(self, body: int) -> tuple[Array, Array]:
        """Pose (7,) of a body's inertial frame and its twist (6,), linear part at the centre of mass."""

    def read_motions(self, bodies: NDArray[np.int64], out: Array) -> None:
        """Fill ``out`` (n, 13) with what `motion` returns of ``bodies`` (n,): poses, then twists."""

    def driven(self, body: int) -> bool:
        """Whether a body is kinematically controlled: a command moves it against all forces."""

    def apply_impulse(self, body: int, impulse: Array, moment: Array) -> None:
        """Change the momentum of a body by ``impulse`` (3,) at its centre of mass and ``moment`` (3,)."""


class HeldBodies(Bodies, Protocol):
    """The rigid bodies in tissue, and those that the tissue belongs to."""

    def mobility(self, body: int) -> Array:
        """Change (6, 6) of a body's twist for a unit of impulse and moment at its centre of mass, at the start."""

    def attached_load(self, body: int) -> tuple[float, Array, Array]:
        """Mass and inertia (3,) attached to a body, and the load (6,) on it in the coming tick besides gravity.

        The load acts at its centre of mass.
        """


class Masses(Protocol):
    """Masses of bodies, larger while they are held, see `ligature.physics.masses`."""

    def mass_of(self, body: int) -> tuple[float, Array]:
        """Mass and principal moments (3,) of a body."""

    def is_held(self, body: int) -> bool:
        """Whether something holds a body, so that it does not fall."""


class SutureBodies(HeldBodies, Protocol):
    """The rigid bodies around threads and holes of a scene, and how heavy they are."""

    @property
    def masses(self) -> Masses:
        """Masses of the bodies."""
