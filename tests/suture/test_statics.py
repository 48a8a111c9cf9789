"""Shapes of rods at rest against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq


def _settle(rod, ticks):
    for _ in range(ticks):
        rod.step()
    assert np.abs(rod.twists[:, :3]).max() < 1e-4


def test_cantilever_sags_by_its_weight_as_euler_and_bernoulli_state(kit):
    n, length, diameter, youngs, density = 40, 0.1, 0.5e-3, 50e9, 6450.0
    bench = kit.Bench([])
    rod = bench.add(kit.damped(kit.from_material(kit.line(n, length), diameter, youngs, density), 1 - 1e-12))
    rod.hold_element(0)
    _settle(rod, 1500)
    # The first joint bends for the halves of both its elements: the clamp is at the first one's centre.
    span = length * (1.0 - 0.5 / n)
    weight = density * np.pi * diameter**2 / 4 * 9.81
    stiffness = youngs * np.pi * diameter**4 / 64
    x = rod.positions[-1, 0] - rod.positions[0, 0]
    expected = weight * x**2 / (24 * stiffness) * (6 * span**2 - 4 * span * x + x**2)
    sag = rod.positions[0, 2] - rod.positions[-1, 2]
    assert expected < 0.02 * length
    assert sag == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    ("load", "down", "back"), [(1.0, 0.30172, 0.05643), (5.0, 0.71379, 0.38763), (10.0, 0.81061, 0.55500)]
)
def test_cantilever_under_a_large_tip_load_takes_the_shape_of_the_elastica(kit, load, down, back):
    """Bisshopp and Drucker, Large deflection of cantilever beams, 1945: load is P L² / (E I)."""
    n, length, diameter, youngs = 60, 0.1, 1e-3, 2e9
    description = kit.from_material(kit.line(n, length), diameter, youngs, 1100.0)
    span = length * (1.0 - 1.0 / n)
    force = load * youngs * np.pi * diameter**4 / 64 / span**2
    gravity = np.zeros((n, 3))
    gravity[-1, 2] = -force / description.mass[-1]
    rod = kit.Bench([]).add(kit.damped(replace(description, gravity=gravity), 1 - 1e-15))
    rod.hold_element(0)
    _settle(rod, 1500)
    tip = rod.positions[-1] - rod.positions[0]
    assert -tip[2] / span == pytest.approx(down, rel=0.03)
    assert (span - tip[0]) / span == pytest.approx(back, rel=0.03)


def test_soft_thread_between_two_hands_hangs_as_a_catenary(kit):
    n, length, span = 100, 0.2, 0.12
    description = kit.from_material(kit.line(n, length), 0.1e-3, 3e5, 1100.0)
    rod = kit.Bench([]).add(kit.damped(description))
    rod.hold_element(0)
    rod.hold_element(n - 1)
    twists = np.zeros((n, 6))
    for _ in range(400):
        twists[:] = rod.twists
        twists[0], twists[-1, :] = 0.0, 0.0
        twists[-1, 0] = -(length * (1 - 1 / n) - span) / 0.4
        rod.set_motion(np.hstack([rod.positions, rod.orientations]), twists)
        rod.step()
    twists[:] = rod.twists
    twists[-1] = 0.0
    rod.set_motion(np.hstack([rod.positions, rod.orientations]), twists)
    _settle(rod, 3000)
    # So soft a thread hangs from the joints beside the hands, which hold the end elements level.
    free, wide = length * (1 - 2 / n), span - length / n
    a = brentq(lambda a: 2 * a * np.sinh(wide / (2 * a)) - free, 0.01, 1.0)
    sag = a * (np.cosh(wide / (2 * a)) - 1)
    assert rod.positions[:, 2].min() == pytest.approx(-sag, rel=0.01)
    pull = 1100.0 * np.pi * (0.05e-3) ** 2 * 9.81 * a
    assert rod.tension[n // 2] == pytest.approx(pull, rel=0.02)


def test_thread_with_locked_joints_stretches_by_less_than_a_thousandth_under_two_newtons(kit):
    n, length = 40, 0.0976
    description = kit.from_material(kit.line(n, length, axis=2), 0.38e-3, 1e9, 1100.0)
    gravity = np.zeros((n, 3))
    gravity[-1, 2] = 2.0 / description.mass[-1]
    locked = replace(description, compliance=np.full(n - 1, length / n / 4000.0), gravity=gravity)
    rod = kit.Bench([]).add(kit.damped(locked))
    rod.hold_element(0)
    _settle(rod, 1000)
    stretch = (rod.positions[-1, 2] - rod.positions[0, 2]) / (length * (1 - 1 / n)) - 1.0
    assert rod.tension[n // 2] == pytest.approx(2.0, rel=1e-3)
    assert stretch == pytest.approx(0.0005, rel=0.02)


def test_nylon_stretches_as_its_modulus_states(kit):
    n, length, diameter, youngs = 40, 0.1, 0.3e-3, 2e9
    description = kit.from_material(kit.line(n, length, axis=2), diameter, youngs, 1100.0)
    gravity = np.zeros((n, 3))
    gravity[-1, 2] = 2.0 / description.mass[-1]
    rod = kit.Bench([]).add(kit.damped(replace(description, gravity=gravity)))
    rod.hold_element(0)
    _settle(rod, 1000)
    strain = (rod.positions[-1, 2] - rod.positions[0, 2]) / (length * (1 - 1 / n)) - 1.0
    assert strain == pytest.approx(2.0 / (youngs * np.pi * diameter**2 / 4), rel=1e-3)
