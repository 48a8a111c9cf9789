"""A loop around the jaws of a tool: how long the thread to it is, where the other tool goes, and what knot it makes.

World axes, metres, radians; angles of tables in degrees about the jaws.
"""

from __future__ import annotations

import numpy as np
from ligature.tasks.diagrams import Diagram
from two_arms import DEEP

Array = np.ndarray

FINGER, THINNEST = 0.0042, 0.011
"""Radius of the jaws as the thread goes around them, and of the least circle that the left tool makes."""

BEGIN, END = 60, 420
"""Degrees about the jaws at which the long end begins and ends, from the side where it leaves the vessel."""

SHARES = (((60, 0.88), (270, 0.88), (END, 0.82)), ((60, 0.98), (180, 0.96), (270, 0.90), (END, 0.84)))
"""For each throw: share of the long end's length that its way about the jaws takes, by the angle."""

ASIDE = (
    ((90, 0.0), (180, -0.005), (340, -0.005), (END, 0.006)),
    ((60, 0.006), (150, 0.004), (210, -0.005), (340, -0.005), (END, 0.006)),
)
"""For each throw: metres along the vessel from the loop to the left tool, by the angle: first and last it draws the
loop to the root of the jaws, and between it passes in front of them."""

FAR = 1.0
"""Metres along the shafts at which a thread is closed to see its knot."""


def length_around(anchor: Array, angle: float, radius: float) -> float:
    """Length of a taut thread from ``anchor`` (2,), around jaws at the origin, to ``radius`` at an ``angle``."""
    away = float(np.hypot(*anchor))
    first = np.arctan2(anchor[1], anchor[0]) + np.arccos(FINGER / away)
    last = angle - np.arccos(min(1.0, FINGER / radius))
    if last <= first:
        return float(np.hypot(*(radius * np.array([np.cos(angle), np.sin(angle)]) - anchor)))
    return float(np.sqrt(away**2 - FINGER**2) + FINGER * (last - first) + np.sqrt(max(radius**2 - FINGER**2, 0.0)))


def radius_for(anchor: Array, angle: float, length: float, most: float = 0.045) -> float:
    """Radius, `THINNEST` to ``most``, at which a thread of ``length`` is just taut."""
    radii = np.linspace(THINNEST, most, 200)
    fits = [radius for radius in radii if length_around(anchor, angle, radius) <= length]
    return float(max(fits, default=THINNEST))


def drawn(thread: Array, right: Array, left: Array) -> Diagram:
    """The knot that tools at ``right`` and ``left`` (4, 4) make of a ``thread`` (n, 3) when they draw its ends away.

    The right one takes the first end, the left one holds the last; along their shafts the thread is closed far away. If
    it goes ``n`` times around the right tool, each time nearer to the first end, it is the torus knot (2, 2 n + 1).
    """
    pads = [T[:3, 3] + DEEP * T[:3, 2] for T in (right, left)]
    far = [T[:3, 3] - FAR * T[:3, 2] for T in (right, left)]
    return Diagram.of(np.vstack([far[0], pads[0], thread, pads[1], far[1]]))


def between(table: tuple[tuple[int, float], ...], at: float) -> float:
    """The value of a table of (angle, value) at an angle."""
    return float(np.interp(at, [angle for angle, _ in table], [value for _, value in table]))
