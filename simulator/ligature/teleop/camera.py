"""The camera driven by one or two hands: as if they held the scene before the operator's eyes.

Poses are matrices (4, 4), metres and radians. The camera frame looks along +z, x to the right, y down.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import axis_rotation, frame

Array = NDArray[np.float64]


class CameraDrive:
    """Moves the camera against the hands; with two of them their connecting line also rolls it.

    ``scale`` is camera metres for a metre of the hands.
    """

    def __init__(self, scale: float = 1.0) -> None:
        self.scale = scale
        self._hands: list[Array] = []
        self._T_world_camera = np.eye(4)

    @property
    def engaged(self) -> bool:
        """Whether hands drive the camera."""
        return bool(self._hands)

    def engage(self, hands: Sequence[Array], T_world_camera: Array) -> None:
        """Begin with the poses (4, 4) of one or two hands in the view; raises ValueError for another number."""
        if len(hands) not in (1, 2):
            raise ValueError(f"one or two hands drive the camera, not {len(hands)}")
        self._hands = [hand.copy() for hand in hands]
        self._T_world_camera = T_world_camera.copy()

    def release(self) -> None:
        """Stop driving."""
        self._hands = []

    def update(self, hands: Sequence[Array]) -> Array:
        """Goal (4, 4) of the camera in the world for new poses of the hands.

        Raises ValueError when their number changed since the start.
        """
        if len(hands) != len(self._hands):
            raise ValueError(f"the camera motion began with {len(self._hands)} hands, not {len(hands)}")
        moved = np.mean([now[:3, 3] - then[:3, 3] for now, then in zip(hands, self._hands, strict=True)], axis=0)
        R = axis_rotation((0.0, 0.0, 1.0), -self._roll(hands))
        return self._T_world_camera @ frame(R, -self.scale * moved)

    def _roll(self, hands: Sequence[Array]) -> float:
        """Angle about the line of sight by which the line between two hands has turned."""
        if len(hands) < 2:
            return 0.0
        before = (self._hands[1] - self._hands[0])[:2, 3]
        after = (hands[1] - hands[0])[:2, 3]
        if min(np.linalg.norm(before), np.linalg.norm(after)) < 1e-3:
            return 0.0
        cross, dot = before[0] * after[1] - before[1] * after[0], float(before @ after)
        return math.atan2(cross, dot)
