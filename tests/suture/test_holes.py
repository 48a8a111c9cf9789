"""Needles and threads in tissue holes: released, pulled along their arc, pushed aside, torn out."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from ligature.model.frames import matrix_pose7, minimal_rotation, pose7_matrix
from ligature.model.piercing import Arc, Hole, Needle, Tissue
from ligature.model.scene import Scene, WorldSettings
from ligature.suture.holes import Holes, settled_tissue
from ligature.suture.rods import Rods

DT, MASS, INERTIA, RADIUS = 1e-3, 2e-4, 1e-8, 0.01
ARC = Arc(np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), RADIUS, 0.0, np.pi)
HALF_WAY = np.array([0.0, RADIUS, 0.0])
NEEDLE, TISSUE = 0, 1


class Tissued:
    """A needle of 0.2 g in holes of a block, integrated freely but for the tissue."""

    def __init__(self, kit, holes=(HALF_WAY,), tissue=None, block_mass=0.0):
        bodies = (kit.body(NEEDLE, None, mass=MASS, inertia=INERTIA), kit.body(TISSUE, None, mass=block_mass))
        self.scene = Scene(
            "tissue", WorldSettings(), (), bodies, (),
            needles=(Needle(NEEDLE, ARC),),
            holes=tuple(self._hole(i, at, tissue or Tissue()) for i, at in enumerate(holes)),
        )  # fmt: skip
        self.bench = kit.Bench(bodies)
        self.wrench = np.zeros(6)
        self.holes = Holes(self.scene, Rods(self.scene, DT), self, DT)

    @staticmethod
    def _hole(index, at, tissue):
        angle = np.arctan2(at[1], at[0])
        T = np.eye(4)
        T[:3, :3] = minimal_rotation(np.array([0.0, 0.0, 1.0]), np.array([-np.sin(angle), np.cos(angle), 0.0]))
        T[:3, 3] = at
        return Hole(index, f"hole {index}", index, TISSUE, T, np.full(2, 0.002), tissue)

    def motion(self, body):
        return self.bench.motion(body)

    def read_motions(self, bodies, out):
        self.bench.read_motions(bodies, out)

    def apply_impulse(self, body, impulse, moment):
        self.bench.apply_impulse(body, impulse, moment)

    def mobility(self, body):
        b = self.scene.bodies[body]
        return np.zeros((6, 6)) if b.static else np.diag(np.r_[np.full(3, 1.0 / b.mass), 1.0 / b.inertia])

    def attached_load(self, body):
        return 0.0, np.zeros(3), self.wrench

    @property
    def pose(self):
        return self.bench.pose[NEEDLE]

    def run(self, ticks, wrench=(0.0,) * 6):
        """Advance with ``wrench`` on the needle, a function of its pose or constant."""
        for _ in range(ticks):
            self.wrench = np.array(wrench(self.pose) if callable(wrench) else wrench, dtype=float)
            self.holes.begin()
            self.holes.end()
            self.bench.apply_impulse(NEEDLE, self.wrench[:3] * DT, self.wrench[3:] * DT)
            self.bench.step()
        return self

    def off_arc(self, start):
        """How far the needle is off the arc that it passed through ``start`` (7,) with, at its middle and ends."""
        T, T0 = pose7_matrix(self.pose), pose7_matrix(start)
        points = np.array([ARC.point(d) for d in (0.0, ARC.length / 2, ARC.length)]) @ T[:3, :3].T + T[:3, 3]
        local = (points - T0[:3, 3]) @ T0[:3, :3]
        return float(np.hypot(np.hypot(local[:, 0], local[:, 1]) - RADIUS, local[:, 2]).max())


def test_released_needle_half_through_one_hole_stays_where_it_was_left(kit):
    tissue = Tissued(kit)
    weight = [0.0, 0.0, -9.81 * MASS, 0.0, 0.0, 0.0]
    tissue.run(10_000, weight)
    assert np.linalg.norm(tissue.pose[:3]) < 0.02e-3
    assert 2.0 * np.linalg.norm(tissue.pose[3:6]) * RADIUS < 0.02e-3
    (insertion,) = tissue.holes.insertions
    assert insertion.body == NEEDLE
    assert insertion.depth == pytest.approx(ARC.length / 2, abs=1e-5)
    assert insertion.force == pytest.approx([0.0, 0.0, 9.81 * MASS], rel=1e-3, abs=1e-9)


TWO_HOLES = tuple(RADIUS * np.array([[0.6, 0.8, 0.0], [-0.6, 0.8, 0.0]]))


def _along(force):
    """A force that draws the needle through the hole half way, along its arc there."""
    return lambda pose: np.r_[-force, 0.0, 0.0, np.cross(HALF_WAY - pose[:3], [-force, 0.0, 0.0])]


def test_needle_drawn_through_one_hole_follows_its_arc(kit):
    tissue = Tissued(kit)
    start = tissue.pose.copy()
    tissue.run(150, _along(0.6))
    assert tissue.holes.insertions[0].depth > ARC.length / 2 + 3e-3
    assert tissue.off_arc(start) < 0.1e-3


def test_needle_turned_about_its_centre_in_two_holes_follows_its_arc(kit):
    tissue = Tissued(kit, TWO_HOLES)
    start = tissue.pose.copy()
    tissue.run(600, [0.0, 0.0, 0.0, 0.0, 0.0, 3.0 * settled_tissue(Tissue(), 0.0).friction * RADIUS])
    assert 2.0 * np.arcsin(abs(tissue.pose[5])) * RADIUS > 2e-3
    assert tissue.off_arc(start) < 0.3e-3


def test_needle_pulled_at_its_tip_through_two_holes_follows_its_arc(kit):
    tissue = Tissued(kit, TWO_HOLES)
    start = tissue.pose.copy()

    def pull(pose):
        T = pose7_matrix(pose)
        tip, along = T[:3, :3] @ ARC.point(0.0), T[:3, :3] @ np.array([0.0, -1.0, 0.0])
        return np.r_[0.8 * along, np.cross(tip, 0.8 * along)]

    depth = tissue.run(1).holes.insertions[0].depth
    tissue.run(400, pull)
    assert tissue.holes.insertions[0].depth > depth + 1e-3
    assert tissue.off_arc(start) < 0.3e-3


def test_sliding_needle_feels_friction_and_drag_of_its_speed(kit):
    tissue = Tissued(kit, tissue=Tissue(friction=0.2, drag=10.0))
    tissue.run(300, _along(0.5))
    speed = tissue.bench.twist[NEEDLE][5] * RADIUS
    assert speed == pytest.approx((0.5 - 0.2) / 10.0, rel=0.05)


def test_needle_drawn_by_less_than_friction_does_not_move(kit):
    tissue = Tissued(kit)
    moment = _along(0.9 * 0.3)
    tissue.run(400, moment)
    before = tissue.pose.copy()
    tissue.run(5000, moment)
    assert np.abs(tissue.pose - before).max() < 1e-9


def test_needle_pushed_aside_gives_by_the_stiffness_of_the_tissue(kit):
    tissue = Tissued(kit, tissue=Tissue(stiffness=3000.0))
    force = np.array([0.0, 0.0, 0.3])
    tissue.run(1000, np.r_[force, np.cross(HALF_WAY, force)])
    assert tissue.pose[2] == pytest.approx(0.3 / 3000.0, rel=0.02)
    assert tissue.holes.insertions[0].force == pytest.approx([0.0, 0.0, -0.3], rel=1e-3, abs=1e-6)


def test_too_hard_a_push_tears_the_tissue_and_the_needle_stays_where_it_was_torn_to(kit):
    tissue = Tissued(kit, tissue=Tissue(strength=0.5))
    force = np.array([0.0, 0.0, 0.6])
    push = np.r_[force, np.cross(HALF_WAY, force)]
    tissue.run(40, push)
    torn = tissue.pose[2]
    assert torn > 3 * 0.5 / 4000.0
    tissue.run(500)
    assert tissue.pose[2] > 0.5 * torn


def test_needle_that_slides_out_of_its_hole_is_free(kit):
    tissue = Tissued(kit)
    ticks = 0
    while (tissue.holes.insertions or not ticks) and ticks < 300:
        tissue.run(1, _along(1.5))
        ticks += 1
    # Half of the needle at the speed at which drag and friction balance the force.
    assert ticks * DT == pytest.approx(ARC.length / 2 / ((1.5 - 0.3) / 10.0), rel=0.1)


@pytest.mark.parametrize("block_mass", [1e-4, 0.01])
def test_what_the_tissue_does_to_the_needle_the_needle_does_to_the_tissue(kit, block_mass):
    tissue = Tissued(kit, block_mass=block_mass)
    tissue.bench.twist[NEEDLE][:] = [0.02, 0.01, 0.03, 1.0, 2.0, 3.0]
    tissue.run(300)
    bench = tissue.bench
    momentum = MASS * bench.twist[NEEDLE][:3] + block_mass * bench.twist[TISSUE][:3]
    assert momentum == pytest.approx(MASS * np.array([0.02, 0.01, 0.03]), rel=1e-9)
    # They end up moving as one.
    assert bench.twist[NEEDLE][3:] == pytest.approx(bench.twist[TISSUE][3:], rel=0.05, abs=0.02)


def test_needle_outside_every_hole_feels_nothing(kit):
    tissue = Tissued(kit)
    tissue.bench.pose[NEEDLE][2] = 0.05
    tissue.run(50, [0.0, 0.0, 1e-3, 0.0, 0.0, 0.0])
    assert tissue.holes.insertions == ()
    assert tissue.bench.twist[NEEDLE] == pytest.approx([0.0, 0.0, 50 * DT * 1e-3 / MASS, 0.0, 0.0, 0.0])


def test_a_snapshot_continues_with_the_same_bits(kit):
    one, two = Tissued(kit), Tissued(kit)
    push = [0.1, 0.2, 0.1, 0.0, 0.001, 0.002]
    one.run(50, push)
    kept = copy.deepcopy(one.holes.snapshot())
    two.bench.pose = {k: v.copy() for k, v in one.bench.pose.items()}
    two.bench.twist = {k: v.copy() for k, v in one.bench.twist.items()}
    two.holes.restore(kept)
    one.run(50, push)
    two.run(50, push)
    assert (one.pose == two.pose).all()


def test_needle_that_was_put_elsewhere_leaves_no_passage_behind(kit):
    tissue = Tissued(kit).run(5)
    tissue.bench.pose[NEEDLE] = matrix_pose7(np.eye(4))
    tissue.bench.pose[NEEDLE][0] = 1.0
    tissue.holes.forget(NEEDLE)
    assert tissue.holes.insertions == ()
