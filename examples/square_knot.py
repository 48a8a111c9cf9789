"""A square knot without hands: two arms make a ligature around a vessel, by the calls that a real robot takes.

Each throw is made with instruments. The right arm bends the short end of the thread until it stands by itself where it
is wanted, and draws back along itself; the left arm lays the long end around its open jaws, in the gap. The right arm
then goes forward by that gap, takes the end and draws it through the loop. The second throw is the mirror image of the
first one. The program localises from ground truth and moves the arms by CRTK alone: ``servo_cp``, ``jaw/servo_jp``,
``measured_cp``. Run it with ``--help``. World axes, metres, radians, seconds of simulated time.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import ligature
import numpy as np
from ligature.model.frames import axis_rotation, frame, inverse
from ligature.model.scene import Scene
from ligature.model.shapes import Cylinder
from ligature.robots.operating_state import Rejected
from ligature.robots.poses import rotation_vector
from ligature.robots.psm_arm import PsmArm
from ligature.tasks.diagrams import Diagram
from ligature.tasks.knots import HALF_KNOT, SquareKnotScore
from ligature.tasks.throws import drawn_back, pose_of

sys.path.insert(0, str(Path(__file__).resolve().parent))
from suture import Failure, Film  # noqa: E402

Array = np.ndarray

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "knot_tying" / "launch.yaml"
RIGHT, LEFT = "PSM1", "PSM2"
STREAM = 0.02
"""Seconds between two set-points of a stream."""

START = (0.0, 0.0, 0.12, 0.0, 0.0, 0.0)
OPEN, FINGER_OPEN, SHUT = 0.8, 0.4, -0.35
DEEP, FINGERTIP, ROOT = 0.0075, 0.0094, 0.002
"""Metres from the control point of a tool to where it holds the thread, to the end of its fingers, and to their root,
where a loop lies."""

TAKES = np.array([0.6, 0.3, -0.74])
"""Direction of the left tool: its shaft passes in front of the right jaws, and over the short end."""

REACHES = np.array([-1.0, 0.0, 0.0])
"""Direction of the right tool: level and along the vessel, a finger that the thread is laid around."""

HELD, TAIL, BESIDE_PADS = 5, 10, 4
"""Elements from its end at which the long end is held, and the short one; how many pads may bend."""

LEAN, STRETCHED, STANDS = -0.0215, 0.95, 0.007
"""Metres along the vessel where the short end is to stand; how far it is drawn out; the error that may stay."""

OVERBEND = (20.0, 36.0)
"""By how many radians a metre of its length, thrice, the short end is bent too far, since it springs back: for each
throw, as a knot gives way, and the vessel does not."""

GAP, SNUG = 0.0155, 0.04
"""Metres between jaws and short end in which the left tool passes; newtons that keep the loop on the jaws."""

FINGER, THINNEST = 0.0042, 0.011
"""Radius of the jaws as the thread goes around them, and of the least circle that the left tool makes."""

BEGIN, END = 60, 420
"""Degrees about the jaws at which the long end begins and ends, from the side where it leaves the vessel."""

SHARES = (((60, 0.88), (270, 0.88), (END, 0.82)), ((60, 0.98), (180, 0.96), (270, 0.90), (END, 0.84)))
"""For each throw: share of the long end's length that its way about the jaws takes, by the angle."""

ASIDE = (
    ((90, 0.0), (180, -0.005), (340, -0.005), (END, 0.006)),
    ((60, 0.006), (150, 0.004), (210, -0.005), (340, -0.005), (END, 0.006)),
)
"""For each throw: metres along the vessel from the loop to the left tool, by the angle: first and last it draws the
loop to the root of the jaws, and between it passes in front of them."""

BELOW, OVER = 0.013, 0.0075
"""Metres that the left tool keeps below the right one, and over the vessel."""

RETRIES, ATTEMPTS = (0, 2, -2, 3), 5
"""Elements beside the first choice at which jaws that closed on nothing try again; how often a throw is tried."""

SLOW, BRISK, FAST, CAREFUL = 0.03, 0.06, 0.08, 0.015
FAR, REACH = 1.0, 0.5
"""Metres along the shafts at which a thread is closed to see its knot; metres that no tool goes at once."""

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


class Missed(Failure):
    """A throw did not succeed, but can be tried again."""


def length_around(anchor: Array, angle: float, radius: float) -> float:
    """Length of a taut thread from ``anchor`` (2,), around jaws at the origin, to ``radius`` at an ``angle``."""
    away = float(np.hypot(*anchor))
    first = np.arctan2(anchor[1], anchor[0]) + np.arccos(FINGER / away)
    last = angle - np.arccos(min(1.0, FINGER / radius))
    if last <= first:
        return float(np.hypot(*(radius * np.array([np.cos(angle), np.sin(angle)]) - anchor)))
    return float(np.sqrt(away**2 - FINGER**2) + FINGER * (last - first) + np.sqrt(max(radius**2 - FINGER**2, 0.0)))


