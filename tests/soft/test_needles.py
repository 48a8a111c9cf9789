"""Needles of a scene in its tissue: commanded, free, in moving tissue, on a thread."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.material import MATERIALS
from ligature.tissue.needle import CUTS, OUTSIDE

SILICONE = MATERIALS["silicone pad"]


def _forces(simulation):
    """Force on the tissue, and on needles and threads, (3,) each."""
    state = simulation.state
    n = int(state["insertion_count"][0])
    return state["tissue_wrench"][0, 0, :3], state["insertion_force"][0, :n].sum(axis=0)


def test_a_commanded_needle_goes_in_cuts_comes_out_and_leaves_marks(kit):
    simulation = kit.run(kit.pad(), kit.needle())
    bite = kit.Bite(simulation)
    seen, peak, tip = set(), 0.0, []
    for _ in range(1200):
        simulation.step()
        seen.add(bite.inside.where)
        peak = max(peak, bite.inside.tip_force)
        if bite.inside.where == CUTS:
            tip.append(bite.inside.tip_force)
        on_tissue, on_needle = _forces(simulation)
        np.testing.assert_allclose(on_tissue, -on_needle, atol=1e-9)
    assert {OUTSIDE, CUTS} < seen
    assert peak == pytest.approx(SILICONE.puncture_force, rel=0.01)
    assert np.median(tip) == pytest.approx(SILICONE.cutting_force, rel=0.02)
    state = simulation.state
    assert state["puncture_count"][0, 0] == 2
    marks, normals = state["puncture_point"][0, 0, :2], state["puncture_normal"][0, 0, :2]
    # A chord of the arc: it is 4 mm below the surface at its middle.
    assert np.linalg.norm(marks[1] - marks[0]) == pytest.approx(2 * np.sqrt(0.01**2 - 0.006**2), rel=0.1)
    np.testing.assert_allclose(marks[:, 2], 0.105, atol=5e-4)
    assert (normals[:, 2] > 0.95).all()
    assert state["insertion_hole"][0, 0] == -1
    assert not simulation.problems


def test_a_released_needle_stays_where_it_is(kit):
    simulation = kit.run(kit.pad(), kit.needle(mass=0.0003))
    bite = kit.Bite(simulation)
    simulation.step(450)
    assert bite.inside.depth > 0.01
    bite.needle.release()
    simulation.step(300)
    before = bite.needle.pose
    simulation.step(3000)
    assert np.linalg.norm(bite.needle.pose[:3] - before[:3]) < 0.2e-3
    assert bite.inside.depth > 0.01
    weight = 0.0003 * 9.8
    on_tissue, _ = _forces(simulation)
    np.testing.assert_allclose(on_tissue, [0.0, 0.0, -weight], atol=0.02 * weight)


def test_a_needle_in_tissue_goes_along_with_the_body_that_carries_it(kit):
    tray = kit.body("Tray", "shape: BOX, geometry: {x: 0.08, y: 0.08, z: 0.01}", (0, 0, 0.0899), 0.5)
    simulation = kit.run(kit.pad("    carried by: BODY Tray\n", mass="0.1"), kit.needle(mass=0.0003), tray)
    tray = simulation.bodies["BODY Tray"]
    tray.command_twist([0, 0, 0, 0, 0, 0])
    bite = kit.Bite(simulation)
    simulation.step(450)
    assert bite.inside.depth > 0.01
    bite.needle.release()
    simulation.step(200)
    rest = bite.needle.pose[:3] - simulation.bodies["BODY Pad"].pose[:3]
    tray.command_twist([0.03, 0.0, 0.02, 0, 0, 0.3])
    simulation.step(1000)
    tray.command_twist([0, 0, 0, 0, 0, 0])
    simulation.step(500)
    pose = simulation.bodies["BODY Pad"].pose
    assert pose[0] == pytest.approx(0.03, abs=1e-3) and pose[2] == pytest.approx(0.12, abs=1e-3)
    turned = np.array([[np.cos(0.3), -np.sin(0.3), 0], [np.sin(0.3), np.cos(0.3), 0], [0, 0, 1]]) @ rest
    np.testing.assert_allclose(bite.needle.pose[:3] - pose[:3], turned, atol=1e-3)
    assert bite.inside.depth > 0.01


def test_a_snapshot_in_the_middle_of_a_bite_goes_on_to_the_bit(kit):
    scene = kit.load(kit.pad(), kit.needle(), kit.THREAD)
    one = kit.Simulation(scene)
    bite = kit.Bite(one)
    one.step(940)
    assert bite.piece.threads[0].engaged
    taken = one.snapshot()
    one.step(101)
    other = kit.Simulation(scene)
    other.restore(taken)
    other.step(101)
    assert other.state_hash() == one.state_hash()
    one.reset()
    assert one.state_hash(clock=False) == kit.Simulation(scene).state_hash(clock=False)


def test_a_needle_that_is_put_elsewhere_leaves_the_tissue(kit):
    simulation = kit.run(kit.pad(), kit.needle())
    bite = kit.Bite(simulation)
    simulation.step(300)
    assert bite.inside.passages
    bite.needle.set_pose([0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0])
    simulation.step(800)
    assert not bite.inside.passages and bite.inside.where == OUTSIDE
    assert np.abs(simulation.state["tissue_wrench"][0, 0]).max() < 1e-12
    piece = bite.piece
    assert np.abs(piece.block.positions - piece.block.elastic.grid.nodes).max() < 0.1e-3


def test_a_thread_follows_its_needle_with_friction_by_its_length(kit):
    simulation = kit.run(kit.pad(), kit.needle(), kit.THREAD)
    bite = kit.Bite(simulation)
    simulation.step(1400)
    (thread,) = bite.piece.threads
    assert thread.engaged and not bite.inside.passages
    bite.needle.command_twist([0.0, 0.0, 0.04, 0.0, 0.0, 0.0])
    simulation.step(700)
    pulls = []
    for _ in range(100):
        simulation.step()
        pulls.append(simulation.state["rod_tension"][0].max())
        on_tissue, on_thread = _forces(simulation)
        np.testing.assert_allclose(on_tissue, -on_thread, atol=1e-9)
    length = float(simulation.state["insertion_depth"][0, 0])
    # The thread bends where it comes out, which adds by the rope's own friction what the path lacks of straightness.
    assert SILICONE.friction * length < np.mean(pulls) < 1.3 * SILICONE.friction * length
    assert np.std(pulls) < 0.05 * np.mean(pulls)
    bite.needle.command_twist([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    simulation.step(800)
    assert not thread.engaged, "the thread was pulled out"
    assert not simulation.problems
