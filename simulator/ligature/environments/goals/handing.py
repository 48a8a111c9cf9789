"""The needle goes from one hand to the other. World axes, metres, radians, simulated seconds."""

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
    on_needle,
    put,
    take_in_hand,
)
from ligature.model.frames import frame, inverse, pose7_matrix
from ligature.tasks.throws import UP, NeedleArc, Throw, best_grasp

Array = NDArray[np.float64]

GIVER, TAKER = 0, 1


class HandOver(Goal):
    """Hand the needle, which the first arm holds near its tip above the pad, to the second arm.

    Done when the second arm's jaws, and no others, have held it for 0.5 s, the first arm's jaws are empty, and its
    tool is `AWAY` from all of the needle. Lost when neither arm holds it. What the taker shall do then, drive the
    needle through the first pair of holes, decides how it is held: `throw` is its circle.
    """

    holes = 1
    text = "hand the needle over from the first arm to the second"
    scene, arms, models, steps = "suturing", ("PSM1", "PSM2"), (0, 1, 2, 3, 4, 5), 300
    grasping = GIVER
    GIVEN, TAKEN = (0.003, 0.004, 0.005), (0.020, 0.0205, 0.021)
    """Metres from the needle's tip at which the giver holds it, and the taker shall."""
    MEETING, BEFORE, BEYOND = 0.03, 0.4, 0.5
    """Metres above the first throw where they meet; angles of the throw's ends before the entry, beyond the exit."""
    WAITING = (0.0, 0.0, 0.08, 0.0, 0.0, 0.0)
    """Joint values of the taker, drawn back from the giver."""
    AWAY = 0.03
    TAKE, RELEASE = 0.02, 0.02
    """What is left, in metres, until the taker holds the needle, and until the giver does not."""
    SHIFT, TURN, ASIDE = 0.004, 0.15, 0.01
    ARRIVAL = 25
    """Ticks until both hands are within 0.05 mm of where they begin."""
    _KEPT = ("_alone", "_taken", "_free", "_given", "_stage")

    def _prepare(self) -> None:
        """Find where they meet, and how the giver holds the needle there."""
        super()._prepare()
        simulation, giver, poses = self._simulation, self._arms[GIVER], self._poses()
        self.arc = NeedleArc.of(simulation.scene.needles[0], simulation.scene.bodies[self.body])
        entry, exit = poses[self.scenery.entries[0], :3].copy(), poses[self.scenery.exits[0], :3].copy()
        self.throw, self.surface = Throw.through(entry, exit, self.arc.radius, UP), entry
        meeting = frame(np.eye(3), self.MEETING * UP) @ self.throw.arc_at(-self.BEFORE, self.arc)
        T_base = base_of(simulation, giver)
        grasp = best_grasp(self.arc, self.GIVEN, giver.kinematics, T_base, [meeting], meeting, entry, upright=True)
        if grasp is None:
            raise ValueError(f"{giver.name} cannot hold the needle where it is handed over")
        self._first = meeting, inverse(T_base) @ meeting @ grasp.tool_in_arc(self.arc)
        self._along = self._on_needle(np.linspace(0.0, self.arc.length, 9))
        self._hold = self._on_needle(np.array(on_needle(self.TAKEN[:1], self.arc)))[0]

    def _on_needle(self, depths: Array) -> Array:
        """The places (n, 3) of the needle, in its body frame, that are ``depths`` (n,) from its tip."""
        angles = (self.arc.end - depths / self.arc.radius).tolist()
        places = self.arc.radius * np.array([(math.cos(angle), math.sin(angle), 0.0) for angle in angles])
        T = self.arc.T_body_arc
        return np.asarray(places @ T[:3, :3].T + T[:3, 3])

    def grasp(self) -> Array:
        """How the taker can hold the needle for the throw: pose (4, 4) of its tool in the needle's arc frame.

        Raises ValueError where it has no grasp.
        """
        taker = self._arms[TAKER]
        now = pose7_matrix(self._poses()[self.body]) @ self.arc.T_body_arc
        angles = np.linspace(-self.BEFORE, self.throw.towards_exit + self.BEYOND, 12)
        way = [self.throw.arc_at(float(angle), self.arc) for angle in angles]
        base = base_of(self._simulation, taker)
        found = best_grasp(self.arc, on_needle(self.TAKEN, self.arc), taker.kinematics, base, way, now, self.surface)
        if found is None:
            raise ValueError(f"{taker.name} has no grasp of the needle that reaches the whole throw")
        return found.tool_in_arc(self.arc)

    def settle(self, start: int = 0) -> None:
        """The needle in the giver's jaws where they meet, the taker above the work."""
        taker = self._arms[TAKER]
        taker.place_jp(self.WAITING)
        taker.adopt()
        take_in_hand(self._simulation, self._arms[GIVER], self.body, self.arc, *self._first)

    def begin(self, rng: np.random.Generator) -> None:
        """Both hands a little elsewhere, that of the giver turned otherwise."""
        giver, taker = self._arms[GIVER], self._arms[TAKER]
        giver.servo_cp(aside(giver, rng, self.SHIFT, self.TURN))
        put(taker, aside(taker, rng, self.ASIDE, 0.0))
        self._simulation.step(self.ARRIVAL)
        self._alone, self._taken, self._free, self._given, self._stage = Dwell(), 0.0, Dwell(), True, 0.0

    def target(self) -> Array:
        """The place of the needle at which the taker shall hold it."""
        T = pose7_matrix(self._poses()[self.body])
        return np.asarray(T[:3, :3] @ self._hold + T[:3, 3])

    def observe(self) -> Progress:
        """How far the giver must still go away once the taker has the needle; before that, how far the taker is."""
        now, T = self._simulation.time, pose7_matrix(self._poses()[self.body])
        self._given, taken = self.holds(GIVER), self.holds(TAKER)
        self._stage = 0.5 * taken + 0.5 * (taken and not self._given)
        gap = float(np.linalg.norm(self._along @ T[:3, :3].T + T[:3, 3] - self._tip(GIVER), axis=1).min())
        empty = self._simulation.grasps[self._arms[GIVER].name] is None
        self._taken = self._alone.observe(taken and empty and gap >= self.AWAY, now)
        free = self._free.observe(not self._given and not taken, now)
        if self._taken >= HOLD - EARLY:
            return Progress(0.0, True)
        if taken:
            return Progress(self.RELEASE * (not empty) + max(self.AWAY - gap, 0.0) + UNDONE)
        to_go = self.TAKE + 0.2 * float(np.linalg.norm(self._tip(TAKER) - self.target()))
        lost = "the needle was dropped" if free >= LOST - EARLY else ""
        return Progress(self.RELEASE + self.AWAY + to_go + UNDONE, lost=lost)

    def marks(self) -> Array:
        """Whether the giver holds the needle, the share of the time that the taker must, whether it does."""
        return np.array([self._given, min(self._taken / HOLD, 1.0), self._stage], dtype=float)
