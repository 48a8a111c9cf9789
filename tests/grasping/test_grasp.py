"""A needle between pads: held, slipping by the law, held by two; against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.grasping.friction import STIFFNESS
from ligature.grasping.grasp import Grasp, Patch, share_of_limit, solve_once
from ligature.grasping.motion import Motion
from ligature.model.frames import pose7_matrix

DT, MASS, INERTIA = 1e-3, 0.05, 1e-6
FRICTION, HALF_WIDTH, NORMAL = 0.3, 0.00125, 10.0
FORCE = 2 * FRICTION * NORMAL
GROWTH = 200
MOMENT = FORCE * HALF_WIDTH / 2


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


def _grasp(at=(0.0, 0.0, 0.0), normal=NORMAL):
    grasp = Grasp(Patch(np.eye(4), HALF_WIDTH, FRICTION), pose7_matrix(np.r_[at, 0, 0, 0, 1]))
    grasp.normal_force = normal
    return grasp


def _pull(wrench, ticks=500, normal=NORMAL):
    """Pull a grasped needle with a wrench (6,) that grows for 0.2 s, then lasts; the needle, the force on it, the grasp."""
    grasp, needle = _grasp(normal=normal), Needle()
    for k in range(GROWTH + ticks):
        motion = needle.motion(np.array(wrench, dtype=float) * min(1.0, k / GROWTH))
        on_needle, on_jaw = solve_once([grasp], [_jaw()], motion, DT)
        assert on_jaw[:3] == pytest.approx(-on_needle[:3], abs=1e-12)
        needle.advance(motion, on_needle)
    return needle, on_needle / DT, grasp


def test_needle_pulled_below_the_limit_gives_as_springs_do():
    needle, wrench, grasp = _pull([0.95 * FORCE, 0, 0, 0, 0, 0])
    assert not grasp.slides.any()
    assert grasp.share() == pytest.approx(0.95, rel=1e-3)
    assert wrench[0] == pytest.approx(-0.95 * FORCE, rel=1e-6)
    assert needle.pose[0] == pytest.approx(0.95 * FORCE / STIFFNESS, rel=1e-3)
    assert grasp.slipped == pytest.approx([0, 0], abs=1e-12)


def test_needle_pulled_above_the_limit_slides_against_the_limiting_force():
    ticks = 50
    needle, wrench, grasp = _pull([FORCE + 0.5, 0, 0, 0, 0, 0], ticks)
    assert grasp.slides[0]
    assert wrench[0] == pytest.approx(-FORCE, rel=1e-6)
    assert grasp.slipped[0] == pytest.approx(needle.pose[0] - FORCE / STIFFNESS, rel=0.02)
    before = needle.twist[0]
    later, _, _ = _pull([FORCE + 0.5, 0, 0, 0, 0, 0], ticks + 20)
    assert later.twist[0] - before == pytest.approx(0.5 / MASS * 20 * DT, rel=1e-6)


def test_needle_stays_where_it_slipped_to():
    grasp, needle = _grasp(), Needle()
    for tick in range(300):
        force = FORCE + 2.0 if tick < 30 else 0.0
        motion = needle.motion(np.array([force, 0, 0, 0, 0, 0]))
        on_needle, _ = solve_once([grasp], [_jaw()], motion, DT)
        needle.advance(motion, on_needle)
    assert np.abs(needle.twist).max() < 1e-6
    assert needle.pose[0] == pytest.approx(grasp.slipped[0], rel=0.02)
    assert needle.pose[0] > 1e-3


def test_needle_turns_about_the_pads_normal_when_the_moment_exceeds_the_limit():
    held, _, still = _pull([0, 0, 0, 0, 0, 0.95 * MOMENT])
    assert not still.slides.any()
    turned, wrench, slipping = _pull([0, 0, 0, 0, 0, 1.1 * MOMENT], 20)
    assert slipping.slides[0]
    assert wrench[5] == pytest.approx(-MOMENT, rel=1e-6)
    assert slipping.slipped[1] > 0.0


@pytest.mark.parametrize("angle", [0.2, 0.7, 1.2])
def test_force_and_moment_share_one_ellipse(angle):
    """Pulled and turned at once, along and across: 3 % below the ellipse it holds, 3 % above it slips."""
    on_edge = np.array([FORCE * np.cos(angle) * 0.6, FORCE * np.cos(angle) * 0.8, 0, 0, 0, MOMENT * np.sin(angle)])
    assert share_of_limit(on_edge[:2], on_edge[5], (FORCE, MOMENT)) == pytest.approx(1.0)
    assert not _pull(0.97 * on_edge)[2].slipped.any()
    assert _pull(1.03 * on_edge, 60)[2].slipped.all()


def test_needle_pushed_across_the_pads_is_held_up_to_the_force_between_the_fingers():
    needle, wrench, grasp = _pull([0, 0, 0.9 * NORMAL, 0, 0, 0])
    assert wrench[2] == pytest.approx(-0.9 * NORMAL, rel=1e-4)
    assert not grasp.slides.any()
    _, wrench, grasp = _pull([0, 0, 1.1 * NORMAL, 0, 0, 0], 50)
    assert wrench[2] == pytest.approx(-NORMAL, rel=1e-6)
    assert grasp.slides[1]


def test_harder_closed_jaws_hold_more():
    wrench = [1.5 * FORCE, 0, 0, 0, 0, 0]
    assert _pull(wrench)[2].slides[0]
    assert not _pull(wrench, normal=2 * NORMAL)[2].slides.any()


def test_two_tools_that_drift_apart_share_a_needle_and_slip_alike():
    """The tools drift apart at 2 mm/s; both slip on the same force, and the needle stays in the middle."""
    needle = Needle()
    grasps = [_grasp((0.01, 0, 0)), _grasp((-0.01, 0, 0))]
    largest = 0.0
    for k in range(1000):
        at = 0.002 * k * DT
        jaws = [_jaw((-0.01 - at, 0, 0), (-0.002, 0, 0)), _jaw((0.01 + at, 0, 0), (0.002, 0, 0))]
        motion = needle.motion(np.zeros(6))
        impulses = solve_once(grasps, jaws, motion, DT)
        largest = max(largest, np.abs(impulses[1:, :3]).max() / DT)
        needle.advance(motion, impulses[0])
    assert largest <= FORCE * (1.0 + 1e-9)
    assert largest > 0.99 * FORCE
    assert abs(needle.pose[0]) < 0.0025
    assert sum(grasp.slipped[0] for grasp in grasps) == pytest.approx(0.004 - 2 * FORCE / STIFFNESS, rel=0.02)


def test_two_tools_that_hold_still_do_not_fight():
    """Held 0.1 mm apart from where they grasped, they pull no more than the springs of one in series with the other's."""
    needle = Needle()
    grasps = [_grasp((0.01, 0, 0)), _grasp((-0.01, 0, 0))]
    for _ in range(300):
        motion = needle.motion(np.zeros(6))
        impulses = solve_once(grasps, [_jaw((-0.01, 0, 0)), _jaw((0.0101, 0, 0))], motion, DT)
        needle.advance(motion, impulses[0])
    assert grasps[0].load[0] == pytest.approx(-0.5e-4 * STIFFNESS, rel=1e-3)
    assert needle.pose[0] == pytest.approx(0.5e-4, rel=1e-3)
