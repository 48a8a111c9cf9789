"""Rods on, around and inside bodies, and against themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from ligature.model.frames import axis_rotation
from ligature.model.shapes import Box, Capsule, Cylinder, Hull, Plane, Sphere

UP = np.array([0.0, 0.0, 1.0])


def _cube(half):
    return Hull(np.array([[x, y, z] for x in (-half, half) for y in (-half, half) for z in (-half, half)]))


@pytest.mark.parametrize(
    "shape",
    [Box(np.full(3, 0.04)), _cube(0.02), Plane(UP, 0.02), Cylinder(0.02, 0.04)],
    ids=["box", "hull", "plane", "cylinder"],
)
def test_thread_dropped_on_a_flat_top_comes_to_rest_on_it(kit, shape):
    bench = kit.Bench([kit.body(0, shape)])
    rod = bench.add(kit.from_material(kit.line(10, 0.02, start=(-0.01, 0.0, 0.023)), 1e-3, 1e7, 1100.0))
    bench.step(400)
    assert rod.positions[:, 2] == pytest.approx(0.0205, abs=0.02e-3)
    start = rod.positions.copy()
    bench.step(1000)
    assert np.abs(rod.positions - start).max() < 1e-6
    weight = rod.description.mass.sum() * 9.81
    count = rod.contacts.count[0]
    assert rod.contacts.force[:count, 2].sum() == pytest.approx(weight, rel=1e-3)


@pytest.mark.parametrize(
    "shape", [Sphere(0.01), Capsule(0.01, 0.06), Cylinder(0.01, 0.06)], ids=["ball", "capsule", "rod"]
)
def test_thread_hung_over_a_round_body_stays_outside_it(kit, shape):
    bench = kit.Bench([kit.body(0, shape, R=axis_rotation((1.0, 0.0, 0.0), np.pi / 2))])
    description = kit.from_material(kit.line(40, 0.08, start=(-0.04, 0.0, 0.011)), 1e-3, 1e5, 1100.0)
    rod = bench.add(kit.damped(description, 0.99))
    bench.step(1000)
    off = (
        np.linalg.norm(rod.positions[:, [0, 2]], axis=1)
        if not isinstance(shape, Sphere)
        else np.linalg.norm(rod.positions, axis=1)
    )
    assert off.min() > 0.0105 - 0.1e-3
    assert rod.positions[[0, -1], 2].max() < -0.01


def _slope(kit, friction, angle):
    """Distance a thread slides down a slope in half a second."""
    R = axis_rotation((0.0, 1.0, 0.0), angle)
    bench = kit.Bench([kit.body(0, Box(np.array([1.0, 1.0, 0.02])), R=R, friction=friction)])
    points = kit.line(10, 0.02, start=(0.0, 0.0, 0.0105)) @ R.T
    rod = bench.add(kit.from_material(points, 1e-3, 1e7, 1100.0, friction=1.0))
    bench.step(100)
    start = rod.positions.copy()
    speed = rod.twists[:, :3].mean(axis=0) @ (R @ np.array([1.0, 0, 0]))
    bench.step(500)
    return float(np.linalg.norm(rod.positions - start, axis=1).max()), speed * 0.5


def test_thread_holds_on_a_slope_flatter_than_the_friction_angle(kit):
    moved, _ = _slope(kit, 0.5, np.arctan(0.45))
    assert moved < 20e-6


def test_thread_slides_on_a_steeper_slope_with_coulombs_acceleration(kit):
    angle = np.arctan(0.7)
    moved, carried = _slope(kit, 0.5, angle)
    acceleration = 9.81 * (np.sin(angle) - 0.5 * np.cos(angle))
    assert moved == pytest.approx(carried + 0.5 * acceleration * 0.25, rel=0.02)


def _over_a_post(kit, friction, ratio):
    """Speed of a thread over a round post half a second after its ends are loaded in ``ratio``."""
    n, radius, thick = 100, 5e-3, 0.4e-3
    bench = kit.Bench(
        [kit.body(0, Cylinder(radius, 0.02), R=axis_rotation((1.0, 0.0, 0.0), np.pi / 2), friction=friction)]
    )
    arc = np.pi * (radius + 0.5 * thick)
    length = 0.05
    s = np.linspace(-length / 2, length / 2, n + 1)
    around = np.clip(s / (radius + 0.5 * thick), -np.pi / 2, np.pi / 2)
    down = np.maximum(np.abs(s) - arc / 2, 0.0)
    r = radius + 0.5 * thick + 2e-6
    points = np.stack([r * np.sin(around), np.zeros(n + 1), r * np.cos(around) - down], axis=1)
    description = kit.from_material(points, thick, 1e8, 1100.0, friction=1.0, gravity=(0, 0, 0))
    stiffness = 0.1 * description.joint_stiffness  # as supple as silk: bending carries a hundredth of the load
    mass = description.mass.copy()
    mass[[0, -1]] = 1e-3
    gravity = np.zeros((n, 3))
    rod = bench.add(kit.damped(replace(description, joint_stiffness=stiffness, mass=mass, gravity=gravity), 0.9))

    def load(share):
        rod.set_gravity(0, (0.0, 0.0, -50.0))
        rod.set_gravity(n - 1, (0.0, 0.0, -50.0 * share))

    load(1.0)
    bench.step(100)
    for share in np.linspace(1.0, ratio, 200):
        load(share)
        bench.step()
    bench.step(100)
    start = rod.positions[-1, 2]
    bench.step(300)
    return (start - rod.positions[-1, 2]) / 0.3


@pytest.mark.parametrize("friction", [0.2, 0.4])
def test_thread_around_a_post_slips_at_the_capstan_ratio(kit, friction):
    limit = np.exp(friction * np.pi)
    assert abs(_over_a_post(kit, friction, 0.9 * limit)) < 1e-3
    assert _over_a_post(kit, friction, 1.1 * limit) > 0.05


def test_fast_thread_does_not_pass_through_a_thin_plate(kit):
    bench = kit.Bench([kit.body(0, Box(np.array([0.1, 0.1, 0.2e-3])))])
    description = kit.from_material(kit.line(20, 0.04, start=(-0.02, 0.0, 0.01)), 0.2e-3, 1e8, 1100.0)
    rod = bench.add(description)
    twists = np.zeros((20, 6))
    twists[:, 2] = -2.0
    rod.set_motion(np.hstack([rod.positions, rod.orientations]), twists)
    bench.step(100)
    assert rod.positions[:, 2].min() > 0.19e-3


def test_moving_plate_carries_a_thread_along(kit):
    bench = kit.Bench([kit.body(0, Box(np.array([0.2, 0.2, 0.02])), friction=1.0)])
    rod = bench.add(kit.from_material(kit.line(10, 0.02, start=(-0.01, 0.0, 0.0105)), 1e-3, 1e7, 1100.0, friction=1.0))
    bench.step(50)
    start = rod.positions.copy()
    for _ in range(500):
        bench.twist[0][0] = 0.05
        bench.step()
    assert rod.positions[:, 0] - start[:, 0] == pytest.approx(0.025, abs=0.3e-3)


def test_thread_that_starts_inside_a_body_comes_out_gently(kit):
    bench = kit.Bench([kit.body(0, Box(np.full(3, 0.02)))])
    rod = bench.add(kit.from_material(kit.line(20, 0.01, start=(-0.005, 0.0, 0.005)), 0.4e-3, 1e8, 1100.0))
    top_speed = 0.0
    for _ in range(400):
        bench.step()
        top_speed = max(top_speed, np.abs(rod.twists[:, :3]).max())
    assert rod.finite()
    assert np.abs(rod.positions).max(axis=1).min() > 0.0101
    assert top_speed < 0.5


@pytest.mark.parametrize("mass", [1e-6, 1e-4, 1.0])
def test_momentum_is_kept_when_a_thread_hits_a_free_body(kit, mass):
    bench = kit.Bench([kit.body(0, Box(np.full(3, 0.01)), mass=mass, inertia=mass * 2e-5)])
    description = kit.from_material(
        kit.line(10, 0.02, start=(-0.01, 0.0, 0.006)), 0.5e-3, 1e8, 1100.0, gravity=(0, 0, 0)
    )
    rod = bench.add(description)
    twists = np.zeros((10, 6))
    twists[:, 2] = -0.3
    rod.set_motion(np.hstack([rod.positions, rod.orientations]), twists)
    before = description.mass.sum() * -0.3
    bench.step(100)
    after = description.mass @ rod.twists[:, 2] + mass * bench.twist[0][2]
    assert after == pytest.approx(before, rel=1e-4)
    assert bench.twist[0][2] < 0.0


def test_thread_falling_on_itself_does_not_pass_through(kit):
    """A loop dropped on its own lower strand, crossing it."""
    s = np.linspace(0.0, 1.0, 61)
    points = np.stack([0.02 * np.cos(2 * np.pi * s), 0.01 * np.sin(4 * np.pi * s), 0.003 + 0.006 * s], axis=1)
    bench = kit.Bench([kit.body(0, Plane(UP, 0.0))])
    rod = bench.add(kit.damped(kit.from_material(points, 1e-3, 1e6, 1100.0, straight=False), 0.99))
    bench.step(1500)
    low = rod.positions[:, 2].min()
    assert low > 0.45e-3
    # Where the figure of eight crosses, one strand lies on the other.
    assert rod.positions[:, 2].max() > 1.2e-3
    assert np.abs(rod.twists[:, :3]).max() < 5e-3
