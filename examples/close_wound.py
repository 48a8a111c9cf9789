"""A wound in soft tissue closed without hands, all of it: a stitch through both lips, and a square knot that holds it.

In the scene `soft_closing` the needle lies on a board, the short end of its thread is in a clip. One arm takes the
needle and drives it through both lips, as `suture_tissue` does; the other one pulls it out and draws the thread after
it. Then the first arm takes the thread, the needle comes off it under a pull, and both arms make the knot of
`soft_knot`. The program finds its way by the ground truth of the simulation. Run it with ``--help``. World axes,
metres, radians, newtons, seconds of simulated time.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import ligature
import numpy as np
from ligature.environments.goals.ligating import RIGHT, holding
from ligature.environments.tying import CARRY
from ligature.model.frames import axis_rotation, frame
from ligature.tasks.throws import PAD, UP, Throw, drawn_back
from ligature.tasks.wounds import ClosureScore

sys.path.insert(0, str(Path(__file__).resolve().parent))
from soft_knot import Outcome, Sewn, Theatre, judged, make_knot, scattered  # noqa: E402
from suture import ABOVE, OPEN, SHUT, STREAM, Failure, Film, seed_and_folder  # noqa: E402
from suture_tissue import Plan, TissueSurgeon  # noqa: E402

Array = np.ndarray

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "soft_closing" / "launch.yaml"

ARMS = ("PSM1", "PSM2")
"""The right hand, which drives the needle, and the left one, which pulls it out: as a knot counts them."""

OUTWARDS, DRAWN, SPEED = np.array([-0.632, 0.775, 0.0]), 0.11, 0.03
"""Direction from where the thread comes out in which it is drawn through, how far at most, and how fast."""

TAUT, BESIDE = 0.03, 0.01
"""Tension of the short end at which enough has been drawn, and metres before the tissue at which that is read."""

TAKING, LIFTED = np.array([-0.7, -0.15, -0.7]), 0.03
"""Direction of the tool that takes the long end, and how far over it that arrives."""

TUG, TUGGED, APART = 0.02, 0.01, 0.003
"""Metres by which the needle is pulled until it comes off, at most, metres a second, and how far off it then is."""

LAID, BACK = np.array([-0.015, 0.312, 0.705]), 0.02
"""Where the needle is laid down, and how far a hand that has let go draws back along itself."""

ACROSS = np.array([0.0, -1.0, -0.1])
"""How the long end then runs beyond the hand: towards the tissue."""

CARRYING = 0.1
"""Metres a second with which the long end is brought over the short one."""

ASIDE, TURN = 0.004, 0.1
"""Metres and radians by which hands of random seeds begin the knot elsewhere."""


class Stitched(Sewn):
    """What the expert of knots sees: the thread from its short end on, which here is its last element."""

    def _prepare(self) -> None:
        rod = self._simulation.scene.rods[0]
        poses = self._simulation.state[0]["body_pose"]
        self._find(list(reversed(rod.bodies)), poses[:, :3])


class Closer(TissueSurgeon):
    """Two arms that stitch a wound which faces them, and make a knot over it."""

    def __init__(self, simulation: ligature.Simulation, seed: int, watch: Callable[[], object] = lambda: None) -> None:
        super().__init__(simulation, Plan(1), watch)
        self._rng = np.random.default_rng(seed) if seed else None
        self._exit = self.ends(1)[1]

    @property
    def up(self) -> Array:  # type: ignore[override]
        """Which way the wound faces, (3,)."""
        return self.wound.axes(self._state)[:, 2]

    def ends(self, pair: int) -> tuple[Array, Array]:
        """Where the stitch goes in, on the side of the short end, and out, (3,) each."""
        near, far = super().ends(pair)
        return far, near

    # --- the stitch ---------------------------------------------------------------------------

    def stitch(self) -> None:
        """One stitch, from taking the needle to where the thread has been drawn through both lips."""
        right, left = ARMS
        self.prepare()
        throw = self.throw(1)
        self.take_needle(right, throw)
        self.drive(right, throw)
        self.made.append(self.wound.stitch(self._state, 0.0))
        self.pull_out(left, right, throw, out=0.0)
        self.draw_through(left)

    def take_needle(self, name: str, throw: Throw) -> None:
        """Take the needle from the board as it is driven, and lift it."""
        self.take_to_drive(name, throw)
        self.line(name, frame(np.eye(3), LIFTED * UP) @ self.tool(name))

    def draw_through(self, name: str) -> None:
        """Draw the needle away from where it came out until the short end is taut in its clip."""
        tail = self.monitor.scenery.needle_points(self._state["body_pose"])[0]
        self.pull(name, self._exit + DRAWN * OUTWARDS - tail, SPEED, lambda: self.short_end() > TAUT)
        self.wait(0.3)

    def pull(self, name: str, way: Array, speed: float, until: Callable[[], bool]) -> None:
        """Stream a hand ``way`` (3,) from where it is until something is so."""
        T = self.tool(name)
        steps = max(2, int(float(np.linalg.norm(way)) / speed / STREAM))
        for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
            if until():
                return
            self.glide(name, iter([frame(T[:3, :3], T[:3, 3] + share * way)]))

    def short_end(self) -> float:
        """Largest tension between clip and tissue."""
        thread = list(self.monitor.scenery.thread)
        away = (self._state["body_pose"][thread, :3] - self._exit) @ self.up
        last = np.flatnonzero(away < BESIDE)[-1]  # the rest up to the clip is the short end
        return float(self._state["rod_tension"][thread][last : last + 25].max())

    # --- from the stitch to the knot ----------------------------------------------------------

    def offer(self, goal: Stitched) -> None:
        """The right hand takes the long end, the needle comes off it, and both hands go to where they begin a knot."""
        right, left = ARMS
        along = self.take_long_end(right, goal)
        self.part(left)
        self.lay_down(left)
        ways = zip((*goal.OVER, goal.FIRST), (along, along, ACROSS, ACROSS), strict=True)
        for place, way in ways:
            self.line(right, self._aside(holding(CARRY, way, goal.vessel + place), place is goal.FIRST), CARRYING)
        waiting = holding(CARRY * [-1.0, 1.0, 1.0], ACROSS, goal.vessel + goal.WAITING)
        self.jaw(left, OPEN)
        self.line(left, self._aside(waiting, True), CARRYING)
        self.wait(0.3)

    def take_long_end(self, name: str, goal: Stitched) -> Array:
        """Take the thread, which the needle keeps straight, as a knot begins; returns how it runs there, (3,)."""
        points = goal.points()
        at = len(points) - 1 - goal.HELD
        along = points[at + 1] - points[at - 1]
        T = holding(TAKING, along, points[at])
        self.jaw(name, OPEN)
        self.line(name, frame(np.eye(3), LIFTED * UP) @ self.tool(name), CARRYING)
        self.line(name, frame(np.eye(3), LIFTED * UP) @ drawn_back(T, BACK), CARRYING)
        self.line(name, drawn_back(T, BACK), CARRYING)
        self.line(name, T)
        self.jaw(name, SHUT, 0.5)
        self.wait(0.2)
        if goal.held(RIGHT) is None:
            raise Failure(f"{name} closed on nothing, not on the thread")
        return along

    def part(self, name: str) -> None:
        """Pull the needle off its thread."""
        self.pull(name, TUG * OUTWARDS, TUGGED, self.is_apart)
        if not self.is_apart():
            raise Failure("the needle did not come off its thread")

    def is_apart(self) -> bool:
        """Whether the needle has come off its thread."""
        poses = self._state["body_pose"]
        tail, start = self.monitor.scenery.needle_points(poses)[0], poses[self.monitor.scenery.thread[0], :3]
        return float(np.linalg.norm(tail - start)) > APART

    def lay_down(self, name: str) -> None:
        """Lay the needle down where it is in nobody's way."""
        T = self.tool(name)
        self.line(name, frame(np.eye(3), ABOVE * UP) @ T, CARRYING)
        self.line(name, frame(T[:3, :3], LAID - PAD * T[:3, 2]), CARRYING)
        self.jaw(name, OPEN)
        self.line(name, drawn_back(self.tool(name), BACK), CARRYING)

    def _aside(self, T: Array, scatter: bool) -> Array:
        """A pose of a tool a little elsewhere and turned otherwise, for random seeds."""
        if self._rng is None or not scatter:
            return T
        way, turn = self._rng.uniform(-ASIDE, ASIDE, 3), self._rng.uniform(-TURN, TURN, 3)
        angle = float(np.linalg.norm(turn))
        return frame(T[:3, :3] @ axis_rotation(turn / angle, angle), T[:3, 3] + way)


