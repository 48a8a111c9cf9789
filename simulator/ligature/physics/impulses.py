"""Impulses on bodies from what is solved beside Bullet: rods, tissue holes, grasps. World axes, SI units."""

from __future__ import annotations

from collections.abc import Sequence, Set
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.subsystem import kept, put_back
from ligature.physics.body_commands import BodyCommands
from ligature.physics.engine import Engine
from ligature.physics.trees import load_body

Array = NDArray[np.float64]


class Impulses:
    """The impulses and moments (6,) of the coming tick by body, about centres of mass.

    Attributes
    ----------
    total
        (bodies, 6) so far.
    acted
        (bodies,) whether there are any; the others' totals are of earlier ticks.
    """

    def __init__(self, engine: Engine, commands: BodyCommands) -> None:
        self._engine, self._commands = engine, commands
        self.total = np.zeros((len(engine.scene.bodies), 6))
        self.acted = np.zeros(len(engine.scene.bodies), np.bool_)

    @property
    def bodies(self) -> Set[int]:
        """The bodies that impulses act on in the coming tick so far."""
        return set(np.flatnonzero(self.acted).tolist())

    def act(self, bodies: Sequence[int]) -> bool:
        """Whether impulses act on one of ``bodies`` in the coming tick so far."""
        return any(self.acted[body] for body in bodies)

    def apply(self, body: int, impulse: Array, moment: Array) -> None:
        """Change the momentum of a body by ``impulse`` (3,) and ``moment`` (3,).

        A driven body feels it and moves as commanded.
        """
        total = self.total[body]
        if self.acted[body]:
            total[:3] += impulse
            total[3:] += moment
        else:
            self.acted[body] = True
            total[:3], total[3:] = impulse, moment
        if self._commands.pushable(body):
            self.load(body, impulse, moment)

    def load(self, body: int, impulse: Array, moment: Array) -> None:
        """Have Bullet apply what is in `total` already."""
        engine, motions = self._engine, self._engine.motions
        if motions.handle:
            load_body(motions.handle, motions.table, engine.place_table, body, impulse, moment, engine.dt)
        else:
            engine.place_of[body].apply_wrench((np.concatenate([impulse, moment]) / engine.dt).tolist())

    def pending(self, body: int) -> Array:
        """Impulse and moment (6,) that act in the coming tick so far."""
        return self.total[body].copy() if self.acted[body] else np.zeros(6)

    def clear(self) -> None:
        """A tick begins."""
        self.acted[:] = False

    def snapshot(self) -> dict[str, Any]:
        """What lasts from tick to tick."""
        return kept(self, _KEPT)

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        put_back(self, snapshot)


_KEPT = ("total", "acted")
"""Attributes that last from tick to tick."""
