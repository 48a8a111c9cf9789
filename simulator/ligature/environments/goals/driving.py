"""Tasks in which one arm drives the needle, which it holds, through holes or soft tissue.

World axes, metres, radians, simulated seconds.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.environments.goals.base import (
    EARLY,
    HOLD,
    LOST,
    REGRASP,
    UNDONE,
    Dwell,
    Goal,
    Progress,
    aside,
    base_of,
    on_needle,
    take_in_hand,
)
from ligature.model.frames import inverse, pose7_matrix
from ligature.simulation import Simulation
from ligature.tasks.passages import PassageWatch
from ligature.tasks.scores import RECOMMENDED_AXIAL, holes_of, judge_insertion, passed_in_order
from ligature.tasks.throws import UP, NeedleArc, Throw, best_grasp

Array = NDArray[np.float64]


class Insert(Goal):
    """Drive the needle, which is in hand before the entry of the first pair of holes, in there and out at the exit.

    Its tip shall go along the circle of its radius through both holes. Done when the tip has gone through the entry
    and then the exit, is 5 mm beyond, the needle is in both, and the arm's jaws have held it for the last 0.5 s. Lost
    when they drop it, after 2 s where tissue has it.
    """

    holes = 1
    text = "drive the needle in at the first entry and out at its exit"
    scene: str = "suturing"
    arms: tuple[str, ...] = ("PSM2",)
    models: tuple[int, ...] = (0, 1, 4, 5)
    grasping = 0
    DEPTHS = (0.020, 0.0205, 0.021)
    BEFORE, MORE, LOOK = 0.4, 0.1, 0.15
    SHIFT, TURN = 0.002, 0.08
    ARRIVAL = 20
    """Ticks until the needle is within 0.05 mm of where the shifted hand holds it, at 12 mm/s at most."""
    _KEPT: tuple[str, ...] = ("_watch", "_grasped", "_held", "_kept", "_free", "_stage")

    def _prepare(self) -> None:
        """Find how the needle is to be held, and where its tip shall go."""
        super()._prepare()
        simulation, arm = self._simulation, self._arms[0]
        self.arc = NeedleArc.of(simulation.scene.needles[0], simulation.scene.bodies[self.body])
        entry, exit = self._places = self._ends()
        self._way = holes_of([1])
        self.throw = Throw.through(entry, exit, self.arc.radius, UP)
        self._pair = holes_at(simulation, entry, exit) if self.holes else set()
        self._last = self.throw.towards_exit + RECOMMENDED_AXIAL / self.arc.radius + self.MORE
        T_base = base_of(simulation, arm)
        way = [self.throw.arc_at(a, self.arc) for a in np.linspace(-self.BEFORE, self._last, 12)]
        grasp = best_grasp(self.arc, on_needle(self.DEPTHS, self.arc), arm.kinematics, T_base, way, way[0], entry)
        if grasp is None:
            raise ValueError(f"{arm.name} has no grasp of the needle that reaches the whole throw")
        self._first = way[0], inverse(T_base) @ way[0] @ grasp.tool_in_arc(self.arc)

    def _ends(self) -> tuple[Array, Array]:
        """Where the tip goes in and out, (3,) each."""
        poses = self._poses()
        return poses[self.scenery.entries[0], :3], poses[self.scenery.exits[0], :3]

    def settle(self, start: int = 0) -> None:
        """Close the jaws on the needle, its tip before the entry."""
        take_in_hand(self._simulation, self._arms[0], self.body, self.arc, *self._first)

    def begin(self, rng: np.random.Generator) -> None:
        """The hand a little elsewhere, and turned otherwise."""
        arm = self._arms[0]
        arm.servo_cp(aside(arm, rng, self.SHIFT, self.TURN))
        self._simulation.step(self.ARRIVAL)
        self._watch = PassageWatch(self.scenery)
        self._grasped, self._held, self._kept, self._free, self._stage = Dwell(), True, 0.0, Dwell(), 0.0

    def _needle_tip(self) -> tuple[Array, float]:
        """The needle's tip (3,), and its angle past the entry on the circle."""
        tip = self._points()[2]
        local = self.throw.axes.T @ (tip - self.throw.centre)
        return tip, math.atan2(local[1], local[0])

    def _look(self) -> tuple[bool, bool, float]:
        """Whether the needle went where it should, whether tissue has it, and the share of the way that it went."""
        state = self._simulation.state
        poses, time = state["body_pose"][0], self._simulation.time
        self._watch.observe(time, poses)
        passed = passed_in_order(self._watch.passages, self._way)
        n = int(state["insertion_count"][0])
        filled = set(state["insertion_hole"][0, :n][state["insertion_body"][0, :n] == self.body].tolist())
        through = passed == len(self._way) and self._pair <= filled and self._is_beyond(poses, time)
        return through, bool(filled), passed / len(self._way)

    def _is_beyond(self, poses: Array, time: float) -> bool:
        """Whether the tip, which has passed both holes, is far enough beyond the exit."""
        score = judge_insertion(self.scenery, poses, self._watch.passages, time)
        return score.success and bool(score.axial >= RECOMMENDED_AXIAL)

    def _on_circle(self, angle: float) -> Array:
        local = self.arc.radius * np.array([math.cos(angle), math.sin(angle), 0.0])
        return np.asarray(self.throw.centre + self.throw.axes @ local)

    def target(self) -> Array:
        """Where the tip should be next: a little further on its circle."""
        _, angle = self._needle_tip()
        return self._on_circle(float(np.clip(angle + self.LOOK, -self.BEFORE, self._last)))

    def observe(self) -> Progress:
        """Way of the tip along the circle that is left, and how far it is beside it."""
        through, inside, self._stage = self._look()
        self._held, now = self.holds(), self._simulation.time
        self._kept = self._grasped.observe(self._held, now)
        free = self._free.observe(not self._held, now)
        if through and self._kept >= HOLD - EARLY:
            return Progress(0.0, True)
        tip, angle = self._needle_tip()
        near = float(np.clip(angle, -2.0 * self.BEFORE, self._last))
        beside = float(np.linalg.norm(tip - self._on_circle(near)))
        left = self.arc.radius * (self._last - near) + beside + UNDONE
        dropped = free >= (REGRASP if inside else LOST) - EARLY
        return Progress(left, lost="the needle was dropped" if dropped else "")

    def marks(self) -> Array:
        """Whether the needle is held, the share of the time that it must be, the share of the holes passed."""
        return np.array([self._held, min(self._kept / HOLD, 1.0), self._stage], dtype=float)


