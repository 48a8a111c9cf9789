"""A square knot over a wound in soft tissue: two arms make it, let go, and wait.

In the scene `soft_knot` a thread is already stitched through both lips of a wound that gapes, its short end in a clip.
The program makes the throws of the expert of `ligature/KnotTie-v0`, with other places: the first throw is drawn just
until it lies on the tissue, since one that is drawn hard locks too far above it; the second throw stays loose, so that
the short end slides through both until the wound is closed; then both ends drawn apart lock the knot. The hands ease
both ends and look, let go and watch: where the wound opens, they slide and lock the knot once more. The program finds
its way by the ground truth of the simulation. Run it with ``--help``. World axes, metres, radians, newtons, seconds of
simulated time.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import ligature
import numpy as np
from ligature.environments.actions import ArmActions
from ligature.environments.goals.ligating import DEEP, LEFT, RIGHT, Ligating, holding
from ligature.environments.hand import SHUT, Hand
from ligature.environments.knotting import BEYOND, SLOWEST, Knotter
from ligature.environments.layout import ACTION
from ligature.environments.reading import ArmReading
from ligature.environments.tying import ACROSS, AJAR, AWAY, DRAW, SLOW, WRONG, Missed
from ligature.model.frames import axis_rotation, frame
from ligature.model.scene import Body, Scene
from ligature.robots.psm_arm import PsmArm
from ligature.tasks.diagrams import Diagram
from ligature.tasks.knots import SQUARE_KNOT, extended
from ligature.tasks.throws import drawn_back
from ligature.tasks.wounds import CLOSED, Wound

sys.path.insert(0, str(Path(__file__).resolve().parent))
from suture import Failure, Film, seed_and_folder  # noqa: E402

Array = np.ndarray

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "soft_knot" / "launch.yaml"

CONTROL = 20
"""Ticks of an action."""

HOLDS = 10
"""Seconds that the knot must hold when nothing holds it."""

BEHIND, ASIDE = 0.003, 0.005
"""How far below the tissue's surface the axis of the vessel would be for which the expert makes its throws, and how
far from where the short end comes out."""

ABOVE = 3e-4
"""How far above the surface a thread is that has come out."""

STRANDS = 3
"""Elements of a thread above the surface from which on what comes after is another strand at it."""

DRAWN, TAUT, CLOSE = ((-0.016, -0.002, 0.014), (-0.066, -0.020, 0.020)), 0.4, 0.040
"""Where the first throw is drawn, from the vessel's axis, until the long end bears so many newtons, and the loop is no
longer than that."""

ENDS, WAY = (3, 12), np.array([-0.2, 0.97, 0.05])
"""Elements from a hand between which the free end is seen to run, and how it is to run for the other hand."""

ABOUT = 0.8
"""Radians by which it may run otherwise for the right hand: a left one turned much is in its way."""

OFFERED = np.array([0.005, 0.0255, -0.008])
"""Where the left hand offers the free end to the right one, below the short end, from the vessel."""

FAR = np.array([0.095, -0.008, 0.005]), np.array([-0.100, 0.022, 0.005])
"""Where the right and the left hand draw both ends: so far that a stretched end is taut before."""

GIVEN, KEPT = np.array([0.020, 0.0, 0.005]), (0.03, 0.08)
"""To where the right hand yields the long end while the short one slides; newtons between which it keeps it: with more
the throws hold the short end, which then draws the whole knot aside instead of sliding through it."""

SNUG, UTMOST, MEETING = 3.0, 9.0, 5e-5
"""Newtons with which the short end is drawn until the lips meet, as many more each further time, and at most: what
is too short springs back when the ends are slack; width of the wound where the lips meet."""

EASED = np.array([0.020, 0.0, 0.008]), np.array([-0.016, 0.010, 0.008])
"""Towards where the right and the left hand ease their ends."""

SLACK, EVEN, LOOSE = 0.005, 0.8, 60
"""Newtons below which an end is slack: 0.05 still hold a knot shut that opens in no hand. Share of the other end's
tension above which a hand eases its own; actions by which both hands go on once both ends are slack."""

FROM = 5
"""Elements from a jaw from which on the tension is that of the thread: the jaw keeps what it held stretched so."""

TIMES, LOOKS, MOST = 8, 4, 300
"""How often the knot is slid and locked at most before the hands let go, and how often they do that; actions of a
slide, of a lock and of easing at most."""

SHORT_END, LONG_END, OFF, FARTHEST = slice(15, 35), slice(-45, -15), 0.03, 1.0
"""Elements between which a hand takes an end again that it has lost; metres by which it goes back before; metres as
which an element counts that was missed."""

DISPLACED = np.array([-0.0015, 0.0010, 0.0])
"""Where the first throw then lies, from where it would lie at the vessel."""

FRICTION, STIFFNESS = (0.5, 0.6), (0.9, 1.1)
"""Of random seeds: the thread's friction, and a factor of the tissue's stiffness."""


class Sewn(Ligating):
    """What the expert sees of a task, with a stitch through both lips of a wound in place of a vessel."""

    scene, HELD = "soft_knot", 32
    OVER = np.array([-0.03, 0.04, 0.02]), np.array([-0.015, 0.045, 0.02]), np.array([0.0, 0.045, 0.014])

    def _prepare(self) -> None:
        scene = self._simulation.scene
        places = np.array([body.T_world_body[:3, 3] for body in scene.bodies])
        self._find(list(scene.rods[0].bodies), places)

    def _find(self, elements: list[int], places: Array) -> None:
        """Find the wound and the thread, whose ``elements`` go from its short end on, with all bodies at ``places``."""
        scene = self._simulation.scene
        self.wound, rod = Wound.of(scene), scene.rods[0]
        self.elements, self.length = elements, float(rod.lengths.mean())
        self.body, self.thickness, self.radius = self.elements[-1], 2.0 * rod.radius, ASIDE
        self._surface = float(self.wound.point(self._simulation.state[0], 1, 0.0, 0.0)[1])
        points = places[elements]
        out = points[np.flatnonzero(points[:, 1] < self._surface)[0]]
        self.vessel = np.array([out[0] - ASIDE - 0.5 * self.thickness, self._surface - BEHIND, out[2]])
        self._round = 2.0 * np.pi * (self.radius + 0.5 * self.thickness)

    def gap(self) -> float:
        """Width of the wound at the stitch."""
        return self.wound.gap(self._simulation.state[0], 0.0)

    def pull(self, arm: int) -> float:
        """As ever, further from the jaws."""
        held = self.held(arm)
        if held is None:
            return 0.0
        first = held - FROM - 5 if held > self.beside(self.points()) else held + FROM
        return float(self.tension()[max(first, 0) :][:6].max())

    def beside(self, points: Array) -> int:
        """The element at which the short end comes out of the tissue."""
        inside = points[:, 1] < self._surface + ABOVE
        return max(int(inside.argmax()) - 1, 0) if inside.any() else len(points) // 3

    def leaves(self, points: Array) -> int:
        """The element at which the long end comes out of the tissue."""
        low = self.beside(points)
        inside = np.flatnonzero(points[low:, 1] < self._surface + ABOVE)
        ends = np.append(np.diff(inside) > STRANDS, True)
        return low + (int(inside[ends.argmax()]) if len(inside) else 0) + 1


class Knotting(Knotter):
    """Both hands, and the thread, over soft tissue: that bends the free end, so they look where it is."""

    UP, LOCKED, TIGHT = np.array([-0.031, 0.047, 0.039]), 10.0, 0.1
    FURTHER, TRIES = 5, 6
    BROUGHT = (*Knotter.BROUGHT[:3], (0.0015, 0.0080, -0.010, ACROSS))
    IN, SHARE = 0.012, 0.45
    """Taken so near, and through the loop so far from the tissue, that the left tool does not lean over the pad; of a
    small loop no further than this share of its length."""

    def __init__(self, hand: Hand) -> None:
        super().__init__(hand)
        self.missed: list[int] = []
        """Elements that a hand has missed since one was taken again."""

    def bring(self) -> Iterator[Array]:
        """As ever, with the free end where the left hand can take it."""
        yield from super().bring()
        yield from self.turn(RIGHT)

    def gap(self) -> Array:
        """As ever, within the loop: that ends where the strand lies over the short end."""
        points = self.goal.points()
        strand = points[self.goal.leaves(points) : self.end(RIGHT)] - self.goal.short
        over = strand[strand[:, 0] > 0.0, 1]
        return self.between(min(self.IN, self.SHARE * float(over[0])) if len(over) else self.IN)

    def turn(self, number: int, within: float = 0.0) -> Iterator[Array]:
        """A hand turns about its tool until the free end runs away from the tissue, ``within`` an angle in radians."""
        T, points, held = self.hands[number].tool, self.goal.points(), self.end(number)
        first, last = (points[held + ahead] for ahead in ENDS)
        x, y, axis = T[:3, :3].T
        angles = [float(np.arctan2(way @ y, way @ x)) for way in (last - first, WAY)]
        angle = math.remainder(angles[1] - angles[0], 2.0 * math.pi)
        turned = axis_rotation(axis, math.copysign(max(abs(angle) - within, 0.0), angle)) @ T[:3, :3]
        yield from self.go(number, frame(turned, T[:3, 3]), SHUT, SLOW)

    def under(self) -> Iterator[Array]:
        """As ever, then the left hand turns and moves until what the right one is to take is where that reaches it."""
        yield from super().under()
        yield from self.turn(LEFT, ABOUT)
        away = self.goal.vessel + OFFERED - self.goal.points()[self.beyond(LEFT, BEYOND)]
        yield from self.go(LEFT, self.moved(LEFT, *away), SHUT, SLOW)

    def second(self) -> Iterator[Array]:
        """As ever; before each try the left hand takes the long end again if it has lost it."""
        yield from self.tries(RIGHT, partial(self.regain, LEFT, LONG_END), self.hook, self.under, self.back_through)

    def back_through(self) -> Iterator[Array]:
        """As ever; broken off where no hand holds the long end, while that is still near to the left one."""
        for action in super().back_through():
            if self.goal.held(LEFT) is None and self.goal.held(RIGHT) is None:
                raise Missed("the left hand lost the thread")
            yield action

    def draw_second(self) -> Iterator[Array]:
        """As ever; the right hand takes the long end again if it has lost it."""
        yield from self.tries(RIGHT, partial(self.regain, RIGHT, LONG_END), super().draw_second)

    def take_short_end(self) -> Iterator[Array]:
        """As ever; a short end that is missed or lost is taken again, and so is the long end."""
        yield from self.tries(LEFT, partial(self.regain, RIGHT, LONG_END), super().take_short_end)

    def draw(self) -> Iterator[Array]:
        """The left hand draws the first throw until it lies on the tissue, and no further."""
        for place in DRAWN:
            T = holding(DRAW, AWAY, self.goal.vessel + place)
            yield from self.go(LEFT, T, SHUT, SLOW, self.lies)

    def lies(self) -> bool:
        """Whether the first throw is drawn close enough."""
        pull, loop = self.pull(LEFT), self.goal.loop(self.goal.points())
        length = np.inf if loop is None else (loop[1] - loop[0]) * self.goal.length
        return pull > TAUT and length < CLOSE

    def draw_apart(self) -> Iterator[Array]:
        """Slide and lock the knot until it holds the wound closed by itself, both ends slack in the hands.

        An end that is lost is taken again.
        """
        goal = self.goal
        assert isinstance(goal, Sewn)
        for count in range(TIMES):
            try:
                yield from self.slide(goal, min((count + 1) * SNUG, UTMOST))
                yield from self.lock()
                yield from self.ease()
            except Missed:
                yield from self.take_ends()
                continue
            if goal.gap() < MEETING and self.slack():  # taut ends would keep the lips shut
                return

    def take_ends(self) -> Iterator[Array]:
        """Each hand that holds no end takes its own again, where that is; a missed one is tried again."""
        for number, among in ((LEFT, SHORT_END), (RIGHT, LONG_END)):
            yield from self.tries(number, partial(self.regain, number, among))

    def regain(self, number: int, among: slice) -> Iterator[Array]:
        """A hand that holds nothing goes back, and takes, turned as it is, what is nearest of some elements.

        Where it missed that, it takes others, and such as are near to being aligned with its jaws: wrists turn only
        so far, and what lies in the way of the jaws lies there.
        """
        if self.goal.held(number) is not None:
            return
        T, points = self.hands[number].tool, self.goal.points()
        elements, tangents = np.arange(len(points))[among], np.gradient(points, axis=0)[among]
        away = np.linalg.norm(points[elements] - (T[:3, 3] + DEEP * T[:3, 2]), axis=1)
        aligned = np.abs(tangents @ T[:3, 0]) / np.linalg.norm(tangents, axis=1)
        cost = away / np.maximum(aligned, 0.05) ** (2 * self.further // self.FURTHER)
        for element in self.missed:
            cost[np.abs(elements - element) <= WRONG] += FARTHEST
        self.missed.append(int(elements[cost.argmin()]))
        yield from self.go(number, drawn_back(T, OFF), AJAR, SLOW)
        yield from self.take(number, T[:3, 2], self.missed[-1])
        self.missed.clear()

    def slide(self, goal: Sewn, most: float) -> Iterator[Array]:
        """The left hand draws the short end, while the right one keeps the long end just taut: the knot does not lock.

        Both ends drawn at once would lock it before the wound is closed.
        """
        for _ in range(MOST):
            short, long = self.pull(LEFT), self.pull(RIGHT)
            if goal.gap() < MEETING and short > most > 2.0 * long:
                return
            action, left = self.towards(LEFT, FAR[LEFT])
            if left < 0.2:  # it can draw no further
                return
            action *= short < most
            if not KEPT[0] < long < KEPT[1]:
                action += self.towards(RIGHT, FAR[RIGHT] if long < KEPT[0] else GIVEN)[0]
            yield action

    def lock(self) -> Iterator[Array]:
        """Each hand draws its end until both bear at once what locks the knot."""
        for _ in range(MOST):
            loose = [n for n in (RIGHT, LEFT) if self.pull(n) < self.LOCKED]
            ways = [self.towards(n, FAR[n]) for n in loose]
            if all(left < 0.2 for _, left in ways):  # also where none is loose
                return
            yield np.sum([action for action, _ in ways], axis=0)

    def ease(self) -> Iterator[Array]:
        """Both hands ease their ends to slack, evenly: where one is slack while the other is taut, the knot slides."""
        loose = 0
        for _ in range(MOST):
            pulls, slack = [self.pull(n) for n in (RIGHT, LEFT)], self.slack()
            loose += slack
            if loose > LOOSE:
                return
            giving = [n for n in (RIGHT, LEFT) if slack or pulls[n] > EVEN * max(pulls)]
            yield np.sum([self.towards(n, EASED[n])[0] for n in giving], axis=0)

    def slack(self) -> bool:
        """Whether both ends are slack."""
        return max(self.pull(RIGHT), self.pull(LEFT)) < SLACK

    def towards(self, number: int, place: Array) -> tuple[Array, float]:
        """A slow action of a hand towards a place that is given from the vessel, and how many full ones are left."""
        action, left = self.hands[number].action(self.turned(number, place), SHUT)
        return SLOWEST * action, left


def hands(simulation: ligature.Simulation) -> tuple[PsmArm, ...]:
    """Both arms, the right hand first."""
    return tuple(arm for name in Sewn.arms if isinstance(arm := simulation.arms[name], PsmArm))


class Theatre:
    """Both arms and the thread, in place of an environment."""

    needle = 0

    def __init__(self, simulation: ligature.Simulation, goal: Sewn, watch: Callable[[], object] = lambda: None) -> None:
        self.simulation, self.goal, self._watch = simulation, goal, watch
        self.arms = hands(simulation)
        self.readings = tuple(ArmReading(simulation, arm) for arm in self.arms)
        self._actions = [
            ArmActions(arm, reading, "cartesian") for arm, reading in zip(self.arms, self.readings, strict=True)
        ]

    def run(self, actions: Iterator[Array]) -> None:
        """Have both arms act."""
        for action in actions:
            for arm, own in zip(self._actions, np.clip(action, -1.0, 1.0).reshape(-1, ACTION), strict=True):
                arm.act(own)
            self.simulation.step(CONTROL)
            self._watch()

    def wait(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Go on for so many seconds, or until something is so; returns whether it was."""
        for _ in range(round(seconds / (CONTROL * self.simulation.dt))):
            if until():
                return True
            self.simulation.step(CONTROL)
            self._watch()
        return until()


