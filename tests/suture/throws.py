"""Knots of several throws over a closed wound whose lips springs part, drawn throw by throw, as surgeons do.

Lengths of the laid knot are in thicknesses of the thread. The wound runs along x and its lips are two round posts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from ligature.model.frames import axis_rotation, pose7_matrix
from ligature.model.shapes import Cylinder
from ligature.suture.description import FREE, Attachment, RodDescription, from_material
from ligature.tasks.knots import determinant
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from tests.suture.conftest import DT, Bench, body, damped
from tests.tasks.threads import closed

Array = NDArray[np.float64]

THICK = 0.8e-3
POST = 1.25
"""Radius of a lip."""

HALF, WINDING, APART = 3.0, 0.75, 4.0
"""Of a laid throw: half its length, radius of its two strands about each other; height of the bend to the next one."""

LEFT, RIGHT, NEAR, FAR, LEFT_FINGERS, RIGHT_FINGERS = range(6)
DRAWS, PACE = 2.0, 0.03
"""Newtons with which a throw is drawn, and metres a second of the hands."""

GAPE, SOFT, HARD, MASS, DAMPED = 0.004, 400.0, 2e4, 0.2, 25.0
"""Of the wound at rest, N/m of what parts its lips, and of lips pressed together; kg and N s/m of each."""


def throws(senses: Sequence[int], tail: float) -> tuple[Array, Array, int]:
    """A thread (n, 3) around both lips and through a throw of each sense, its two ends along y.

    Also the outermost points (throws - 1, 2, 3) of the bends above each throw but the last, left and right, and the
    index of the point at the bottom of the loop. Senses in turn make square knots, alike ones grannies.
    """
    s = np.linspace(0.0, 1.0, 240)
    bend = np.linspace(0.0, np.pi, 60)[1:-1]
    strands: list[list[Array]] = [[], []]
    from_left, from_right, z, tips = 0, 1, WINDING + 0.7, []
    for number, sense in enumerate(senses):
        # Both turn one and a half times about each other, from the bottom on one side to the top on the other.
        angle = np.pi * (3.0 * sense * s - 0.5)
        wound, along = WINDING * np.column_stack([np.cos(angle), np.sin(angle)]), HALF * (2.0 * s - 1.0)
        strands[from_left].append(np.column_stack([wound[:, 0], along, z + wound[:, 1]]))
        strands[from_right].append(np.column_stack([-wound[:, 0], along, z - wound[:, 1]])[::-1])
        from_left, from_right = from_right, from_left
        if number < len(senses) - 1:
            up = z + WINDING + 0.5 * APART * (1.0 - np.cos(bend))
            out = HALF + 0.75 * APART * np.sin(bend)
            for strand, side in ((from_left, -1.0), (from_right, 1.0)):
                strands[strand].append(np.column_stack([0.0 * out, side * out, up]))
            tips.append([[0.0, side * (HALF + 0.75 * APART), z + WINDING + 0.5 * APART] for side in (-1.0, 1.0)])
            z += 2.0 * WINDING + APART
    for strand, side in ((from_left, -1.0), (from_right, 1.0)):
        end = strands[strand][-1][-1]
        strands[strand].append(end + np.linspace(0.0, 1.0, 200)[1:, None] * [0.0, side * tail, 1.0])
    wide, low = 2.0 * POST + 0.6, -2.0 * POST - 0.9
    loop = np.array([[0, 0, low], [0, -POST, low + 0.1], [0, -wide, -POST - 0.8], [0, -wide - 0.3, -0.6],
                     [0, -wide, 0.4], [0, -HALF, 0.7]])  # fmt: skip
    at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(loop, axis=0), axis=1))]
    loop = PchipInterpolator(at, loop)(np.linspace(0.0, at[-1], 200))[:-1]
    first, second = np.vstack([loop, *strands[0]]), np.vstack([loop * [1.0, -1.0, 1.0], *strands[1]])
    return np.vstack([first[::-1], second[1:]]), np.array(tips).reshape(-1, 2, 3), len(first) - 1


def in_hands(thread: RodDescription, left: int, right: int) -> tuple[Attachment, ...]:
    """Two bodies hold the ends of a thread, which turn freely."""
    none, held = np.zeros(3), []
    for element, hand, end in ((0, left, 0), (len(thread.ends) - 1, right, 1)):
        T = np.eye(4)
        T[:3, 3] = thread.ends[element, end]
        held.append(Attachment(element, hand, T, np.eye(4), none, none, none, *FREE))
    return tuple(held)


class KnotOverWound:
    """A knot laid over a wound that fingers keep closed; two hands hold the ends of its thread."""

    def __init__(self, senses: Sequence[int], yield_strain: float, friction: float, tail: float = 62.0) -> None:
        points, tips, bottom = throws(senses, tail)
        points, self._tips = THICK * points, THICK * tips
        at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
        n = round(at[-1] / (1.25 * THICK))
        even = np.linspace(0.0, at[-1], n + 1)
        points = np.column_stack([np.interp(even, at, column) for column in points.T])
        turned, radius = axis_rotation((0.0, 1.0, 0.0), np.pi / 2), POST * THICK
        lips = [
            body(lip, Cylinder(radius, 0.03), (0.0, side * radius, -radius), MASS, 1e-3, 0.3, turned)
            for lip, side in ((NEAR, -1.0), (FAR, 1.0))
        ]
        fingers = [body(LEFT_FINGERS, None), body(RIGHT_FINGERS, None)]
        self.bench = Bench([body(LEFT, None, points[0]), body(RIGHT, None, points[-1]), *lips, *fingers])
        made = from_material(
            points, THICK, 2e7, 1100.0, friction=friction, gravity=(0, 0, 0), damping=0.003, straight=False,
            yield_strain=yield_strain,
        )  # fmt: skip
        made = replace(made, compliance=np.full(n - 1, at[-1] / n / 4000.0), attachments=in_hands(made, LEFT, RIGHT))
        self.rod = self.bench.add(damped(made, 0.9))
        self._sides = {hand: float(np.sign(self.bench.pose[hand][1])) for hand in (LEFT, RIGHT)}
        self._laid, self._bottom = self.rod.positions.copy(), round(at[bottom] / at[-1] * n)
        self._apart = self.bench.pose[FAR] - self.bench.pose[NEAR]
        self._closed = {lip: self.bench.pose[lip].copy() for lip in (NEAR, FAR)}
        self.pressed = True

    @property
    def gap(self) -> float:
        """Between the lips, metres."""
        return float((self.bench.pose[FAR] - self.bench.pose[NEAR] - self._apart)[1])

    @property
    def loop(self) -> float:
        """Tension in the loop, N."""
        return float(self.rod.tension[self._bottom - 3 : self._bottom + 4].mean())

    @property
    def ends(self) -> Array:
        """Tension (2,) at both ends, N."""
        return self.rod.tension[[1, -2]]

    def determinant(self) -> int:
        """Of the knot in the thread."""
        return determinant(closed(self._sides[RIGHT] * self.rod.positions))

    def _lips(self) -> None:
        """Lips move along y alone: fingers hold them closed, or springs part them, implicitly."""
        for lip, side in ((NEAR, -1.0), (FAR, 1.0)):
            pose, twist = self.bench.pose[lip], self.bench.twist[lip]
            speed, twist[:] = twist[1], 0.0
            pose[[0, 2, 3, 4, 5, 6]] = self._closed[lip][[0, 2, 3, 4, 5, 6]]
            if self.pressed:
                pose[1] = self._closed[lip][1]
                continue
            stiffness = SOFT + (HARD if self.gap < 0.0 else 0.0)
            force = side * (SOFT * GAPE - stiffness * self.gap)
            twist[1] = (speed + DT * force / MASS) / (1.0 + DT * DAMPED / MASS + 2.0 * DT**2 * stiffness / MASS)

    def step(self, ticks: int = 1) -> None:
        self.bench.step(ticks, self._lips)

    def _grasp(self, element: int, fingers: int) -> None:
        pose = np.r_[self.rod.positions[element], self.rod.orientations[element]]
        self.bench.pose[fingers] = np.r_[pose[:3], 0.0, 0.0, 0.0, 1.0]
        T = pose7_matrix(pose)
        T[:3, 3] = 0.0
        self.rod.attach(element, fingers, np.eye(4), T)

    def _draw(self, pulls: Sequence[tuple[int, int, float]], most: int = 3000) -> None:
        """Draw elements by hands or fingers, to a side each, until all have borne the force for 0.1 s."""
        twist, tension = self.bench.twist, self.rod.tension
        drawn = 0
        for _ in range(most):
            borne = [max(tension[max(e - 1, 1)], tension[min(e + 1, len(tension) - 2)]) for _, e, _ in pulls]
            for (hand, _, side), pull in zip(pulls, borne, strict=True):
                twist[hand][1] = side * PACE * np.clip((DRAWS - pull) / (0.3 * DRAWS), -1.0, 1.0)
            if pulls[0][0] != LEFT:
                # The hands give thread that the fingers draw.
                for hand, pull in zip((LEFT, RIGHT), self.ends, strict=True):
                    twist[hand][1] = -self._sides[hand] * PACE * np.clip(pull / (0.1 * DRAWS) - 1.0, 0.0, 1.0)
            self.step()
            drawn += min(borne) > 0.9 * DRAWS
            if drawn > 100:
                break
        else:
            raise AssertionError(f"the throw never drew tight: {borne} N")
        for hand, _, _ in pulls:
            twist[hand][:] = 0.0

    def draw(self) -> None:
        """Draw the throws tight one after the other, from the wound up; the hands then hold the ends."""
        for tips in self._tips:
            left, right = (int(np.argmin(np.linalg.norm(self._laid - tip, axis=1))) for tip in tips)
            self._grasp(left, LEFT_FINGERS)
            self._grasp(right, RIGHT_FINGERS)
            self._draw([(LEFT_FINGERS, left, -1.0), (RIGHT_FINGERS, right, 1.0)])
            self.rod.detach(left, LEFT_FINGERS)
            self.rod.detach(right, RIGHT_FINGERS)
        last = len(self._laid) - 1
        self._draw([(LEFT, 1, self._sides[LEFT]), (RIGHT, last - 1, self._sides[RIGHT])])

    def let_go(self) -> None:
        """The fingers leave the lips; 0.2 s later the hands ease the ends, within another 0.2 s."""
        self.pressed = False
        self.step(200)
        held = self.ends.copy()
        for share in np.linspace(1.0, 0.0, 200):
            self._ease(share * held)
            self.step()

    def _ease(self, goal: Array) -> None:
        for hand, pull, aim in zip((LEFT, RIGHT), self.ends, goal, strict=True):
            self.bench.twist[hand][1] = self._sides[hand] * 0.02 * np.clip((aim - pull) / DRAWS, -1.0, 1.0)

    def rest(self, ticks: int) -> None:
        """Wait; the hands follow the ends without force."""
        for _ in range(ticks):
            self._ease(np.zeros(2))
            self.step()
