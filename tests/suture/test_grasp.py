"""A needle between jaws: held, slipping by the law, held by two."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.frames import pose7_matrix
from ligature.suture.grasp import Grasp, Patch, share_of_limit
from ligature.suture.motion import Motion

DT, MASS, INERTIA = 1e-3, 1e-3, 1e-8


class Needle:
    """A free body that collects impulses."""

    def __init__(self):
        self.pose = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        self.twist = np.zeros(6)

    def motion(self, push):
        """Its motion with the wrench ``push`` (6,) of this tick taken in."""
        twist = self.twist + DT * np.r_[push[:3] / MASS, push[3:] / INERTIA]
        return Motion(self.pose, twist, 1.0 / MASS, np.full(3, 1.0 / INERTIA))

    def advance(self, motion, impulse):
        self.twist = motion.twist + np.r_[impulse[:3] / MASS, impulse[3:] / INERTIA]
        self.pose[:3] += DT * self.twist[:3]
        x, y, z, w = self.pose[3:]
        a, b, c = 0.5 * DT * self.twist[3:]
        q = np.array(
            [x + a * w + b * z - c * y, y + b * w + c * x - a * z, z + c * w + a * y - b * x, w - a * x - b * y - c * z]
        )
        self.pose[3:] = q / np.linalg.norm(q)


def _jaw(at=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0)):
    return Motion(np.r_[at, 0.0, 0.0, 0.0, 1.0], np.r_[velocity, 0.0, 0.0, 0.0], 0.0, np.zeros(3))


def _pull(force, moment=0.0, normal=10.0, ticks=500):
    """Pull a grasped needle along the pads and turn it about their normal; returns needle and last wrench."""
    grasp, needle = Grasp(Patch(np.eye(4), 0.001, 0.3), np.eye(4)), Needle()
    for _ in range(ticks):
        motion = needle.motion(np.array([force, 0.0, 0.0, 0.0, 0.0, moment]))
        on_needle, on_jaw = grasp.impulse(_jaw(), motion, normal, DT)
        assert on_jaw[:3] == pytest.approx(-on_needle[:3], abs=1e-12)
        needle.advance(motion, on_needle)
    return needle, on_needle / DT, grasp


def test_needle_pulled_below_the_limit_stays():
    needle, wrench, grasp = _pull(5.5)
    assert not grasp.slipped
    assert wrench[0] == pytest.approx(-5.5, rel=1e-6)
    assert np.linalg.norm(needle.pose[:3]) < 20e-6


def test_needle_pulled_above_the_limit_slides_against_the_limiting_force():
    needle, wrench, grasp = _pull(6.5, ticks=50)
    assert grasp.slipped
    assert wrench[0] == pytest.approx(-6.0, rel=1e-6)
    assert needle.twist[0] == pytest.approx(0.5 / MASS * 50 * DT, rel=0.02)


def test_needle_turns_about_the_pads_normal_when_the_moment_exceeds_the_limit():
    limit = 6.0 * 2.0 / 3.0 * 0.001
    held, _, still = _pull(0.0, 0.9 * limit)
    assert not still.slipped
    assert abs(held.pose[5]) < 1e-3
    turned, wrench, slipping = _pull(0.0, 1.1 * limit, ticks=20)
    assert slipping.slipped
    assert wrench[5] == pytest.approx(-limit, rel=1e-6)
    assert turned.twist[5] > 0.0


def test_force_and_moment_share_one_ellipse():
    assert share_of_limit(np.array([3.0, 0.0]), 0.0, (6.0, 0.004)) == pytest.approx(0.5)
    assert share_of_limit(np.array([6.0 * 0.6, 0.0]), 0.004 * 0.8, (6.0, 0.004)) == pytest.approx(1.0)
    assert share_of_limit(np.array([0.1, 0.0]), 0.0, (0.0, 0.0)) == float("inf")


def test_needle_across_the_pads_is_held_whatever_the_force():
    needle, wrench, grasp = _pull(0.0)
    for _ in range(200):
        motion = needle.motion(np.array([0.0, 0.0, 50.0, 0.0, 0.0, 0.0]))
        on_needle, _ = grasp.impulse(_jaw(), motion, 10.0, DT)
        needle.advance(motion, on_needle)
    assert on_needle[2] / DT == pytest.approx(-50.0, rel=1e-3)


def test_two_tools_that_disagree_share_a_needle_without_fighting():
    """The tools drift apart at 2 mm/s; neither ever pulls harder than its pads can."""
    needle = Needle()
    patches = [Patch(np.eye(4), 0.001, 0.3), Patch(np.eye(4), 0.001, 0.3)]
    rest = pose7_matrix(np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
    grasps = [Grasp(patches[0], rest), Grasp(patches[1], np.linalg.inv(rest))]
    largest = 0.0
    for k in range(1000):
        at = 0.002 * k * DT
        jaws = [_jaw((-0.01 - at, 0, 0), (-0.002, 0, 0)), _jaw((0.01 + at, 0, 0), (0.002, 0, 0))]
        motion = needle.motion(np.zeros(6))
        total = np.zeros(6)
        for grasp, jaw in zip(grasps, jaws, strict=True):
            now = Motion(
                motion.pose,
                motion.twist + np.r_[total[:3] / MASS, total[3:] / INERTIA],
                motion.inverse_mass,
                motion.inverse_inertia,
            )
            push, _ = grasp.impulse(jaw, now, 5.0, DT)
            largest = max(largest, np.linalg.norm(push[:3]) / DT)
            total += push
        needle.advance(motion, total)
    assert largest <= 3.0 * (1.0 + 1e-6)
    assert np.abs(needle.pose[0]) < 0.003
    assert np.isfinite(needle.pose).all()