@dataclass(frozen=True)
class Outcome:
    """How well it went.

    Parameters
    ----------
    kind
        Determinant, signature and three-colourings of the knot in the thread, its ends continued straight.
    gaps
        Width of the wound at the stitch in metres: at first, with both ends slack in the hands, when those have let
        go, and `HOLDS` seconds later.
    sewn, hands_empty
        Whether the thread still passes through both lips, and no jaw holds anything.
    time
        Simulated seconds until the end.
    stopped
        Why the program gave up, if it did.
    """

    kind: tuple[int, int, int]
    gaps: tuple[float, ...]
    sewn: bool
    hands_empty: bool
    time: float
    stopped: str = ""

    @property
    def success(self) -> bool:
        """Whether a square knot holds the wound closed, and has not slipped by 0.1 mm."""
        if self.stopped or self.kind != SQUARE_KNOT or not (self.sewn and self.hands_empty):
            return False
        *_, free, last = self.gaps
        return last < CLOSED and last - free < 1e-4

    def lines(self) -> list[str]:
        """One figure a line."""
        names = ["at first", "both ends slack", "hands let go", f"{HOLDS} s later"]
        if self.stopped:
            names[len(self.gaps) - 1 :] = ["when it stopped"]
        determinant, signature, colourings = self.kind
        return [
            f"{'a' if self.success else 'no'} square knot that holds the lips, in {self.time:.1f} s",
            f"determinant {determinant}, signature {signature}, {colourings} three-colourings",
            *(f"gap {1e3 * gap:.2f} mm, {name}" for name, gap in zip(names, self.gaps, strict=True)),
        ]


