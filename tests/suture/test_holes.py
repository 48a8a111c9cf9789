"""A needle in tissue: released, pulled along its arc, pushed aside."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.suture.holes import Arc, Tissue, fit_arc, insertions
from ligature.suture.motion import Motion

DT, MASS, INERTIA = 1e-3, 2e-4, 1e-8
ARC = Arc(np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), 0.01, 0.0, np.pi)
HOLES = 0.01 * np.array([[np.cos(a), np.sin(a), 0.0] for a in (np.pi / 4, np.pi / 2, 3 * np.pi / 4)])


def _run(push, ticks, pose=None):
    """Push a needle that passes entry, channel and exit; ``push(pose)`` gives the wrench (6,)."""
    pose = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]) if pose is None else pose
    twist = np.zeros(6)
    state = []
    for _ in range(ticks):
        wrench = push(pose)
        free = twist + DT * np.r_[wrench[:3] / MASS, wrench[3:] / INERTIA]
        needle = Motion(pose, free, 1.0 / MASS, np.full(3, 1.0 / INERTIA))
        impulse, state = insertions(needle, ARC, HOLES, np.zeros((3, 3)), Tissue(), DT)
        twist = free + np.r_[impulse[:3] / MASS, impulse[3:] / INERTIA]
        pose[:3] += DT * twist[:3]
        x, y, z, w = pose[3:]
        a, b, c = 0.5 * DT * twist[3:]
        q = np.array(
            [x + a * w + b * z - c * y, y + b * w + c * x - a * z, z + c * w + a * y - b * x, w - a * x - b * y - c * z]
        )
        pose[3:] = q / np.linalg.norm(q)
    return pose, twist, state


def test_arc_is_found_from_points_along_a_needle():
    angles = np.linspace(0.3, 2.9, 30)
    points = 0.012 * np.stack([np.cos(angles), np.zeros(30), np.sin(angles)], axis=1) + 0.005
    arc = fit_arc(points)
    assert arc.radius == pytest.approx(0.012, rel=1e-9)
    assert arc.centre == pytest.approx(np.full(3, 0.005), abs=1e-9)
    depth, at, _ = arc.nearest(points[-1])
    assert depth == pytest.approx(0.0, abs=1e-9)
    assert at == pytest.approx(points[-1], abs=1e-9)
    assert arc.nearest(points[0])[0] == pytest.approx(0.012 * 2.6, rel=1e-9)


def test_three_points_on_a_line_make_no_arc():
    with pytest.raises(ValueError, match="not on one line"):
        fit_arc(np.outer(np.arange(3.0), np.ones(3)))


def test_released_needle_stays_where_it_was_left():
    weight = np.array([0.0, 0.0, -MASS * 9.81, 0.0, 0.0, 0.0])
    pose, twist, state = _run(lambda pose: weight, 10_000)
    assert np.linalg.norm(pose[:3]) < 0.2e-3
    assert np.linalg.norm(twist[:3]) < 1e-6
    assert [round(s.depth / 0.01, 2) for s in state] == [2.36, 1.57, 0.79]


def test_needle_turned_along_its_arc_follows_it():
    # Enough moment about the arc's centre to overcome the friction of all points, and drag sets the pace.
    pose, twist, _ = _run(lambda pose: np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.008]), 1000)
    assert twist[5] > 0.1
    assert np.linalg.norm(pose[:3]) < 0.3e-3


def test_needle_turned_by_less_than_friction_does_not_move():
    moment = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.005])
    # The tissue gives a little at first; then nothing moves.
    pose, _, _ = _run(lambda pose: moment, 1000)
    start = pose[5]
    pose, _, _ = _run(lambda pose: moment, 3000, pose)
    assert abs(2.0 * (pose[5] - start)) * ARC.radius < 0.02e-3


def test_needle_pushed_aside_at_its_channel_gives_by_the_stiffness_of_the_tissue():
    """The push goes through the middle of the three points, and they share it."""
    middle = HOLES.mean(axis=0)
    force = np.array([0.0, 0.0, 0.3])
    pose, _, state = _run(lambda pose: np.r_[force, np.cross(middle, force)], 2000)
    assert [s.force[2] for s in state] == pytest.approx([-0.1] * 3, rel=0.02)
    assert pose[2] == pytest.approx(0.1 / Tissue().stiffness, rel=0.02)


def test_needle_outside_every_hole_feels_nothing():
    needle = Motion(np.array([0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0]), np.ones(6), 1.0 / MASS, np.full(3, 1e8))
    impulse, state = insertions(needle, ARC, HOLES, np.zeros((3, 3)), Tissue(), DT)
    assert not impulse.any()
    assert state == []
