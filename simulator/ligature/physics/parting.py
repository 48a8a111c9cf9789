"""Pushes bodies that were put into each other apart gently.

Bullet takes a fixed share of an overlap back within a tick: bodies that start, or are let go, 50 mm inside each
other leave at 10 m/s. While there is such an overlap, the share is made so small that they part at `PACE`.
"""

from __future__ import annotations

import pybullet

from ligature.physics.engine import Engine

SHARE = 0.2
"""Part of an overlap that Bullet takes back in a tick, its default."""

PACE = 0.2
"""Speed in m/s at which bodies that overlap are pushed apart at most."""

EVERY = 10
"""Ticks between two looks at overlaps while there are deep ones."""


class Parting:
    """The share of contacts of an engine's present client; `begin` after bodies were put somewhere."""

    def __init__(self, engine: Engine) -> None:
        self._engine, self._client, self._dt = engine, engine.client, engine.dt
        self._ticks = 0
        self._share = SHARE
        self.begin()

    def begin(self) -> None:
        """Bodies may overlap from now on: wait a tick for how deep."""
        self._ticks = 1
        self._use(0.0)

    @property
    def watches(self) -> bool:
        """Whether overlaps are looked at in a coming tick."""
        return self._ticks > 0

    def step(self) -> None:
        """A tick is over."""
        if self._ticks == 0:
            return
        self._ticks -= 1
        if self._ticks == 0:
            found = pybullet.getContactPoints(physicsClientId=self._client)
            deepest = -min((point[8] for point in found), default=0.0)
            self._use(min(SHARE, PACE * self._dt / max(deepest, 1e-9)))
            self._ticks = EVERY if self._share < SHARE else 0

    def _use(self, share: float) -> None:
        if share != self._share:
            self._share = share
            pybullet.setPhysicsEngineParameter(contactERP=share, physicsClientId=self._client)
            self._engine.motions.rouse_all()

    def snapshot(self) -> tuple[int, float]:
        """What lasts from tick to tick."""
        return self._ticks, self._share

    def restore(self, snapshot: tuple[int, float]) -> None:
        """Continue from `snapshot`."""
        self._ticks, share = snapshot
        self._use(share)
