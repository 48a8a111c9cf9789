"""A thread does not pass through itself: knots stay the knots that they are, however they are drawn."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from ligature.model.frames import axis_rotation
from ligature.model.shapes import Cylinder
from ligature.suture import layout
from ligature.suture.crossing import NEAREST, _share_of_pair
from ligature.suture.description import FREE, Attachment, from_material
from ligature.tasks.knots import determinant
from scipy.spatial.transform import Rotation

from tests.suture.conftest import Bench, body, damped
from tests.suture.knots import room, square_knot, wander, wound
from tests.tasks.threads import closed

KNOTS = {
    "unknot": lambda rng: (wound(1, 3, 3, rng.choice([-1, 1])), 1),
    "trefoil": lambda rng: (wound(2, 3, 3, rng.choice([-1, 1])), 3),
    "figure of eight": lambda rng: (wound(3, 2, 4, rng.choice([-1, 1])), 5),
    "five crossings": lambda rng: (wound(2, 5, 5, rng.choice([-1, 1])), 5),
    "seven crossings": lambda rng: (wound(2, 7, 7, rng.choice([-1, 1])), 7),
    "square knot": lambda rng: (square_knot(), 9),
    "wandering": lambda rng: _wandering(rng),
}
LEFT, RIGHT = 0, 1
SHAFT, APART = 0.05, 1.2
"""Length of the shafts of the hands, and how far off the thread's end they begin, in its radii."""


QUICK = (0, 1, 3, *range(5, 10), 13)
"""Seeds that take little: each kind of knot, and most of them twice."""


def _wandering(rng):
    """A random curve that leaves room for a thread, and its determinant."""
    while True:
        points = wander(rng)
        if np.linalg.norm(np.diff(points, axis=0), axis=1).sum() < 120.0 * room(points):
            return points, determinant(closed(points[::5], 500.0))


@dataclass
class Drawn:
    """A knot in a thread that two hands hold by its ends.

    Each hand is a shaft as thick as the thread that goes on from its end, outwards: a loop that snaps over an end would
    be another knot.
    """

    seed: int

    def __post_init__(self):
        rng = self.rng = np.random.default_rng(self.seed)
        self.kind = list(KNOTS)[self.seed % len(KNOTS)]
        points, self.known = KNOTS[self.kind](rng)
        self.diameter = rng.uniform(0.2e-3, 1e-3)
        points = points * 1.1 * self.diameter / room(points)
        at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
        n = round(at[-1] / (rng.uniform(1.0, 1.8) * self.diameter))
        even = np.linspace(0.0, at[-1], n + 1)
        points = np.column_stack([np.interp(even, at, column) for column in points.T])
        lengthwise = axis_rotation((1.0, 0.0, 0.0), -np.pi / 2)
        shaft, off = Cylinder(self.diameter / 2, SHAFT), SHAFT / 2 + APART * self.diameter / 2
        self.bench = Bench([
            body(hand, shaft, at=points[end] + [0.0, side * off, 0.0], friction=0.0, R=lengthwise)
            for hand, end, side in ((LEFT, 0, -1.0), (RIGHT, -1, 1.0))
        ])  # fmt: skip
        made = from_material(
            points, self.diameter, 10.0 ** rng.uniform(5.0, 8.0), 1100.0, friction=rng.uniform(0.3, 0.95),
            gravity=(0, 0, 0), damping=10.0 ** rng.uniform(-3.0, -1.5), straight=bool(rng.integers(2)),
        )  # fmt: skip
        none, ends = np.zeros(3), []
        for element, hand, end in ((0, LEFT, 0), (n - 1, RIGHT, 1)):
            T, tip = np.eye(4), np.eye(4)
            T[:3, 3], tip[2, 3] = made.ends[element, end], (off, -off)[end]
            ends.append(Attachment(element, hand, T, tip, none, none, none, *FREE))
        made = replace(made, compliance=np.full(n - 1, at[-1] / n / 4000.0), attachments=tuple(ends))
        self.rod = self.bench.add(damped(made, rng.choice([0.9, 1.0])))

    def determinant(self):
        """Of the rod's axis: the ends of its elements."""
        turns = Rotation.from_quat(self.rod.orientations).as_matrix()
        ends = self.rod.positions[:, None] + np.einsum("nij,nsj->nsi", turns, self.rod.description.ends)
        return determinant(closed(np.vstack([ends[:, 0], ends[-1:, 1]])), self.seed)

    def draw(self, force, speed, ticks):
        """The hands part along y, up to a tension and at a speed; yields every tenth determinant."""
        aside = speed * self.rng.uniform(-0.5, 0.5, size=(2, 3)) * [1.0, 0.0, 1.0]
        for tick in range(ticks):
            pulls = self.rod.tension[1], self.rod.tension[-2]
            for hand, side in ((LEFT, -1), (RIGHT, 1)):
                share = np.clip((force - max(pulls)) / force, -1.0, 1.0)
                self.bench.twist[hand][:3] = share * (aside[hand] + [0.0, side * speed, 0.0])
            self.bench.step()
            if tick % 10 == 9:
                yield self.determinant()

    def knots(self):
        """Determinants on the way: drawn anew thrice, each time to another tension and another side."""
        for _ in range(3):
            yield from self.draw(10.0 ** self.rng.uniform(-0.7, 0.48), 10.0 ** self.rng.uniform(-1.7, -0.5), 120)


