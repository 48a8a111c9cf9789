"""Threads that hold by friction on themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np


def _resample(points, n):
    at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    even = np.linspace(0.0, at[-1], n + 1)
    return np.stack([np.interp(even, at, points[:, a]) for a in range(3)], axis=1), at[-1]


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
    rod = kit.Bench([]).add(kit.damped(replace(description, give=np.full(n - 1, length / n / 4000.0)), 0.999))
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
