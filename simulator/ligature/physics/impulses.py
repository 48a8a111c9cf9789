"""Impulses on bodies from what is solved beside Bullet: rods, tissue holes, grasps. World axes, SI units."""

from __future__ import annotations

from collections.abc import KeysView

import numpy as np
from numpy.typing import NDArray

from ligature.model.subsystem import kept, put_back
from ligature.physics.body_commands import BodyCommands
from ligature.physics.engine import Engine
from ligature.physics.trees import load_body

Array = NDArray[np.float64]


class Impulses:
    """The impulses and moments (6,) of the coming tick by body, about centres of mass."""

    def __init__(self, engine: Engine, commands: BodyCommands) -> None:
        self._engine, self._commands = engine, commands
        self._total: dict[int, Array] = {}

    @property
    def bodies(self) -> KeysView[int]:
        """The bodies that impulses act on in the coming tick so far."""
        return self._total.keys()

    def apply(self, body: int, impulse: Array, moment: Array) -> None:
        """Change the momentum of a body by ``impulse`` (3,) and ``moment`` (3,).

        A driven body feels it and moves as commanded.
        """
        total, given = self._total.get(body), np.concatenate([impulse, moment])
        self._total[body] = given if total is None else total + given
        if self._commands.pushable(body):
            self._load(body, given / self._engine.dt)

    def _load(self, body: int, wrench: Array) -> None:
        engine, motions = self._engine, self._engine.motions
        if motions.handle:
            load_body(motions.handle, motions.table, engine.place_table, body, wrench)
        else:
            engine.place_of[body].load(wrench.tolist())

    def pending(self, body: int) -> Array:
        """Impulse and moment (6,) that act in the coming tick so far."""
        return self._total.get(body, np.zeros(6))

    def clear(self) -> None:
        """A tick begins."""
        self._total.clear()

    def snapshot(self) -> dict[str, dict[int, Array]]:
        """What lasts from tick to tick."""
        return kept(self, _KEPT)

    def restore(self, snapshot: dict[str, dict[int, Array]]) -> None:
        """Continue from `snapshot`."""
        put_back(self, snapshot)


_KEPT = ("_total",)
"""Attributes that last from tick to tick."""