@dataclass(frozen=True)
class Closed:
    """How well a wound was closed: the stitch, and the knot over it, which is None where the stitch failed."""

    stitch: ClosureScore
    knot: Outcome | None
    stopped: str = ""

    @property
    def success(self) -> bool:
        """Whether the stitch goes through both lips, and a square knot holds the wound closed by itself."""
        return self.knot is not None and self.knot.success and self.stitch.success and not self.stopped

    def lines(self) -> list[str]:
        """One figure a line."""
        knot = self.knot.lines() if self.knot else []
        return [*([f"stopped: {self.stopped}"] if self.stopped else []), *self.stitch.lines(), *knot]


def operate(simulation: ligature.Simulation, seed: int = 0, watch: Callable[[], object] = lambda: None) -> Closed:
    """Stitch the wound, make the knot, let go, wait; returns how well it went."""
    closer = Closer(simulation, seed, watch)
    closer.wait(0.3)
    outcome, stopped = None, ""
    try:
        closer.stitch()
        goal = Stitched(simulation, tuple(closer.arms.values()))
        closer.offer(goal)
        theatre = Theatre(simulation, goal, closer.see)
        outcome = judged(theatre, *make_knot(theatre))
    except (Failure, ValueError) as failure:
        stopped = str(failure)
    return Closed(closer.score(), outcome, stopped)


def main() -> int:
    """Close a wound and print how well it went."""
    given = seed_and_folder(
        "Two arms close a wound in soft tissue by a stitch and a knot.",
        "hands, friction and stiffness; 0 is the scene's own",
    )
    simulation = ligature.Simulation(scattered(ligature.load(SCENE), given.seed))
    film = Film(simulation, given.out) if given.out else None
    started = time.perf_counter()
    closed = operate(simulation, given.seed, film.watch if film else lambda: None)
    took = time.perf_counter() - started
    lines = [*closed.lines(), f"computed in {took:.1f} s, {simulation.time / took:.2g} times real time"]
    print("\n".join(lines))
    if film is not None:
        print(film.save())
    return 0 if closed.success else 1


if __name__ == "__main__":
    sys.exit(main())
