"""Answers to geometry questions: ray hits and contact points, as values; world axes, metres."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class RayHits(NamedTuple):
    """Closest hits of n rays: body index or -1, fraction along the ray in 0..1, point and normal (n, 3)."""

    body: NDArray[np.int32]
    fraction: Array
    point: Array
    normal: Array


class Contact(NamedTuple):
    """One contact point of a body with another: signed distance, point and normal (3,) on the other body."""

    body: int
    distance: float
    point: Array
    normal: Array
