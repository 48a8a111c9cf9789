"""Ends of a rod that come off the bodies that they are attached to, as a control-release needle does under a pull."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from ligature.suture.description import FREE, Attachment
from ligature.suture.layout import Joints

Array = NDArray[np.float64]

APART = 1e12
"""Compliance in m/N of the joint of an end that has come off: half a metre apart, it pulls with 5e-13 N."""


class Releases:
    """Which ends of a rod have come off.

    Parameters
    ----------
    joints
        The joints of the rod's chain. That of an end which comes off stays, and bears nothing.
    ends
        Number of the joint, and the attachment, of each end that is attached.
    dt
        Length of a tick in seconds.

    Attributes
    ----------
    off
        Whether each end has come off.
    possible
        Whether an end that is on can come off.
    """

    def __init__(self, joints: Joints, ends: Sequence[tuple[int, Attachment]], dt: float) -> None:
        self._joints, self._ends = joints, tuple(ends)
        self._most = [attachment.release * dt**2 for _, attachment in ends]
        self._whole = [[array[j].copy() for array in self._rows()] for j, _ in ends]
        self.off = (False,) * len(self._ends)
        self.possible = self._remain()

    @property
    def bodies(self) -> list[int]:
        """The bodies whose ends have come off."""
        return [attachment.body for (_, attachment), off in zip(self._ends, self.off, strict=True) if off]

    def look(self) -> None:
        """Let ends come off that were pulled too much in the last tick."""
        pulls = [np.linalg.norm(self._joints.load[j, :3]) for j, _ in self._ends]
        self.set(tuple(off or bool(p > most) for p, most, off in zip(pulls, self._most, self.off, strict=True)))

    def set(self, off: tuple[bool, ...]) -> None:
        """Say which ends are off."""
        before, self.off = self.off, off
        self.possible = self._remain()
        for (j, _), whole, was, now in zip(self._ends, self._whole, before, off, strict=True):
            if was != now:
                parted = (APART, 0.0, 0.0, *FREE, 0.0)
                for array, value, loose in zip((*self._rows(), self._joints.load), (*whole, 0.0), parted, strict=True):
                    array[j] = loose if now else value

    def _remain(self) -> bool:
        return any(isfinite(most) and not off for most, off in zip(self._most, self.off, strict=True))

    def _rows(self) -> tuple[Array, ...]:
        joints = self._joints
        return joints.compliance, joints.stiffness, joints.damping, joints.low, joints.high
