"""Help with a throw: the jaw turns to the needle, picks it up, brings it to the tissue, drives it along its arc.

Each is one press of a button or the slider of the drive; the arm goes at a hand's speed, and whatever the operator does
by hand takes over at once. World axes, metres, radians, simulated seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.cockpit.arm_facts import ArmFacts
from ligature.cockpit.pursuit import JAW, ArmPursuits
from ligature.model.frames import frame, inverse
from ligature.model.scene import Scene
from ligature.robots.fitting import kinematics_of
from ligature.robots.poses import rotation_vector
from ligature.robots.psm import Psm
from ligature.tasks.plans import ABOVE, APPROACH, BEFORE, BEYOND, DEPTHS, Pick, Planner
from ligature.tasks.throws import PAD, UP, Throw, drawn_back

Array = NDArray[np.float64]

OPEN, SHUT = 0.4, -0.35
"""Angles of the jaw. The lower finger of a leaning tool that is wide open gets under the needle and flings it away."""

LIFT = 0.03
"""Metres by which a needle is lifted."""

NEAR, TURNED = 2e-4, 0.01
"""Metres and radians within which a set-point counts as arrived."""

PRESSES = (-0.0004, 0.0, 0.0004)
"""Metres by which a tool goes further than where it holds the needle in the middle of its pads, try by try.

A little less at first: fingers that press on soft tissue fling the needle away.
"""

BLUNT, SHALLOWER = 10.0, 0.0006
"""Newtons at which closing fingers have met what the needle lies on, and metres less by which they go there next.

