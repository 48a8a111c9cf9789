"""The needle, which is through the tissue, is pulled out, and its thread after it.

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
    UNDONE,
    Dwell,
    Goal,
    Progress,
    aside,
    base_of,
    carry,
    put,
)
from ligature.environments.goals.seams import Seam
from ligature.model.frames import inverse, matrix_pose7
from ligature.tasks.throws import UP, NeedleArc, Throw, best_grasp

Array = NDArray[np.float64]


class PullThrough(Goal):
    """Grasp the needle, whose tip is out at the exit of the first pair of holes, and pull 30 mm of thread through.

    Done when the thread goes through entry and exit, 30 mm of it are beyond the exit, and the arm's jaws have held the
    needle for the last 0.5 s. Lost when neither needle nor thread is in the exit any more, or when the needle is
    dropped once it is out.
    """

    holes = 1
    text = "grasp the needle where it comes out and pull its thread through"
    scene, arms, models, steps = "suturing", ("PSM1",), (0, 1, 2, 3), 300
    BEFORE, BEYOND = 0.4, 0.65
    """Angles of the tip: before the entry where it comes from, and beyond the exit at the first start."""
    starts, FURTHER = 16, 0.01
    """How many starts there are; angle by which the needle is driven further in each than in the one before."""
    DRIVE, PAUSE = 0.001, 200
    """Radians of a tick while the needle is driven in; ticks until it is at rest then."""
    LENGTH = 0.03
    GRASP = 0.02
    """What is left, in metres, until the needle is held."""
    DEPTHS = (0.0018, 0.0022, 0.0026)
    """Metres from the needle's tip at which it is to be grasped."""
    SHIFT = 0.01
    _KEPT = ("_kept", "_done_for", "_free", "_held", "_drawn", "_beyond")

    def _prepare(self) -> None:
        """Find the first throw, and its holes."""
        super()._prepare()
        scene, poses = self._simulation.scene, self._poses()
        self.arc = NeedleArc.of(scene.needles[0], scene.bodies[self.body])
        entry, exit = poses[self.scenery.entries[0], :3].copy(), poses[self.scenery.exits[0], :3].copy()
        self.surface = entry
        self.throw = Throw.through(entry, exit, self.arc.radius, UP)
        self._seam = Seam.of(self._simulation, self.scenery, self.arc)
        self._out = exit + (self.LENGTH + 2.0 * self.arc.radius) * UP

    def settle(self, start: int = 0) -> None:
        """The needle driven through both holes, nobody holding it; at each start a little further."""
        first = self.throw.towards_exit + self.BEYOND
        if start:
            self._drive(first, first + start * self.FURTHER)
            return
        super().settle()
        before = self.throw.arc_at(-self.BEFORE, self.arc) @ inverse(self.arc.T_body_arc)
        self._simulation.set_pose(self.body, matrix_pose7(before))
        self._drive(-self.BEFORE, first)

    def begin(self, rng: np.random.Generator) -> None:
        """The hand elsewhere."""
        put(self._arms[0], aside(self._arms[0], rng, self.SHIFT, 0.0))
        self._simulation.step(0)
        self._kept, self._done_for, self._free = Dwell(), 0.0, Dwell()
        self._held, self._drawn, self._beyond = False, 0.0, 0.0

    def _drive(self, begin: float, end: float) -> None:
        """Turn the needle along the throw's circle, as a hand would, and leave it in the tissue."""
        angles = np.arange(begin, end, self.DRIVE)
        back = inverse(self.arc.T_body_arc)
        carry(self._simulation, self.body, [self.throw.arc_at(float(a), self.arc) @ back for a in angles])
        self._simulation.step(self.PAUSE)

    def reached(self) -> float:
        """The angle of the needle's tip past the entry, on the throw's circle."""
        tip = self.throw.axes.T @ (self._points()[2] - self.throw.centre)
        return math.atan2(tip[1], tip[0]) % (2.0 * np.pi)

    @property
    def out(self) -> float:
        """The same once all of the needle is beyond the exit."""
        return self.throw.towards_exit + self.arc.end - self.arc.begin + 0.3

    def grasp(self) -> Array:
        """How the arm can hold the needle to turn it out: pose (4, 4) of its tool in the needle's arc frame.

        Raises ValueError where it has no grasp.
        """
        arm = self._arms[0]
        way = [self.throw.arc_at(float(a), self.arc) for a in np.linspace(self.reached(), self.out, 10)]
        base = base_of(self._simulation, arm)
        found = best_grasp(self.arc, self.DEPTHS, arm.kinematics, base, way, self._needle_arc(), self.surface)
        if found is None:
            raise ValueError(f"{arm.name} cannot grasp the needle so that it could turn it out of the tissue")
        return found.tool_in_arc(self.arc)

    def place(self) -> Array:
        """Where the needle is to be grasped (3,)."""
        T = self._needle_arc()
        return np.asarray(T[:3, 3] + T[:3, :3] @ self.arc.point(self.DEPTHS[1]))

    def target(self) -> Array:
        """The place to grasp; once it is held, a place above the exit."""
        return self._out if self._held else self.place()

    def observe(self) -> Progress:
        """What is left of needle and thread to pull through, and before the needle is held, how far the tool is."""
        now, pulled = self._simulation.time, self._seam.look()
        self._held, self._drawn, self._beyond = self.holds(), pulled.drawn, pulled.beyond
        self._done_for = self._kept.observe(self._held and self._drawn >= self.LENGTH, now)
        if self._done_for >= HOLD - EARLY:
            return Progress(0.0, True)
        left = max(self.arc.length + self.LENGTH - self._beyond, 0.0) + UNDONE
        if not self._held:
            left += self.GRASP + 0.2 * float(np.linalg.norm(self._tip() - self.place()))
        free = self._free.observe(not self._held and not pulled.needle_inside, now)
        if not pulled.exit_filled:
            return Progress(left, lost="needle and thread are no longer in the exit")
        return Progress(left, lost="the needle was dropped" if free >= LOST - EARLY else "")

    def marks(self) -> Array:
        """Whether the needle is held, the share of the time that it must be, the share of the thread that is out."""
        share = min(self._drawn / self.LENGTH, 1.0)
        return np.array([self._held, min(self._done_for / HOLD, 1.0), share], dtype=float)

    def _needle_arc(self) -> Array:
        """Pose (4, 4) of the needle's arc frame."""
        return self._pose(self.body) @ self.arc.T_body_arc
