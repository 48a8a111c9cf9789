"""What may be wrong with the numbers of an episode though readers can read it: their rate, numbers that are none."""

from __future__ import annotations

from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

EXACT = 1e-6
"""Seconds by which times may differ from the rate unmentioned: they are rounded."""

MOST_OFF = 0.5
"""Periods by which samples may be off the rate on average, besides an offset that all have. A sample is taken in the
first step after it is due: where steps are no longer than a period, delays spread evenly over less than a period."""


class Pace(NamedTuple):
    """Samples a second by the times of an episode, seconds by which one is off its time, and whether the rate holds."""

    measured: float
    off: float
    holds: bool


def pace(times: NDArray[Any], rate: float) -> Pace:
    """How well ascending ``times`` of samples keep ``rate``."""
    n = len(times)
    off = times - times[:1] - np.arange(n) / rate
    measured = (n - 1) / float(times[-1] - times[0]) if n > 1 else rate
    spread = float(np.abs(off - np.median(off)).mean()) if n else 0.0
    return Pace(measured, float(np.abs(off).max(initial=0.0)), spread <= MOST_OFF / rate + EXACT)


def not_finite(episode: h5py.Group) -> str:
    """Array, sample and value of the first number of an episode that is infinite or none; empty without one."""
    found: list[str] = []

    def look(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if found or not isinstance(item, h5py.Dataset) or item.dtype.kind != "f":
            return
        values = item[:]
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            found.append(f"'{name}' of sample {bad[0][0]} is {values[tuple(bad[0])]}")

    episode.visititems(look)
    return found[0] if found else ""
