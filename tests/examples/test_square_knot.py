"""The program that makes a square knot around a vessel with two arms."""

from __future__ import annotations

import sys
from pathlib import Path

import ligature
import numpy as np
import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))

import square_knot  # noqa: E402


def test_a_thread_that_nobody_wraps_has_no_knot() -> None:
    simulation = ligature.Simulation(ligature.load(square_knot.SCENE))
    score = square_knot.Knotter(simulation).score()
    assert (score.determinant, score.success) == (1, False)


@pytest.mark.parametrize("seed", range(1, 9))
def test_another_seed_lays_vessel_and_thread_elsewhere_together(seed: int) -> None:
    """Moved without the ridges that hold it, the thread would begin inside them, and be pushed out with newtons."""
    scene = ligature.load(square_knot.SCENE)
    block = next(body.index for body in scene.bodies if body.identity.name == "Block")
    lain = [block, *scene.rods[0].bodies]
    here, there = (ligature.Simulation(s) for s in (scene, square_knot.scattered(scene, seed)))
    moved = there.state["body_pose"][0, lain, :3] - here.state["body_pose"][0, lain, :3]
    assert (np.abs(moved[0, :2]) > 0.0).all() and (np.abs(moved[0, :2]) <= square_knot.SHIFT).all()
    assert np.allclose(moved, moved[0], atol=1e-9) and moved[0, 2] == 0.0
    there.step(300)
    assert there.state["rod_tension"][0].max() < 0.1


def test_the_short_end_stands_where_the_right_arm_bends_it() -> None:
    """Without the yield of the scene's thread it springs back by tens of millimetres."""
    knotter = square_knot.Knotter(ligature.Simulation(ligature.load(square_knot.SCENE)))
    knotter.take(square_knot.RIGHT, square_knot.REACHES, knotter.tail, 1)
    knotter.stand()
    stood = knotter.points()[knotter.tail]
    assert abs(stood[0] - knotter.vessel[0] - square_knot.LEAN) < 0.007
    assert abs(stood[1] - knotter.vessel[1]) < 0.009
    assert knotter.held(square_knot.RIGHT) is None
    knotter.wait(0.5)
    assert np.linalg.norm(knotter.points()[knotter.tail] - stood) < 0.001


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_two_arms_make_a_square_knot_that_holds() -> None:
    simulation = ligature.Simulation(ligature.load(square_knot.SCENE))
    score, stopped = square_knot.operate(simulation)
    assert stopped == ""
    assert score.success, score.lines()
