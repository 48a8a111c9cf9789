"""Help with a throw: the jaw turns to the needle, picks it up, brings it to the tissue, drives it along its arc.

Each is one press of a button or the slider of the drive; the arm goes at a hand's speed, and whatever the operator does
by hand takes over at once. World axes, metres, radians, simulated seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.cockpit.arm_facts import ArmFacts
from ligature.cockpit.pursuit import ArmPursuits
from ligature.model.frames import frame, inverse
from ligature.model.scene import Scene
from ligature.robots.fitting import kinematics_of
from ligature.robots.poses import rotation_vector
from ligature.robots.psm import Psm
from ligature.tasks.plans import ABOVE, BEFORE, BEYOND, DEPTHS, Planner
from ligature.tasks.throws import PAD, UP, Throw

Array = NDArray[np.float64]

OPEN, SHUT = 0.8, -0.35
"""Angles of the jaw."""

LIFT, BEHIND = 0.03, 0.02
"""Metres by which a needle is lifted, and along itself from which a tool comes to it."""

NEAR, TURNED = 2e-4, 0.01
"""Metres and radians within which a set-point counts as arrived."""

PRESSES = (0.0002, 0.0005, 0.0008)
"""Metres by which a tool goes further than where it holds the needle in the middle of its pads, try by try."""

CLOSING, STUCK = 0.6, 1.0
"""Seconds in which jaws must have closed on a needle, and for which a set-point may rest before its goal."""

SETTLING = 0.2
"""Seconds in which an arm comes to rest at its set-point."""

THROUGH, BESIDE = 0.15, 0.004
"""Angle of the tip beyond the exit from which the needle counts as through, and metres from it to its puncture."""

Steps = Generator[None, None, None]


class Failed(Exception):
    """A deed that cannot be done; the text is for the operator."""


class Assist:
    """What is done for the operator of ``arms``; goals go to ``pursuits``."""

    def __init__(self, scene: Scene, arms: Sequence[ArmFacts], pursuits: Sequence[ArmPursuits]) -> None:
        self._arms, self._pursuits = arms, pursuits
        self._needle = scene.needles[0].body if scene.needles else -1
        names = [jaw.name for jaw in scene.jaws]
        self._planners: dict[int, Planner] = {}
        self._jaws: dict[int, int] = {}
        for arm in arms:
            kinematics = kinematics_of(scene, arm.description)
            if self._needle >= 0 and isinstance(kinematics, Psm) and arm.grip is not None and arm.name in names:
                self._planners[arm.index] = Planner.of(scene, kinematics)
                self._jaws[arm.index] = names.index(arm.name)
        self._thinker = ThreadPoolExecutor(1, "plans")
        self._thought: Future[Any] | None = None
        self._steps: Steps | None = None
        self._arm = -1
        self._state: Any = None
        self._throw: tuple[int, Throw, Array] | None = None
        """Of which arm, where, and the tool's pose (4, 4) in the needle's arc frame."""
        self._target = 0.0
        self.note = ""

    # --- what the operator asks for --------------------------------------------------------------

    def begin(self, word: str, arm: int, state: Any) -> None:
        """Do what ``word`` (`orders.HELP`) asks for with ``arm``, instead of what was done so far."""
        self.stop()
        if arm in self._planners and self._arms[arm].ready(state):
            self._arm, self._state, self.note = arm, state, ""
            self._steps = {"align": self._align, "pick": self._pick, "bring": self._bring}[word]()

    def drive(self, share: float, arm: int, state: Any) -> None:
        """Take the needle's tip to a share of the way along its arc."""
        if self._throw is None or self._throw[0] != arm or not self._arms[arm].ready(state):
            return
        _, throw, _ = self._throw
        self._target = -BEFORE + share * (throw.towards_exit + BEYOND + BEFORE)
        if self._steps is not None and self._pursuits[arm].steer(self._target):
            return
        self.stop()
        self._arm, self._state, self.note = arm, state, ""
        self._steps = self._drive()

    def stop(self) -> None:
        """Leave everything to the operator, from where the arm is going."""
        if self._steps is not None:
            self._pursuits[self._arm].stop()
        self._steps = None

    def forget(self) -> None:
        """Stop, and forget the throw: the scene has been reset."""
        self.stop()
        self._throw, self.note = None, ""

    @property
    def busy(self) -> bool:
        """Whether something is being done."""
        return self._steps is not None

    @property
    def thinking(self) -> bool:
        """Whether a plan is being made."""
        return self._thought is not None and not self._thought.done()

    def advance(self, state: Any) -> None:
        """Go on with what is being done, in a state (one element of the record)."""
        self._state = state
        if self._throw is not None and not self._holds(self._throw[0], state):
            self._throw = None
        if self._steps is None:
            return
        try:
            next(self._steps)
        except StopIteration:
            self._steps = None
        except Failed as failure:
            self.stop()
            self.note = str(failure)

    # --- what the page shows -----------------------------------------------------------------------

    def facts(self, arm: int, state: Any) -> dict[str, Any]:
        """What the page shows of a throw with ``arm``: its stage, and how far the needle is driven."""
        if arm not in self._planners or not self._arms[arm].ready(state):
            return {"stage": ""}
        shown: dict[str, Any] = {"stage": self._stage(arm, state), "busy": self.busy, "note": self.note}
        if shown["stage"] == "drive" and self._throw is not None:
            throw, planner = self._throw[1], self._planners[arm]
            angle = planner.angle(state, throw)
            shown["driven"] = round((angle + BEFORE) / (throw.towards_exit + BEYOND + BEFORE), 3)
            shown["inside"] = self._inside(state)
            shown["through"] = angle > throw.towards_exit + THROUGH and self._out(state, planner.exit(throw))
        return shown

    def aim(self, arm: int, state: Any) -> tuple[Array, Array] | None:
        """From where (3,) to where (3,) the operator has to go next, None where there is nothing to aim at."""
        stage = self.facts(arm, state)["stage"]
        if stage not in ("pick", "drive"):
            return None
        planner = self._planners[arm]
        if stage == "pick":
            T = self._arms[arm].tip_in_world(state)
            return T[:3, 3] + PAD * T[:3, 2], planner.point(state, DEPTHS[1])
        assert self._throw is not None
        throw, tip = self._throw[1], planner.point(state, 0.0)
        return tip, planner.exit(throw) if self._inside(state) else planner.entry(throw)

    def _stage(self, arm: int, state: Any) -> str:
        if not self._holds(arm, state):
            return "pick"
        if self._throw is not None and self._throw[0] == arm:
            return "drive"
        return "hand" if self._inside(state) else "bring"

    def _holds(self, arm: int, state: Any) -> bool:
        return int(state["jaw_body"][self._jaws[arm]]) == self._needle

    def _inside(self, state: Any) -> bool:
        count = int(state["insertion_count"])
        return bool((state["insertion_body"][:count] == self._needle).any())

    def _out(self, state: Any, exit: Array) -> bool:
        """Whether the needle, which is in something, has come out of it at ``exit`` (3,).

        Tissue bulges before it is punctured from inside: where the tip is does not decide.
        """
        count = int(state["insertion_count"])
        holes = state["insertion_hole"][:count][state["insertion_body"][:count] == self._needle]
        if not (holes < 0).any():
            return len(holes) > 1
        places = [points[: int(n)] for points, n in zip(state["puncture_point"], state["puncture_count"], strict=True)]
        return bool((np.linalg.norm(np.concatenate(places) - exit, axis=1) < BESIDE).any())

    # --- deeds: each step ends a turn of the loop ---------------------------------------------------

    def _align(self) -> Steps:
        """Turn the jaw to the needle, and stand before it, open."""
        grasp = yield from self._grasp()
        yield from self._jaw(OPEN)
        yield from self._go(self._behind(grasp))

    def _pick(self) -> Steps:
        """Take the needle and lift it; jaws that close on nothing go a little deeper the next time."""
        for press in PRESSES:
            grasp = yield from self._grasp()
            yield from self._jaw(OPEN)
            yield from self._go(self._behind(grasp))
            yield from self._go(self._planner.needle(self._state) @ grasp @ frame(np.eye(3), np.array([0, 0, press])))
            yield from self._jaw(SHUT)
            yield from self._wait(CLOSING, lambda: self._holds(self._arm, self._state))
            if self._holds(self._arm, self._state):
                yield from self._go(_raised(self._tip, LIFT))
                return
        raise Failed("The jaws closed on nothing. Try again.")

    def _bring(self) -> Steps:
        """Take the needle's tip to before the entry of the throw that the arm reaches best."""
        hold = inverse(self._planner.needle(self._state)) @ self._tip
        throw = yield from self._think(lambda state, T_base: self._planner.throw(state, T_base, hold))
        if throw is None:
            raise Failed("Held like this the needle does not reach through. Put it down (X) and pick it up again.")
        start = throw.arc_at(-BEFORE, self._planner.arc) @ hold
        yield from self._go(_raised(self._tip, max(0.0, float((start - self._tip)[2, 3]) + ABOVE)))
        yield from self._go(_raised(start, ABOVE))
        yield from self._go(start)
        self._throw = self._arm, throw, hold

    def _drive(self) -> Steps:
        """Turn the needle along its arc to where the slider is."""
        assert self._throw is not None
        _, throw, hold = self._throw
        facts, pursuits, planner = self._arms[self._arm], self._pursuits[self._arm], self._planner
        angle = planner.angle(self._state, throw) if self._inside(self._state) else -BEFORE
        yield from self._go(throw.arc_at(angle, planner.arc) @ hold)
        T_reference_world = facts.in_reference(self._state, np.eye(4))
        pursuits.along(lambda a: T_reference_world @ throw.arc_at(a, planner.arc) @ hold, angle, self._target)
        while pursuits.active:
            yield

    @property
    def _planner(self) -> Planner:
        return self._planners[self._arm]

    @property
    def _tip(self) -> Array:
        return self._arms[self._arm].tip_in_world(self._state)

    def _behind(self, grasp: Array) -> Array:
        T = self._planner.needle(self._state) @ grasp
        return np.asarray(frame(np.eye(3), -BEHIND * T[:3, 2]) @ T)

    def _grasp(self) -> Generator[None, None, Array]:
        grasp = yield from self._think(self._planner.pick)
        if grasp is None:
            raise Failed(f"{self._arms[self._arm].name} cannot reach the needle. Try the other arm (N).")
        return grasp

    def _think(self, plan: Callable[[Any, Array], Any]) -> Generator[None, None, Any]:
        """What ``plan`` finds, of a copy of the state and on a thread of its own: the page goes on meanwhile."""
        state = self._state.copy()
        found = self._thinker.submit(plan, state, self._arms[self._arm].base_in_world(state))
        self._thought = found
        while not found.done():
            yield
        try:
            return found.result()
        except ValueError as error:  # a scene in which nothing can be sutured
            raise Failed(str(error)) from error

    def _go(self, T: Array) -> Steps:
        """Take the tip to ``T`` (4, 4)."""
        facts, pursuits = self._arms[self._arm], self._pursuits[self._arm]
        pursuits.pose(facts.in_reference(self._state, self._tip), facts.in_reference(self._state, T))
        since = None
        while not self._at(T):
            yield
            now = float(self._state["sim_time"])
            since = now if since is None or pursuits.active else since
            if now - since > STUCK:
                raise Failed(f"{facts.name} cannot get there.")
        yield from self._wait(SETTLING)  # the arm follows its set-point

    def _wait(self, seconds: float, until: Callable[[], bool] = lambda: False) -> Steps:
        """Wait so long, or until something holds."""
        begin = float(self._state["sim_time"])
        while float(self._state["sim_time"]) - begin < seconds and not until():
            yield

    def _at(self, T: Array) -> bool:
        away = self._tip
        turn = rotation_vector(away[:3, :3].T @ T[:3, :3])
        return bool(np.linalg.norm((away - T)[:3, 3]) < NEAR and np.linalg.norm(turn) < TURNED)

    def _jaw(self, angle: float) -> Steps:
        """Take the jaw to ``angle``."""
        facts, pursuits = self._arms[self._arm], self._pursuits[self._arm]
        assert facts.grip is not None
        angle = float(np.clip(angle, facts.grip.low, facts.grip.high))
        pursuits.jaw(self._setpoint, angle, facts.grip_verb)
        while pursuits.active:
            yield
        yield from self._wait(STUCK, lambda: abs(self._setpoint - angle) < TURNED)

    @property
    def _setpoint(self) -> float:
        return float(self._state["arm"][self._arm]["jaw_setpoint_js"][0])


def _raised(T: Array, height: float) -> Array:
    return np.asarray(frame(np.eye(3), height * UP) @ T)
