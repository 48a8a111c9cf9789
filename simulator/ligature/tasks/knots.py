"""Distinguishes knots in a thread independently of their shape, and scores throws around a vessel.

Metres, newtons, world axes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.tasks.diagrams import Diagram, crossings

Array = NDArray[np.float64]

HALF_KNOT = 3
"""Knot determinant of a thread with one throw, a trefoil."""

SQUARE_KNOT = (9, 0, 27)
"""Determinant, signature and three-colourings of a square knot: a trefoil and its mirror image, one after the other.

A granny knot, of two trefoils of the same hand, has the signature 4 or -4; the stevedore knot has 9 colourings.
"""

AROUND = 0.75
"""Turns that a thread must make around a vessel to go around it: it makes half of one where it only passes below."""


def determinant(points: Array, seed: int = 0) -> int:
    """The determinant of the knot of a closed polygon (n, 3): 1 without a knot, 3 for a trefoil.

    From the crossings of its shadow on a random plane (Livingston, Knot Theory, 1993, chapter 3): in each, twice the
    arc that passes over less both that end below.
    """
    found = crossings(points, seed)
    m = len(found)
    if m < 3:
        return 1
    unders = np.sort([crossing.under for crossing in found])
    rows = np.zeros((m, m))
    for row, (under, over, _) in enumerate(found):
        i = int(np.searchsorted(unders, under))
        rows[row, int(np.searchsorted(unders, over)) % m] += 2.0
        rows[row, i] -= 1.0
        rows[row, (i + 1) % m] -= 1.0
    return abs(round(float(np.linalg.det(rows[1:, 1:]))))


def extended(points: Array, centre: Array, far: float = 1.0) -> Array:
    """An open thread (n, 3), closed far around the knot: each end leads straight away from ``centre`` (3,)."""
    ends = points[[-1, 0]] - centre
    ends = centre + far * ends / np.maximum(np.linalg.norm(ends, axis=1), 1e-9)[:, None]
    up = np.array([0.0, 0.0, 2.0 * far])
    return np.vstack([points, ends[0], ends + up, ends[1]])


def knotted_around(points: Array, centre: Array, radius: float) -> bool:
    """Whether the knot in a thread (n, 3) joins its parts on both sides of the point below a vessel along x.

    A knot in one end of a thread that lies below the vessel is in that part alone, which then is knotted by itself.
    """
    near = (np.linalg.norm((points - centre)[:, 1:], axis=1) < 1.5 * radius) & (points[:, 2] < centre[2])
    if not near.any():
        return False
    lowest = int(np.where(near, points[:, 2], np.inf).argmin())
    return all(
        determinant(_closed_below(half)) == 1 for half in (points[: lowest + 1], np.flip(points[lowest:], axis=0))
    )


def _closed_below(half: Array, far: float = 1.0) -> Array:
    """A part of a thread (n, 3), closed far around it: down from its last point, along y to its first one."""
    side = np.array([0.0, far if half[0, 1] > half[-1, 1] else -far, 0.0])
    down = np.array([0.0, 0.0, -far])
    return np.vstack([half, half[-1] + down, half[-1] + down + side, half[0] + side])


def turns(points: Array, centre: Array) -> float:
    """Turns that a thread (n, 3) makes around a vessel along x through ``centre`` (3,), positive from y to z."""
    way = points[:, 1:] - centre[1:]
    angles = np.unwrap([math.atan2(z, y) for y, z in way.tolist()])
    return float(angles[-1] - angles[0]) / (2.0 * np.pi)


@dataclass(frozen=True)
class ThrowScore:
    """How well one throw was made around a vessel.

    Parameters
    ----------
    determinant
        Of the knot in the thread, its ends continued straight away from the vessel.
    turns
        That the thread makes around the vessel.
    drawn
        Tension in newtons of both ends, the lesser, when the throw was drawn.
    hands_empty
        Whether no jaw holds anything.
    time
        Simulated seconds until the end.
    """

    determinant: int
    turns: float
    drawn: float
    hands_empty: bool
    time: float

    @classmethod
    def of(cls, points: Array, centre: Array, drawn: float, hands_empty: bool, time: float) -> ThrowScore:
        """The score of a thread whose elements are at ``points`` (n, 3) now."""
        return cls(determinant(extended(points, centre)), turns(points, centre), drawn, hands_empty, time)

    @property
    def success(self) -> bool:
        """Whether there is one throw in the thread, around the vessel, and nothing holds it."""
        return self.determinant == HALF_KNOT and abs(self.turns) >= AROUND and self.hands_empty

    def lines(self) -> list[str]:
        """One figure a line."""
        return [
            f"{'a throw' if self.success else 'no throw'} around the vessel in {self.time:.1f} s",
            f"determinant of the knot {self.determinant}, {abs(self.turns):.2f} turns around the vessel",
            f"drawn with {self.drawn:.1f} N, hands {'empty' if self.hands_empty else 'not empty'}",
        ]


@dataclass(frozen=True)
class SquareKnotScore:
    """How well a square knot was made around a vessel: two throws of opposite hands, one on the other.

    Parameters
    ----------
    determinant, signature, colourings
        Of the knot in the thread, its ends continued straight away from the vessel.
    around
        Whether the knot closes a loop around the vessel (`knotted_around`); in a square knot each end leaves on its own
        side, so that turns do not tell.
    tension
        Of the loop around the vessel in newtons.
    hands_empty
        Whether no jaw holds anything.
    time
        Simulated seconds until the end.
    """

    determinant: int
    signature: int
    colourings: int
    around: bool
    tension: float
    hands_empty: bool
    time: float

    @classmethod
    def of(
        cls, points: Array, centre: Array, radius: float, tension: Array, hands_empty: bool, time: float
    ) -> SquareKnotScore:
        """The score of a thread whose elements are at ``points`` (n, 3) now and bear ``tension`` (n,).

        ``centre`` (3,) and ``radius`` are those of the vessel along x.
        """
        diagram = Diagram.of(extended(points, centre))
        below = (np.linalg.norm((points - centre)[:, 1:], axis=1) < 1.5 * radius) & (points[:, 2] < centre[2])
        loop = float(np.median(tension[below])) if below.any() else 0.0
        return cls(*diagram.kind, knotted_around(points, centre, radius), loop, hands_empty, time)

    @property
    def success(self) -> bool:
        """Whether there is a square knot in the thread, around the vessel, and nothing holds it."""
        kind = self.determinant, self.signature, self.colourings
        return kind == SQUARE_KNOT and self.around and self.hands_empty

    def lines(self) -> list[str]:
        """One figure a line."""
        kind = f"determinant {self.determinant}, signature {self.signature}, {self.colourings} three-colourings"
        return [
            f"{'a square knot' if self.success else 'no square knot'} around the vessel in {self.time:.1f} s",
            f"{kind}, {'around' if self.around else 'not around'} the vessel",
            f"the loop bears {self.tension:.2f} N, hands {'empty' if self.hands_empty else 'not empty'}",
        ]
