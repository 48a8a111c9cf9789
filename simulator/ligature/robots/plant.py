"""What an arm moves: axes that follow set-points or efforts, real ones in the physics or ideal ones here.

Radians and metres, newton metres and newtons.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

NO_AXES: Integers = np.zeros((0, 2), dtype=np.int64)
"""The axes of the physics of a plant that keeps its own state."""


class Plant(Protocol):
    """Axes that an arm drives; arrays are (n,)."""

    def read(self) -> Array:
        """Positions, velocities and efforts now, (3, n)."""

    def source(self) -> tuple[Array | None, Integers]:
        """Where compiled code finds these, as long as the plant lives.

        Either the plant's own state (3, n), or axes (n, 2) of the physics: the second of each is -1, or that of another
        finger, which shares the opening.
        """

    def servo(self, position: Array, velocity: Array) -> None:
        """Follow set-points that move with ``velocity``."""

    def push(self, effort: Array) -> None:
        """Drive the axes with efforts; zeros let them move freely."""

    def free(self) -> None:
        """Switch the drives off."""

    def place(self, position: Array) -> None:
        """Put the axes somewhere at once, at rest."""

    def reset(self) -> None:
        """The scene was reset."""

    def snapshot(self) -> Any:
        """What lasts from tick to tick and is not part of the physics, for snapshots."""

    def restore(self, snapshot: Any) -> None:
        """Continue from `snapshot`."""


class IdealPlant:
    """Axes without bodies: they are where they should be, and yield to efforts as damped inertias.

    A master arm is simulated so: nothing touches it but the commands of its clients.

    Parameters
    ----------
    lower, upper
        Ends of travel (n,).
    inertia, damping
        Of each axis (n,): kg·m² and N·m·s, or kg and N·s/m.
    """

    def __init__(self, lower: Array, upper: Array, inertia: Array, damping: Array, start: Array) -> None:
        self._lower, self._upper = lower, upper
        self._inertia, self._damping = inertia, damping
        self._state = np.zeros((3, len(start)))
        self._state[0] = start
        self._pushed = False

    def read(self) -> Array:
        """Position, velocity and effort (3, joints)."""
        return self._state

    def source(self) -> tuple[Array | None, Integers]:
        """The state."""
        return self._state, NO_AXES

    def servo(self, position: Array, velocity: Array) -> None:
        """Move to a position and velocity at once."""
        self._pushed = False
        self._state[0], self._state[1], self._state[2] = position, velocity, 0.0

    def push(self, effort: Array) -> None:
        """Drive by effort from the next step on."""
        self._pushed = True
        self._state[2] = effort

    def free(self) -> None:
        """Stop, without effort."""
        self._pushed = False
        self._state[1:] = 0.0

    def place(self, position: Array) -> None:
        """Stand still at a position."""
        self.free()
        self._state[0] = position

    def reset(self) -> None:
        """Be as at the start of a run, at the position where it is."""
        self.free()

    def snapshot(self) -> Any:
        """What a restore needs."""
        return self._pushed, self._state.copy()

    def restore(self, snapshot: Any) -> None:
        """Be again as in a snapshot."""
        self._pushed = snapshot[0]
        self._state[:] = snapshot[1]

    def step(self, dt: float, load: Array | float = 0.0) -> None:
        """Advance by ``dt`` seconds against a ``load`` (n,): implicit in the damping, stopped at the ends of travel."""
        if not self._pushed:
            return
        q, qd, effort = self._state
        qd[:] = (qd + dt * (effort - load) / self._inertia) / (1.0 + dt * self._damping / self._inertia)
        q += dt * qd
        ended = (q < self._lower) | (q > self._upper)
        qd[ended] = 0.0
        np.clip(q, self._lower, self._upper, out=q)
