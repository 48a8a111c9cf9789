"""Jaws on a thread: grasped, sliding by Coulomb's law, released."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.frames import minimal_rotation, pose7_matrix
from ligature.simulation import Snapshot

from tests.grasping.theatre import DEPTH, Theatre, matrix_pose7

FRICTION = 0.25
ELEMENT = 20


class Stretched(Theatre):
    """A weightless thread, straight through the open jaws of PSM1 along their axis; the needle at its end is driven."""

    def __init__(self) -> None:
        super().__init__()
        self.open("PSM1")
        self.rod = self.sim._suture.rods.rods[0]
        for element in range(len(self.rod.positions)):
            self.rod.set_gravity(element, (0.0, 0.0, 0.0))
        H = self.palm("PSM1")
        axis, between = H[:3, 2], H[:3, 3] - DEPTH * H[:3, 1]
        along = self.rod.positions[ELEMENT + 5] - self.rod.positions[ELEMENT - 5]
        R, N = minimal_rotation(along / np.linalg.norm(along), axis), pose7_matrix(self.needle.pose)
        T = np.eye(4)
        T[:3, :3] = R @ N[:3, :3]
        T[:3, 3] = between + R @ (N[:3, 3] - self.rod.positions[ELEMENT])
        self.back = -R @ along / np.linalg.norm(along)
        self.at = matrix_pose7(T)
        self.needle.set_pose(self.at)
        self.needle.command_pose(self.at)
        self.sim.step(5)
        self.close("PSM1")
        self.sim.step(100)

    def pull(self, way: float, speed: float = 0.003) -> None:
        """Draw the needle's end away from the jaws by ``way`` metres."""
        for _ in range(round(way / speed / 0.005)):
            self.at[:3] += 0.005 * speed * self.back
            self.needle.command_pose(self.at)
            self.sim.step(5)


@pytest.fixture(scope="module")
def once() -> tuple[Stretched, Snapshot, np.ndarray]:
    theatre = Stretched()
    return theatre, theatre.sim.snapshot(), theatre.at.copy()


@pytest.fixture
def thread(once: tuple[Stretched, Snapshot, np.ndarray]) -> Stretched:
    theatre, snapshot, at = once
    theatre.sim.restore(snapshot)
    theatre.at = at.copy()
    return theatre


def test_a_thread_is_held_where_it_was_grasped(thread: Stretched) -> None:
    held = thread.sim.grasps["PSM1"]
    assert held.body in thread.sim.scene.rod_bodies
    assert held.share < 0.05
    assert held.slip[0] < 1e-6
    thread.pull(0.3e-3)
    held = thread.sim.grasps["PSM1"]
    assert 0.5 < held.share < 1.0
    # the pads' springs deflect, and the thread stretches between the pads' two ends, of which the nearer yields first
    assert held.slip[0] < 0.15e-3
    limit = 2 * FRICTION * held.normal_force
    assert thread.rod.tension[5] == pytest.approx(held.share * limit, rel=1e-3)
    assert abs(thread.rod.tension[30]) < 1e-3


def test_a_thread_pulled_beyond_the_limit_slides_against_it(thread: Stretched) -> None:
    thread.pull(1.5e-3)
    held = thread.sim.grasps["PSM1"]
    limit = 2 * FRICTION * held.normal_force
    assert thread.rod.tension[5] == pytest.approx(limit, rel=1e-3)
    assert held.share == pytest.approx(1.0, rel=1e-3)
    stretch = 1.5e-3 - held.slip[0]
    assert 0.1e-3 < stretch < 0.6e-3
    pulled = thread.sim._world.wrenches.on(thread.tools("PSM1"), np.zeros(3))[:3]
    assert pulled == pytest.approx(limit * thread.back, abs=0.05)
    thread.pull(1.5e-3, speed=0.03)
    assert thread.rod.tension[5] == pytest.approx(limit, rel=0.02)


def test_a_thread_slips_out_when_the_jaws_open(thread: Stretched) -> None:
    thread.pull(0.3e-3)
    thread.sim.arms["PSM1"].servo_jaw([0.5])  # type: ignore[attr-defined]  # a PSM
    thread.sim.step(200)
    assert thread.sim.grasps["PSM1"] is None
    assert abs(thread.rod.tension[5]) < 1e-2
    assert np.abs(thread.rod.positions).max() < 2.0


def test_a_thread_drawn_through_the_jaws_to_its_end_is_lost(thread: Stretched) -> None:
    thread.pull(0.08, speed=0.1)
    assert thread.sim.grasps["PSM1"] is None
    assert np.isfinite(thread.rod.positions).all()


def test_a_snapshot_with_a_thread_in_the_jaws_continues_bit_for_bit(thread: Stretched) -> None:
    thread.pull(1.2e-3)
    snapshot, at = thread.sim.snapshot(), thread.at.copy()
    hashes = []
    for _ in range(2):
        thread.sim.restore(snapshot)
        thread.at = at.copy()
        thread.pull(0.3e-3)
        assert thread.sim.grasps["PSM1"] is not None
        hashes.append(thread.sim.state_hash())
    assert hashes[0] == hashes[1]
