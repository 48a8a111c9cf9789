"""Time: that of the simulation, counted in ticks, and that which its work takes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray


@dataclass
class Clock:
    """Ticks since the start and since the last reset, and how many resets there were."""

    tick: int = 0
    since_reset: int = 0
    resets: int = 0

    def advance(self, ticks: int = 1) -> None:
        """``ticks`` went by."""
        self.tick += ticks
        self.since_reset += ticks

    def restart(self) -> None:
        """The scene was reset."""
        self.since_reset = 0
        self.resets += 1

    def set(self, other: Clock) -> None:
        """Continue from the counts of another clock."""
        self.tick, self.since_reset, self.resets = other.tick, other.since_reset, other.resets

    def write(self, fields: Sequence[NDArray[Any]], dt: float, ticks_per_update: int) -> None:
        """Write counts and time to the fields tick, update, resets and sim_time of a record, (1,) each."""
        tick, update, resets, sim_time = fields
        tick[0], resets[0], sim_time[0] = self.tick, self.resets, self.tick * dt
        update[0] = self.tick // ticks_per_update


class Stopwatch:
    """Adds up the time of what is done within it; time never flows into the simulation."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._start = 0.0

    def __enter__(self) -> None:
        self._start = time.perf_counter()

    def __exit__(self, *exception: object) -> None:
        self.seconds += time.perf_counter() - self._start
