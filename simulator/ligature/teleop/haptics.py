"""Forces from a follower's tip to the hand that drives it: axes of the view to those of the device.

Newtons, seconds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.teleop.calibration import Calibration
from ligature.teleop.devices.device import Device
from ligature.teleop.feedback import Feedback, FeedbackSettings
from ligature.teleop.pairing import Hand

Array = NDArray[np.float64]

PERIOD = 0.002
"""Seconds between two forces at least: 500 Hz."""


class Haptics:
    """What one hand feels."""

    def __init__(self, settings: FeedbackSettings, device: Device, calibration: Calibration) -> None:
        self._feedback = Feedback(settings)
        self._device, self._calibration = device, calibration
        self._pressed: float | None = None

    def rest(self) -> None:
        """Press no more."""
        if self._pressed is not None:
            self._pressed = None
            self._device.feel(np.zeros(3))

    def press(self, hand: Hand, contact: Array, extra: Array) -> None:
        """Press with what the tip feels, once for each sample of the hand.

        ``contact`` (3,) is in axes of the view, ``extra`` (3,), which others ask for, in the device's.
        """
        if self._pressed is None:
            self._feedback.reset()
        elif hand.time - self._pressed < PERIOD:
            return
        self._pressed = hand.time
        force = self._feedback.force(contact, hand.T_view_hand[:3, 3], hand.time)
        self._device.feel(self._calibration.force_on_device(force) + extra)