class Puncture(Insert):
    """Drive the needle, which is in hand above a block of soft tissue, in at one place of its top and out at another.

    Its tip shall go along the circle of its radius through both. Done when the needle is in the tissue, has punctured
    its top within 4 mm of each of them, its tip is out of the tissue and 5 mm beyond the second, and the arm's jaws
    have held it for the last 0.5 s.
    """

    holes = 0
    text = "drive the needle in at the top of the tissue and out again beside it"
    NEAR = 0.004
    scene, arms, models = "needle_insertion", ("PSM2",), (0, 1, 2)
    CHORD = 0.014

    def _ends(self) -> tuple[Array, Array]:
        """Two places on the top of the block, either side of its middle."""
        if not self._simulation.scene.tissues:
            raise ValueError("the scene has no body of soft tissue to puncture")
        nodes = self._simulation.state["tissue_node"][0, self._simulation.scene.tissues[0].rows]
        middle = np.append(0.5 * (nodes.min(axis=0) + nodes.max(axis=0))[:2], nodes[:, 2].max())
        aside = np.array([0.5 * self.CHORD, 0.0, 0.0])
        return middle - aside, middle + aside

    def _look(self) -> tuple[bool, bool, float]:
        state = self._simulation.state
        n = int(state["insertion_count"][0])
        in_tissue = (state["insertion_hole"][0, :n] == -1) & (state["insertion_body"][0, :n] == self.body)
        places = state["puncture_point"][0, 0, : int(state["puncture_count"][0, 0])]
        near = [bool((np.linalg.norm(places - wanted, axis=1) < self.NEAR).any()) for wanted in self._places]
        tip, angle = self._needle_tip()
        beyond = self.throw.towards_exit + RECOMMENDED_AXIAL / self.arc.radius
        out = beyond < angle < np.pi and float(tip[2]) > float(self._places[1][2])
        return bool(in_tissue.any() and all(near) and out), bool(in_tissue.any()), sum(near) / 2.0


def holes_at(simulation: Simulation, *places: Array) -> set[int]:
    """Holes of the scene that are the nearest to ``places``, (3,) each, in world axes."""
    scene, poses = simulation.scene, simulation.state["body_pose"][0]
    at = np.array([(pose7_matrix(poses[hole.body]) @ hole.T_body_hole)[:3, 3] for hole in scene.holes])
    return {int(np.argmin(np.linalg.norm(at - place, axis=1))) for place in places} if len(at) else set()
