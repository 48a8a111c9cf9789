"""Geometry of a throw that is made with instruments: how a long end goes around jaws, and where a short end stands.

A thread (n, 3) lies around a vessel along x; its first elements are the short end, its last ones the long end. World
axes, metres, radians. Frame *tool*: z along the instrument, x along the thread between its jaws, y from pad to pad.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Table = tuple[tuple[int, float], ...]

FINGER, THINNEST = 0.0042, 0.011
"""Radius of the jaws as the thread goes around them, and of the least circle that the other tool makes."""

FARTHEST = 0.06
"""Radius of the greatest one."""

BEGIN, FULL, END = 60, 380, 420
"""Degrees about the jaws at which the long end begins, is around them, and ends, from the side where it leaves the
vessel."""

SHARES: Table = ((BEGIN, 0.95), (180, 0.95), (270, 0.88), (END, 0.82))
"""Share of the long end's length that its way about the jaws takes, by the angle."""

ASIDE: Table = ((BEGIN, 0.012), (150, 0.008), (210, -0.006), (340, -0.006), (END, 0.006))
"""Metres along the vessel from the loop to the other tool, by the angle: first and last it draws the loop to the root
of the jaws, and between it passes in front of them."""

BELOW, OVER = 0.015, 0.0075
"""Metres that the other tool keeps below the jaws, and over the vessel."""

BESIDE, KNOT = 1.3, 0.008
"""Radii of the vessel, and metres from its middle, within which a thread lies on it, and in a knot on it."""

WRIST, TIP, FINGERS, ONCE = 0.026, 0.01, 0.001, 1.2 * np.pi
"""Metres behind and before the control point of a tool between which a loop may lie, and from its axis to those of its
fingers, a little open; radians from which the loop goes around."""

APART, TOUCHES = 8, 0.0011
"""Elements between two strands that touch, and metres between their axes."""


def length_around(anchor: Array, angle: float, radius: float) -> float:
    """Length of a taut thread from ``anchor`` (2,), around jaws at the origin, to ``radius`` at an ``angle``."""
    away = float(np.hypot(*anchor))
    first = np.arctan2(anchor[1], anchor[0]) + np.arccos(FINGER / away)
    last = angle - np.arccos(min(1.0, FINGER / radius))
    if last <= first:
        return float(np.hypot(*(radius * np.array([np.cos(angle), np.sin(angle)]) - anchor)))
    return float(np.sqrt(away**2 - FINGER**2) + FINGER * (last - first) + np.sqrt(max(radius**2 - FINGER**2, 0.0)))


def radius_for(anchor: Array, angle: float, length: float, most: float = FARTHEST) -> float:
    """Radius, `THINNEST` to ``most``, at which a thread of ``length`` is just taut."""
    radii = np.linspace(THINNEST, most, 200)
    fits = [radius for radius in radii if length_around(anchor, angle, radius) <= length]
    return float(max(fits, default=THINNEST))


def between(table: Table, at: float) -> float:
    """The value of a table of (angle, value) at an angle."""
    return float(np.interp(at, [angle for angle, _ in table], [value for _, value in table]))


@dataclass(frozen=True)
class Wrap:
    """The way on which a tool lays a long end once around jaws that point along the vessel.

    Parameters
    ----------
    centre
        (3,) where the loop is to lie on the jaws.
    start
        (3,) where the long end leaves the vessel or the knot.
    side
        Of the vessel on which it does: 1 towards y, else -1.
    length
        Of the long end, from there to the tool.
    height
        Of the jaws over the vessel.
    """

    centre: Array
    start: Array
    side: float
    length: float
    height: float

    def outwards(self, degrees: float) -> Array:
        """Direction (3,) from the jaws at an angle about them."""
        angle = np.radians(degrees)
        return np.array([0.0, self.side * np.cos(angle), np.sin(angle)])

    def radius(self, degrees: float, slack: float) -> float:
        """Distance from the jaws at which the long end is as taut as `SHARES` says, and ``slack`` metres looser."""
        angle = np.radians(degrees)
        _, y, z = self.start - self.centre
        wanted = radius_for(np.array([self.side * y, z]), angle, between(SHARES, degrees) * self.length - slack)
        down = -np.sin(angle)
        return min(wanted, BELOW / down, max((self.height - OVER) / down, THINNEST)) if down > 0.0 else wanted

    def at(self, degrees: float, slack: float) -> Array:
        """Where the tool holds the long end (3,) at an angle."""
        along = np.array([between(ASIDE, degrees), 0.0, 0.0])
        return self.centre + along + self.radius(degrees, slack) * self.outwards(degrees)


def leaves(points: Array, vessel: Array, radius: float, knotted: bool) -> tuple[int, int]:
    """The elements at which the short end and the long end leave a vessel (3,), or the knot on it."""
    if not knotted:
        away = np.linalg.norm((points - vessel)[:, 1:], axis=1)
        return int(np.flatnonzero(away < BESIDE * radius).min()), int(
            np.flatnonzero(away < 1.15 * BESIDE * radius).max()
        )
    near = np.flatnonzero(np.linalg.norm(points - vessel, axis=1) < KNOT)
    others = np.arange(len(points))
    touching = [
        i for i in near if np.linalg.norm(points[np.abs(others - i) >= APART] - points[i], axis=1).min() < TOUCHES
    ]
    found = touching or near.tolist()
    return int(found[0]), int(found[-1])


def fingers_within(strand: Array) -> int:
    """How many of the fingers of a tool a strand (n, 3), in its frame, goes once around; both where on its wrist.

    What passes in front of the tips does not count. From a vessel below to a hand above, a strand makes half a turn at
    most that does not go around.
    """
    along = 0.5 * (strand[1:, 2] + strand[:-1, 2])
    on = (along > -WRIST) & (along < TIP)
    return sum(abs(_turns(strand - [0.0, aside, 0.0])[on].sum()) > ONCE for aside in (-FINGERS, FINGERS))


def _turns(strand: Array) -> Array:
    """Angles (n - 1,) by which each part of a strand turns about the z axis."""
    turns = np.diff(np.arctan2(strand[:, 1], strand[:, 0]))
    return np.asarray((turns + np.pi) % (2.0 * np.pi) - np.pi)


def level_with(strand: Array) -> Array:
    """The point (3,) of a strand (n, 3), in the frame of a tool, that passes level with its jaws, nearest to them."""
    return np.asarray(strand[np.argmin(np.abs(strand[:, 0]) + 0.1 * np.abs(strand[:, 2]))])


def leaning(root: Array, x: float, length: float) -> Array:
    """Direction (3,) in which an end of ``length`` reaches from ``root`` (3,) to ``x`` along the vessel."""
    along = x - root[0]
    return np.array([along, 0.0, np.sqrt(max(length**2 - along**2, 1e-6))]) / length


def unit(way: Array) -> Array:
    """A vector divided by its length."""
    return np.asarray(way / np.linalg.norm(way))


def swept(a: Array, b: Array, share: float) -> Array:
    """The direction (3,) at a ``share`` of the way from ``a`` to ``b`` on the unit sphere."""
    angle = np.arccos(np.clip(a @ b, -1.0, 1.0))
    return (
        b if angle < 1e-6 else np.asarray((np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle))
    )
