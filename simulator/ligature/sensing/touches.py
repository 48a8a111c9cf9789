"""Contact points and forces for displays, at their rate; world axes, metres and newtons."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.state import MAX_TOUCHES, FieldViews, StateRecord
from ligature.model.subsystem import ALWAYS, Subsystem, kept, put_back
from ligature.sensing.queries import Touchable

LOOK_TICKS = 16
"""Ticks between two readings of watched contacts."""


class Touches(Subsystem):
    """Contact points between bodies while a display watches them."""

    def __init__(self, bodies: Touchable) -> None:
        self._bodies = bodies
        self._watching, self._fields = False, FieldViews("touch_count")
        self._points: NDArray[np.float64] = np.zeros((0, 3))
        self._forces: NDArray[np.float64] = np.zeros((0, 3))

    def watch(self, enabled: bool) -> None:
        """Start or stop reading contacts."""
        self._watching = enabled
        self._empty()

    def _empty(self) -> None:
        self._points, self._forces = np.zeros((0, 3)), np.zeros((0, 3))

    def step(self, tick: int) -> None:
        """Read the contacts of the last step, every `LOOK_TICKS`."""
        if self._watching and (tick + 1) % LOOK_TICKS == 0:
            self._points, self._forces = self._bodies.touches(MAX_TOUCHES)

    def idle_ticks(self, tick: int) -> int:
        """None while a display watches, else always."""
        return 0 if self._watching else ALWAYS

    def write_state(self, state: StateRecord) -> None:
        """Write the contacts of the last reading."""
        (reported,), count = self._fields.of(state), len(self._points)
        if count or reported[0]:
            reported[0] = count
            for name, found in (("touch_point", self._points), ("touch_force", self._forces)):
                state[name][0, :count], state[name][0, count:] = found, 0.0

    def reset(self) -> None:
        """Forget the last reading; measurement continues."""
        self._empty()

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        return kept(self, _KEPT)

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        put_back(self, snapshot)


_KEPT = ("_watching", "_points", "_forces")
