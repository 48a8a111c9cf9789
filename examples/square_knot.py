"""A square knot without hands: two arms make a ligature around a vessel, by the calls that a real robot takes.

Each throw is made with instruments. The right arm bends the short end of the thread until it stands by itself where it
is wanted, and draws back along itself; the left arm lays the long end around its open jaws, in the gap. The right arm
then goes forward by that gap, takes the end and draws it through the loop. The second throw is the mirror image of the
first one. The program localises from ground truth and moves the arms by CRTK alone: ``servo_cp``, ``jaw/servo_jp``,
``measured_cp``. Run it with ``--help``. World axes, metres, radians, seconds of simulated time.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import ligature
import numpy as np
from ligature.model.frames import axis_rotation, frame
from ligature.model.scene import Scene
from ligature.robots.poses import rotation_vector
from ligature.tasks.knots import HALF_KNOT, SquareKnotScore
from ligature.tasks.throws import drawn_back

sys.path.insert(0, str(Path(__file__).resolve().parent))
from looping import ASIDE, BEGIN, END, SHARES, THINNEST, between, drawn, radius_for  # noqa: E402
from suture import Failure, Film, seed_and_folder  # noqa: E402
from two_arms import (  # noqa: E402
    BRISK,
    CAREFUL,
    DEEP,
    FINGER_OPEN,
    FINGERTIP,
    LEFT,
    OPEN,
    RIGHT,
    ROOT,
    SHUT,
    SLOW,
    STREAM,
    Missed,
    TwoArms,
)  # fmt: skip

Array = np.ndarray

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "knot_tying" / "launch.yaml"

TAKES = np.array([0.6, 0.3, -0.74])
"""Direction of the left tool: its shaft passes in front of the right jaws, and over the short end."""

REACHES = np.array([-1.0, 0.0, 0.0])
"""Direction of the right tool: level and along the vessel, a finger that the thread is laid around."""

HELD, TAIL = 5, 10
"""Elements from its end at which the long end is held, and the short one."""

LEAN, STRETCHED, STANDS = -0.0215, 0.95, 0.007
"""Metres along the vessel where the short end is to stand; how far it is drawn out; the error that may stay."""

OVERBEND = (20.0, 36.0)
"""By how many radians a metre of its length, thrice, the short end is bent too far, since it springs back: for each
throw, as a knot gives way, and the vessel does not."""

GAP, SNUG = 0.0155, 0.04
"""Metres between jaws and short end in which the left tool passes; newtons that keep the loop on the jaws."""

BELOW, OVER = 0.013, 0.0075
"""Metres that the left tool keeps below the right one, and over the vessel."""

RETRIES, ATTEMPTS = (0, 2, -2, 3), 5
"""Elements beside the first choice at which jaws that closed on nothing try again; how often a throw is tried."""

PULL, DRAWN, MOST = 0.3, 1.0, 8.0
"""Newtons with which a loop is drawn close, a throw is drawn tight, and the most."""

HOLDS = 10.0
"""Seconds that a knot must hold when nothing holds it."""

SHIFT, FRICTION = 0.003, (0.5, 0.6)
"""Of random seeds: metres by which vessel and thread lie elsewhere on the table, and the thread's friction."""

DRAWS = (
    (-0.003, 0.03, 0.008), (-0.003, 0.045, 0.008), (-0.003, 0.06, 0.008), (-0.003, 0.066, 0.015),
    (-0.003, 0.064, 0.03), (-0.003, 0.062, 0.045), (-0.02, 0.06, 0.05), (-0.04, 0.06, 0.05),
)  # fmt: skip
"""Where the left hand goes one after the other until the throw is tight: along and beside the vessel, and above it."""