def _stay(seed):
    drawn = Drawn(seed)
    assert drawn.determinant() == drawn.known
    seen = list(drawn.knots())
    assert set(seen) == {drawn.known}, f"{drawn.kind} became another knot: {seen}"
    assert drawn.rod.settled_soundly


@pytest.mark.parametrize("seed", QUICK)
def test_a_knot_stays_the_same_knot_however_it_is_drawn(seed):
    _stay(seed)


@pytest.mark.slow
def test_a_hundred_knots_stay_the_same_knots_however_they_are_drawn():
    for seed in sorted(set(range(114)) - set(QUICK)):
        _stay(seed)


@pytest.mark.parametrize(
    ("way", "known"),
    [((1, 3, 3), 1), ((2, 3, 3), 3), ((2, 5, 5), 5), ((3, 2, 4), 5), ((2, 7, 7), 7)],
)
def test_determinant_tells_knots_apart_from_any_side(way, known):
    for hand in (-1, 1):
        points = closed(wound(*way, hand)[::5], 100.0)
        assert [determinant(points, side) for side in range(5)] == [known] * 5


# --- two elements on their way ------------------------------------------------------------------


def _two_elements(rng):
    """Two elements of random lengths and radii that are near each other, and their random motions."""
    nodes, work = layout.nodes(2), layout.work(2, 2, 2, 1)
    for i in range(2):
        half = rng.uniform(0.2e-3, 1.5e-3) * np.array([0.0, 0.0, 1.0])
        nodes.axis[i], nodes.radius[i] = [-half, half], rng.uniform(0.1e-3, 0.5e-3)
        work.x[i], work.q[i] = rng.normal(scale=1e-3, size=3), Rotation.random(random_state=rng).as_quat()
        nodes.x[i] = work.x[i] + rng.normal(scale=2e-3, size=3)
        turn = Rotation.from_rotvec(rng.normal(scale=0.5, size=3))
        nodes.q[i] = (turn * Rotation.from_quat(work.q[i])).as_quat()
        work.segment[i] = _ends(nodes, work, i, 0.0)
    return nodes, work


def _ends(nodes, work, i, share):
    start = Rotation.from_quat(work.q[i])
    turn = (Rotation.from_quat(nodes.q[i]) * start.inv()).as_rotvec()
    R = (Rotation.from_rotvec(share * turn) * start).as_matrix()
    return work.x[i] + share * (nodes.x[i] - work.x[i]) + nodes.axis[i] @ R.T


def _distance(a, b):
    """Of two segments (2, 3), from points along both."""
    s = np.linspace(0.0, 1.0, 60)[:, None]
    p, q = a[0] + s * (a[1] - a[0]), b[0] + s * (b[1] - b[0])
    return float(np.linalg.norm(p[:, None] - q[None], axis=2).min())


@pytest.mark.parametrize("seed", range(60))
def test_within_the_free_share_two_elements_keep_half_their_distance(seed):
    rng = np.random.default_rng(seed)
    nodes, work = _two_elements(rng)
    share = _share_of_pair(0, nodes, work, 0, 1, -1.0)
    assert 0.0 < share <= 1.0
    least = NEAREST * min(_distance(work.segment[0], work.segment[1]), nodes.radius.sum())
    way = [_distance(_ends(nodes, work, 0, t), _ends(nodes, work, 1, t)) for t in np.linspace(0.0, share, 50)]
    assert min(way) > 0.99 * least
    if share < 1.0:
        # Points along segments are a little farther from each other than the segments.
        assert way[-1] < 1.05 * least + 0.03e-3
