"""Contact points and forces for whoever looks at them, as often as eyes can see; world axes, metres and newtons."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.state import MAX_TOUCHES, StateRecord
from ligature.model.subsystem import Subsystem, kept, put_back
from ligature.sensing.queries import Touchable

LOOK_TICKS = 16
"""Ticks between two looks at contacts that are watched."""


class Touches(Subsystem):
    """Where bodies touch, while that is watched."""

    def __init__(self, bodies: Touchable) -> None:
        self._bodies = bodies
        self._watching = False
        self._points: NDArray[np.float64] = np.zeros((0, 3))
        self._forces: NDArray[np.float64] = np.zeros((0, 3))

    def watch(self, enabled: bool) -> None:
        """Look from now on, or no longer."""
        self._watching = enabled
        self._empty()

    def _empty(self) -> None:
        self._points, self._forces = np.zeros((0, 3)), np.zeros((0, 3))

    def step(self, tick: int) -> None:
        """Look at the contacts of the step that has just been done, every `LOOK_TICKS`."""
        if self._watching and (tick + 1) % LOOK_TICKS == 0:
            self._points, self._forces = self._bodies.touches(MAX_TOUCHES)

    def write_state(self, state: StateRecord) -> None:
        """Write what the last look found."""
        count = len(self._points)
        if count or state["touch_count"][0]:
            state["touch_count"] = count
            for name, found in (("touch_point", self._points), ("touch_force", self._forces)):
                state[name][0, :count], state[name][0, count:] = found, 0.0

    def reset(self) -> None:
        """Nothing was seen yet; watching goes on."""
        self._empty()

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        return kept(self, _KEPT)

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        put_back(self, snapshot)


_KEPT = ("_watching", "_points", "_forces")
