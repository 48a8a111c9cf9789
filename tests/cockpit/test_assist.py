"""Help with a throw: it picks the needle up, brings it to the tissue and drives it through; a hand takes over at once."""

from __future__ import annotations

import numpy as np
import pytest

from tests.cockpit.assisted import Page


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow), pytest.param(3, marks=pytest.mark.slow)])
def test_three_presses_take_a_needle_through_tissue(seed: int) -> None:
    page = Page("needle_insertion", "PSM2")
    if seed:
        page.scatters(seed)
    assert page.facts["stage"] == "pick"
    page.presses("pick")
    assert page.facts["stage"] == "bring", page.facts
    assert page.simulation.grasps["PSM2"] is not None
    page.presses("bring")
    assert page.facts["stage"] == "drive", page.facts
    state = page.simulation.state[0]
    assert int(state["puncture_count"][0]) == 0, "nothing is punctured before the drive"
    page.pulls(0.4)
    assert int(state["puncture_count"][0]) == 1
    assert page.facts["inside"] and not page.facts["through"]
    page.pulls(1.0)
    assert int(state["puncture_count"][0]) == 2
    assert page.facts["through"]
    entry, exit = state["puncture_point"][0, :2]
    assert np.linalg.norm(exit - entry) == pytest.approx(0.014, abs=0.003), "as far apart as the throw was planned"
    page.pulls(0.0)
    page.simulation.step(200)
    assert not page.facts["inside"], "the slider takes it back, too"


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "filled"), [("suturing", 2), ("soft_suturing", 1)])
def test_it_sutures_holes_and_wounds_too(scene: str, filled: int) -> None:
    page = Page(scene, "PSM2")
    for word in ("pick", "bring"):
        page.presses(word)
    page.pulls(1.0)
    state = page.simulation.state[0]
    rows = state["insertion_body"][: int(state["insertion_count"])]
    assert int((rows == page.needle).sum()) == filled, "both holes of the pair have it, or the tissue"
    assert page.facts["through"]
    if scene == "soft_suturing":
        assert int(state["puncture_count"][0]) == 4, "through both lips"


def test_the_jaw_turns_to_the_needle_and_a_hand_takes_over() -> None:
    page = Page("needle_insertion", "PSM2")
    page.presses("align")
    aim = page.assist.aim(page.arm, page.simulation.state[0])
    assert aim is not None
    assert np.linalg.norm(aim[1] - aim[0]) == pytest.approx(0.02, abs=0.004), "before the needle, by as much as is said"
    page.assist.begin("pick", page.arm, page.simulation.state[0])
    page.waits(lambda: page.pursuits[page.arm].active)
    page.assist.stop()
    assert not page.pursuits[page.arm].active
    before = page.simulation.state["arm"][0, page.arm]["setpoint_js"].copy()
    for _ in range(30):
        page.turn()
    assert (page.simulation.state["arm"][0, page.arm]["setpoint_js"][0] == before[0]).all(), "nothing drives it"


@pytest.mark.parametrize("turns", [40, pytest.param(150, marks=pytest.mark.slow)])
def test_help_that_is_stopped_says_why_and_goes_on_with_the_next_press(turns: int) -> None:
    page = Page("needle_insertion", "PSM2")
    page.assist.begin("pick", page.arm, page.simulation.state[0])
    for _ in range(turns):
        page.turn()
    assert page.assist.busy
    page.assist.stop("somebody asked for it")
    assert page.facts["note"] == "somebody asked for it" and page.facts["stage"] in ("pick", "bring")
    if page.facts["stage"] == "pick":
        page.presses("pick")
    assert page.facts["stage"] == "bring", page.facts
    assert page.facts["note"] == ""


def test_an_arm_that_is_disabled_ends_it_with_words() -> None:
    page = Page("needle_insertion", "PSM2")
    page.assist.begin("pick", page.arm, page.simulation.state[0])
    page.waits(lambda: page.pursuits[page.arm].active)
    page.simulation.arms["PSM2"].disable()
    page.simulation.step(1)
    page.turn()
    assert not page.assist.busy and not page.pursuits[page.arm].active
    assert page.assist.note == "PSM2 stopped: it is no longer enabled and homed."


def test_a_needle_out_of_reach_is_reported() -> None:
    page = Page("needle_insertion", "PSM2")
    page.simulation.set_pose(page.needle, [2.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0])
    page.simulation.step(1)
    page.presses("pick")
    assert page.facts["note"] == "PSM2 cannot reach the needle. Push it nearer by hand, or reset the simulation."


def test_a_scene_without_a_needle_offers_nothing() -> None:
    page = Page("peg_transfer", "PSM1")
    assert page.facts == {"stage": ""}
    page.assist.begin("pick", page.arm, page.simulation.state[0])
    page.assist.drive(0.5, page.arm, page.simulation.state[0])
    assert not page.assist.busy
