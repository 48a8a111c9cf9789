"""What a rod needs of the rigid bodies: their poses, and a way to push them; `ligature.physics.World` gives it.

World axes, SI units; poses are x y z qx qy qz qw of the body frame B.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Bodies(Protocol):
    """The rigid bodies around a rod."""

    def pose7(self, body: int) -> Array:
        """Pose (7,) of a body."""

    def twist6(self, body: int) -> Array:
        """Linear velocity of the centre of mass and angular velocity (6,) of a body."""

    def apply_impulse(self, body: int, impulse: Array, moment: Array) -> None:
        """Change the momentum of a body by ``impulse`` (3,) at its centre of mass and ``moment`` (3,)."""
