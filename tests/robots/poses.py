"""What the tests of kinematics compare poses with."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def pose(rows: ArrayLike) -> Array:
    """Pose (4, 4) of its upper three rows."""
    return np.vstack([np.asarray(rows, dtype=float), [0.0, 0.0, 0.0, 1.0]])


def distances(T: Array, other: Array) -> tuple[Array, Array]:
    """Metres and radians between poses (..., 4, 4)."""
    turned = np.linalg.norm(T[..., :3, :3] - other[..., :3, :3], axis=(-2, -1)) / np.sqrt(2.0)
    return np.linalg.norm(T[..., :3, 3] - other[..., :3, 3], axis=-1), 2.0 * np.arcsin(np.minimum(turned / 2.0, 1.0))


def assert_same_pose(T: Array, other: Array, tolerance: float = 1e-9) -> None:
    """Poses (..., 4, 4) agree to ``tolerance`` metres and radians."""
    metres, radians = distances(T, other)
    assert np.max(metres) <= tolerance
    assert np.max(radians) <= tolerance
