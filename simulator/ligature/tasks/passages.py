"""When the needle's tip goes through a hole: crossings of the hole's plane, as the suturing challenge counts them.

In the frame of a hole body, z runs along the suture's way: an entry is crossed with z going from positive to negative,
an exit from negative to positive (interface reference §4.6). Metres, seconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.tasks.scenery import Scenery

Array = NDArray[np.float64]

NEAR = 0.005
"""Half side of the box around a hole within which a crossing counts."""


@dataclass(frozen=True)
class Passage:
    """The tip went through hole ``pair`` (counted from 1) at ``time``, ``lateral`` metres beside its middle."""

    time: float
    pair: int
    exit: bool
    lateral: tuple[float, float]

    @property
    def miss(self) -> float:
        """Distance from the hole's middle, in its plane."""
        return float(np.hypot(*self.lateral))


class PassageWatch:
    """Looks at the needle's tip in the frames of all holes, sample by sample."""

    def __init__(self, scenery: Scenery) -> None:
        self._scenery = scenery
        self._holes = [(body, pair, False) for pair, body in enumerate(scenery.entries, 1)]
        self._holes += [(body, pair, True) for pair, body in enumerate(scenery.exits, 1)]
        self._before: dict[int, Array] = {}
        self.passages: list[Passage] = []

    def observe(self, time: float, body_pose: Array) -> None:
        """Take the poses (bodies, 7) of one moment."""
        tip = self._scenery.needle_points(body_pose)[2]
        for body, pair, is_exit in self._holes:
            T = pose7_matrix(body_pose[body])
            local = T[:3, :3].T @ (tip - T[:3, 3])
            before = self._before.get(body)
            self._before[body] = local
            if before is not None and _crossed(before, local, is_exit):
                share = before[2] / (before[2] - local[2])
                at = before + share * (local - before)
                self.passages.append(Passage(time, pair, is_exit, (float(at[0]), float(at[1]))))


def _crossed(before: Array, after: Array, is_exit: bool) -> bool:
    """Whether the plane was crossed in the hole's direction, near its middle."""
    if np.abs(before).max() > NEAR and np.abs(after).max() > NEAR:
        return False
    return bool(before[2] <= 0.0 < after[2]) if is_exit else bool(before[2] >= 0.0 > after[2])
