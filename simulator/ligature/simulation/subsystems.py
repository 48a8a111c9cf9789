"""Calls the subsystems of a simulation so that one which fails ends neither the run nor the others.

What a subsystem raises is reported. One whose step raises is reset and skipped for a while.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from operator import methodcaller
from typing import Any

from ligature.adf import Diagnostic
from ligature.model.state import StateRecord
from ligature.model.subsystem import Subsystem
from ligature.physics import failed
from ligature.physics.guard import Guard
from ligature.simulation.clock import Clock, Stopwatch

REST = 1000
"""Ticks for which a subsystem that failed is left out, and for which another failure of its kind is not reported."""

Phases = Sequence[tuple[Stopwatch, Sequence[Subsystem]]]
"""Subsystems of a tick, in the order of their steps, with the stopwatch of their phase."""


class Subsystems:
    """All subsystems of a simulation.

    Parameters
    ----------
    subsystems
        They, in the order of their steps.
    clock
        Counts the ticks.
    dt
        Length of a tick in seconds.

    Attributes
    ----------
    problems
        What failed, and what the subsystems reported.
    resting
        Subsystems that are skipped, by their number, and the tick at which each continues.
    """

    def __init__(self, subsystems: Iterable[Subsystem], clock: Clock, dt: float) -> None:
        self._all, self._clock, self._dt = list(subsystems), clock, dt
        self._writers, self._senses, self._reporters = (
            [s for s in self._all if getattr(type(s), name) is not getattr(Subsystem, name)]
            for name in ("write_state", "sense", "take_problems")
        )
        self.problems: list[Diagnostic] = []
        self.resting: dict[int, int] = {}
        self._reported: dict[tuple[str, str], int] = {}

    def __iter__(self) -> Iterator[Subsystem]:
        return iter(self._all)

    def step(self, phases: Phases) -> None:
        """Step the subsystems of ``phases`` of a tick."""
        tick, now = self._clock.since_reset, time.perf_counter()
        for stopwatch, subsystems in phases:
            for subsystem in subsystems:
                if self.resting and self._rests(subsystem):
                    continue
                try:
                    subsystem.step(tick)
                except Exception as error:  # nothing ends a run but its user
                    self.leave_out(subsystem, error)
            begin, now = now, time.perf_counter()
            stopwatch.seconds += now - begin

    def write_state(self, state: StateRecord) -> None:
        """Fill the state record, and take what the subsystems report."""
        self._fill("write_state", self._writers, state)
        for subsystem in self._reporters:
            self.problems += subsystem.take_problems()

    def sense(self, state: StateRecord) -> None:
        """Fill in the sensors' readings of the written state."""
        self._fill("sense", self._senses, state)

    def reset(self, but: Subsystem | None = None) -> None:
        """Reset all, the last one first, ``but`` one."""
        for subsystem in reversed(self._all):
            if subsystem is not but:
                self._attempt(subsystem, "reset")
        self.resting.clear()

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick; the caller copies it."""
        return {"resting": self.resting, **{f"{n}": s.snapshot() for n, s in enumerate(self._all)}}

    def restore(self, parts: dict[str, Any]) -> None:
        """Continue from a copy of a `snapshot`."""
        self.resting = parts["resting"]
        for n, subsystem in reversed(list(enumerate(self._all))):
            subsystem.restore(parts[f"{n}"])

    def leave_out(self, subsystem: Subsystem, error: Exception) -> None:
        """Reset and skip, for a while, a subsystem whose step raised; then it continues without commands."""
        self.report(subsystem, "step", f"it is reset to its start and skipped for {REST * self._dt:g} s", error)
        self._attempt(subsystem, "recover")
        self.resting[self._all.index(subsystem)] = self._clock.tick + REST

    def _rests(self, subsystem: Subsystem) -> bool:
        """Whether a subsystem is skipped in this tick; recovers it in the tick in which it continues."""
        number = self._all.index(subsystem)
        if self.resting.get(number, 0) > self._clock.tick:
            return True
        if self.resting.pop(number, None) is not None:  # Bullet adds up what pushes bodies meanwhile
            self._attempt(subsystem, "recover")
        return False

    def _attempt(self, subsystem: Subsystem, name: str) -> None:
        """Call a method other than `step` of a subsystem; an exception is reported, and the others continue."""
        try:
            getattr(subsystem, name)()
        except Exception as error:
            self.report(subsystem, name, "the simulation continues without it", error)

    def _fill(self, name: str, subsystems: Sequence[Subsystem], state: StateRecord) -> None:
        """Have subsystems write to the record, each by its method ``name``; where one fails the others continue."""
        write = methodcaller(name, state)
        for subsystem in subsystems:
            try:  # here and not in `_attempt`: it is done every update
                write(subsystem)
            except Exception as error:
                self.report(subsystem, name, "the simulation continues without it", error)

    def report(self, part: Subsystem | Guard, name: str, outcome: str, error: Exception) -> None:
        """Report a failure, unless the same method of the same part failed a moment ago."""
        what, now = (type(part).__name__, name), self._clock.tick
        if now >= self._reported.get(what, 0):
            self._reported[what] = now + REST
            self.problems.append(failed(f"'{name}' of {what[0]} failed; {outcome}", error))
