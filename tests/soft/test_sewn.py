"""A thread that starts as a stitch through soft tissue: its file gives the way."""

from __future__ import annotations

import ligature
import numpy as np
import pytest
from ligature.tasks.wounds import Wound


@pytest.fixture(scope="module")
def scene():
    return ligature.load("soft_knot")


def test_the_scene_starts_with_a_stitch_through_both_lips_and_without_tension(scene):
    simulation = ligature.Simulation(scene)
    wound, rod = Wound.of(scene), list(scene.rods[0].bodies)
    gap = wound.gap(simulation.state[0], 0.0)
    for _ in range(2):
        stitch = wound.stitch(simulation.state[0], 0.0)
        assert stitch is not None
        np.testing.assert_allclose(stitch.widths, 4.5e-3, atol=0.3e-3)
        np.testing.assert_allclose(stitch.depths, 4.5e-3, atol=0.4e-3)
        assert np.abs(simulation.state["rod_tension"][0][rod]).max() < 0.02
        assert wound.gap(simulation.state[0], 0.0) == pytest.approx(gap, abs=0.05e-3)
        simulation.step(300)
    assert not simulation.problems


def test_a_reset_and_a_snapshot_of_a_stitched_thread_go_on_to_the_bit(scene):
    simulation = ligature.Simulation(scene)
    simulation.step(50)
    first, taken = simulation.state_hash(clock=False), simulation.snapshot()
    simulation.step(51)
    later = simulation.state_hash(clock=False)
    other = ligature.Simulation(scene)
    other.restore(taken)
    other.step(51)
    assert other.state_hash(clock=False) == later
    simulation.reset()
    simulation.step(50)
    assert simulation.state_hash(clock=False) == first
