"""Clouds of points that are drawn into pictures of a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LARGEST = 64
"""Largest size of a point in pixels."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """``points`` (n, 3) in world axes, their ``colours`` (n, 3), and their ``size`` in pixels."""

    points: NDArray[np.float64]
    colours: NDArray[np.uint8]
    size: int
