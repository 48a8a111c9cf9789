"""Where the numbers of an action and of a state observation stand (`SuturingEnv` has the tables)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

ACTION = 7
"""Numbers of an arm's action."""

STATE, FURTHER = 52, 33
"""Numbers of a state observation of one arm, and of each further one."""

PLACE, TURN, TWIST, TARGET = slice(14, 17), slice(17, 21), slice(21, 27), slice(30, 33)
"""Place, quaternion and twist of what is handled, and the target."""

POSE = slice(PLACE.start, TURN.stop)
"""Place and quaternion together."""

LEFT = 33
"""How far there is to go."""

HELD, MARKS = 49, slice(49, 52)
"""Whether the first arm's jaws hold what is handled; that, the share of the time and the stage."""


class Places(NamedTuple):
    """Where the numbers of an arm begin: joints, jaw and tip; control point; velocities and set-points."""

    joints: int
    control_point: int
    velocities: int


def places(arm: int) -> Places:
    """Where a state observation has the numbers of an arm, by its number."""
    begin = STATE + FURTHER * (arm - 1)
    return Places(begin, begin + 14, begin + 17) if arm else Places(0, 27, 34)


def held_at(arm: int) -> int:
    """Where it has whether the jaws of an arm hold what is handled."""
    return STATE + FURTHER * arm - 1 if arm else HELD


_ANGLES = (0, 1, 3, 4, 5, 6)
"""Joints that turn, and the jaw, among the numbers of an arm."""


def action_width(arms: int) -> int:
    """Numbers of an action of so many arms."""
    return ACTION * arms


def state_width(arms: int) -> int:
    """Numbers of a state observation of so many arms."""
    return STATE + FURTHER * (arms - 1)


def angles(arms: int) -> list[int]:
    """Where a state observation has the angles of joints and jaws."""
    starts = [0, *(STATE + FURTHER * k for k in range(arms - 1))]
    return [start + angle for start in starts for angle in _ANGLES]


def numbers_of(action: Any, shape: tuple[int, ...], what: str) -> NDArray[np.float64]:
    """Actions as a new array of a shape; raises ValueError for what is none, with ``what`` it would be."""
    try:
        found = np.array(action)
        if found.dtype.kind == "O":
            found = found.astype(float)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{what}: {error}") from error
    if found.dtype.kind not in "biuf":
        raise ValueError(f"{what}, not of the type {found.dtype}")
    if found.shape != shape:
        raise ValueError(f"{what}, not of the shape {found.shape}")
    return found.astype(float, copy=False)
