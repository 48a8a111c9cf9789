"""What the leader's hand feels of the follower's contacts: scaled, bounded, damped, and never more than it put in.

Delay makes reflected forces give energy back that the hand never spent, and the device shakes. A passivity observer
counts the energy that flowed to the hand, and a controller brakes as much as there is too much of it (Hannaford and
Ryu, *Time-domain passivity control of haptic interfaces*, IEEE T-RA 18, 2002). Newtons, metres, seconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FeedbackSettings:
    """``gain`` of forces, ``limit`` in N, ``damping`` of the hand in N·s/m, ``most_damping`` that may brake it.

    Contacts weaker than ``deadband`` N are not felt.
    """

    gain: float = 1.0
    limit: float = 3.0
    damping: float = 0.5
    most_damping: float = 30.0
    deadband: float = 0.0


class Feedback:
    """Forces for the hand; ``energy`` is what the forces gave it so far, in J, negative when it spent some."""

    def __init__(self, settings: FeedbackSettings | None = None) -> None:
        self.settings = settings or FeedbackSettings()
        self.energy = 0.0

    def reset(self) -> None:
        """Forget the past, when leading begins."""
        self.energy = 0.0

    def force(self, contact: Array, velocity: Array, dt: float) -> Array:
        """Force (3,) on the hand.

        Parameters
        ----------
        contact
            Force (3,) of the world on the follower's tip, in axes of the view.
        velocity
            Velocity (3,) of the hand, in the same axes.
        dt
            Seconds until the next call.
        """
        settings = self.settings
        if not (np.isfinite(contact).all() and np.isfinite(velocity).all()):
            return np.zeros(3)
        felt = contact if np.linalg.norm(contact) >= settings.deadband else np.zeros(3)
        force = settings.gain * felt - settings.damping * velocity
        size = float(np.linalg.norm(force))
        if size > settings.limit:
            force = force * (settings.limit / size)
        power, speed = float(force @ velocity), float(velocity @ velocity)
        surplus = self.energy + power * dt
        if surplus > 0.0 and speed > 1e-12:
            brake = min(surplus / (speed * dt), settings.most_damping)
            force = force - brake * velocity
        self.energy += float(force @ velocity) * dt
        return np.asarray(force)
