"""When the needle's tip goes through a hole: crossings of the hole's plane, as the suturing challenge counts them.

In the frame of a hole body, z runs along the suture's way: an entry is crossed with z going from positive to negative,
an exit from negative to positive (as in the suturing challenge). Metres, seconds.
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

REACH = 1.8 * NEAR
"""Distance from a hole within which all of its box is: its corners are √3 half sides away."""


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
        self._holes = [(pair, False) for pair in range(1, len(scenery.entries) + 1)]
        self._holes += [(pair, True) for pair in range(1, len(scenery.exits) + 1)]
        self._bodies = np.array([*scenery.entries, *scenery.exits], dtype=np.int64)
        self._before: tuple[Array, Array, NDArray[np.bool_]] | None = None
        self.passages: list[Passage] = []

    def observe(self, time: float, body_pose: Array) -> None:
        """Take the poses (bodies, 7) of one moment."""
        tip, poses = self._scenery.needle_points(body_pose)[2], body_pose[self._bodies]
        near = ((poses[:, :3] - tip) ** 2).sum(axis=1) < REACH**2
        before, self._before = self._before, (tip, poses, near)
        if before is None:
            return
        for k in np.flatnonzero(near | before[2]).tolist():
            was, now = _in_hole(before[1][k], before[0]), _in_hole(poses[k], tip)
            pair, is_exit = self._holes[k]
            if _crossed(was, now, is_exit):
                share = was[2] / (was[2] - now[2])
                at = was + share * (now - was)
                self.passages.append(Passage(time, pair, is_exit, (float(at[0]), float(at[1]))))


def _in_hole(pose: Array, tip: Array) -> Array:
    """The tip (3,) in the frame of a hole with a ``pose`` (7,)."""
    T = pose7_matrix(pose)
    return np.asarray(T[:3, :3].T @ (tip - T[:3, 3]))


def _crossed(before: Array, after: Array, is_exit: bool) -> bool:
    """Whether the plane was crossed in the hole's direction, near its middle."""
    if np.abs(before).max() > NEAR and np.abs(after).max() > NEAR:
        return False
    return bool(before[2] <= 0.0 < after[2]) if is_exit else bool(before[2] >= 0.0 > after[2])
