"""Ends of travel of a scene's joints, in radians or metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ligature.model.scene import Scene

Array = NDArray[np.float64]


def travel(scene: Scene, joints: Sequence[int]) -> Array:
    """Ends of travel (2, n) of the joints of a scene."""
    low = [scene.joints[j].low for j in joints]
    high = [scene.joints[j].high for j in joints]
    return np.array([[-np.inf if v is None else v for v in low], [np.inf if v is None else v for v in high]])
