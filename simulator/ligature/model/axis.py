"""One degree of freedom of a joint. Metres or radians; directions in the joint's frame A."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Axis:
    """One degree of freedom: ``direction`` (3,), limits or None, and a spring about ``rest``."""

    prismatic: bool
    direction: Array
    low: float | None = None
    high: float | None = None
    stiffness: float = 0.0
    damping: float = 0.0
    rest: float = 0.0

    @property
    def sprung(self) -> bool:
        """Whether a spring or damper acts."""
        return self.stiffness != 0.0 or self.damping != 0.0

    def reversed(self) -> Axis:
        """The same degree of freedom seen from the child: same coordinate, opposite direction."""
        return Axis(self.prismatic, -self.direction, self.low, self.high, self.stiffness, self.damping, self.rest)
