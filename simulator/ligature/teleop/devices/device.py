"""What every input device gives: readings of a hand and of buttons, and perhaps a force in return.

Devices speak in their own axes, metres and radians; `ligature.teleop.calibration` defines them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import axis_rotation, frame, matrix_pose7

Array = NDArray[np.float64]

STILL = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Reading:
    """A device at ``time`` (s, monotonic): ``pose`` (7,) of the handle, ``grip`` in its own unit, ``buttons`` down."""

    time: float
    pose: Array
    grip: float | None = None
    buttons: Mapping[str, bool] = field(default_factory=dict)


Take = Callable[[Reading], None]


class Device:
    """An input device; readings go to ``take`` on any thread."""

    def __init__(self, take: Take) -> None:
        self.take = take

    def poll(self, now: float) -> None:
        """Called steadily, for devices that do not speak by themselves."""

    def feel(self, wrench: Array) -> None:
        """Press the hand with a force in N and a torque in N·m (6,) in the device's axes, as far as it has motors."""

    def make_ready(self) -> str:
        """Ask for what the device needs before a hand can drive with it; what it waits for, empty when nothing."""
        return ""

    def begin(self) -> None:
        """The hand begins to drive."""

    def turn_to(self, R: Array) -> bool:
        """Turn the handle to an orientation (3, 3) in the device's axes; False for a device that has no motors."""
        return False

    def hold_orientation(self, R: Array) -> None:
        """Keep an orientation (3, 3) in the device's axes while the hand moves, until it begins to drive again."""

    def close(self) -> None:
        """Listen no more."""


class RateHand:
    """A hand that never was: a stick's velocities, integrated.

    ``speed`` (m/s) and ``turn`` (rad/s) are those of a full deflection. A deflected stick that is silent for
    ``timeout`` yields no more readings, as a hand that disappeared; one at rest may be silent.
    """

    def __init__(self, speed: float, turn: float, timeout: float = 0.2, deadband: float = 0.05) -> None:
        self.speed, self.turn, self.timeout, self.deadband = speed, turn, timeout, deadband
        self._T = np.eye(4)
        self._deflection = np.zeros(6)
        self._heard = self._last = -np.inf

    def deflect(self, now: float, deflection: Array) -> None:
        """Set where the stick stands: six numbers from -1 to 1, three ways, then three turns."""
        self._deflection = np.where(np.abs(deflection) <= self.deadband, 0.0, deflection)
        self._heard = now

    def pose(self, now: float) -> Array | None:
        """The hand (7,) at ``now``; None before the stick was heard, or when it is lost."""
        if not np.isfinite(self._heard):
            return None
        if not np.isfinite(self._deflection).all():
            return np.full(7, np.nan)
        moving = bool(self._deflection.any())
        if moving and now - self._heard > self.timeout:
            return None
        dt = min(max(now - self._last, 0.0), 0.05)
        self._last = now
        if moving:
            turn = self.turn * dt * np.clip(self._deflection[3:], -1.0, 1.0)
            angle = float(np.linalg.norm(turn))
            R = axis_rotation(turn / angle, angle) if angle > 0.0 else np.eye(3)
            way = self.speed * dt * np.clip(self._deflection[:3], -1.0, 1.0)
            self._T = frame(R @ self._T[:3, :3], self._T[:3, 3] + way)
        return matrix_pose7(self._T)
