"""Impulses on bodies from what is solved beside Bullet: rods, tissue holes, grasps. World axes, SI units."""

from __future__ import annotations

from collections.abc import Set
from typing import Any

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
        self._total = np.zeros((len(engine.scene.bodies), 6))
        self._bodies: set[int] = set()

    @property
    def bodies(self) -> Set[int]:
        """The bodies that impulses act on in the coming tick so far."""
        return self._bodies

    def apply(self, body: int, impulse: Array, moment: Array) -> None:
        """Change the momentum of a body by ``impulse`` (3,) and ``moment`` (3,).

        A driven body feels it and moves as commanded.
        """
        total = self._total[body]
        if body in self._bodies:
            total[:3] += impulse
            total[3:] += moment
        else:
            self._bodies.add(body)
            total[:3], total[3:] = impulse, moment
        if self._commands.pushable(body):
            self._load(body, impulse, moment)

    def _load(self, body: int, impulse: Array, moment: Array) -> None:
        engine, motions = self._engine, self._engine.motions
        if motions.handle:
            load_body(motions.handle, motions.table, engine.place_table, body, impulse, moment, engine.dt)
        else:
            engine.place_of[body].apply_wrench((np.concatenate([impulse, moment]) / engine.dt).tolist())

    def pending(self, body: int) -> Array:
        """Impulse and moment (6,) that act in the coming tick so far."""
        return self._total[body].copy() if body in self._bodies else np.zeros(6)

    def clear(self) -> None:
        """A tick begins."""
        self._bodies.clear()

    def snapshot(self) -> dict[str, Any]:
        """What lasts from tick to tick."""
        return kept(self, _KEPT)

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        put_back(self, snapshot)


_KEPT = ("_total", "_bodies")
"""Attributes that last from tick to tick."""
