"""The program that closes a wound by a stitch and a knot: its scene fits it, and it goes on working."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.tasks import throws
from ligature.tasks.knots import SQUARE_KNOT
from ligature.tasks.wounds import ClosureScore, Stitch

from tests.bench.campaign import authored

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "examples"), str(ROOT / "scenes")]

import author_soft_closing  # noqa: E402
import close_wound  # noqa: E402
from soft_knot import Outcome  # noqa: E402
from suture import BEFORE, BEYOND, HOLD_DEPTHS  # noqa: E402

KNOT = Outcome(SQUARE_KNOT, (4e-3, 0.0, 0.0, 0.0), True, True, 70.0)
STITCH = ClosureScore(
    (1, 4.5e-3), (Stitch((4.5e-3, 4.5e-3), (2e-3, 2e-3), (0.0, 0.0)),), 4e-3, (0.0,), 0.0, 1.0, 1.0, 70.0
)  # fmt: skip


def closer_of(folder: Path, width: float, heading: float) -> close_wound.Closer:
    """Both arms before a wound of that width."""
    scene = authored(author_soft_closing.texts(width, None, heading), folder, close_wound.SCENE.parents[1])
    return close_wound.Closer(ligature.Simulation(scene), 0)


def test_it_counts_where_the_stitch_passes_both_lips_and_the_knot_holds() -> None:
    assert close_wound.Closed(STITCH, KNOT).success
    assert not close_wound.Closed(STITCH, None).success
    assert not close_wound.Closed(STITCH, KNOT, "the needle did not come off its thread").success
    assert not close_wound.Closed(replace(STITCH, stitches=()), KNOT).success
    assert not close_wound.Closed(STITCH, replace(KNOT, gaps=(4e-3, 0.0, 0.0, 1e-3))).success


@pytest.mark.parametrize(("width", "turned"), [(0.002, 8.0), (0.004, 0.0), (0.006, -8.0)])
def test_one_arm_reaches_the_whole_stitch_from_the_board_on_and_the_clip_is_before_its_entry(
    tmp_path: Path, width: float, turned: float
) -> None:
    closer = closer_of(tmp_path, width, author_soft_closing.HEADING + np.radians(turned))
    throw, entry = closer.throw(1), closer.ends(1)[0]
    assert entry[0] - author_soft_closing.knot.PLACE[0] == pytest.approx(author_soft_closing.clipped(width), abs=2e-4)
    way = [throw.arc_at(a, closer.arc) for a in np.linspace(-BEFORE, throw.towards_exit + BEYOND, 12)]
    arm = close_wound.ARMS[0]
    kinematics, base = closer.arms[arm].kinematics, closer._base[arm]
    found = throws.best_grasp(closer.arc, HOLD_DEPTHS, kinematics, base, way, closer.needle(), entry, up=closer.up)
    assert found is not None and abs(found.tilt) < np.radians(15)  # a jaw that leans about the needle meets the board


def test_a_wound_that_faces_the_arms_is_kept_clear_of(tmp_path: Path) -> None:
    closer = closer_of(tmp_path, 0.004, author_soft_closing.HEADING)
    throw, entry = closer.throw(1), closer.ends(1)[0]
    arm = close_wound.ARMS[0]
    kinematics, base = closer.arms[arm].kinematics, closer._base[arm]
    last = [throw.arc_at(throw.towards_exit + BEYOND, closer.arc)]
    kept = 0
    for grasp in throws.grasps(HOLD_DEPTHS, upright=False):
        T = [pose @ grasp.tool_in_arc(closer.arc) for pose in last]
        q = throws.reach(kinematics, base, T, entry, up=closer.up)
        if q is not None:
            kept += 1
            palm = (base @ kinematics.frames(q))[0, throws.PALM, :3, 3]
            assert (palm - entry) @ closer.up > throws.LEAST_CLEARANCE
    assert kept


@pytest.mark.slow
def test_a_stitch_and_a_knot_close_the_wound_for_ten_seconds() -> None:
    simulation = ligature.Simulation(ligature.load(close_wound.SCENE))
    closed = close_wound.operate(simulation)
    assert closed.success, closed.lines()
    assert closed.stitch.open_gap == pytest.approx(4e-3, abs=0.1e-3)
