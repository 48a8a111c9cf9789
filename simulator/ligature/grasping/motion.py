"""Motion of rigid bodies at a point; world axes, SI units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """A body at the start of a tick.

    ``pose`` (7,) is that of its inertial frame, ``twist`` (6,) the one after the tick without
    further impulses; ``inverse_mass`` and ``inverse_inertia`` (3,) are zero for a body that impulses do not move.
    """

    pose: Array
    twist: Array
    inverse_mass: float
    inverse_inertia: Array

    def velocity_at(self, point: Array) -> Array:
        """Velocity (3,) of the body's material at ``point`` (3,), and its angular velocity (3,): (6,)."""
        arm = point - self.pose[:3]
        return np.concatenate([self.twist[:3] + np.cross(self.twist[3:], arm), self.twist[3:]])
