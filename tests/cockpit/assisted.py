"""The page's help with a throw in this process: a simulation instead of the bus, without a browser or a clock."""

from __future__ import annotations

from collections.abc import Callable

import ligature
import numpy as np
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
        for handle in self.simulation.arms.values():
            handle.home()
        while any(handle.is_busy or not handle.is_homed for handle in self.simulation.arms.values()):
            self.simulation.step(50)

    def turn(self) -> None:
        if self.assist.busy:
            self.arm = self.assist.arm
        waiting.until(lambda: not self.assist.thinking, "a plan is made", 60.0, every=0.001)  # the same each time
        self.assist.advance(self.simulation.state[0])
        for pursuits in self.pursuits:
            for command in pursuits.advance(TURN):
                self.simulation.apply(command)
        self.simulation.step(10)

    def presses(self, word: str) -> None:
        self.assist.begin(word, self.arm, self.simulation.state[0])
        self.waits(lambda: not self.assist.busy, 120.0)

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
