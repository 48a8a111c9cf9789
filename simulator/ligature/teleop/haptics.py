"""Forces from a follower's tip to the hand that leads it: axes of the view to those of the device. Newtons, seconds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.teleop.calibration import Calibration
from ligature.teleop.devices.device import Device
from ligature.teleop.feedback import Feedback, FeedbackSettings
from ligature.teleop.pairing import Hand

Array = NDArray[np.float64]

SMOOTHING = 0.01
"""Time constant of the hand's velocity, in seconds."""

PERIOD = 0.002
"""Seconds between two forces at least: 500 Hz."""


class Haptics:
    """What one hand feels."""

    def __init__(self, settings: FeedbackSettings, device: Device, calibration: Calibration) -> None:
        self._feedback = Feedback(settings)
        self._device, self._calibration = device, calibration
        self._last: Hand | None = None
        self._velocity = np.zeros(3)
        self._pressed = -np.inf

    def rest(self) -> None:
        """Press no more."""
        if self._last is not None:
            self._last = None
            self._velocity = np.zeros(3)
            self._device.feel(np.zeros(3))

    def press(self, now: float, hand: Hand, contact: Array, extra: Array) -> None:
        """Press with what the tip feels: ``contact`` (3,) in axes of the view, ``extra`` (3,) in the device's."""
        if self._last is None:
            self._feedback.reset()
            self._last, self._pressed = hand, now
        dt = now - self._pressed
        if dt < PERIOD:
            return
        self._pressed = now
        since = hand.time - self._last.time
        if since > 0.0:
            velocity = (hand.T_view_hand[:3, 3] - self._last.T_view_hand[:3, 3]) / since
            self._velocity += (velocity - self._velocity) * min(since / SMOOTHING, 1.0)
            self._last = hand
        force = self._feedback.force(contact, self._velocity, dt)
        self._device.feel(self._calibration.force_on_device(force) + extra)