class Knotter(TwoArms):
    """Two arms that make throws: ``throws`` are done, and ``side`` is +1 for the first one, -1 for its mirror image."""

    def __init__(self, simulation: ligature.Simulation, watch: Callable[[], object] = lambda: None) -> None:
        super().__init__(simulation, watch)
        self.throws, self.side = 0, 1.0
        self.tail = TAIL
        """The element at which the short end is held, and found again."""

    # --- seeing the knot ----------------------------------------------------------------------

    def score(self) -> SquareKnotScore:
        """How well it went until now."""
        empty = all(self.simulation.grasps[name] is None for name in self.arms)
        return SquareKnotScore.of(self.points(), self.vessel, self._radius, self.tension(), empty, self.simulation.time)

    def made(self) -> bool:
        """Whether the thread has one throw more than before, square with the one before."""
        score = self.score()
        return (score.determinant, abs(score.signature)) == (HALF_KNOT ** (self.throws + 1), 2 * (1 - self.throws))

    def leaves(self) -> tuple[int, int]:
        """The elements at which the short end and the long end leave the vessel, or the knot on it."""
        points, beside = self.points(), 1.3 * self._radius
        away = np.linalg.norm((points - self.vessel)[:, 1:], axis=1)
        if self.throws == 0:
            return int(np.flatnonzero(away < beside).min()), int(np.flatnonzero(away < 1.15 * beside).max())
        near = np.flatnonzero(np.linalg.norm(points - self.vessel, axis=1) < 0.008)
        touching = [
            i
            for i in near
            if (np.linalg.norm(points[np.abs(np.arange(len(points)) - i) >= 8] - points[i], axis=1)).min() < 0.0011
        ]
        return (touching[0], touching[-1]) if touching else (int(near.min()), int(near.max()))

    def laced(self) -> bool:
        """Whether the throw is a knot once its ends are drawn, square with the one before."""
        held = self.held(RIGHT)
        first = self.tail if held is None else held
        diagram = drawn(self.points()[first : self.must_hold(LEFT) + 1], self.tools[RIGHT], self.tools[LEFT])
        return (diagram.determinant, abs(diagram.signature)) == (HALF_KNOT ** (self.throws + 1), 2 * (1 - self.throws))

    def looped(self, first: int) -> bool:
        """Whether the thread, from element ``first`` to the left hand, goes about the right arm's jaws or shaft."""
        T, points = self.tools[RIGHT], self.points()[first : self.must_hold(LEFT)]
        local = (points - T[:3, 3]) @ T[:3, :3]
        near = (np.abs(local[:, 2] + 0.008) < 0.018) & (np.hypot(local[:, 0], local[:, 1]) < 0.007)
        angles = np.unwrap(np.arctan2(local[near, 1], local[near, 0]))
        return bool(near.any() and np.ptp(angles) > np.pi)

    def _left_at(self, point: Array) -> Array:
        """The left tool, turned as it is, with what it holds at ``point`` (3,)."""
        return self.held_at(LEFT, point)

    # --- the short end ------------------------------------------------------------------------

    def stand(self) -> None:
        """The right arm bends the short end, which it holds, until it stands by itself where it is wanted."""
        self.bend()
        for _ in RETRIES:
            self.let_go()
            root, length = self._root(self.tail)
            at = self.points()[self.tail]
            if np.linalg.norm(root + STRETCHED * length * self._wanted(root, length) - at) < STANDS:
                return
            R = self.tools[RIGHT][:3, :3]
            self.go({RIGHT: frame(R, at - (DEEP + 0.006) * REACHES)}, {RIGHT: FINGER_OPEN}, speed=SLOW)
            self.go({RIGHT: frame(R, at - DEEP * REACHES)}, speed=SLOW)
            self.go({}, {RIGHT: SHUT})
            self.wait(0.2)
            if self.must_hold(RIGHT) > self.tail + 10:
                raise Missed(f"{RIGHT} took another part of the thread")
            self.correct(at)
        self.let_go()

    def _root(self, element: int) -> tuple[Array, float]:
        """Where the short end leaves the vessel (3,), and how long it is from there to an element."""
        first = self.leaves()[0]
        return self.points()[first], self._length * abs(element - first)

    def _wanted(self, root: Array, length: float) -> Array:
        """Direction (3,) from its root in which the short end is to stand."""
        x = self.vessel[0] + LEAN - root[0]
        return np.array([x, 0.0, np.sqrt(max((STRETCHED * length) ** 2 - x**2, 1e-6))]) / (STRETCHED * length)

    def bend(self) -> None:
        """First upright, then along the vessel beyond where it is to stand, and back there, where it bears nothing."""
        held = self.must_hold(RIGHT)
        root, length = self._root(held)
        wanted, R = self._wanted(root, length), self.tools[RIGHT][:3, :3]
        ways = [self.tool(REACHES, np.array([0.0, 0.0, sign]), np.zeros(3))[:3, :3] for sign in (1.0, -1.0)]
        level = min(ways, key=lambda way: float(np.linalg.norm(rotation_vector(R.T @ way))))
        now = _unit(self.points()[held] - root)
        up = _unit(np.array([-0.1, 0.15 * self.side, 1.0]))
        turned = axis_rotation((0.0, -1.0, 0.0), OVERBEND[self.throws] * length / 3.0) @ wanted
        beyond = _unit(turned + [0.0, 0.12 * self.side, 0.0])
        self._sweep(root, length, now, up, R, level)
        self._sweep(root, length, up, beyond, level, level)
        self._sweep(root, length, beyond, wanted, level, level)

    def correct(self, stood: Array) -> None:
        """The same from where it ``stood`` (3,) by itself."""
        held = self.must_hold(RIGHT)
        root, length = self._root(held)
        wanted, R = self._wanted(root, length), self.tools[RIGHT][:3, :3]
        axis = _unit(np.cross(_unit(stood - root), wanted))
        beyond = axis_rotation(axis, OVERBEND[self.throws] * length / 3.0) @ wanted
        self._sweep(root, length, _unit(self.points()[held] - root), beyond, R, R)
        self._sweep(root, length, beyond, wanted, R, R)

    def _sweep(self, root: Array, length: float, a: Array, b: Array, R: Array, S: Array) -> None:
        """What the right arm holds goes about ``root`` from the direction ``a`` to ``b``; its tool turns to ``S``."""
        about, turn = np.cross(a, b), rotation_vector(R.T @ S)
        sine = float(np.linalg.norm(about))
        angle = float(np.arctan2(sine, a @ b))
        if sine < 1e-9:  # opposite ways: about any axis across them
            about = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])
        size = float(np.linalg.norm(turn))
        for share in np.linspace(0.0, 1.0, 9)[1:]:
            way = axis_rotation(_unit(about), share * angle) @ a
            now = R @ axis_rotation(turn / size, share * size) if size > 1e-6 else R
            self.go({RIGHT: frame(now, root + STRETCHED * length * way - DEEP * now[:, 2])}, speed=BRISK)

    def let_go(self) -> None:
        """The right arm opens, keeps the short end in the middle between its fingers, and draws back along itself."""
        self.wait(0.2)
        self.tail = self.must_hold(RIGHT)
        self.go({}, {RIGHT: OPEN})
        self.wait(0.3)
        for back in (0.0, 0.004):
            T = self.tools[RIGHT]
            local = (self.points()[: self.tail + 20] - T[:3, 3]) @ T[:3, :3]
            near = np.abs(local[:, 2] - DEEP + back) < 0.003
            if near.any():
                self.go({RIGHT: frame(np.eye(3), local[near, 1].mean() * T[:3, 1] - back * T[:3, 2]) @ T}, speed=0.01)
            self.wait(0.1)
        self.go({RIGHT: drawn_back(self.tools[RIGHT], GAP)}, speed=SLOW)
        self.wait(0.2)

    # --- the loop -----------------------------------------------------------------------------

    def _at_tail(self, element: int) -> Array:
        """Pose (4, 4) of the right tool that takes the short end, level as it is."""
        along = np.array([0.0, 0.0, np.sign(self.tools[RIGHT][2, 0])])
        return self.tool(REACHES, along, self.points()[element])

    def wrap(self) -> None:
        """The left arm lays the long end once around the open jaws of the right arm, from its own side on."""
        side, first, held = self.side, self.leaves()[1], self.must_hold(LEFT)
        free = self._length * (held - first)
        finger = drawn_back(self._at_tail(self.tail), GAP)
        self.go({LEFT: self._left_at(self.vessel + [-0.003, side * 0.03, 0.035])}, speed=BRISK)
        self.go({RIGHT: finger}, {RIGHT: FINGER_OPEN}, speed=SLOW)
        centre = finger[:3, 3] + ROOT * finger[:3, 2]
        place = self.points()[first] - centre
        anchor = np.array([side * place[1], place[2]])
        low = centre[2] - self.vessel[2] - OVER
        for degrees in range(BEGIN, END + 1, 10):
            angle = np.radians(degrees)
            radius = radius_for(anchor, angle, between(SHARES[self.throws], degrees) * free)
            if np.sin(angle) < 0.0:
                radius = min(radius, BELOW / -np.sin(angle), max(low / -np.sin(angle), THINNEST))
            way = np.array([0.0, side * np.cos(angle), np.sin(angle)])
            at = centre + [between(ASIDE[self.throws], degrees), 0.0, 0.0] + radius * way
            self.go({LEFT: self._left_at(at)}, speed=BRISK)
        snug = at + (0.045 - radius) * way + [0.004, 0.0, 0.0]
        self.go({LEFT: self._left_at(snug)}, speed=SLOW, until=lambda: self.pull() > SNUG)
        if not self.laced():
            raise Missed(f"the loop slipped off {RIGHT}")

    def seize(self) -> None:
        """The right arm goes forward and takes the short end; the left one follows, and keeps the loop on its jaws."""
        off = self.tools[LEFT][:3, 3] + DEEP * self.tools[LEFT][:3, 2] - drawn_back(self.tools[RIGHT], ROOT)[:3, 3]
        away = float(np.linalg.norm(off))
        off = off / away

        def keep() -> None:
            nonlocal away
            more = CAREFUL * STREAM * np.clip((SNUG - self.pull()) / SNUG, -4.0, 1.0)
            away = float(np.clip(away + more, THINNEST, 0.06))
            self.tools[LEFT] = self._left_at(drawn_back(self.tools[RIGHT], ROOT)[:3, 3] + away * off)

        for more in RETRIES:
            for behind in (0.006, 0.0):
                goal = drawn_back(self._at_tail(self.tail + more), behind)
                self.go({RIGHT: goal}, speed=CAREFUL, meanwhile=keep)
            self.go({}, {RIGHT: SHUT})
            self.wait(0.2)
            held = self.held(RIGHT)
            if held is not None and held < self.leaves()[0] - 5:
                break
            self.go({}, {RIGHT: FINGER_OPEN})
            self.go({RIGHT: drawn_back(self.tools[RIGHT], 0.006)}, speed=SLOW, meanwhile=keep)
        else:
            raise Missed(f"{RIGHT} did not find the short end")
        if not self.laced():
            raise Missed(f"the loop slipped off {RIGHT}")

    def draw_through(self) -> None:
        """The right arm goes back through the loop, which the left one draws off its jaws."""
        tip = self.tools[RIGHT][:3, 3] + FINGERTIP * self.tools[RIGHT][:3, 2]
        self.go({LEFT: self._left_at(tip + [-0.012, self.side * 0.004, 0.012])}, speed=BRISK)
        first = self.must_hold(RIGHT) + 12

        def taut() -> bool:
            return self.taut() > 0.8

        for step in range(8):
            self.go({RIGHT: drawn_back(self.tools[RIGHT], 0.006)}, speed=SLOW, until=taut)
            if not self.looped(first):
                return
            if taut() or step > 4:
                off = frame(np.eye(3), [-0.012, 0.0, 0.0]) @ self.tools[LEFT]
                self.go({LEFT: off}, speed=SLOW, until=lambda: self.pull() > PULL)
                slack = {RIGHT: [-0.003, 0.0, 0.0], LEFT: [0.004, 0.0, 0.0]}
                self.go({name: frame(np.eye(3), way) @ self.tools[name] for name, way in slack.items()}, speed=SLOW)
        raise Missed(f"the loop did not slip off {RIGHT}")

    def tighten(self) -> None:
        """The loop is drawn close along the short end, then each end to where the other one was until both are taut."""

        def right(x: float, y: float, z: float) -> Array:
            return self.held_at(RIGHT, self.vessel + [x, self.side * y, z])

        def left(x: float, y: float, z: float) -> Array:
            return self._left_at(self.vessel + [x, -self.side * y, z])

        def tight() -> bool:
            return min(self.ends()) > DRAWN or self.taut() > MOST

        self.go({RIGHT: right(0.006, 0.002, 0.05)}, speed=SLOW, until=lambda: self.ends()[0] > 0.1)
        self.go({LEFT: left(-0.02, 0.03, 0.01)}, speed=BRISK, until=lambda: self.pull() > PULL)
        self.go({LEFT: left(-0.005, 0.05, 0.008)}, speed=BRISK, until=lambda: self.pull() > PULL)
        for place in DRAWS:
            self.go({RIGHT: right(0.0, 0.034, 0.012), LEFT: left(*place)}, speed=SLOW, until=tight)
            if tight():
                break
        self.wait(0.1)

    # --- throws -------------------------------------------------------------------------------

    def throw(self) -> None:
        """One throw; what goes wrong before the ends are drawn is tried again."""
        for attempt in range(ATTEMPTS):
            try:
                if self.held(RIGHT) is None:
                    self.take(RIGHT, REACHES, self.tail, 1)
                self.stand()
                self.wrap()
                self.seize()
                self.draw_through()
                self.tighten()
                if self.made():
                    break
                raise Missed(f"throw {self.throws + 1} came undone")
            except Missed:
                if attempt + 1 == ATTEMPTS:
                    raise
                self.start_again()
                if self.made():  # the hands were in the way, or an end lay across the other
                    break
        self.throws, self.side = self.throws + 1, -self.side

    def start_again(self) -> None:
        """The right arm lets go and draws back; the left one goes to its side, and takes the long end if it lost it."""
        self.go({}, {RIGHT: OPEN})
        self.go({RIGHT: drawn_back(self.tools[RIGHT], 0.012)}, speed=SLOW)
        self.go({}, {RIGHT: SHUT})  # a loop slips off closed jaws
        self.go({RIGHT: drawn_back(self.tools[RIGHT], 0.03)}, speed=SLOW)
        self.tail = TAIL
        if self.held(LEFT) is None:
            self.go({LEFT: frame(np.eye(3), [0.0, 0.0, 0.03]) @ self.tools[LEFT]}, {LEFT: OPEN}, speed=BRISK)
            self.take(LEFT, TAKES, len(self.thread) - HELD, -1)
        self.go({LEFT: self._left_at(self.vessel + [-0.003, self.side * 0.03, 0.06])}, speed=BRISK)
        self.go({LEFT: self._left_at(self.vessel + [0.0, self.side * 0.05, 0.025])}, speed=BRISK)

    def give_slack(self) -> None:
        """The left hand goes where the long end does not disturb the short one."""
        hand = self.tools[LEFT][:3, 3] + DEEP * self.tools[LEFT][:3, 2] - self.vessel
        self.go({LEFT: self._left_at(self.vessel + hand * [0.0, 0.8, 1.0] + [0.0, 0.0, 0.015])}, speed=BRISK)

    def leave(self) -> None:
        """Both hands let go and draw back; the knot must hold by itself."""
        self.go({}, {RIGHT: OPEN, LEFT: OPEN})
        self.go({name: drawn_back(T, 0.03) for name, T in self.tools.items()})
        self.wait(HOLDS)

    def make(self) -> None:
        """The whole knot."""
        self.take(LEFT, TAKES, len(self.thread) - HELD, -1)
        self.throw()
        self.give_slack()
        self.throw()
        self.leave()