Fingers reach farther when they are closed than open, and what is hard does not give way.
"""

CLOSING, STUCK = 0.6, 1.0
"""Seconds in which jaws must have closed on a needle, and for which a set-point may rest before its goal."""

GRIP = 1.0
"""Speed in rad/s at which a jaw closes: a needle jumped out of fingers that snapped at it with twice that."""

PRESSED = 20.0
"""Newtons at a tip above which an arm has met something that no plan knows of: needles and tissue take a few."""

SPEED = 0.5
"""Share of the maximum velocity of joints at which an arm goes over the work."""

SETTLING = 0.2
"""Seconds in which an arm comes to rest at its set-point."""

CANNOT = "cannot get there: a joint is at its limit, or something is in the way. Move it by hand, then try again."
"""Why a plan of motion ends, behind the name of the arm, and what the operator can do."""

TURNS = 3
"""Attempts to lay a needle down in another direction before the operator is asked."""

THROUGH, BESIDE = 0.15, 0.004
"""Angle of the tip beyond the exit from which the needle has passed, and largest distance in metres to its puncture."""

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
        self._rest: Array | None = None
        """Where the needle lay when it was taken last (4, 4)."""
        self._throw: tuple[int, Throw, Array] | None = None
        """Of which arm, where, and the tool's pose (4, 4) in the needle's arc frame."""
        self._target = 0.0
        self.note = ""

    # --- what the operator asks for --------------------------------------------------------------

    def begin(self, word: str, arm: int, state: Any) -> None:
        """Do what ``word`` (`orders.HELP`) asks for with ``arm``, instead of what was done so far."""
        self.stop()
        if arm in self._planners and self._arms[arm].ready(state):
            self._pursuits[arm].stop()  # it rests while a plan is made
            self._arm, self._state, self.note = arm, state, ""
            self._steps = {"align": self._align, "pick": self._pick, "bring": self._move_to_entry}[word]()

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

    def stop(self, why: str = "") -> None:
        """Leave everything to the operator, from where the arm is going, and say ``why``."""
        if self._steps is not None:
            self._pursuits[self._arm].stop()
            self.note = why
        self._steps = None

    def forget(self) -> None:
        """Stop, and forget the throw: the scene has been reset."""
        self.stop()
        self._throw, self._rest, self.note = None, None, ""

    @property
    def busy(self) -> bool:
        """Whether something is being done."""
        return self._steps is not None

    @property
    def arm(self) -> int:
        """The arm that does it, -1 for none."""
        return self._arm if self.busy else -1

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
        if not self._arms[self._arm].ready(state):
            self.stop(f"{self._arms[self._arm].name} stopped: it is no longer enabled and homed.")
            return
        if self._tip_force > PRESSED:
            self.stop(f"{self._arms[self._arm].name} stopped: it presses on something. Move it away by hand.")
            return
        try:
            next(self._steps)
        except StopIteration:
            self._steps = None
        except Failed as failure:
            self.stop(str(failure))

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
        """Align the jaw with the needle and move to the approach pose, jaw open."""
        pick = yield from self._plan()
        yield from self._approach(pick.T_arc_tool)

    def _pick(self) -> Steps:
        """Grasp the needle so that it can be driven; if needed, lay it down in another orientation first."""
        for _ in range(TURNS):
            if (yield from self._grasp()):
                return
            if not (yield from self._lay_down()):
                return

    def _approach(self, grasp: Array) -> Steps:
        """Move to the approach pose with the jaw open, without touching the needle on the way."""
        planner = self._planner
        yield from self._jaw(OPEN)
        T = self._tip
        if np.linalg.norm(planner.needle(self._state)[:3, 3] - T[:3, 3]) < PAD + 2.0 * planner.arc.radius:
            yield from self._go(drawn_back(T, APPROACH))  # it may stand about the needle
        before = drawn_back(planner.needle(self._state) @ grasp, APPROACH)
        over = _raised(before, ABOVE)
        if planner.joints(self._arms[self._arm].base_in_world(self._state), over) is not None:
            yield from self._go(over)
        yield from self._go(before)

    def _grasp(self) -> Generator[None, None, bool]:
        """Take the needle and lift it; jaws that close on nothing try it at another depth.

        Whether it can be driven held so.
        """
        deepest = np.inf
        for press in PRESSES:
            pick = yield from self._plan()
            grasp = pick.T_arc_tool
            yield from self._approach(grasp)
            self._rest = self._planner.needle(self._state)
            depth = min(press, deepest)
            yield from self._go(self._rest @ grasp @ frame(np.eye(3), np.array([0, 0, depth])))
            if not (yield from self._close()):
                deepest = depth - SHALLOWER
                yield from self._jaw(OPEN)
            elif self._holds(self._arm, self._state):
                if not self._inside(self._state):
                    yield from self._go(_raised(self._tip, LIFT))
                return pick.drives or self._inside(self._state)
        raise Failed("The jaws closed on nothing. Try again.")

    def _lay_down(self) -> Generator[None, None, bool]:
        """Lay the needle down in a direction from which it can be picked up and driven; whether there is one."""
        rest, hold = self._rest, self._hold
        if rest is None:
            return False
        lie = yield from self._planned(self._arm, self._planner.lie, hold, rest)
        if lie is None:
            return False
        down = lie @ hold
        yield from self._go(_raised(down, ABOVE))
        yield from self._go(down)
        yield from self._jaw(OPEN)
        yield from self._go(drawn_back(down, APPROACH))
        return True

    def _move_to_entry(self) -> Steps:
        """Move the needle's tip in front of the entry of the throw that the arm reaches best."""
        for left in reversed(range(TURNS)):
            hold = self._hold
            throw = yield from self._planned(self._arm, self._planner.throw, hold)
            if throw is not None:
                break
            if not left or not (yield from self._lay_down()):
                raise Failed("Held like this the needle does not reach through. Put it down (X) and pick it up again.")
            yield from self._grasp()
        start = throw.arc_at(-BEFORE, self._planner.arc) @ hold
        yield from self._go(_raised(start, ABOVE))
        yield from self._go(start)
        self._throw = self._arm, throw, hold

    def _drive(self) -> Steps:
        """Drive the needle along its arc to the position of the slider."""
        assert self._throw is not None
        _, throw, hold = self._throw
        facts, pursuits, planner = self._arms[self._arm], self._pursuits[self._arm], self._planner
        angle = planner.angle(self._state, throw) if self._inside(self._state) else -BEFORE
        begin = throw.arc_at(angle, planner.arc) @ hold
        yield from self._slide(begin) if self._inside(self._state) else self._go(begin)
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

    @property
    def _hold(self) -> Array:
        """Pose (4, 4) of the tool in the arc frame of the needle that it holds."""
        return np.asarray(inverse(self._planner.needle(self._state)) @ self._tip)

    def _plan(self) -> Generator[None, None, Pick]:
        """Plan the grasp of the needle: by the operator's arm, or by another arm that is ready and reaches it."""
        others = [arm for arm in self._planners if arm != self._arm and self._arms[arm].ready(self._state)]
        found: dict[int, Pick] = {}
        for arm in (self._arm, *others):
            pick = yield from self._planned(arm, self._planners[arm].pick)
            if pick is not None:
                found[arm] = pick
                if pick.drives:
                    break
        if not found:
            names = " and ".join(self._arms[arm].name for arm in (self._arm, *others))
            raise Failed(f"{names} cannot reach the needle. Push it nearer by hand, or reset the simulation.")
        self._arm = next((arm for arm, pick in found.items() if pick.drives), next(iter(found)))
        return found[self._arm]

    def _planned(self, arm: int, plan: Callable[..., Any], *given: Any) -> Generator[None, None, Any]:
        """The result of ``plan`` for an arm, from a copy of the state and on a thread: the page does not wait."""
        state = self._state.copy()
        found = self._thinker.submit(plan, state, self._arms[arm].base_in_world(state), *given)
        self._thought = found
        while not found.done():
            yield
        try:
            return found.result()
        except ValueError as error:  # a scene in which nothing can be sutured
            raise Failed(str(error)) from error

    def _go(self, T: Array) -> Steps:
        """Move the tip to ``T`` (4, 4): straight, or up and over where joints would reach their limits."""
        planner, q = self._planner, self._arms[self._arm].setpoints(self._state)
        T_base = self._arms[self._arm].base_in_world(self._state)
        if not planner.straight(T_base, q, self._tip, T):
            for through in (_raised(self._tip, ABOVE), _raised(T, ABOVE)):
                joints = planner.joints(T_base, through)
                if joints is not None:
                    yield from self._turn(joints)
            q = self._arms[self._arm].setpoints(self._state)
            if not planner.straight(T_base, q, self._tip, T):
                joints = planner.joints(T_base, T)
                if joints is None:
                    raise Failed(f"{self._arms[self._arm].name} {CANNOT}")
                yield from self._turn(joints)
        yield from self._slide(T)

    def _turn(self, joints: Array) -> Steps:
        """Move the arm to joint values (6,)."""
        facts, pursuits = self._arms[self._arm], self._pursuits[self._arm]
        pursuits.joints(facts.setpoints(self._state), joints, SPEED * facts.speed)
        while pursuits.active:
            yield
        yield from self._wait(STUCK, lambda: bool(np.abs(facts.setpoints(self._state) - joints).max() < NEAR))

    def _slide(self, T: Array) -> Steps:
        """Move the tip straight to ``T`` (4, 4)."""
        facts, pursuits = self._arms[self._arm], self._pursuits[self._arm]
        pursuits.pose(facts.in_reference(self._state, self._tip), facts.in_reference(self._state, T), True)
        since = None
        while not self._at(T):
            yield
            now = float(self._state["sim_time"])
            since = now if since is None or pursuits.active else since
            if now - since > STUCK:
                raise Failed(f"{facts.name} {CANNOT}")
        yield from self._wait(SETTLING)  # the arm follows its set-point

    def _wait(self, seconds: float, until: Callable[[], bool] = lambda: False) -> Steps:
        """Wait for a time, or until a condition holds."""
        begin = float(self._state["sim_time"])
        while float(self._state["sim_time"]) - begin < seconds and not until():
            yield

    def _at(self, T: Array) -> bool:
        away = self._tip
        turn = rotation_vector(away[:3, :3].T @ T[:3, :3])
        return bool(np.linalg.norm((away - T)[:3, 3]) < NEAR and np.linalg.norm(turn) < TURNED)

    def _close(self) -> Generator[None, None, bool]:
        """Close the jaw on the needle; False as soon as the fingers press on what it lies on."""

        def held() -> bool:
            return self._holds(self._arm, self._state)

        for _ in chain(self._jaw(SHUT), self._wait(CLOSING, held)):
            if self._tip_force > BLUNT and not held():
                return False
            yield
        return True

    def _jaw(self, angle: float) -> Steps:
        """Move the jaw to ``angle``."""
        facts, pursuits = self._arms[self._arm], self._pursuits[self._arm]
        assert facts.grip is not None
        angle = float(np.clip(angle, facts.grip.low, facts.grip.high))
        pursuits.jaw(self._setpoint, angle, facts.grip_verb, True, JAW if angle > self._setpoint else GRIP)
        while pursuits.active:
            yield
        yield from self._wait(STUCK, lambda: abs(self._setpoint - angle) < TURNED)

    @property
    def _tip_force(self) -> float:
        """Force at the tip of the arm, N."""
        return float(np.linalg.norm(self._state["arm"][self._arm]["spatial_measured_cf"][:3]))

    @property
    def _setpoint(self) -> float:
        return float(self._state["arm"][self._arm]["jaw_setpoint_js"][0])


def _raised(T: Array, height: float) -> Array:
    return np.asarray(frame(np.eye(3), height * UP) @ T)
