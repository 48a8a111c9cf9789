"""What tells knots in a thread apart whatever their shape, and how well a throw was made around a vessel.

Metres, newtons, world axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HALF_KNOT = 3
"""Knot determinant of a thread with one throw, a trefoil."""

AROUND = 0.75
"""Turns that a thread must make around a vessel to go around it: it makes half of one where it only passes below."""


def determinant(points: Array, seed: int = 0) -> int:
    """The determinant of the knot of a closed polygon (n, 3): 1 without a knot, 3 for a trefoil.

    From the crossings of its shadow on a random plane (Livingston, Knot Theory, 1993, chapter 3): in each, twice the
    arc that passes over less both that end below.
    """
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    a = points @ turn
    d, n = np.roll(a, -1, axis=0) - a, len(points)
    crossings: list[tuple[float, float]] = []
    for i in range(n):
        j = np.arange(i + 2, n if i else n - 1)
        r, s, q = d[i], d[j], a[j] - a[i]
        with np.errstate(all="ignore"):
            per = r[0] * s[:, 1] - r[1] * s[:, 0]
            t, u = (q[:, 0] * s[:, 1] - q[:, 1] * s[:, 0]) / per, (q[:, 0] * r[1] - q[:, 1] * r[0]) / per
            cross = np.abs(per) > 1e-9 * np.linalg.norm(r) * np.linalg.norm(s, axis=1)
        for k in np.flatnonzero(cross & (t >= 0.0) & (t < 1.0) & (u >= 0.0) & (u < 1.0)):
            below = a[i, 2] + t[k] * r[2] < a[j[k], 2] + u[k] * s[k, 2]
            first, second = i + float(t[k]), float(j[k] + u[k])
            crossings.append((first, second) if below else (second, first))
    m = len(crossings)
    if m < 3:
        return 1
    unders = np.sort([under for under, _ in crossings])
    rows = np.zeros((m, m))
    for row, (under, over) in enumerate(crossings):
        i = int(np.searchsorted(unders, under))
        rows[row, int(np.searchsorted(unders, over)) % m] += 2.0
        rows[row, i] -= 1.0
        rows[row, (i + 1) % m] -= 1.0
    return abs(round(float(np.linalg.det(rows[1:, 1:]))))


def closed(points: Array, far: float = 1.0) -> Array:
    """An open thread (n, 3), closed far around the knot: its first end leads on along y, its last one the other way."""
    middle = points.mean(axis=0)
    way = middle + far * np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 2.0], [0.0, -1.0, 2.0], [0.0, -1.0, 0.0]])
    return np.vstack([points, way])


def turns(points: Array, centre: Array) -> float:
    """Turns that a thread (n, 3) makes around a vessel along x through ``centre`` (3,), positive from y to z."""
    way = points[:, 1:] - centre[1:]
    angles = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
    return float(angles[-1] - angles[0]) / (2.0 * np.pi)


@dataclass(frozen=True)
class ThrowScore:
    """How well one throw was made around a vessel.

    Parameters
    ----------
    determinant
        Of the knot in the thread, its ends led on along y.
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
        side = 1.0 if points[0, 1] > points[-1, 1] else -1.0
        return cls(determinant(closed(side * points)), turns(points, centre), drawn, hands_empty, time)

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
