"""Two arms make a ligature around a vessel: its first throw, or all of a square knot. World axes, SI units."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.environments.goals.base import EARLY, HOLD, REGRASP, UNDONE, Dwell, Progress
from ligature.environments.goals.ligating import LEFT, LYING, RIGHT, Ligating
from ligature.tasks.diagrams import Diagram
from ligature.tasks.knots import AROUND, HALF_KNOT, SQUARE_KNOT, determinant, extended, knotted_around, turns

Array = NDArray[np.float64]


class FirstThrow(Ligating):
    """Make the first throw of a ligature around an upright vessel, and draw it close.

    The thread passes beside the vessel; its short end is in a clip, its long end in the first arm's jaws. The task is
    done when for 0.5 s the thread has had one throw around the vessel, by the crossings of its two ends and not by what
    is near to what; the loop has been closed to within `SLACK` of the vessel; the second arm's jaws alone have held the
    thread, and the first arm's tool has been clear of it. It is lost when no jaws have held the thread for 2 s, or when
    it is no longer at the vessel.
    """

    text = "make a throw around the vessel: pass the long end around the short one with both arms, and draw it close"
    steps = 500
    THROW, TAKE, RELEASE = 0.1, 0.02, 0.02
    """What is left, in metres, until the thread has a throw, until the second arm holds the thread, and until the first
    arm has let go and gone away."""
    _KEPT = ("_rest", "_rested", "_free", "_held", "_thrown")

    def thrown(self, points: Array) -> bool:
        """Whether the thread (n, 3), its ends continued straight away from the vessel, has one throw around it."""
        lying = (points - self.vessel) @ LYING
        return determinant(extended(lying, np.zeros(3))) == HALF_KNOT and knotted_around(
            lying, np.zeros(3), self.radius
        )

    @property
    def is_thrown(self) -> bool:
        """Whether the thread has the throw."""
        return bool(self._thrown)

    def begin(self, rng: np.random.Generator) -> None:
        """Both hands a little elsewhere, that with the thread turned otherwise."""
        super().begin(rng)
        self._rest, self._rested, self._free, self._held, self._thrown = Dwell(), 0.0, Dwell(), True, False

    def observe(self) -> Progress:
        """The throw that is missing, how far its loop is from closed, and which hands are to hold the thread."""
        points, now = self.points(), self._simulation.time
        self._thrown, self._held, held = self.thrown(points), self.holds(RIGHT), self.holds(LEFT)
        loop = self.slack(points) if self._thrown else self.LOOP
        away = not self._held and self.clear(RIGHT, points)
        made = self._thrown and loop <= self.SLACK and held and away
        self._rested = self._rest.observe(made, now)
        if self._rested >= HOLD - EARLY:
            return Progress(0.0, True)
        left = self.THROW * (not self._thrown) + loop + UNDONE
        left += self.TAKE * (not (self._thrown and held)) + self.RELEASE * (not (self._thrown and away))
        if self.is_gone(points):
            return Progress(left, lost="the thread is no longer at the vessel")
        dropped = self._free.observe(not self._held and not held, now) >= REGRASP - EARLY
        return Progress(left, lost="the thread was dropped" if dropped else "")

    def marks(self) -> Array:
        """Whether the first arm holds the thread, the share of the time that the throw is drawn, whether it is made."""
        return np.array([self._held, min(self._rested / HOLD, 1.0), self._thrown], dtype=float)


class KnotTie(Ligating):
    """Make a square knot around an upright vessel: two throws of opposite hands, both ends drawn apart.

    It begins as `FirstThrow`. The task is done when for 0.5 s there has been a square knot in the thread, around the
    vessel, by the crossings of its two ends; all of it within `KNOT` of the vessel, the loop closed to within `SLACK`;
    no jaws have held the thread, and both tools have been clear of it; and since the knot was there both arms have once
    drawn its two ends with `DRAWN` newtons each, at once. It is lost when no jaws have held a thread without the knot
    for 2 s, or when it is no longer at the vessel.
    """

    text = "make a square knot around the vessel: two throws of opposite hands with both arms, both ends drawn apart"
    steps = 1400
    THROW, DRAW, CLOSE, RELEASE = 0.1, 0.05, 0.03, 0.02
    """What is left, in metres, for each throw that is missing, until both ends have been drawn, until the knot is close
    to the vessel, and until both arms have let go and gone away."""
    DRAWN = 1.0
    """Newtons."""
    KNOT, HIGH = 0.008, 0.012
    """Metres from the vessel, and above or below the middle of the loop, within which all of the knot must be."""
    _KEPT = ("_rest", "_rested", "_free", "_held", "_throws", "_drawn")

    def throws(self, points: Array) -> int:
        """Throws of a square knot that a thread (n, 3) has around the vessel: 2 for the knot, 1 for any lesser one.

        A second throw of the same hand as the first one, which makes a granny knot, does not count.
        """
        loop, lying = self.loop(points), (points - self.vessel) @ LYING
        if loop is not None:
            lying = (points - self.vessel) @ _lying(points[sum(loop) // 2] - self.vessel)
            if abs(turns(lying[loop[0] : loop[1] + 1], np.zeros(3))) < AROUND:
                return 0
        if not knotted_around(lying, np.zeros(3), self.radius):
            return 0
        found = Diagram.of(extended(lying, np.zeros(3)))
        if found.kind == SQUARE_KNOT:
            return 2
        return int(found.determinant % HALF_KNOT == 0)

    def close(self, points: Array) -> bool:
        """Whether a thread (n, 3) with a square knot has all of it at the vessel: the ends beyond add nothing to it."""
        x, y, z = (points - self.vessel).T
        away, low = np.hypot(x, y), self.beside(points)
        at = away < self.radius + self.thickness + self.NEAR
        level = float(np.median(z[at])) if at.any() else 0.0
        near = (away < self.radius + self.KNOT) & (np.abs(z - level) < self.HIGH)
        if not near[low]:
            return False
        outside = np.flatnonzero(~near)
        first = outside[outside < low].max(initial=-1) + 1
        last = outside[outside > low].min(initial=len(points))
        return self.throws(points[first:last]) == 2

    @property
    def made(self) -> int:
        """Throws that the thread has."""
        return int(self._throws)

    @property
    def is_drawn(self) -> bool:
        """Whether both ends of the knot have been drawn."""
        return bool(self._drawn)

    def begin(self, rng: np.random.Generator) -> None:
        """Both hands a little elsewhere, that with the thread turned otherwise."""
        super().begin(rng)
        self._rest, self._rested, self._free, self._held = Dwell(), 0.0, Dwell(), True
        self._throws, self._drawn = 0, False

    def observe(self) -> Progress:
        """The throws that are missing, how far the knot is from drawn and closed, and whether arms are to let go."""
        points, now = self.points(), self._simulation.time
        self._throws, ends = self.throws(points), [self.held(RIGHT), self.held(LEFT)]
        self._held = ends[RIGHT] is not None
        self._drawn = self._throws == 2 and (self._drawn or self._draws(points))
        loop = self.slack(points) if self._throws else self.LOOP
        close = self._drawn and loop <= self.SLACK and self.close(points)
        away = ends == [None, None] and self.clear(RIGHT, points) and self.clear(LEFT, points)
        self._rested = self._rest.observe(close and away, now)
        if self._rested >= HOLD - EARLY:
            return Progress(0.0, True)
        left = self.THROW * (2 - self._throws) + loop + UNDONE
        left += self.DRAW * (not self._drawn) + self.CLOSE * (not close) + self.RELEASE * (not (close and away))
        if self.is_gone(points):
            return Progress(left, lost="the thread is no longer at the vessel")
        dropped = self._free.observe(ends == [None, None] and self._throws < 2, now) >= REGRASP - EARLY
        return Progress(left, lost="the thread was dropped" if dropped else "")

    def _draws(self, points: Array) -> bool:
        """Whether both arms draw now, each at its own end of the thread (n, 3)."""
        low, ends = self.beside(points), [self.held(arm) for arm in (RIGHT, LEFT)]
        sides = sorted(end > low for end in ends if end is not None)
        return sides == [False, True] and min(self.pull(RIGHT), self.pull(LEFT)) >= self.DRAWN

    def marks(self) -> Array:
        """Whether the first arm holds the thread, the share of the time that the knot is made, its stage."""
        return np.array([self._held, min(self._rested / HOLD, 1.0), (self._throws + self._drawn) / 3.0], dtype=float)


def _lying(below: Array) -> Array:
    """Places times this (3, 3) are as if the upright vessel lay along x, with what is at ``below`` (3,) below it."""
    x, y = below[:2].tolist()
    away = max(math.hypot(x, y), 1e-9)
    return np.array([[0.0, -y / away, -x / away], [0.0, x / away, -y / away], [1.0, 0.0, 0.0]])
