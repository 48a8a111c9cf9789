"""Advances bodies, threads and what jaws hold over several ticks in one compiled call: nothing else has work in them.

Calls of Python within a tick cost more than what they compute, for Bullet and the threads evict Python from the caches.
Every other subsystem has stated that it is idle; see `ligature.model.subsystem.Subsystem.idle_ticks`.
"""

from __future__ import annotations

import numpy as np

from ligature.arms import ArmSet
from ligature.coasting.clock import clock
from ligature.coasting.ticks import coast
from ligature.grasping import NOTHING, Grasps
from ligature.physics import World
from ligature.physics.divergence import MAX_SPEED
from ligature.suture import Suture
from ligature.suture.ticking import offer_ticks

PHASES = ("control", "suture", "bodies")
"""Phases of a tick that are timed here, in order."""


class Coasting:
    """Coasts through ticks of one simulation.

    Attributes
    ----------
    spent
        (3,) seconds of the last call, by `PHASES`.
    """

    def __init__(self, world: World, suture: Suture, grasps: Grasps, arms: ArmSet) -> None:
        self._world, self._suture, self._grasps, self._arms, self._dt = world, suture, grasps, arms, world.dt
        self.spent, self._corners, self._clock = np.zeros(len(PHASES)), np.zeros((2, 3)), clock()
        # loads the kernels now: a run would stand still for them
        if suture.rods.rods:
            offer_ticks()
        self._coast(0)

    @property
    def begins(self) -> bool:
        """Whether controllers and threads have no work in the coming tick but what compiled code does."""
        return self._world.begins and self._suture.coasts

    @property
    def coasts(self) -> bool:
        """Whether bodies have none either; `begins` is true."""
        return self._world.coasts

    def pass_ticks(self, ticks: int, begins: bool = False) -> tuple[int, int]:
        """Advance, where `begins` is true, by up to ``ticks`` with the bits of single ticks; returns how many passed.

        Returns also how far another one has begun, whose controllers have acted: 0 is not at all; after `SOLVED`
        grasps and bodies are to follow, else threads, too. Where it ``begins`` on purpose, that is so as a rule.
        """
        self.spent[:] = 0.0
        self._suture.load_ahead()
        passed, begun, sound = self._coast(ticks if self.coasts else 0, begins)
        self._suture.conclude(passed, begun)
        self._world.conclude(sound)
        return passed, begun

    def _coast(self, ticks: int, begins: bool = False) -> tuple[int, int, bool]:
        world, rods, masses = self._world, self._suture.rods, self._world.masses
        threads = (
            world.commands.drives, rods.colliders.table, rods.colliders.indices,
            rods.tick_tables(), self._corners,
        ) if rods.rods else None  # fmt: skip
        return coast(
            *world.always, world.impulses.total, world.impulses.acted, self._suture.holes.search_table,
            *(self._grasps.carried() if ticks else (NOTHING, NOTHING)), masses.laden, masses.lifts,
            self._arms.course_table, self._grasps.look_table, self._clock, self.spent, self._dt, MAX_SPEED, ticks,
            int(begins), threads,
        )  # fmt: skip
