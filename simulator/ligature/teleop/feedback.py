"""What the leader's hand feels of the follower's contacts: scaled, bounded, damped, and never more than it put in.

Delay makes reflected forces give energy back that the hand never spent, and the device shakes. A passivity observer
counts the energy that flowed to the hand: a force that stays until the next one does exactly ``F · Δx``. What pushes
the hand along is cut down to the energy that the hand has spent before, and where that was not enough, the hand is
braked (after Hannaford and Ryu, *Time-domain passivity control of haptic interfaces*, IEEE T-RA 18, 2002). Torques are
treated as forces are, with turns in place of ways; each has an account of its own. Newtons, metres, seconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SMOOTHING = 0.01
"""Time constant of the velocity that is damped, in seconds: devices report their places in steps."""

STILL = 1e-6
"""Metres per second below which a hand rests."""


@dataclass(frozen=True)
class FeedbackSettings:
    """``gain`` of forces, ``limit`` in N, ``damping`` of the hand in N·s/m, ``most_damping`` that may brake it.

    Contacts weaker than ``deadband`` N are not felt. ``torque_gain`` is that of torques (0: none are exerted),
    ``torque_limit`` in N·m, ``torque_damping`` in N·m·s/rad, ``most_torque_damping`` that may brake a turn.
    """

    gain: float = 1.0
    limit: float = 3.0
    damping: float = 0.5
    most_damping: float = 30.0
    deadband: float = 0.0
    torque_gain: float = 0.0
    torque_limit: float = 0.1
    torque_damping: float = 0.0005
    most_torque_damping: float = 0.03

    def of_torques(self) -> FeedbackSettings:
        """The same for torques and turns."""
        return FeedbackSettings(self.torque_gain, self.torque_limit, self.torque_damping, self.most_torque_damping)


class Feedback:
    """Forces for the hand; ``energy`` is what the forces gave it so far, in J, negative when it spent some.

    ``step`` are the seconds that count as gone by between two forces; 0: those that have gone by.
    """

    def __init__(self, settings: FeedbackSettings | None = None, step: float = 0.0) -> None:
        self.settings = settings or FeedbackSettings()
        self._step = step
        self.reset()

    def reset(self) -> None:
        """Forget the past, when driving begins."""
        self.energy = 0.0
        self._force = np.zeros(3)
        self._smooth = np.zeros(3)
        self._last: tuple[float, Array] | None = None

    def force(self, contact: Array, place: Array, now: float) -> Array:
        """Force (3,) on the hand, which stays on it until the next call.

        Parameters
        ----------
        contact
            Force (3,) of the world on the follower's tip, in axes of the view.
        place
            Where the hand is (3,), in the same axes.
        now
            Seconds.
        """
        if not (np.isfinite(contact).all() and np.isfinite(place).all()):
            self._force, self._last = np.zeros(3), None
            return self._force.copy()
        velocity, dt = self._observe(place, now)
        settings = self.settings
        felt = contact if np.linalg.norm(contact) >= settings.deadband else np.zeros(3)
        force = self._bounded(settings.gain * felt - settings.damping * self._smooth)
        speed = float(np.linalg.norm(velocity))
        if speed > STILL:
            along = velocity / speed
            most = max(-self.energy / (speed * dt), -settings.most_damping * speed)
            force = self._bounded(force - max(float(force @ along) - most, 0.0) * along)
        self._force = force
        return force.copy()

    def _observe(self, place: Array, now: float) -> tuple[Array, float]:
        """Count what the last force did; the hand's velocity (3,) since, and for how long."""
        last, self._last = self._last, (now, place.copy())
        if last is None or now <= last[0]:
            return np.zeros(3), 0.0
        dt, moved = self._step or now - last[0], place - last[1]
        self.energy += float(self._force @ moved)
        velocity = moved / dt
        self._smooth += (velocity - self._smooth) * min(dt / SMOOTHING, 1.0)
        return velocity, dt

    def _bounded(self, force: Array) -> Array:
        size = float(np.linalg.norm(force))
        return np.asarray(force * (self.settings.limit / size) if size > self.settings.limit else force)
