"""Threads and the holes that they pass through as one subsystem, since their steps interleave. World axes, SI units."""

from __future__ import annotations

from typing import Any

from ligature.adf import Diagnostic
from ligature.model.scene import Scene
from ligature.model.state import StateRecord
from ligature.model.subsystem import ALWAYS, Subsystem
from ligature.suture.bodies import SutureBodies
from ligature.suture.holes import Holes
from ligature.suture.rods import Rods
from ligature.suture.searching import LOOKED, SEARCHED, SOLVED


class Suture(Subsystem):
    """All rods and tissue holes of a scene, coupled to its rigid bodies.

    Parameters
    ----------
    scene
        The scene with the rods and holes.
    bodies
        Gives motion and masses of the rigid bodies and takes impulses on them; the simulation passes its `World`.
    dt
        Length of a tick in seconds.
    """

    def __init__(self, scene: Scene, bodies: SutureBodies, dt: float) -> None:
        self._bodies = bodies
        self.rods = Rods(scene, dt)
        self.holes = Holes(scene, self.rods, bodies, dt)
        self._idle = not self.rods.rods and self.holes.idle

    def step(self, tick: int) -> None:
        """Exchange impulses between rods, holes and bodies; the coming step of the bodies moves by them."""
        if self._idle:
            return
        self.holes.begin()
        self.rods.step(self._bodies)
        self.holes.end()

    def idle_ticks(self, tick: int) -> int:
        """Always where nothing can ever be done, else none."""
        return ALWAYS if self._idle else 0

    @property
    def coasts(self) -> bool:
        """Whether `step` is what compiled code does with `Rods.tick_tables` and `Holes.search_table`.

        It is until a command comes, something enters a hole or other bodies are near a rod.
        """
        return self._idle or (self.holes.coasts and self.rods.coasts)

    def load_ahead(self) -> None:
        """Prepare what compiled code takes of needles in holes; `conclude` is to follow."""
        self.holes.load_ahead()

    def conclude(self, ticks: int, begun: int) -> None:
        """Take over ``ticks`` of compiled code, and how far another one has ``begun``: 0, `SEARCHED` and so on."""
        solved = begun == SOLVED
        if solved or not begun:
            self.rods.end_pulls()
        if ticks or solved:
            self.rods.conclude()
        if begun and not solved:
            self.holes.look_ahead(followed=begun != SEARCHED)
        if begun == LOOKED:
            self.rods.colliders.look_ahead()

    def write_state(self, state: StateRecord) -> None:
        """Write elements and insertions."""
        self.rods.write_state(state)
        self.holes.write_state(state)

    def reset(self) -> None:
        """Put the rods back to their initial shapes and empty the holes."""
        self.rods.reset()
        self.rods.update_masses(self._bodies.masses)
        self.holes.reset()

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        return {"rods": self.rods.snapshot(), "holes": self.holes.snapshot()}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        self.rods.restore(snapshot["rods"])
        self.holes.restore(snapshot["holes"])

    def take_problems(self) -> list[Diagnostic]:
        """Rods that diverged since the last call."""
        return self.rods.take_problems()
