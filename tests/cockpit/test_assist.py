"""Help with a throw: it picks the needle up, brings it to the tissue and drives it through; a hand takes over at once."""

from __future__ import annotations

from collections.abc import Callable

import ligature
import numpy as np
import pytest
from ligature.cockpit.arm_facts import ArmFacts
from ligature.cockpit.assist import Assist
from ligature.cockpit.pursuit import ArmPursuits
from ligature.model.frames import axis_rotation, frame, matrix_pose7, pose7_matrix

from tests import waiting

TURN = 0.01
"""Seconds of a turn of the page's loop."""


class Page:
    """The page's loop, with a simulation in this process instead of the bus."""

    def __init__(self, scene: str, arm: str) -> None:
        self.simulation = ligature.Simulation(ligature.load(scene))
        arms = self.simulation.scene.arms
        facts = [ArmFacts.of(self.simulation.scene, i) for i in range(len(arms))]
        self.arm = [one.name for one in arms].index(arm)
        self.pursuits = [ArmPursuits(i) for i in range(len(facts))]
        self.assist = Assist(self.simulation.scene, facts, self.pursuits)
        handle = self.simulation.arms[arm]
        handle.home()
        while handle.is_busy or not handle.is_homed:
            self.simulation.step(50)

    def turn(self) -> None:
        waiting.until(lambda: not self.assist.thinking, "a plan is made", 60.0, every=0.001)  # the same each time
        self.assist.advance(self.simulation.state[0])
        for command in self.pursuits[self.arm].advance(TURN):
            self.simulation.apply(command)
        self.simulation.step(10)

    def presses(self, word: str) -> None:
        self.assist.begin(word, self.arm, self.simulation.state[0])
        self.waits(lambda: not self.assist.busy)

    def pulls(self, share: float) -> None:
        self.assist.drive(share, self.arm, self.simulation.state[0])
        self.waits(lambda: not self.assist.busy)

    def waits(self, condition: Callable[[], bool], seconds: float = 40.0) -> None:
        begin = self.simulation.time
        while not condition():
            assert self.simulation.time < begin + seconds, self.facts
            self.turn()

    @property
    def facts(self) -> dict[str, object]:
        return self.assist.facts(self.arm, self.simulation.state[0])

    @property
    def needle(self) -> int:
        return self.simulation.scene.needles[0].body

    def scatters(self, seed: int) -> None:
        """Lay the needle elsewhere."""
        rng = np.random.default_rng(seed)
        T = pose7_matrix(self.simulation.state["body_pose"][0, self.needle])
        turn = axis_rotation((0.0, 0.0, 1.0), float(rng.uniform(-np.pi, np.pi)))
        shift = np.append(rng.uniform(-0.006, 0.006, 2), 0.001)
        self.simulation.set_pose(self.needle, matrix_pose7(frame(turn @ T[:3, :3], T[:3, 3] + shift)))
        self.simulation.step(300)


@pytest.mark.parametrize("seed", [1, 3])
def test_a_needle_that_one_arm_cannot_grasp_there_is_reported(seed: int) -> None:
    page = Page("needle_insertion", "PSM2")
    page.scatters(seed)
    page.presses("pick")
    assert page.facts["stage"] == "pick" and not page.facts["busy"]
    assert "PSM2 cannot reach the needle" in page.facts["note"]


@pytest.mark.parametrize("seed", [0, 4])
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


def test_a_needle_out_of_reach_is_reported() -> None:
    page = Page("needle_insertion", "PSM2")
    page.simulation.set_pose(page.needle, [2.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0])
    page.simulation.step(1)
    page.presses("pick")
    assert page.facts["note"] == "PSM2 cannot reach the needle. Try the other arm (N)."


def test_a_scene_without_a_needle_offers_nothing() -> None:
    page = Page("peg_transfer", "PSM1")
    assert page.facts == {"stage": ""}
    page.assist.begin("pick", page.arm, page.simulation.state[0])
    page.assist.drive(0.5, page.arm, page.simulation.state[0])
    assert not page.assist.busy
