"""Script of the expert that makes a square knot: a first throw, its mirror image, and both ends drawn apart.

The second throw has the hands exchanged. The right tool hooks the long end, which the left hand holds after the first
throw, and draws it over the short end: now it goes around the tool, which then reaches down beside the short end. The
left hand brings the end below that; the right one takes it there, within the loop, and draws it up through that. Then
the left hand lifts the short end out of its clip and draws it to its own side, the right one the long end to the other.

It finds its way by the ground truth of the simulation. World axes, metres, radians, newtons.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ligature.environments.goals.ligating import DEEP, LEFT, RIGHT, holding
from ligature.environments.hand import SHUT, Hand
from ligature.environments.tying import AJAR, AWAY, CARRY, SLOW, Missed, Tier
from ligature.model.frames import frame
from ligature.tasks.diagrams import Diagram
from ligature.tasks.knots import SQUARE_KNOT
from ligature.tasks.throws import drawn_back

Array = NDArray[np.float64]

MIRRORED = np.array([-1.0, 1.0, 1.0])

BEHIND = np.array([-0.009, 0.009, 0.028]), np.array([-0.009, 0.009, 0.004])
"""Where the right tool comes down behind it, on the side of the vessel."""

HOOK, ACROSS = np.array([0.3, 0.0, -0.95]), np.array([-0.8, 0.3, -0.2])
"""Direction of the right tool as it hooks: its fingers point away from the thread, which so slides up on them; and the
axis of its jaw, turned as it will be when it takes the end."""

HOOKED = (
    ((-0.005, 0.017, 0.0035), (-0.012, 0.032, 0.026)), ((0.005, 0.020, 0.0035), (-0.012, 0.032, 0.026)),
    ((0.013, 0.018, 0.0035), (-0.010, 0.032, 0.020)), ((0.014, 0.017, 0.0), (-0.010, 0.032, 0.014)),
)  # fmt: skip
"""Where it draws the long end around the short one, and where the left hand goes meanwhile as far as that is drawn."""

FEED = 0.06
"""Newtons from which on it follows."""

BELOW, UNDER = np.array([0.85, -0.3, -0.25]), ((-0.014, 0.032, 0.010), (-0.016, 0.030, -0.009), (-0.001, 0.018, -0.008))
"""Direction of the left tool that brings the end below the short one, and where: the end lies along that tool since it
was drawn through the first throw."""

BEYOND = 10
"""Elements from the left hand, towards the end, at which the right one takes it."""

GAP = np.array([0.011, 0.0145, 0.002])
"""Where the right tool reaches down through the loop, from the vessel."""

PULLED, OUT = np.array([-0.6, -0.5, -0.62]), np.array([0.9, -0.35, 0.3])
"""Direction of the right tool that draws, and of the thread beyond it."""

DRAWN = ((0.016, -0.002, 0.014, 0.25), (0.066, -0.020, 0.020, 1.2))
"""Where it draws the throw, one place after the other, from the vessel, and newtons with which it stops."""

SHORT, TAKEN = 0.036, np.array([0.6, -0.4, -0.7])
"""How far from the vessel, beside the clip, the left hand takes the short end, and the direction of its tool there."""

OPPOSITE, GIVEN, YIELD = np.array([-0.028, 0.014, 0.005]), np.array([0.030, 0.0, 0.008]), 0.3
"""Where the left hand then brings the short end, to where the right one yields meanwhile, and from which newtons on."""

APART, SLOWEST = (np.array([0.075, -0.008, 0.005]), np.array([-0.060, 0.018, 0.005])), 0.3
"""Where the right and the left hand draw both ends, and share of an action."""


def knot_tie(hand: Hand, observation: Array) -> Iterator[Array]:
    """Make a throw, a second one that mirrors it, draw both ends apart, and let go."""
    knotter = Knotter(hand)
    yield from knotter.knot()
    yield from knotter.let_go()


class Knotter(Tier):
    """Both hands, and the thread."""

    UP = np.array([-0.025, 0.040, 0.032])
    """Where the left hand holds the long end for the hook, from the vessel."""

    LOCKED = 2.0
    """Newtons with which both hands stop to draw the ends apart."""

    TIGHT = np.inf
    """Newtons with which the second throw is drawn at most, before the short end is in a hand."""

    def knot(self) -> Iterator[Array]:
        """All of the knot, both of its ends drawn, each in a hand."""
        yield from self.first()
        yield from self.second()
        yield from self.draw_second()
        yield from self.take_short_end()
        yield from self.draw_apart()

    def second(self) -> Iterator[Array]:
        """The second throw, up to where the right hand has drawn the end through it; a missed one is made again."""
        yield from self.tries(RIGHT, self.hook, self.under, self.back_through)

    def at(self, way: Array, along: Array, place: Array) -> Array:
        """Pose (4, 4) of a tool with the thread at a place that is given from the vessel."""
        return holding(way, along, self.goal.vessel + place)

    def hook(self) -> Iterator[Array]:
        """The right tool draws the long end over the short one, to its own side, where it goes around the tool."""
        left = CARRY * MIRRORED
        above, behind = (self.at(HOOK, ACROSS, place) for place in BEHIND)
        yield from self.together(self.go(LEFT, self.at(left, AWAY, self.UP), SHUT, SLOW), self.go(RIGHT, above, SHUT))
        yield from self.go(RIGHT, behind, SHUT, SLOW)
        for place, follows in HOOKED:
            way = self.go(RIGHT, self.at(HOOK, ACROSS, np.array(place)), SHUT, SLOW)
            yield from self.yielding(way, LEFT, self.at(left, AWAY, np.array(follows)), FEED)

    def under(self) -> Iterator[Array]:
        """The left hand brings the end below the short one."""
        for place in UNDER:
            yield from self.go(LEFT, self.at(BELOW, AWAY, np.array(place)), SHUT, SLOW)

    def back_through(self) -> Iterator[Array]:
        """The right hand takes the end below, and draws it up through the loop that is around its tool.

        Raises `Missed` where that would make no square knot.
        """
        element = self.beyond(LEFT, BEYOND)
        way = self.goal.points()[element] - (self.goal.vessel + GAP)
        yield from self.go(RIGHT, drawn_back(self.grasp(RIGHT, way, element), 0.010), SHUT, SLOW)
        yield from self.take(RIGHT, way, element)
        if Diagram.of(self.drawn(RIGHT)).kind != SQUARE_KNOT:
            raise Missed("the loop of the second throw is not around the right tool")
        yield from self.leave(LEFT)
        yield from self.together(
            self.go(LEFT, self.moved(LEFT, -0.014, 0.008, 0.004), AJAR),
            self.go(RIGHT, drawn_back(self.hands[RIGHT].tool, 0.035), SHUT, SLOW),
        )

    def draw_second(self) -> Iterator[Array]:
        """The right hand draws the second throw to the first one."""
        along = OUT if OUT @ self.hands[RIGHT].tool[:3, 0] > 0.0 else -OUT
        for *place, most in DRAWN:
            T = self.at(PULLED, along, np.array(place))
            yield from self.go(RIGHT, T, SHUT, SLOW, lambda most=most: self.pull(RIGHT) > min(most, self.TIGHT))  # type: ignore[misc]

    def take_short_end(self) -> Iterator[Array]:
        """The left hand lifts the short end out of its clip, and brings it to its own side."""
        points = self.goal.points()
        ahead = points[: self.goal.beside(points), 1] - self.goal.vessel[1]
        yield from self.take(LEFT, TAKEN, int(np.abs(ahead - SHORT).argmin()))
        yield from self.go(LEFT, self.moved(LEFT, -0.004, -0.004, 0.008), SHUT, SLOW)
        way = self.go(LEFT, self.turned(LEFT, OPPOSITE), SHUT, SLOW)
        yield from self.yielding(way, RIGHT, self.turned(RIGHT, GIVEN), YIELD)

    def draw_apart(self) -> Iterator[Array]:
        """Both hands draw, each at its end, until both bear what locks the knot."""
        for _ in range(3):
            ways = (
                self.go(n, self.turned(n, APART[n]), SHUT, SLOWEST, lambda n=n: self.pull(n) > self.LOCKED)  # type: ignore[misc]
                for n in (RIGHT, LEFT)
            )
            yield from self.together(*ways)

    def let_go(self) -> Iterator[Array]:
        """Both hands open and draw back."""
        yield from self.together(self.leave(RIGHT), self.leave(LEFT))
        yield from self.together(*(self.go(n, drawn_back(self.hands[n].tool, 0.02), AJAR) for n in (RIGHT, LEFT)))
        yield from self.hands[RIGHT].stay(60, AJAR)

    def turned(self, number: int, place: Array) -> Array:
        """Pose (4, 4) of a tool, turned as it is, with the thread at a place that is given from the vessel."""
        R = self.hands[number].tool[:3, :3]
        return frame(R, self.goal.vessel + place - DEEP * R[:, 2])

    def yielding(self, way: Iterator[Array], number: int, T: Array, most: float) -> Iterator[Array]:
        """A way of one hand, meanwhile another one goes towards a pose whenever its thread bears more than ``most``."""
        for action in way:
            follows = self.pull(number) > most
            yield action + self.hands[number].action(T, SHUT)[0] if follows else action
