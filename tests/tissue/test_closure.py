"""A wound closed by three bites of one thread that two hands draw tight: it stays closed until the thread is cut."""

from __future__ import annotations

import numpy as np
import pytest

from tests.tissue.strings import String
from tests.tissue.wounds import GAP, MIDDLE, gap_at, gaping_pad, way_through

PLACES = (0.0135, 0.0225, 0.0315)
"""Of the bites, along the wound."""


def _over(a, b):
    """A slack way over the wound, between two places on the top."""
    u = np.linspace(0.0, 1.0, 9)[1:-1]
    return a + u[:, None] * (b - a) + 0.006 * np.sin(np.pi * u)[:, None] * [0.0, 0.0, 1.0]


class RunningSuture:
    """One thread through three bites, slack between them, its ends up in the air; two hands hold these."""

    def __init__(self):
        self.block = gaping_pad()
        up = np.array([0.0, 0.0, 1.0])
        ways = [way for x in PLACES for way in (way_through(x, -1)[::-1], way_through(x, 1))]
        points = [ways[0][0] + up * d for d in np.linspace(0.012, 0.0, 13)[:-1]]
        begins = []
        for number, way in enumerate(ways):
            if number and number % 2 == 0:
                points.extend(_over(points[-1], way[0]))
            begins.append(len(points))
            points.extend(way)
        points.extend(list(points[-1] + up * np.linspace(0.0, 0.03, 31)[1:, None]))
        points = np.array(points)
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        thread = self.block.add_thread(1e-4)
        for way, begin in zip(ways, begins, strict=True):
            thread.insert(self.block.lay_path(way[::-1], 1e-4), length[begin])
        even = np.linspace(0.0, length[-1], round(length[-1] / 1e-3) + 1)
        fine = np.column_stack([np.interp(even, length, column) for column in points.T])
        self.strings = [String(self.block, thread, fine, stiffness=3e4)]
        between = [0.5 * (length[begins[k] + 4] + length[begins[k + 1]]) for k in (1, 3)]
        self.between = [int(np.argmin(np.abs(even - middle))) for middle in between]
        """Points of the thread between the bites."""
        self.inside = int(thread.engaged.sum())

    @property
    def gaps(self):
        """Of the wound at the bites (3,), and the least of all."""
        return np.array([gap_at(self.block, x) for x in PLACES]), self.block.lips.gaps().min()

    def run(self, ticks=1):
        for _ in range(ticks):
            for string in self.strings:
                string.tick()
            self.block.step()

    def draw(self, most, tension):
        """Draw the ends past each other over the wound, until it is closed; the longer one comes from high up."""
        (string,) = self.strings
        begin, last = string.x.copy(), len(string.x) - 1
        goals = [np.array([PLACES[k], MIDDLE + side * 0.003, 0.0095]) for k, side in ((0, 1), (2, -1))]
        for tick in range(most):
            for i, goal, side, pace in ((0, goals[0], 1.0, 4e-5), (last, goals[1], -1.0, 8e-5)):
                way = begin[i] - goal
                there = np.linalg.norm(way) / 1e-4
                string.held[i] = (
                    goal + way * (1.0 - tick / there) if tick < there
                    else goal + side * pace * (tick - there) * np.array([0.0, 1.0, 0.1 * side])
                )  # fmt: skip
            self.run()
            assert self.gaps[1] > -5e-5
            assert string.tension.max() < tension
            if self.gaps[0].max() < 5e-5:
                return
        raise AssertionError(f"gaps of {self.gaps[0]} m are left")

    def cut(self):
        """Cut the thread between the bites: three threads lie in the paths then."""
        (whole,) = self.strings
        held = whole.thread.snapshot()
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(whole.x, axis=0), axis=1))])
        self.strings = []
        whole.thread.reset()
        first, second = self.between
        for low, high in ((0, first), (first + 1, second), (second + 1, len(whole.x) - 1)):
            thread = self.block.add_thread(1e-4)
            on_it = (length[low] < held["at"]) & (held["at"] < length[high])
            thread.restore({
                **held, "engaged": held["engaged"] * on_it, "at": held["at"] - length[low],
                "anchor": held["anchor"] - length[low],
            })  # fmt: skip
            part = String(self.block, thread, whole.x[low : high + 1], stiffness=3e4)
            part.v, part.rest = whole.v[low : high + 1].copy(), whole.rest[low:high].copy()
            part.held = {i - low: goal for i, goal in whole.held.items() if low <= i <= high}
            self.strings.append(part)


@pytest.mark.slow
def test_three_bites_of_one_thread_close_a_wound_of_4_mm_until_it_is_cut():
    suture = RunningSuture()
    assert suture.gaps[0] == pytest.approx(GAP)
    suture.draw(1500, 2.5)
    for _ in range(6):
        suture.run(50)
        gaps, least = suture.gaps
        assert gaps.max() < 1e-4
        assert least > -5e-5
        assert suture.strings[0].thread.engaged.sum() == suture.inside
    suture.cut()
    suture.run(400)
    assert suture.gaps[0].min() > 0.85 * GAP