def scattered(scene: Scene, seed: int) -> Scene:
    """The thread more or less smooth, the tissue more or less stiff; seed 0 leaves both."""
    if seed == 0:
        return scene
    rng = np.random.default_rng(seed)
    friction, stiffness = float(rng.uniform(*FRICTION)), float(rng.uniform(*STIFFNESS))
    thread, tissue = set(scene.rods[0].bodies), scene.tissues[0].body

    def other(body: Body) -> Body:
        if body.index in thread:
            return replace(body, friction=friction)
        if body.index != tissue or body.tissue is None:
            return body
        materials = tuple(replace(material, youngs=stiffness * material.youngs) for material in body.tissue.materials)
        return replace(body, tissue=replace(body.tissue, materials=materials))

    return replace(scene, bodies=type(scene.bodies)([other(body) for body in scene.bodies]))


def begun(simulation: ligature.Simulation, seed: int) -> Sewn:
    """The task, its long end in the right hand; raises ValueError where the jaws do not hold the thread."""
    goal = Sewn(simulation, hands(simulation))
    goal.settle()
    if seed:
        goal.begin(np.random.default_rng(seed))
    return goal


def lock_knot(theatre: Theatre, knotter: Knotting) -> list[float]:
    """Draw both ends, let go, and watch for `HOLDS` seconds: once the wound opens the hands take both ends again.

    Returns the width of the wound with both ends slack, when the hands have let go, and `HOLDS` seconds later.
    """
    goal = theatre.goal
    for look in range(LOOKS):
        theatre.run(knotter.draw_apart())
        eased = goal.gap()
        theatre.run(knotter.let_go())
        free, more = goal.gap(), look < LOOKS - 1
        if not theatre.wait(HOLDS, lambda more=more: more and goal.gap() >= MEETING):  # type: ignore[misc]
            break
        theatre.run(knotter.take_ends())
    return [eased, free, goal.gap()]


