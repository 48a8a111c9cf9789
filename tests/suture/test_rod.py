"""What a rod refuses, remembers, repeats and survives."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest
from ligature.model.shapes import Box, Plane
from ligature.suture.description import FREE, Attachment


@pytest.mark.parametrize(
    ("points", "data", "message"),
    [
        (np.zeros((4, 3)), (1e-3, 1e9, 1100.0), "at least three points, no two neighbours alike"),
        (np.eye(3)[:2], (1e-3, 1e9, 1100.0), "at least three points"),
        (np.eye(3), (0.0, 1e9, 1100.0), "diameter is 0; it must be positive"),
        (np.eye(3), (1e-3, -1.0, 1100.0), "Young's modulus is -1; it must be positive"),
        (np.eye(3), (1e-3, 1e9, float("nan")), "density is nan; it must be positive"),
    ],
)
def test_impossible_threads_are_refused_with_the_reason(kit, points, data, message):
    with pytest.raises(ValueError, match=message):
        kit.from_material(points, *data)


def test_element_without_length_is_named(kit):
    description = kit.from_material(kit.line(5, 0.1), 1e-3, 1e9, 1100.0)
    ends = description.ends.copy()
    ends[3] = 0.0
    with pytest.raises(ValueError, match="element 3 has length 0 m; give it a positive one"):
        replace(description, ends=ends)


def test_attachment_to_an_unknown_body_is_refused(kit):
    description = kit.from_material(kit.line(5, 0.1), 1e-3, 1e9, 1100.0)
    none = np.zeros(3)
    attachment = Attachment(0, 9, np.eye(4), np.eye(4), none, none, none, *FREE)
    with pytest.raises(ValueError, match="attached to body 9, which is missing in its partners"):
        kit.Bench([]).add(replace(description, attachments=(attachment,)))


def _messy(kit):
    """A thread falling on a tilted box and on itself, attached to a free body."""
    s = np.linspace(0.0, 1.0, 41)
    points = np.stack([0.02 * np.cos(9 * s), 0.015 * np.sin(9 * s), 0.012 + 0.01 * s], axis=1)
    bench = kit.Bench(
        [kit.body(0, Box(np.array([0.05, 0.05, 0.02]))), kit.body(1, None, points[-1], mass=1e-4, inertia=1e-9)],
        gravity=(0.0, 0.0, -9.81),
    )
    description = kit.from_material(points, 0.5e-3, 1e7, 1100.0, straight=False)
    T = np.eye(4)
    T[:3, 3] = description.ends[-1, 1]
    none = np.zeros(3)
    rod = bench.add(replace(description, attachments=(Attachment(39, 1, T, np.eye(4), none, none, none, *FREE),)))
    return bench, rod


def test_same_start_gives_the_same_bits(kit):
    ends = []
    for _ in range(2):
        bench, rod = _messy(kit)
        bench.step(300)
        ends.append(np.concatenate([rod.positions.ravel(), rod.twists.ravel(), rod.tension]).tobytes())
    assert ends[0] == ends[1]


def test_rod_continues_from_its_memory_with_the_same_bits(kit):
    bench, rod = _messy(kit)
    bench.step(150)
    kept = copy.deepcopy(rod.snapshot())
    pose, twist = ({b: v.copy() for b, v in d.items()} for d in (bench.pose, bench.twist))
    bench.step(100)
    expected = rod.positions.tobytes()
    rod.restore(kept)
    bench.pose, bench.twist = pose, twist
    bench.colliders.restart()
    bench.step(100)
    assert rod.positions.tobytes() == expected


def test_reset_puts_a_rod_back_to_where_it_started(kit):
    bench, rod = _messy(kit)
    start = rod.positions.copy()
    bench.step(50)
    rod.reset()
    assert np.array_equal(rod.positions, start)
    assert not rod.twists.any()


def test_joint_stops_at_its_limit(kit):
    """A heavy thread, clamped at one end, bends at no joint further than its limit allows."""
    n = 10
    description = kit.from_material(kit.line(n, 0.05), 1e-3, 1e4, 8000.0)
    limit = np.full((n - 1, 3), 0.1)
    rod = kit.Bench([]).add(kit.damped(replace(description, low=-limit, high=limit)))
    rod.hold_element(0)
    for _ in range(2000):
        rod.step()
    assert np.abs(rod.joints.angle).max() < 0.12
    assert np.abs(rod.joints.angle[0]).max() > 0.095


def test_spring_rests_at_its_equilibrium(kit):
    description = kit.from_material(kit.line(10, 0.05), 1e-3, 1e8, 1100.0, gravity=(0, 0, 0))
    rest = np.zeros((9, 3))
    rest[:, 1] = 0.05
    rod = kit.Bench([]).add(kit.damped(replace(description, rest=rest), 1 - 1e-9))
    for _ in range(2000):
        rod.step()
    assert rod.joints.angle[:, 1] == pytest.approx(0.05, abs=1e-4)


def test_damping_of_a_joint_is_physical(kit):
    """A wheel of inertia I on a joint without stiffness loses its spin at the rate d / I."""
    inertia, damping = 1e-8, 1e-7
    description = kit.from_material(kit.line(2, 0.02), 1e-3, 1e6, 1100.0, gravity=(0, 0, 0))
    none = np.zeros((1, 3))
    rod = kit.Bench([]).add(
        replace(
            description,
            inertia=np.full((2, 3), inertia),
            joint_stiffness=none,
            joint_damping=none + damping,
        )
    )
    rod.hold_element(0)
    twists = np.zeros((2, 6))
    twists[1, 3] = 0.1
    rod.set_motion(np.hstack([rod.positions, rod.orientations]), twists)
    for _ in range(100):
        rod.step()
    assert rod.twists[1, 3] == pytest.approx(0.1 * (1.0 + damping / inertia * kit.DT) ** -100, rel=1e-6)


def test_two_thousand_elements_fall_on_a_floor_and_stay_finite(kit):
    s = np.linspace(0.0, 40 * np.pi, 2001)
    points = np.stack([0.02 * np.cos(s), 0.02 * np.sin(s), 0.0004 + 2e-4 * s], axis=1)
    bench = kit.Bench([kit.body(0, Plane(np.array([0.0, 0.0, 1.0]), 0.0))])
    rod = bench.add(kit.from_material(points, 0.3e-3, 1e8, 1100.0, straight=False))
    bench.step(12)
    assert rod.finite()
    assert rod.positions[:, 2].min() > 0.0


def test_body_teleported_onto_a_thread_never_makes_it_diverge(kit):
    bench = kit.Bench([kit.body(0, Box(np.full(3, 0.01)), at=(0.0, 0.0, 0.1))])
    rod = bench.add(kit.from_material(kit.line(40, 0.05, start=(-0.025, 0.0, 0.0)), 0.4e-3, 1e9, 1100.0))
    rod.hold_element(0)
    rod.hold_element(39)
    bench.step(20)
    bench.pose[0][2] = 0.0
    bench.step(300)
    assert rod.finite()
    assert np.abs(rod.twists[:, :3]).max() < 1.0


def test_attachment_holds_an_element_to_a_moving_body_until_released(kit):
    bench = kit.Bench([kit.body(0, Box(np.full(3, 0.001)), at=(0.025, 0.0, 0.02))])
    rod = bench.add(kit.from_material(kit.line(20, 0.05), 0.4e-3, 1e8, 1100.0))
    T = np.eye(4)
    T[:3, 3] = rod.positions[10] - np.array([0.025, 0.0, 0.02])
    T_element = np.eye(4)
    rod.attach(10, 0, T_element, T)
    bench.twist[0][2] = 0.05
    bench.step(400)
    assert rod.positions[10, 2] == pytest.approx(0.02, abs=0.2e-3)
    rod.detach(10, 0)
    bench.step(200)
    assert rod.positions[10, 2] < 0.0


def test_thread_of_milligrams_between_two_hands_survives_taut_jerks(kit):
    """40 elements, 7 mg in all: pulled taut, then jerked at 0.5 m/s back and forth."""
    n, length = 40, 0.0976
    description = kit.from_material(kit.line(n, length), 0.3e-3, 2e9, 1100.0)
    rod = kit.Bench([]).add(description)
    rod.hold_element(0)
    rod.hold_element(n - 1)
    for k in range(3000):
        twists = rod.twists
        twists[[0, -1]] = 0.0
        twists[-1, 0] = 0.002 if k < 500 else 0.5 * (1 if (k // 2) % 2 else -1)
        rod.set_motion(np.hstack([rod.positions, rod.orientations]), twists)
        rod.step()
    assert rod.finite()
    assert np.abs(rod.positions[:, 1:]).max() < 0.5e-3
    assert 0.0 < rod.tension[n // 2] < 30.0
