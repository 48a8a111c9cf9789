"""What a rod needs of the rigid bodies: motion, and a way to push; `ligature.physics.World` gives it.

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

    def driven(self, body: int) -> bool:
        """Whether a body moves as a command states, whatever pushes it."""

    def apply_impulse(self, body: int, impulse: Array, moment: Array) -> None:
        """Change the momentum of a body by ``impulse`` (3,) at its centre of mass and ``moment`` (3,)."""


class HeldBodies(Bodies, Protocol):
    """The rigid bodies that tissue holds, and those it is part of."""

    def mobility(self, body: int) -> Array:
        """Change (6, 6) of a body's twist for a unit of impulse and moment at its centre of mass, at the start."""

    def attached_load(self, body: int) -> tuple[float, Array, Array]:
        """Mass and inertia (3,) of what holds a body, and what pulls at it in the coming tick besides gravity.

        The pull (6,) is at its centre of mass.
        """


class Masses(Protocol):
    """How bodies resist forces: more while they are held, see `ligature.physics.grips`."""

    def mass_of(self, body: int) -> tuple[float, Array]:
        """Mass and principal moments (3,) of a body."""

    def is_held(self, body: int) -> bool:
        """Whether something holds a body, so that it does not fall."""


class SutureBodies(HeldBodies, Masses, Protocol):
    """The rigid bodies around threads and holes of a scene."""