def make_knot(theatre: Theatre) -> tuple[list[float], str]:
    """Make the knot, let go, wait; returns the gaps of `Outcome`, and why it stopped, if it did."""
    env: Any = theatre
    knotter, goal, stopped = Knotting(Hand(env, 0)), theatre.goal, ""
    gaps = [goal.gap()]
    try:
        theatre.run(knotter.first())
        goal.vessel = goal.vessel + DISPLACED
        for step in (knotter.second, knotter.draw_second, knotter.take_short_end):
            theatre.run(step())
        gaps += lock_knot(theatre, knotter)
    except (Missed, ValueError) as error:
        stopped = str(error)
        gaps.append(goal.gap())
    return gaps, stopped


def judged(theatre: Theatre, gaps: list[float], stopped: str) -> Outcome:
    """How well it went."""
    simulation, goal = theatre.simulation, theatre.goal
    kind = Diagram.of(extended(goal.points() - goal.vessel, np.zeros(3))).kind
    empty = all(simulation.grasps[arm.name] is None for arm in theatre.arms)
    sewn = goal.wound.stitch(simulation.state[0], 0.0) is not None
    return Outcome(kind, tuple(gaps), sewn, empty, simulation.time, stopped)


def operate(simulation: ligature.Simulation, seed: int = 0, watch: Callable[[], object] = lambda: None) -> Outcome:
    """Take the long end, make the knot, let go, wait; returns how well it went."""
    try:
        theatre = Theatre(simulation, begun(simulation, seed), watch)
    except ValueError as error:  # the jaws do not hold the thread
        raise Failure(str(error)) from error
    return judged(theatre, *make_knot(theatre))


def main() -> int:
    """Make a knot and print how well it went."""
    given = seed_and_folder(
        "Two arms make a square knot over a wound in soft tissue.",
        "hands, friction and stiffness; 0 is the scene's own",
    )
    simulation = ligature.Simulation(scattered(ligature.load(SCENE), given.seed))
    film = Film(simulation, given.out) if given.out else None
    try:
        outcome = operate(simulation, given.seed, film.watch if film else lambda: None)
    except Failure as failure:
        sys.exit(f"error: {failure}")
    print("\n".join([f"stopped: {outcome.stopped}"] * bool(outcome.stopped) + outcome.lines()))
    if film is not None:
        print(film.save())
    return 0 if outcome.success else 1


if __name__ == "__main__":
    sys.exit(main())
