"""Forces and torques from a follower's tip to the hand that drives it: axes of the view to those of the device.

Newtons, newton metres, seconds.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.robots.poses import rotation_vector
from ligature.teleop.calibration import Calibration
from ligature.teleop.devices.device import Device
from ligature.teleop.feedback import Feedback, FeedbackSettings
from ligature.teleop.pairing import Hand

Array = NDArray[np.float64]

PERIOD = 0.00095
"""Seconds between two forces at least: a device that reports at 1 kHz gets one for each of its readings."""


def period_of(rate: object) -> float:
    """Seconds between two forces for a rate in Hz that is asked for; `PERIOD` for none, or one that is no rate."""
    if not isinstance(rate, (int, float)) or not 0.0 < rate < 1.0 / PERIOD:
        return PERIOD
    return 0.95 / rate  # a reading that is a little early counts


def step_of(seconds: object) -> float:
    """The fixed step that is asked for; 0, as measured, for none or one that is no length of time."""
    return float(seconds) if isinstance(seconds, (int, float)) and 0.0 < seconds < math.inf else 0.0


class Haptics:
    """What one hand feels, every ``period`` seconds at most; ``step`` as for `Feedback`."""

    def __init__(
        self,
        settings: FeedbackSettings,
        device: Device,
        calibration: Calibration,
        period: float = PERIOD,
        step: float = 0.0,
    ) -> None:
        self._period = period
        self._feedback = Feedback(settings, step)
        self._twisting = Feedback(settings.of_torques(), step) if settings.torque_gain > 0.0 else None
        self._turned, self._R = np.zeros(3), np.eye(3)
        self._device, self._calibration = device, calibration
        self._pressed: float | None = None

    def rest(self) -> None:
        """Press no more."""
        if self._pressed is not None:
            self._pressed = None
            self._device.feel(np.zeros(6))

    def press(self, hand: Hand, contact: Array, extra: Array) -> None:
        """Press with what the tip feels, once for each sample of the hand.

        ``contact`` (6,), force and torque about the tip, is in axes of the view, ``extra`` (6,), which others ask for,
        in the device's.
        """
        if self._pressed is None:
            self._feedback.reset()
            self._turned, self._R = np.zeros(3), hand.T_view_hand[:3, :3]
            if self._twisting is not None:
                self._twisting.reset()
        elif hand.time - self._pressed < self._period:
            return
        self._pressed = hand.time
        force = self._feedback.force(contact[:3], hand.T_view_hand[:3, 3], hand.time)
        torque = np.zeros(3)
        if self._twisting is not None:
            R, self._R = self._R, hand.T_view_hand[:3, :3]
            self._turned = self._turned + rotation_vector(self._R @ R.T)
            torque = self._twisting.force(contact[3:], self._turned, hand.time)
        axes = self._calibration.force_on_device
        self._device.feel(np.concatenate([axes(force), axes(torque)]) + extra)
