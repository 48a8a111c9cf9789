"""Threads that hold by friction on themselves: a knot tied and pulled tight, a hitch around a post."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from ligature.model.frames import axis_rotation, pose7_matrix
from ligature.model.shapes import Cylinder

LEFT, RIGHT = 0, 1


def _resample(points, n):
    """The polyline ``points`` (m, 3) in n equal lengths, and its length."""
    at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    even = np.linspace(0.0, at[-1], n + 1)
    return np.stack([np.interp(even, at, points[:, a]) for a in range(3)], axis=1), at[-1]


def _supple(kit, points, diameter, youngs, **keys):
    """A stress-free thread through ``points``, stretching by 0.05 % at 2 N."""
    description = kit.from_material(points, diameter, youngs, 1100.0, gravity=(0, 0, 0), straight=False, **keys)
    n, length = len(description.mass), np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    return replace(description, compliance=np.full(n - 1, length / n / 4000.0))


class TwoArms:
    """Two hands that hold the ends of a thread lying in an open bend."""

    def __init__(self, kit, n=110):
        turn, radius = np.linspace(0.0, 3.6, 200), 0.018
        bend = np.stack([radius * np.sin(turn), radius * (1.0 - np.cos(turn))], axis=1)
        away = np.array([np.cos(turn[-1]), np.sin(turn[-1])])
        drive = np.linspace([-0.04, 0.0], [0.0, 0.0], 50)[:-1]
        flat = np.vstack([drive, bend, bend[-1] + np.linspace(0.0, 0.075, 100)[1:, None] * away])
        points, self.length = _resample(np.column_stack([flat, np.zeros(len(flat))]), n)
        self.bench = kit.Bench([kit.body(LEFT, None, at=points[0]), kit.body(RIGHT, None, at=points[-1])])
        # So viscous a medium that the thread stays where it is driven; a braid that creeps for 10 ms when bent.
        thread = _supple(kit, points, 0.8e-3, 1e6, friction=0.6, damping=0.01)
        self.rod = self.bench.add(kit.damped(thread, 1.0))
        for element, hand in ((0, LEFT), (n - 1, RIGHT)):
            T = pose7_matrix(np.r_[self.rod.positions[element], self.rod.orientations[element]])
            T[:3, 3] -= self.bench.pose[hand][:3]
            self.rod.attach(element, hand, np.eye(4), T)

    @property
    def tension(self):
        return self.rod.tension[-2]

    @property
    def span(self):
        return np.linalg.norm(self.rod.positions[-1] - self.rod.positions[0]) / self.length

    def move(self, hand, to, speed=0.15):
        way = np.asarray(to) - self.bench.pose[hand][:3]
        ticks = int(np.ceil(np.linalg.norm(way) / speed * 1e3))
        self.bench.twist[hand][:3] = way / ticks * 1e3
        self.bench.step(ticks)
        self.bench.twist[hand][:] = 0.0

    def pull(self, force, ticks):
        """Draw the right hand outwards with ``force`` in newtons, yielding by 5 mm/s for each that is too much."""
        for _ in range(ticks):
            self.bench.twist[RIGHT][0] = 5e-3 * (force - self.tension)
            self.bench.step()
        self.bench.twist[RIGHT][:] = 0.0

    def attachment(self):
        """The right hand crosses over the thread near the left one, back under it, and up through the loop."""
        for to in ((-60, 10, 6), (-12, 5, 6), (-12, -20, 6), (-12, -25, -6), (-4, -15, -8), (-4, 16, -8), (0, 16, 20)):
            self.move(RIGHT, 1e-3 * np.array(to))


def test_trefoil_tied_by_two_moving_arms_draws_tight_and_holds_a_newton_for_five_seconds(kit):
    arms = TwoArms(kit)
    arms.attachment()
    arms.move(RIGHT, (0.10, 0.0, 0.02))
    while arms.tension < 1.0:
        arms.move(RIGHT, arms.bench.pose[RIGHT][:3] + [0.001, 0.0, 0.0], 0.05)
        # Without its knot the thread would be taut at its full length.
        assert arms.span < 0.97, "the knot slipped open"
    arms.pull(1.0, 500)
    tight = arms.span
    for _ in range(50):
        arms.pull(1.0, 100)
        assert arms.tension == pytest.approx(1.0, abs=0.02)
        assert arms.rod.tension[1] == pytest.approx(1.0, abs=0.02)
    assert abs(arms.span - tight) * arms.length < 0.02e-3


def _open_trefoil(n, scale, tail):
    """Points along a loose overhand knot with straight tails (Shastri, Polynomial representations of knots, 1992)."""
    u = np.linspace(-2.3, 2.3, 4000)
    knot = scale * np.stack([u**3 - 3 * u, u**4 - 4 * u**2, (u**5 - 10 * u) / 5], axis=1)
    out, back = knot[0] - knot[1], knot[-1] - knot[-2]
    reach = np.linspace(tail, 0.0, 200)[:-1, None]
    ends = knot[0] + reach * out / np.linalg.norm(out), knot[-1] + reach[::-1] * back / np.linalg.norm(back)
    return _resample(np.vstack([ends[0], knot, ends[1]]), n)


def test_trefoil_pulled_tight_by_two_hands_holds_a_newton_for_five_seconds(kit):
    n, diameter = 160, 0.8e-3
    points, length = _open_trefoil(n, 0.004, 0.03)
    description = kit.from_material(points, diameter, 1e7, 1100.0, friction=0.6, gravity=(0, 0, 0), straight=False)
    rod = kit.Bench([]).add(kit.damped(replace(description, compliance=np.full(n - 1, length / n / 4000.0)), 0.999))
    rod.hold_element(0)
    rod.hold_element(n - 1)
    apart = (points[-1] - points[0]) / np.linalg.norm(points[-1] - points[0])

    def step(speed):
        twists = rod.twists
        twists[[0, -1]] = 0.0
        twists[-1, :3] = speed * apart
        rod.set_motion(np.hstack([rod.positions, rod.orientations]), twists)
        rod.step()

    ticks = 0
    while rod.tension[n - 2] < 1.0:
        step(0.05)
        ticks += 1
        assert ticks < 4000, "the knot never drew tight"
    span = np.linalg.norm(rod.positions[-1] - rod.positions[0])
    # A thread without its knot would be taut at its full length.
    assert span < 0.96 * length
    for _ in range(5000):
        step(0.0)
    assert rod.tension[n - 2] > 0.9
    count = rod.contacts.count[0]
    gaps = rod.contacts.gap[:count][rod.contacts.closed[:count]]
    assert len(gaps) >= 4
    assert gaps.min() > -0.1 * diameter


POST, THICK, TURN = 4e-3, 0.5e-3, 2.0 * np.pi + 0.6


def _half_hitch(n):
    """Points from the loaded end up to a post along y, once around it, under the beginning, and away."""
    turn = np.linspace(0.0, TURN, 2000)
    # The beginning stands off the post where the end passes beneath it.
    lift = np.where(turn < 1.2, 1.05 * THICK * 0.5 * (1.0 + np.cos(np.pi * turn / 1.2)), 0.0)
    r = POST + 0.5 * THICK + 3e-6 + lift
    aside = 2.2 * THICK * np.sin(np.pi * np.clip((turn - 0.3) / (TURN - 0.9), 0.0, 1.0))
    crossing = np.clip((turn - 2.0 * np.pi + 1.0) / 1.6, 0.0, 1.0)
    before = aside[np.searchsorted(turn, 2.0 * np.pi - 1.0)]
    y = np.where(crossing > 0.0, before * (1.0 - crossing) - 3.0 * THICK * crossing, aside)
    round_the_post = np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=1)
    onward = round_the_post[-1] - round_the_post[-2]
    onward /= np.linalg.norm(onward)
    loaded = round_the_post[0] - np.linspace(0.03, 0.0, 200)[:-1, None] * np.array([0.0, 0.0, 1.0])
    free = round_the_post[-1] + np.linspace(0.0, 0.02, 200)[1:, None] * onward
    return _resample(np.vstack([loaded, round_the_post, free]), n)[0], onward


def _slip_of_half_hitch(kit, friction, ratio, start):
    """Speed in m/s of the loaded end under 0.3 N, the free end being held with a ``ratio``-th of it.

    Runs with another ``start`` differ by the width of an atom at first.
    """
    n, weight = 110, 1e-3
    points, onward = _half_hitch(n)
    points = points + np.random.default_rng(start).normal(scale=1e-10, size=points.shape)
    side = np.sqrt(friction)  # of a contact the product of both sides counts
    post = kit.body(0, Cylinder(POST, 0.03), R=axis_rotation((1.0, 0.0, 0.0), np.pi / 2), friction=side)
    bench = kit.Bench([post])
    description = _supple(kit, points, THICK, 1e7, friction=side)
    mass = description.mass.copy()
    mass[[0, -1]] = weight
    rod = bench.add(kit.damped(replace(description, mass=mass), 0.99))

    def load(loaded, free):
        rod.set_gravity(0, (0.0, 0.0, -loaded / weight))
        rod.set_gravity(n - 1, tuple(free / weight * onward))
        bench.step()

    for share in np.linspace(0.0, 1.0 / ratio, 200):
        load(0.3 * share, 0.3 * share)
    for share in np.linspace(1.0 / ratio, 1.0, 300):
        load(0.3 * share, 0.3 / ratio)
    bench.step(100)
    begin = rod.positions[0, 2]
    bench.step(200)
    return (begin - rod.positions[0, 2]) / 0.2


@pytest.mark.parametrize("start", range(3))
@pytest.mark.parametrize("ratio", [10.0, 20.0])
def test_half_hitch_slides_below_the_friction_of_the_capstan_limit(kit, ratio, start):
    assert _slip_of_half_hitch(kit, 0.88 * np.log(ratio) / TURN, ratio, start) > 0.1


@pytest.mark.parametrize("start", range(5))
@pytest.mark.parametrize("ratio", [10.0, 20.0])
def test_half_hitch_holds_above_the_friction_of_the_capstan_limit(kit, ratio, start):
    assert abs(_slip_of_half_hitch(kit, 1.12 * np.log(ratio) / TURN, ratio, start)) < 1e-3
