"""What a tick is made of: subsystems that step in turn, and keep themselves in snapshots.

`ligature.simulation.Simulation` advances one list of them. All that a subsystem changes in `Subsystem.step` is in its
snapshot; a test walks the attributes of every one and fails on what a restore leaves as it was.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any

import numpy as np

from ligature.adf import Diagnostic
from ligature.model.state import StateRecord

ALWAYS = 2**31
"""More ticks than are ever done in one call."""


class Subsystem(ABC):
    """One part of a running simulation.

    `step` alone changes how the simulation goes on. `write_state` and `sense` are called whenever somebody wants
    to look, however often that is, so they are pure functions of the state.
    """

    def step(self, tick: int) -> None:  # noqa: B027 - some do nothing in a tick
        """Do this part of a tick; ``tick`` counts from the last reset, for what is done every few ticks only."""

    def idle_ticks(self, tick: int) -> int:
        """For how many ticks from ``tick`` on `step` does nothing that `pass_idle` does not, if no command comes."""
        return 0

    def pass_idle(self, ticks: int) -> None:  # noqa: B027
        """Do in one call what `step` would have done in ``ticks`` idle ticks, such as counting time."""

    def write_state(self, state: StateRecord) -> None:  # noqa: B027
        """Write what this part of the simulation is like now."""

    def sense(self, state: StateRecord) -> None:  # noqa: B027
        """Evaluate what follows from the written state of all subsystems, and write it."""

    @abstractmethod
    def reset(self) -> None:
        """Go back to the start of the scene, to the bit; what commands hold on to stays."""

    def recover(self) -> None:
        """Go on after a step that raised: from the start of the scene, and without what commands may have caused it."""
        self.reset()

    @abstractmethod
    def snapshot(self) -> Any:
        """Everything that lasts from tick to tick, as plain data; the caller copies it."""

    @abstractmethod
    def restore(self, snapshot: Any) -> None:
        """Continue from a copy of a `snapshot`, which is now this subsystem's own."""

    def take_problems(self) -> list[Diagnostic]:
        """What went wrong since the last call."""
        return []


def kept(owner: object, names: Iterable[str]) -> dict[str, Any]:
    """The named attributes of ``owner``, for a snapshot."""
    return {name: getattr(owner, name) for name in names}


def put_back(owner: object, values: dict[str, Any]) -> None:
    """Set attributes to what `kept` gave; arrays are filled in place, for compiled code knows their addresses."""
    for name, value in values.items():
        now = getattr(owner, name)
        if isinstance(value, np.ndarray) and isinstance(now, np.ndarray) and now.shape == value.shape:
            now[...] = value
        else:
            setattr(owner, name, value)


def copied(value: Any, memo: dict[int, Any] | None = None) -> Any:
    """A copy of a snapshot that shares nothing that changes with it.

    A snapshot is plain data for the most part, which takes `copy.deepcopy` four times as long. ``memo`` has what was
    copied already of the rest.
    """
    kind, memo = type(value), {} if memo is None else memo
    if kind is np.ndarray:
        return value.copy() if value.dtype != object else copy.deepcopy(value, memo)
    if kind is dict:
        return {key: copied(entry, memo) for key, entry in value.items()}
    if kind in (list, tuple, set):
        return kind([copied(entry, memo) for entry in value])
    return value if kind in _FROZEN else copy.deepcopy(value, memo)


_FROZEN = (float, int, bool, str, bytes, type(None), np.float64, np.int64)
"""Types of values that a copy may share."""
