"""Motion of rods against closed forms and conservation laws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from ligature.model.frames import pose7_matrix
from ligature.suture.description import FREE, Attachment


def _crossings(values, dt):
    """Times at which a signal passes zero upwards."""
    v = np.asarray(values)
    i = np.flatnonzero((v[:-1] < 0) & (v[1:] >= 0))
    return dt * (i - v[i] / (v[i + 1] - v[i]))


def test_free_rod_falls_as_a_stone(kit):
    rod = kit.Bench([]).add(kit.from_material(kit.line(40, 0.1), 0.3e-3, 2e9, 1100.0))
    start = rod.positions.copy()
    for _ in range(500):
        rod.step()
    fall = rod.positions - start
    # Implicit Euler: sum of g dt² k over k = 1 … 500.
    assert fall[:, 2] == pytest.approx(-9.81 * 1e-6 * 500 * 501 / 2, rel=1e-9)
    assert np.abs(fall[:, :2]).max() < 1e-12


def test_cantilever_swings_at_its_first_bending_frequency(kit):
    n, length, diameter, youngs, density = 40, 0.1, 1e-3, 2e7, 1100.0
    description = kit.from_material(kit.line(n, length), diameter, youngs, density, gravity=(0, 0, 0))
    rod = kit.Bench([]).add(description)
    rod.hold_element(0)
    span = length * (1 - 0.5 / n)
    x = (rod.positions[:, 0] - rod.positions[0, 0]) / span
    twists = np.zeros((n, 6))
    # The first mode of a clamped-free beam, to a per cent: x² (6 - 4 x + x²) / 3.
    twists[:, 2] = 0.02 * x**2 * (6 - 4 * x + x**2) / 3
    twists[:, 4] = -0.02 * (12 * x - 12 * x**2 + 4 * x**3) / 3 / span
    rod.set_motion(np.hstack([rod.positions, rod.orientations]), twists)
    tip = []
    for _ in range(2500):
        rod.step()
        tip.append(rod.positions[-1, 2])
    period = np.diff(_crossings(tip, kit.DT)).mean()
    stiffness = youngs * np.pi * diameter**4 / 64
    per_length = density * np.pi * diameter**2 / 4
    assert period == pytest.approx(2 * np.pi / (3.51602 * np.sqrt(stiffness / per_length) / span**2), rel=0.02)


def test_wheel_on_a_rod_turns_back_and_forth_at_its_torsional_frequency(kit):
    n, length, diameter, youngs, wheel = 20, 0.1, 1e-3, 2e7, 1e-8
    description = kit.from_material(kit.line(n, length), diameter, youngs, 1100.0, gravity=(0, 0, 0))
    inertia = description.inertia.copy()
    inertia[-1] = wheel
    rod = kit.Bench([]).add(replace(description, inertia=inertia))
    rod.hold_element(0)
    twists = np.zeros((n, 6))
    twists[:, 3] = np.linspace(0.0, 2.0, n)
    rod.set_motion(np.hstack([rod.positions, rod.orientations]), twists)
    angle = []
    for _ in range(2000):
        rod.step()
        angle.append(rod.joints.angle[:, 2].sum())
    period = np.diff(_crossings(angle, kit.DT)).mean()
    shear = youngs / 2.8
    twist = shear * np.pi * diameter**4 / 32 / (length * (1 - 1 / n))
    assert period == pytest.approx(2 * np.pi * np.sqrt(wheel / twist), rel=0.02)


def test_energy_never_grows_while_a_thread_whips_about(kit):
    description = kit.from_material(kit.line(60, 0.15), 0.5e-3, 1e8, 1100.0)
    rod = kit.Bench([]).add(description)
    rod.hold_element(0)
    before = kit.energy(rod)
    start = before
    scale = float((description.mass * 9.81).sum()) * 0.15
    for _ in range(3000):
        rod.step()
        now = kit.energy(rod)
        assert now <= before + 1e-6 * scale
        before = now
    assert before < start - 0.1 * scale


def _attachment(element, body, offset):
    T = np.eye(4)
    T[:3, 3] = offset
    return Attachment(element, body, T, np.eye(4), np.zeros(3), np.zeros(3), np.zeros(3), *FREE)


@pytest.mark.parametrize("mass", [1e-7, 1e-3, 0.5, 100.0])
def test_momentum_passes_between_rod_and_body_without_loss(kit, mass):
    description = kit.from_material(kit.line(20, 0.1), 1e-3, 1e8, 1100.0, gravity=(0, 0, 0))
    bench = kit.Bench([kit.body(0, None, (0.1, 0.0, 0.0), mass=mass, inertia=mass * 1e-5)])
    rod = bench.add(replace(description, attachments=(_attachment(19, 0, description.ends[-1, 1]),)))
    twists = np.zeros((20, 6))
    twists[:, 1] = np.linspace(0.5, 0.0, 20)
    twists[:, 2] = 0.2
    rod.set_motion(np.hstack([rod.positions, rod.orientations]), twists)

    def momentum():
        p, v = rod.positions, rod.twists
        linear = description.mass @ v[:, :3] + mass * bench.twist[0][:3]
        angular = (description.mass[:, None] * np.cross(p, v[:, :3])).sum(axis=0)
        angular = angular + mass * np.cross(bench.pose[0][:3], bench.twist[0][:3])
        for e, q in enumerate(rod.orientations):
            R = pose7_matrix(np.r_[0.0, 0.0, 0.0, q])[:3, :3]
            angular = angular + R @ (description.inertia[e] * (R.T @ v[e, 3:]))
        return linear, angular + mass * 1e-5 * bench.twist[0][3:]

    before = momentum()
    bench.step(300)
    after = momentum()
    moved = description.mass.sum() * 0.3
    assert after[0] == pytest.approx(before[0], abs=1e-5 * moved)
    # Angular momentum drifts by the step of implicit Euler alone.
    assert after[1] == pytest.approx(before[1], abs=0.02 * moved * 0.1)
    assert np.linalg.norm(bench.twist[0][:3]) > 0.0


def test_weight_a_million_times_an_element_swings_as_a_pendulum(kit):
    n, length = 40, 0.1
    description = kit.from_material(kit.line(n, -length, axis=2), 0.3e-3, 2e9, 1100.0)
    bench = kit.Bench([kit.body(0, None, (0.0, 0.0, -length), mass=0.2, inertia=1e-5)], gravity=(0, 0, -9.81))
    rod = bench.add(replace(description, attachments=(_attachment(n - 1, 0, description.ends[-1, 1]),)))
    rod.hold_element(0)
    bench.twist[0][0] = 0.03
    x = []
    bench.step(3000, lambda: x.append(bench.pose[0][0]))
    period = np.diff(_crossings(x[500:], kit.DT)).mean()
    reach = length * (1 - 0.5 / n) * (1.0 + 0.2 * 9.81 / (2e9 * np.pi * 0.15e-3**2))
    assert period == pytest.approx(2 * np.pi * np.sqrt(reach / 9.81), rel=0.02)
    assert rod.tension[n // 2] == pytest.approx(0.2 * 9.81, rel=0.02)
