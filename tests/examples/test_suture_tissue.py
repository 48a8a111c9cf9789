"""The example that sutures soft tissue by itself: it must go on working as the simulator changes."""

from __future__ import annotations

import sys
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.tasks import throws

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))

import suture_tissue  # noqa: E402
from suture import BEFORE, BEYOND, HOLD_DEPTHS, PULL_DEPTHS  # noqa: E402


@pytest.fixture(scope="module")
def surgeon() -> suture_tissue.TissueSurgeon:
    simulation = ligature.Simulation(ligature.load(suture_tissue.SCENE))
    return suture_tissue.TissueSurgeon(simulation, suture_tissue.Plan())


def test_a_bite_takes_the_same_of_both_lips_at_its_place(surgeon: suture_tissue.TissueSurgeon) -> None:
    assert surgeon.width == pytest.approx(0.0045)
    middle = surgeon.simulation.bodies["Pad"].pose[:2]
    surgeon.plan = suture_tissue.Plan(stitches=3, spacing=0.008)
    for number, place in enumerate((-0.008, 0.0, 0.008), 1):
        entry, exit = surgeon.ends(number)
        np.testing.assert_allclose((entry + exit)[:2] / 2, middle + [0.0, place], atol=1e-4)
        assert np.linalg.norm(exit - entry) == pytest.approx(0.004 + 2 * 0.0045, abs=1e-4)


def test_a_wide_wound_gets_smaller_bites_so_that_the_needle_is_long_enough() -> None:
    simulation = ligature.Simulation(ligature.load(suture_tissue.SCENE))
    surgeon = suture_tissue.TissueSurgeon(simulation, suture_tissue.Plan(width=0.01))
    assert 0.0045 <= surgeon.width < 0.005
    throw = surgeon.throw(1)
    assert surgeon.arc.radius * throw.towards_exit + suture_tissue.STANDS_OUT == pytest.approx(max(HOLD_DEPTHS))


@pytest.mark.parametrize("depth", [0.0015, 0.002, 0.0023])
def test_the_planned_depth_decides_how_much_of_the_lips_a_bite_takes(
    surgeon: suture_tissue.TissueSurgeon, depth: float
) -> None:
    width = suture_tissue.Plan(depth=depth).width_for(surgeon.open_gap, surgeon.arc.radius)
    entry, exit = np.array([0.0, 0.0, 0.0]), np.array([surgeon.open_gap + 2.0 * width, 0.0, 0.0])
    throw = throws.Throw.through(entry, exit, surgeon.arc.radius, throws.UP)
    wall = width - throw.centre[0]
    assert throw.centre[2] - np.sqrt(surgeon.arc.radius**2 - wall**2) == pytest.approx(-depth)
    with pytest.raises(ValueError, match="cannot pass 50.0 mm below the top"):
        suture_tissue.Plan(depth=0.05).width_for(surgeon.open_gap, surgeon.arc.radius)


def test_both_arms_reach_every_bite_and_the_place_where_they_meet(surgeon: suture_tissue.TissueSurgeon) -> None:
    arc = surgeon.arc
    surgeon.plan = suture_tissue.Plan(stitches=3, spacing=0.008)
    for number, place in enumerate((-0.008, 0.0, 0.008), 1):
        throw, entry = surgeon.throw(number), surgeon.ends(number)[0]
        tip, rest = throw.towards_exit + BEYOND, arc.end - arc.begin
        ways = {
            "PSM2": (HOLD_DEPTHS, np.linspace(-BEFORE, tip, 6)),
            "PSM1": (PULL_DEPTHS, np.linspace(tip, throw.towards_exit + rest + 0.3, 6)),
        }
        for name, (depths, turns) in ways.items():
            way = [throw.arc_at(a, arc) for a in turns]
            kinematics, base = surgeon.arms[name].kinematics, surgeon._base[name]
            meeting = surgeon.meeting(throw)
            assert throws.best_grasp(arc, depths, kinematics, base, way, meeting, entry), (place, name)


@pytest.mark.slow
def test_one_stitch_closes_the_wound_without_tearing_it() -> None:
    simulation = ligature.Simulation(ligature.load(suture_tissue.SCENE))
    score, measures, stopped = suture_tissue.operate(simulation, suture_tissue.Plan())
    assert stopped == ""
    assert score.success, score.lines()
    assert score.open_gap == pytest.approx(0.004, abs=1e-5) and max(score.gaps) < 0.3e-3
    (stitch,) = score.stitches
    assert stitch.widths == pytest.approx((0.0045, 0.0045), abs=1e-3)
    assert stitch.depths == pytest.approx((0.0022, 0.0022), abs=1e-3)
    assert score.tear < 1e-3
    assert measures.drops == 0
    assert measures.tissue_force < 0.5 and measures.thread_tension < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("stitches", [2, 3])
def test_stitches_of_one_thread_close_the_wound_where_they_are(stitches: int) -> None:
    simulation = ligature.Simulation(ligature.load(suture_tissue.SCENE))
    plan = suture_tissue.Plan(stitches=stitches, spacing=0.008)
    score, measures, stopped = suture_tissue.operate(simulation, plan)
    assert stopped == ""
    assert score.success, score.lines()
    assert len(score.stitches) == stitches
    assert max(score.gaps) < 0.5e-3
    for stitch in score.stitches:
        assert stitch.widths == pytest.approx((0.0045, 0.0045), abs=1e-3)
        assert stitch.depths == pytest.approx((0.0022, 0.0022), abs=1e-3)
    assert score.tear < 1e-3
    assert measures.drops == 0
    assert measures.thread_tension < 3.0
