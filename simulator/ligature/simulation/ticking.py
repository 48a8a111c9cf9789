"""The tick, by the shortest way: which subsystems step one by one, and which ticks are one compiled call.

Every way gives the same bits; see `ligature.coasting`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ligature.arms import ArmSet
from ligature.coasting import PHASES as COASTED
from ligature.coasting import Coasting
from ligature.model.subsystem import Subsystem
from ligature.physics import Controllers, World
from ligature.simulation.clock import Clock, Stopwatch
from ligature.simulation.parts import Parts
from ligature.simulation.subsystems import Subsystems
from ligature.suture import Suture
from ligature.suture.searching import SOLVED

PHASES = ("control", "suture", "bodies", "sensing", "state")
"""What the time of a tick is spent on, in order."""


class Ticking:
    """Advances a simulation.

    Parameters
    ----------
    parts
        The subsystems by phase.
    subsystems
        Steps them.
    clock
        Counts the ticks.

    Attributes
    ----------
    phases
        Time spent, by `PHASES`.
    coasting
        Advances through ticks in which only bodies and threads have work.
    """

    def __init__(self, parts: Parts, subsystems: Subsystems, clock: Clock) -> None:
        self._world, self._subsystems, self._clock = parts.world, subsystems, clock
        self.phases = {name: Stopwatch() for name in PHASES}
        self.coasting = Coasting(parts.world, parts.suture, parts.grasps, parts.arms)
        stepping = [
            (self.phases[phase], [s for s in subsystems if type(s).step is not Subsystem.step])
            for phase, subsystems in parts.phases.items()
        ]
        (control, controlling), (suture, coupled), *left = stepping
        leaders, controllers = _parted(controlling, Controllers)
        followers, threads = _parted(coupled, Suture)
        self._leading = [(control, leaders)]
        self._unsolved = [(suture, followers), *left]
        self._following = [(suture, coupled), *left]
        self._controlled = [(control, controllers), *self._following]
        """What is left of a tick after leaders, and controllers, and threads have stepped."""
        self._begins = coupled[: len(threads)] == threads
        """Whether threads step next after controllers."""
        self._before_bodies = _never_idle_first(leaders)
        self._after_bodies = _never_idle_first(_parted([s for _, group in self._unsolved for s in group], World)[0])

    def advance(self, ticks: int) -> int:
        """Advance by a tick, or by up to ``ticks`` in which only bodies, threads and jaws have work; returns how many.

        In a tick commands become motor targets and forces, threads and grasps exchange impulses, bodies move.
        """
        tick, step, idle = self._clock.since_reset, self._subsystems.step, 0
        if ticks > 1:
            begins, free = self._left_to_bodies(tick, ticks)
            idle = _idle_ticks(self._before_bodies, tick, min(free + 1, ticks)) if begins else 0
        if not idle:
            step(self._leading)
            begins, free = self._left_to_bodies(tick, 1)  # what has stepped may drive a jaw
        most = min(free, idle or 1)
        begins = begins and self._begins and most < (idle or 1)
        passed, begun = self._coast(most, begins) if most or begins else (0, 0)
        if passed:
            for subsystem in (*self._after_bodies, *(self._before_bodies if idle else ())):
                subsystem.pass_idle(passed)
            self._clock.advance(passed)
            if not begun:
                return passed
        if idle:
            step(self._leading)
        step(self._unsolved if begun == SOLVED else self._following if begun else self._controlled)
        self._clock.advance()
        return passed + 1

    def _left_to_bodies(self, tick: int, most: int) -> tuple[bool, int]:
        """Whether compiled code can begin the tick, and in how many only bodies and threads have work, at most."""
        coasting = self.coasting
        if self._subsystems.resting or not coasting.begins:
            return False, 0
        return True, _idle_ticks(self._after_bodies, tick, most) if coasting.coasts else 0

    def _coast(self, ticks: int, begins: bool) -> tuple[int, int]:
        """Advance by up to ``ticks`` in which only bodies and threads have work, in one call; returns how many.

        Returns also how far another one has begun; see `Coasting.pass_ticks`.
        """
        try:
            passed, begun = self.coasting.pass_ticks(ticks, begins)
        except Exception as error:  # nothing ends a run but its user
            self._subsystems.leave_out(self._world, error)
            passed, begun = 1, 0
        for phase, seconds in zip(COASTED, self.coasting.spent.tolist(), strict=True):
            self.phases[phase].seconds += seconds
        return passed, begun


def _parted(subsystems: Sequence[Subsystem], kind: Any) -> tuple[list[Subsystem], list[Subsystem]]:
    """Subsystems that are not of a kind, and those that are."""
    return [s for s in subsystems if not isinstance(s, kind)], [s for s in subsystems if isinstance(s, kind)]


def _never_idle_first(subsystems: Sequence[Subsystem]) -> list[Subsystem]:
    """Subsystems in the order in which to ask them; arms take the longest to answer."""
    return sorted(subsystems, key=lambda s: (type(s).idle_ticks is not Subsystem.idle_ticks, isinstance(s, ArmSet)))


def _idle_ticks(subsystems: Sequence[Subsystem], tick: int, most: int) -> int:
    """For how many ticks from ``tick`` on all ``subsystems`` are idle, at most."""
    for subsystem in subsystems:
        most = min(most, subsystem.idle_ticks(tick))
        if most < 1:
            return 0
    return most