def _unit(way: Array) -> Array:
    return np.asarray(way / np.linalg.norm(way))


def scattered(scene: Scene, seed: int) -> Scene:
    """Vessel and thread elsewhere on the table, the thread more or less smooth; seed 0 leaves them."""
    if seed == 0:
        return scene
    rng = np.random.default_rng(seed)
    shift, friction = frame(np.eye(3), np.append(rng.uniform(-SHIFT, SHIFT, 2), 0.0)), float(rng.uniform(*FRICTION))
    thread, block = set(scene.rods[0].bodies), next(b for b in scene.bodies if b.identity.name == "Block")
    bodies = [
        replace(body, T_world_body=shift @ body.T_world_body, friction=friction) if body.index in thread else body
        for body in scene.bodies
    ]
    bodies[block.index] = replace(block, T_world_body=shift @ block.T_world_body)
    roots = {**scene.start.roots, block.index: shift @ scene.start.roots[block.index]}
    return replace(scene, bodies=type(scene.bodies)(bodies), start=replace(scene.start, roots=roots))


def operate(simulation: ligature.Simulation, watch: Callable[[], object] = lambda: None) -> tuple[SquareKnotScore, str]:
    """Make the knot; returns how well it went, and why it stopped, if it did."""
    knotter = Knotter(simulation, watch)
    try:
        knotter.make()
    except Failure as failure:
        return knotter.score(), str(failure)
    return knotter.score(), ""


def main() -> int:
    """Make a knot and print how well it went."""
    given = seed_and_folder(
        "Two arms make a square knot around a vessel by themselves.",
        "where the thread lies; 0 is the scene's own place",
    )
    simulation = ligature.Simulation(scattered(ligature.load(SCENE), given.seed))
    film = Film(simulation, given.out) if given.out else None
    score, stopped = operate(simulation, film.watch if film else lambda: None)
    print("\n".join([f"stopped: {stopped}"] * bool(stopped) + score.lines()))
    if film is not None:
        print(film.save())
    return 0 if score.success and not stopped else 1


if __name__ == "__main__":
    sys.exit(main())