def radius_for(anchor: Array, angle: float, length: float, most: float = 0.045) -> float:
    """Radius, `THINNEST` to ``most``, at which a thread of ``length`` is just taut."""
    radii = np.linspace(THINNEST, most, 200)
    fits = [radius for radius in radii if length_around(anchor, angle, radius) <= length]
    return float(max(fits, default=THINNEST))


def drawn(thread: Array, right: Array, left: Array) -> Diagram:
    """The knot that tools at ``right`` and ``left`` (4, 4) make of a ``thread`` (n, 3) when they draw its ends away.

    The right one takes the first end, the left one holds the last; along their shafts the thread is closed far away. If
    it goes ``n`` times around the right tool, each time nearer to the first end, it is the torus knot (2, 2 n + 1).
    """
    pads = [T[:3, 3] + DEEP * T[:3, 2] for T in (right, left)]
    far = [T[:3, 3] - FAR * T[:3, 2] for T in (right, left)]
    return Diagram.of(np.vstack([far[0], pads[0], thread, pads[1], far[1]]))


class TwoArms:
    """Two arms and a thread that lies under a vessel: what they see, and how they move."""

    def __init__(self, simulation: ligature.Simulation, watch: Callable[[], object] = lambda: None) -> None:
        self.simulation, self._watch = simulation, watch
        scene = simulation.scene
        self.thread = list(scene.rods[0].bodies)
        self._length = float(scene.rods[0].lengths.mean())
        self._base = {arm.name: scene.bodies[arm.base].T_world_body for arm in scene.arms if arm.base >= 0}
        self.arms: dict[str, PsmArm] = {}
        for name in (RIGHT, LEFT):
            arm = simulation.arms[name]
            if not isinstance(arm, PsmArm) or arm.jaw is None:
                raise Failure(f"{name} is not a PSM with a jaw")
            self.arms[name] = arm
            arm.place_jp(START)
            arm.adopt()
            arm.jaw.servo_jp([OPEN])
        simulation.step(300)
        self.tools = {name: self._base[name] @ pose_of(arm.local_measured_cp()) for name, arm in self.arms.items()}
        self.jaws = dict.fromkeys(self.arms, OPEN)
        block = next(body for body in scene.bodies if body.identity.name == "Block")
        vessel = next(part for part in block.colliders if isinstance(part.shape, Cylinder))
        assert isinstance(vessel.shape, Cylinder)
        self._radius = vessel.shape.radius
        centre = (block.T_world_body @ vessel.T_body_shape)[:3, 3]
        under = np.linalg.norm((self.points() - centre)[:, 1:], axis=1).argmin()
        self.vessel = np.array([self.points()[under, 0], *centre[1:]])

    # --- seeing -------------------------------------------------------------------------------

    def points(self) -> Array:
        """Where the elements of the thread are (n, 3)."""
        return np.array(self.simulation.state["body_pose"][0, self.thread, :3])

    def tension(self) -> Array:
        """Tension (n,) of the elements."""
        return np.array(self.simulation.state["rod_tension"][0][self.thread])

    def taut(self) -> float:
        """Tension of the thread, the most of all of it but what is beside the pads, which bend it."""
        tension = self.tension()
        for held in (self.held(name) for name in self.arms):
            if held is not None:
                tension[max(held - BESIDE_PADS, 0) : held + BESIDE_PADS + 1] = 0.0
        return float(tension.max())

    def pull(self) -> float:
        """Tension of the long end beside the left jaws."""
        return float(self.tension()[self.must_hold(LEFT) - 6 :][:3].max())

    def ends(self) -> tuple[float, float]:
        """Tension of both ends beside the jaws that hold them."""
        tension, right, left = self.tension(), self.must_hold(RIGHT), self.must_hold(LEFT)
        return float(tension[right + 4 : right + 8].max()), float(tension[left - 6 : left - 3].max())

    def held(self, name: str) -> int | None:
        """The element between the jaws of an arm."""
        grasp = self.simulation.grasps[name]
        return None if grasp is None or grasp.body not in self.thread else self.thread.index(grasp.body)

    def must_hold(self, name: str) -> int:
        """The same; raises `Missed` when the arm holds nothing."""
        held = self.held(name)
        if held is None:
            raise Missed(f"{name} lost the thread")
        return held

    def roll(self, name: str, T: Array) -> float:
        """How far an arm's instrument is rolled when its tool is at ``T`` (4, 4)."""
        return float(abs(self.arms[name].kinematics.inverse(np.array([inverse(self._base[name]) @ T])).q[0, 3]))

    def tool(self, way: Array, along: Array, point: Array) -> Array:
        """Pose (4, 4) of a tool along ``way`` (3,) that holds a thread at ``point``, which there runs ``along``."""
        z = way / np.linalg.norm(way)
        x = along - (along @ z) * z
        x = x / np.linalg.norm(x)
        return frame(np.column_stack([x, np.cross(z, x), z]), point - DEEP * z)

    def held_at(self, name: str, point: Array) -> Array:
        """A tool, turned as it is, with what it holds at ``point`` (3,)."""
        R = self.tools[name][:3, :3]
        return frame(R, point - DEEP * R[:, 2])

    def _left_at(self, point: Array) -> Array:
        return self.held_at(LEFT, point)

    # --- moving -------------------------------------------------------------------------------

    def tick(self) -> None:
        """Send a set-point to all, and advance."""
        for name, arm in self.arms.items():
            try:
                arm.servo_cp(inverse(self._base[name]) @ self.tools[name])
            except Rejected as rejection:
                raise Failure(str(rejection)) from rejection
            assert arm.jaw is not None
            arm.jaw.servo_jp([self.jaws[name]])
        self.simulation.step(round(STREAM / self.simulation.dt))
        self._watch()

    def wait(self, seconds: float) -> None:
        """Hold still."""
        for _ in range(round(seconds / STREAM)):
            self.tick()

    def go(
        self,
        goals: Mapping[str, Array],
        jaws: Mapping[str, float] | None = None,
        speed: float = 0.04,
        until: Callable[[], bool] = lambda: False,
        meanwhile: Callable[[], None] = lambda: None,
    ) -> None:
        """Tools go straight to their ``goals`` (4, 4), and jaws to their angles, all in the same time."""
        jaws = jaws or {}
        start, opening = {name: self.tools[name].copy() for name in goals}, {name: self.jaws[name] for name in jaws}
        turn = {name: rotation_vector(start[name][:3, :3].T @ T[:3, :3]) for name, T in goals.items()}
        way = {name: T[:3, 3] - start[name][:3, 3] for name, T in goals.items()}
        for name, w in way.items():
            if not float(np.linalg.norm(w)) < REACH:
                raise Missed(f"{name} was to go {float(np.linalg.norm(w)):.2g} m, farther than it reaches")
        seconds = [
            STREAM,
            *(float(np.linalg.norm(w)) / speed for w in way.values()),
            *(float(np.linalg.norm(w)) / 2.0 for w in turn.values()),
            *(abs(angle - opening[name]) / 4.0 for name, angle in jaws.items()),
        ]
        for share in np.linspace(0.0, 1.0, int(np.ceil(max(seconds) / STREAM)) + 1)[1:]:
            for name in goals:
                angle = float(np.linalg.norm(turn[name]))
                R = axis_rotation(turn[name] / angle, share * angle) if angle > 1e-9 else np.eye(3)
                self.tools[name] = frame(start[name][:3, :3] @ R, start[name][:3, 3] + share * way[name])
            for name, angle in jaws.items():
                self.jaws[name] = opening[name] + share * (angle - opening[name])
            meanwhile()
            self.tick()
            if until():
                break

    def take(self, name: str, way: Array, element: int, towards: int) -> None:
        """An arm takes the thread; where its jaws close on nothing, it tries nearer to the vessel (``towards``)."""
        for more in (0, 2, -2, 4):
            at = element + towards * more
            self.go({name: drawn_back(self._grasp(name, way, at), 0.03)}, {name: FINGER_OPEN}, speed=FAST)
            self.go({name: drawn_back(self._grasp(name, way, at), 0.012)})
            self.go({name: self._grasp(name, way, at)}, speed=SLOW)
            self.go({}, {name: SHUT})
            self.wait(0.2)
            if self.held(name) is not None:
                return
            self.go({name: drawn_back(self.tools[name], 0.012)}, {name: FINGER_OPEN})
        raise Missed(f"{name} did not find the thread")

    def _grasp(self, name: str, way: Array, element: int) -> Array:
        points = self.points()
        along = points[element + 1] - points[element - 1]
        both = [self.tool(way, sign * along, points[element]) for sign in (1.0, -1.0)]
        return min(both, key=lambda T: self.roll(name, T))


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
            radius = radius_for(anchor, angle, _between(SHARES[self.throws], degrees) * free)
            if np.sin(angle) < 0.0:
                radius = min(radius, BELOW / -np.sin(angle), max(low / -np.sin(angle), THINNEST))
            way = np.array([0.0, side * np.cos(angle), np.sin(angle)])
            at = centre + [_between(ASIDE[self.throws], degrees), 0.0, 0.0] + radius * way
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


def _between(table: tuple[tuple[int, float], ...], at: float) -> float:
    """The value of a table of (angle, value) at an angle."""
    return float(np.interp(at, [angle for angle, _ in table], [value for _, value in table]))


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
    arguments = argparse.ArgumentParser(description="Two arms make a square knot around a vessel by themselves.")
    arguments.add_argument("--seed", type=int, default=0, help="where the thread lies; 0 is the scene's own place")
    arguments.add_argument("--out", type=Path, help="folder for pictures and an animation")
    given = arguments.parse_args()
    simulation = ligature.Simulation(scattered(ligature.load(SCENE), given.seed))
    film = Film(simulation, given.out) if given.out else None
    score, stopped = operate(simulation, film.watch if film else lambda: None)
    print("\n".join([f"stopped: {stopped}"] * bool(stopped) + score.lines()))
    if film is not None:
        print(film.save())
    return 0 if score.success and not stopped else 1


if __name__ == "__main__":
    sys.exit(main())
