"""Script of the expert that makes a throw around a vessel: a half hitch of the long end around the short one.

The short end is in its clip. The right hand brings the long end over the short one, down beside it and below it. The
left one reaches down between the short end and the strand that comes from the vessel, takes the long end there, and
draws it up. The throw slides along the short end to the vessel when it is drawn. The thread is always in a hand or in
the clip, so that nothing must be found again.

It finds its way by the ground truth of the simulation. World axes, metres, radians, newtons.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from ligature.environments.goals.ligating import LEFT, RIGHT, Ligating, holding
from ligature.environments.hand import SHUT, Hand
from ligature.environments.layout import ACTION
from ligature.model.frames import frame
from ligature.tasks.knots import HALF_KNOT, determinant
from ligature.tasks.throws import drawn_back

Array = NDArray[np.float64]

AJAR = 0.5
"""Angle of jaws that go around a thread."""

BESIDE = 7
"""Elements between both hands when one takes the thread from the other, nearer to its end."""

AWAY, ALONG, ACROSS = np.array([0.0, -1.0, 0.0]), np.array([0.0, -1.0, -0.1]), np.array([-0.8, -0.3, 0.2])
"""Directions of the long end beyond a hand: back along the short end, the same a little down, and below it."""

CARRY, DRAW = np.array([-0.5, -0.25, -0.83]), np.array([0.6, -0.5, -0.62])
"""Directions of the right tool that brings the end, and of the left one that draws it."""

APPROACH = ((0.052, 1.0), (0.026, 1.0), (0.010, 0.6))
"""How far it stands back along itself on its way, and shares of an action with which it goes there."""

DRAWN = ((-0.016, -0.002, 0.014, 0.25), (-0.066, -0.020, 0.020, 1.2))
"""Where the left hand draws the throw, one place after the other, from the vessel, and newtons with which it stops."""

CYCLE = 3
"""Tries after which it takes the thread as near to the other one again as at first: the end is not far."""

WRONG = 4
"""Elements from the one that it was to take at which a hand has taken another strand."""

SLOW = 0.6
"""Share of an action beside the thread."""

SIDES = ("right", "left")
"""Names of the hands."""


class Missed(ValueError):
    """A step did not succeed."""


def first_throw(hand: Hand, observation: Array) -> Iterator[Array]:
    """Bring the long end around the short one, draw it up through the loop with the other hand, and pull it close."""
    tier = Tier(hand)
    yield from tier.first()
    yield from tier.hands[LEFT].stay(60, SHUT)


def shorter(T: Array, tool: Array) -> Array:
    """A pose (4, 4) for a tool, or that after half a turn about it: what is less of a turn from where it is now."""
    if np.sum(T[:3, :2] * tool[:3, :2]) >= 0.0:  # what the cosine of the turn has of the axes that a half turn reverses
        return T
    return np.asarray(T * np.array([-1.0, -1.0, 1.0, 1.0]))


class Tier:
    """Both hands, and the thread."""

    BROUGHT = (
        (0.010, 0.040, 0.006, ALONG), (0.009, 0.037, -0.010, ALONG), (0.010, 0.030, -0.010, ACROSS),
        (0.0015, 0.0135, -0.010, ACROSS),
    )  # fmt: skip
    """Where the right hand brings the long end, from where the short end begins, and how it runs beyond it there."""

    IN = 0.009
    """How far from the vessel the left tool reaches down through the loop."""

    FURTHER = 0
    """Elements by which a hand takes the thread further from the other one each time that it missed it."""

    TRIES = 3
    """How often a hand tries to take the thread from the other one at most."""

    further = 0

    def __init__(self, hand: Hand) -> None:
        goal = hand.env.goal
        assert isinstance(goal, Ligating)
        self.goal, self.hands = goal, (hand, hand.other(LEFT))

    def first(self) -> Iterator[Array]:
        """The first throw, drawn by the left hand."""
        yield from self.tries(LEFT, self.bring, self.through)
        yield from self.draw()

    def tries(self, number: int, *steps: Callable[[], Iterator[Array]]) -> Iterator[Array]:
        """Steps at whose end a hand takes the thread from the other one; where it missed that, they are made again."""
        for count in range(self.TRIES):
            self.further = count % CYCLE * self.FURTHER
            try:
                for step in steps:
                    yield from step()
                return
            except Missed:
                if count == self.TRIES - 1:
                    raise
                yield from self.leave(number)

    def bring(self) -> Iterator[Array]:
        """The right hand lays the long end over the short one, and brings it below that."""
        for x, y, z, along in self.BROUGHT:
            yield from self.go(RIGHT, holding(CARRY, along, self.goal.short + [x, y, z]), SHUT, SLOW)

    def through(self) -> Iterator[Array]:
        """The left hand reaches down through the loop, takes the long end there, and draws it up.

        Raises `Missed` where the loop is not around its tool then.
        """
        element = self.beyond(RIGHT, BESIDE)
        way = self.goal.points()[element] - self.gap()
        for back, pace in APPROACH:
            yield from self.go(LEFT, drawn_back(self.grasp(LEFT, way, element), back), SHUT, pace)
        yield from self.take(LEFT, way, element)
        if not self.laced():
            raise Missed("the left hand did not reach through the loop")
        yield from self.leave(RIGHT)
        yield from self.together(
            self.go(RIGHT, self.moved(RIGHT, 0.014, 0.008, 0.012), AJAR),
            self.go(LEFT, drawn_back(self.hands[LEFT].tool, 0.035), SHUT, SLOW),
        )

    def draw(self) -> Iterator[Array]:
        """The left hand draws the throw up to the vessel."""
        for *place, most in DRAWN:
            T = holding(DRAW, AWAY, self.goal.vessel + place)
            yield from self.go(LEFT, T, SHUT, SLOW, lambda most=most: self.pull(LEFT) > most)  # type: ignore[misc]

    # --- seeing -----------------------------------------------------------------------------

    def end(self, number: int) -> int:
        """The element at which a hand holds the thread; raises `Missed` when it holds none."""
        held = self.goal.held(number)
        if held is None:
            raise Missed(f"the {SIDES[number]} hand lost the thread")
        return held

    def beyond(self, number: int, ahead: int) -> int:
        """The element, ``ahead`` or more from a hand, at which the other one takes the thread: the last one at most."""
        return min(self.end(number) + ahead + self.further, len(self.goal.elements) - 1)

    def pull(self, number: int) -> float:
        """Tension of the thread beside a hand; raises `Missed` when it holds none."""
        self.end(number)
        return self.goal.pull(number)

    def gap(self) -> Array:
        """The middle (3,) of the loop where the left tool reaches down through it."""
        return self.between(self.IN)

    def between(self, far: float) -> Array:
        """The middle (3,) between the short end and the strand on its other side, ``far`` from the vessel."""
        points, count = self.goal.points(), round(far / self.goal.length)
        ahead, low, last = points[:, 1] - self.goal.vessel[1], self.goal.beside(points), self.end(RIGHT)
        strand = np.arange(self.goal.leaves(points), last)
        beyond = strand[ahead[strand] > far]
        return np.asarray(0.5 * (points[low - count] + points[beyond[0] if len(beyond) else strand[0]]))

    def laced(self) -> bool:
        """Whether the thread, up to where the left hand holds it, makes a throw with that hand's tool."""
        return determinant(self.drawn(LEFT)) == HALF_KNOT

    def drawn(self, number: int) -> Array:
        """The thread up to where a hand holds it, as that draws it along its tool: closed far away."""
        points, T = self.goal.points()[: self.end(number) + 1], self.hands[number].tool
        shaft = np.array([T[:3, 3] - far * T[:3, 2] for far in (0.0, 0.02, 0.2, 1.0)])
        free, up = self.goal.vessel + [0.0, 1.0, 0.0], np.array([0.0, 0.0, 2.0])
        return np.vstack([free, points, shaft, shaft[-1] + up, free + up])

    def grasp(self, number: int, way: Array, element: int) -> Array:
        """Pose (4, 4) of a tool along ``way`` (3,) that takes an element of the thread, turned the shorter way.

        The jaws are alike: half a turn about the tool changes nothing.
        """
        points = self.goal.points()
        element = min(max(element, 1), len(points) - 2)
        T = holding(way, points[element + 1] - points[element - 1], points[element])
        return shorter(T, self.hands[number].tool)

    # --- moving -----------------------------------------------------------------------------

    def moved(self, number: int, x: float, y: float, z: float) -> Array:
        """The tool of a hand, moved."""
        return frame(np.eye(3), np.array([x, y, z])) @ self.hands[number].tool

    def go(
        self,
        number: int,
        T: Array,
        jaw: float,
        pace: float = 1.0,
        until: Callable[[], bool] = lambda: False,
        most: int = 200,
    ) -> Iterator[Array]:
        """A hand goes to a pose of its tool, with a share of each action, until something is so."""
        for _ in range(most):
            found, left = self.hands[number].action(T, jaw)
            if left < 0.2 or until():
                return
            moving = found.reshape(-1, ACTION)[:, : ACTION - 1]
            moving *= pace
            yield found

    def together(self, *ways: Iterator[Array]) -> Iterator[Array]:
        """What several hands do at once, until the last one is there."""
        going = list(ways)
        while going:
            actions = [next(way, None) for way in going]
            going = [way for way, action in zip(going, actions, strict=True) if action is not None]
            if going:
                yield np.sum([action for action in actions if action is not None], axis=0)

    def take(self, number: int, way: Array, element: int) -> Iterator[Array]:
        """A hand goes forward along itself, and closes its jaws on the thread; `Missed` where it cannot."""
        hand = self.hands[number]
        for more in (0, 1, -1, 2):
            yield from self.go(number, drawn_back(self.grasp(number, way, element + more), 0.008), AJAR, SLOW)
            for _ in range(3):
                yield from self.go(number, self.grasp(number, way, element + more), AJAR, SLOW, most=40)
            yield from hand.stay(14, SHUT)
            held = self.goal.held(number)
            if held is not None and abs(held - element) <= WRONG:
                return
            yield from hand.stay(10, AJAR)
        raise Missed(f"the {SIDES[number]} hand did not find the thread")

    def leave(self, number: int) -> Iterator[Array]:
        """A hand opens, and draws back along itself."""
        yield from self.hands[number].stay(9, AJAR)
        yield from self.go(number, drawn_back(self.hands[number].tool, 0.014), AJAR, SLOW)
