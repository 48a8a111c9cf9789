"""The example that sutures by itself: it must go on working as the simulator changes."""

from __future__ import annotations

import sys
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.render.context import RenderUnavailable
from ligature.tasks import throws

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))

import suture  # noqa: E402


@pytest.fixture(scope="module")
def operated() -> tuple[ligature.Simulation, object, object, str]:
    """One throw from the scene's own place of the needle."""
    simulation = ligature.Simulation(ligature.load(suture.SCENE))
    return (simulation, *suture.operate(simulation, throws=1))


def test_one_throw_goes_through_entry_and_exit(operated: tuple) -> None:
    _, score, _, stopped = operated
    assert stopped == ""
    assert score.success, score.lines()
    assert max(score.misses) < 1e-3


def test_nothing_was_dropped_and_the_tissue_was_treated_gently(operated: tuple) -> None:
    _, _, measures, _ = operated
    assert measures.drops == 0
    assert measures.tissue_force < 2.0
    assert set(measures.path_lengths) == {"PSM1", "PSM2"}


def test_the_thread_followed_the_needle_out_of_the_exit(operated: tuple) -> None:
    simulation, *_ = operated
    holes = {simulation.scene.holes[i.hole].name.rpartition("ghost")[2] for i in simulation.insertions}
    assert {"Entry1", "Exit1"} <= holes


def test_without_opengl_a_film_has_no_pictures_and_states_why(tmp_path: Path) -> None:
    class Blind:
        def capture(self, *_: object, **__: object) -> None:
            raise RenderUnavailable("no OpenGL")

    simulation = type("S", (), {"cameras": {"cameraL": Blind()}, "time": 1.0})()
    film = suture.Film(simulation, tmp_path)
    film.watch()
    film.watch()
    assert film.save() == "no pictures: no OpenGL"


def test_holes_too_far_apart_for_the_needle_are_reported() -> None:
    with pytest.raises(ValueError, match=r"holes 25\.0 mm apart are too far for a needle of radius 10\.0 mm"):
        throws.Throw.through(np.zeros(3), np.array([0.025, 0, 0]), 0.01, throws.UP)


def test_the_circle_of_a_throw_goes_through_both_holes() -> None:
    entry, exit = np.array([0.01, 0.02, 0.03]), np.array([0.022, 0.02, 0.03])
    throw = throws.Throw.through(entry, exit, 0.0097, throws.UP)
    at = [throw.centre + 0.0097 * throw.axes @ [np.cos(a), np.sin(a), 0.0] for a in (0.0, throw.towards_exit)]
    assert at[0] == pytest.approx(entry)
    assert at[1] == pytest.approx(exit)
    middle = throw.centre + 0.0097 * throw.axes @ [np.cos(throw.towards_exit / 2), np.sin(throw.towards_exit / 2), 0]
    assert middle[2] < entry[2]


def test_both_arms_reach_every_pair_of_holes() -> None:
    surgeon = suture.Surgeon(ligature.Simulation(ligature.load(suture.SCENE)))
    arc = surgeon.arc
    for pair in (1, 2, 3, 4):
        throw = surgeon.throw(pair)
        tip, rest = throw.towards_exit + suture.BEYOND, arc.end - arc.begin
        ways = {
            "PSM2": (suture.HOLD_DEPTHS, np.linspace(-suture.BEFORE, tip, 6)),
            "PSM1": (suture.PULL_DEPTHS, np.linspace(tip, throw.towards_exit + rest + 0.3, 6)),
        }
        for name, (depths, turns) in ways.items():
            way = [throw.arc_at(a, arc) for a in turns]
            kinematics, base = surgeon.arms[name].kinematics, surgeon._base[name]
            above = surgeon.ends(pair)[0]
            assert throws.best_grasp(arc, depths, kinematics, base, way, way[0], above), (pair, name)


@pytest.mark.slow
def test_all_four_throws_are_made_from_another_place() -> None:
    simulation = ligature.Simulation(ligature.load(suture.SCENE))
    suture.scatter(simulation, 1)
    score, measures, stopped = suture.operate(simulation, throws=4)
    assert stopped == ""
    assert score.success, score.lines()
    assert max(score.misses) < 1e-3
    assert measures.drops == 0
