"""A throw without hands: two arms make the first throw of a ligature around a vessel, by the calls a real robot takes.

As surgeons do with instruments: the left arm takes the long end of the thread and lays it around the open jaws of the
right arm, these take the short end, and draw it back through the loop; both ends are then drawn apart. The program
localises from ground truth, and moves the arms by CRTK alone: ``servo_cp``, ``jaw/servo_jp``, ``measured_cp``. Run it
with ``--help``. World axes, metres, radians, seconds of simulated time.
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
from ligature.tasks.knots import ThrowScore
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
DEEP, FINGERTIP = 0.0075, 0.0094
"""Metres from the control point of a tool to where it holds the thread, and to the end of its fingers."""

TAKES = np.array([0.926, -0.185, -0.324])
"""Direction of the left tool: from its own side, so that its shaft stays clear of the other one."""

REACHES = np.array([-0.989, -0.148, 0.0])
"""Direction of the right tool: level and along the vessel, a finger that the thread is laid around."""

HELD, TAIL, BESIDE_PADS = 6, 6, 4
"""How many elements from its end the thread is held: the long one, and the short one; how many pads may bend."""

TIP, LOOP = -0.022, -0.003
"""Metres along the vessel from the thread to the fingertips and to the left tool, while the thread is laid around."""

FINGER, THINNEST = 0.0042, 0.011
"""Radius of the jaws as the thread goes around them, and of the least circle that the left tool makes."""

LOW, HIGH, SHARE, MORE = 0.022, 0.042, 0.88, 0.034
"""Metres over the vessel at which the jaws are: least, most, and share of the free thread less what the loop takes."""

BEGIN, END = 60, 420
"""Degrees about the jaws at which the long end begins and ends, from the side where it leaves the vessel."""

OVER, BESIDE = 0.0075, 0.005
"""Metres that the left tool keeps over the vessel, and from the thread that leads up from it."""

RETRIES = (0, 3, -2, 6)
"""Elements nearer to the vessel than the first choice at which jaws that closed on nothing try again."""

SLOW, BRISK, FAST = 0.03, 0.06, 0.08
PULL, DRAWN, MOST = 0.35, 1.0, 8.0
"""Newtons that keep the loop on the jaws, with which a throw is drawn, and the most."""

SHIFT, FRICTION = 0.003, (0.3, 0.4)
"""Of random seeds: metres by which vessel and thread lie elsewhere on the table, and the thread's friction."""


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


class Knotter:
    """Two arms and a thread that lies under a vessel."""

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
        self.drawn = 0.0

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
            if held is None:
                continue
            tension[max(held - BESIDE_PADS, 0) : held + BESIDE_PADS + 1] = 0.0
        return float(tension.max())

    def pull(self) -> float:
        """Tension of the long end beside the left jaws."""
        return float(self.tension()[self._must_hold(LEFT) - 6 :][:3].max())

    def held(self, name: str) -> int | None:
        """The element between the jaws of an arm."""
        grasp = self.simulation.grasps[name]
        return None if grasp is None or grasp.body not in self.thread else self.thread.index(grasp.body)

    def _must_hold(self, name: str) -> int:
        held = self.held(name)
        if held is None:
            raise Failure(f"{name} lost the thread")
        return held

    def ends(self) -> tuple[float, float]:
        """Tension of both ends beside the jaws that hold them."""
        tension, right, left = self.tension(), self._must_hold(RIGHT), self._must_hold(LEFT)
        return float(tension[right + 4 : right + 8].max()), float(tension[left - 6 : left - 3].max())

    def anchor(self) -> int:
        """The element at which the long end leaves the vessel."""
        away = np.linalg.norm((self.points() - self.vessel)[:, 1:], axis=1)
        return int(np.flatnonzero(away < 1.5 * self._radius).max())

    def grasp(self, name: str, way: Array, element: int) -> Array:
        """Pose (4, 4) of a tool along ``way`` (3,) at which its jaws close on an element."""
        points = self.points()
        along = points[min(element + 1, len(points) - 1)] - points[element - 1]
        along = -along if along[1] > 0.0 else along
        return self._tool(way, along, points[element], DEEP)

    @staticmethod
    def _tool(way: Array, along: Array, point: Array, deep: float) -> Array:
        z = way / np.linalg.norm(way)
        x = along - (along @ z) * z
        x = x / np.linalg.norm(x)
        return frame(np.column_stack([x, np.cross(z, x), z]), point - deep * z)

    def _left_at(self, point: Array) -> Array:
        """The left tool, turned as it is, with what it holds at ``point`` (3,)."""
        R = self.tools[LEFT][:3, :3]
        return frame(R, point - DEEP * R[:, 2])

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

    # --- the throw ----------------------------------------------------------------------------

    def take_long_end(self) -> None:
        """The left arm takes the long end; where its jaws close on nothing, it tries nearer to the vessel."""
        for more in RETRIES:
            element = len(self.thread) - HELD - more
            self.go({LEFT: drawn_back(self.grasp(LEFT, TAKES, element), 0.03)}, {LEFT: OPEN}, speed=FAST)
            self.go({LEFT: drawn_back(self.grasp(LEFT, TAKES, element), 0.015)})
            self.go({LEFT: self.grasp(LEFT, TAKES, element)})
            self.go({}, {LEFT: SHUT})
            self.wait(0.2)
            if self.held(LEFT) is not None:
                return
            self.go({LEFT: drawn_back(self.tools[LEFT], 0.01)}, {LEFT: OPEN})
        raise Failure(f"{LEFT} did not find the long end")

    def wrap(self, side: float = 1.0) -> None:
        """The left arm lays the long end once around the open jaws of the right arm, from ``side`` of the vessel on.

        Its tool comes from -X, so it stays on that side of the thread that leads up from the vessel.
        """
        free = self._length * abs(self._must_hold(LEFT) - self.anchor())
        height = float(np.clip(SHARE * free - MORE, LOW, HIGH))
        self.go({LEFT: self._left_at(self.vessel + [LOOP, side * 0.03, height + 0.02])}, speed=BRISK)
        finger = self._tool(REACHES, np.array([0.0, -1.0, 0.0]), self.vessel + [TIP, 0.0, height], FINGERTIP)
        self.go({RIGHT: drawn_back(finger, 0.04)}, {RIGHT: FINGER_OPEN}, speed=FAST)
        self.go({RIGHT: finger})
        z, at = finger[:3, 2], finger[:3, 3]
        centre = at + (self.vessel[0] + LOOP - at[0]) / z[0] * z
        first = self.anchor()
        place = self.points()[first] - centre
        anchor, aside = np.array([side * place[1], place[2]]), 0.0
        for degrees in range(BEGIN, END + 1, 10):
            angle = np.radians(degrees)
            radius = radius_for(anchor, angle, float(np.interp(degrees, [270, END], [0.96, 0.9])) * free)
            if np.sin(angle) < 0.0:
                radius = min(radius, max((centre[2] - self.vessel[2] - OVER) / -np.sin(angle), THINNEST))
            if 180 <= degrees <= 350:
                aside = min(-BESIDE, self._left_of(first, centre) - BESIDE)
            elif degrees > 350:
                aside = float(np.interp(degrees, [350, END], [aside, -0.006]))
            on_circle = radius * np.array([0.0, side * np.cos(angle), np.sin(angle)])
            self.go({LEFT: self._left_at(centre + [aside, 0.0, 0.0] + on_circle)}, speed=BRISK)

    def _left_of(self, first: int, centre: Array) -> float:
        """How far along the vessel from ``centre`` the thread is that leads up from the vessel; its least."""
        way = self.points()[first : first + 30]
        way = way[(way[:, 2] > self.vessel[2] + 0.004) & (way[:, 2] < centre[2] - 0.006)]
        return float(way[:, 0].min() - centre[0]) if len(way) else 0.0

    def take_short_end(self) -> bool:
        """The right arm takes the short end, the loop about its jaws; the left arm keeps it from slipping off.

        False, and nothing taken, where the loop has slipped off before.
        """
        root = self.tools[RIGHT][:3, 3] - 0.002 * self.tools[RIGHT][:3, 2]
        off = self.tools[LEFT][:3, 3] + DEEP * self.tools[LEFT][:3, 2] - root
        away = float(np.linalg.norm(off))
        off = off / away

        def keep() -> None:
            nonlocal away
            away = float(
                np.clip(away + STREAM * np.clip((PULL - self.pull()) / PULL, -1.0, 1.0) * 0.03, THINNEST, 0.045)
            )
            T = self.tools[RIGHT]
            self.tools[LEFT] = self._left_at(T[:3, 3] - 0.002 * T[:3, 2] + away * off)

        for more in RETRIES:
            for behind in (0.007, 0.007, 0.0):
                goal = drawn_back(self.grasp(RIGHT, REACHES, TAIL + more), behind)
                self.go({RIGHT: goal}, speed=SLOW, meanwhile=keep)
                if not self.looped(self.anchor()):
                    self.go({RIGHT: drawn_back(self.tools[RIGHT], 0.03)})
                    return False
            self.go({}, {RIGHT: SHUT})
            self.wait(0.2)
            held = self.held(RIGHT)
            if held is not None and held < TAIL + more + 6:
                break
            self.go({}, {RIGHT: FINGER_OPEN})
            self.go({RIGHT: drawn_back(self.tools[RIGHT], 0.007)}, speed=SLOW, meanwhile=keep)
        else:
            raise Failure(f"{RIGHT} did not find the short end")
        self.slip_off(off)
        return True

    def slip_off(self, off: Array) -> None:
        """The right arm goes back through the loop, which the left one draws off its jaws along ``off`` (3,)."""
        root = self.tools[RIGHT][:3, 3] - 0.002 * self.tools[RIGHT][:3, 2]
        self.go({LEFT: self._left_at(root + 0.015 * off - [0.012, 0.0, 0.0])})
        self.go({RIGHT: drawn_back(self.tools[RIGHT], 0.03)}, speed=SLOW)

        def pulls() -> bool:
            return self.taut() > 2.0

        through = frame(np.eye(3), np.array([0.015, 0.0, 0.006])) @ self.tools[RIGHT]
        self.go({RIGHT: through, LEFT: self._left_at(root + 0.03 * off - [0.03, 0.0, 0.0])}, until=pulls)
        for _ in range(6):
            if not self.looped(self._must_hold(RIGHT) + 12):
                return
            hand, tool = self.tools[LEFT], self.tools[RIGHT]
            self.go({LEFT: frame(np.eye(3), [0.01, 0.0, 0.0]) @ hand, RIGHT: drawn_back(tool, 0.006)}, speed=SLOW)
            self.go({LEFT: frame(np.eye(3), [-0.02, 0.0, 0.0]) @ hand}, until=pulls)
        if self.looped(self._must_hold(RIGHT) + 12):
            raise Failure(f"the loop did not slip off {RIGHT}")

    def looped(self, first: int) -> bool:
        """Whether the thread, from element ``first`` to the left hand, goes about the right arm's jaws or shaft."""
        T, points = self.tools[RIGHT], self.points()[first : self._must_hold(LEFT)]
        local = (points - T[:3, 3]) @ T[:3, :3]
        near = (np.abs(local[:, 2] + 0.008) < 0.018) & (np.hypot(local[:, 0], local[:, 1]) < 0.007)
        angles = np.unwrap(np.arctan2(local[near, 1], local[near, 0]))
        return bool(near.any() and np.ptp(angles) > np.pi)

    def draw(self, side: float = 1.0) -> None:
        """Both ends go to where the other one was, until both are taut."""

        def tight() -> bool:
            return min(self.ends()) > DRAWN or self.taut() > MOST

        R = self.tools[RIGHT][:3, :3]

        def right(x: float, y: float, z: float) -> Array:
            return frame(R, self.vessel + [x, side * y, z] - DEEP * R[:, 2])

        def left(x: float, y: float, z: float) -> Array:
            return self._left_at(self.vessel + [x, -side * y, z])

        self.go({RIGHT: right(0.015, 0.01, 0.02), LEFT: left(0.0, 0.02, 0.02)}, until=tight)
        self.go({RIGHT: right(-0.02, 0.05, 0.006), LEFT: left(0.01, 0.075, 0.006)}, speed=SLOW, until=tight)
        self.go({LEFT: left(0.01, 0.075, 0.006)}, speed=SLOW, until=tight)
        self.wait(0.1)
        self.drawn = min(self.ends())

    def leave(self) -> None:
        """Both hands let go and draw back."""
        self.go({}, {RIGHT: OPEN, LEFT: OPEN})
        self.go({name: drawn_back(T, 0.03) for name, T in self.tools.items()})
        self.wait(0.5)

    def throw(self, side: float = 1.0) -> None:
        """One throw, until both ends are taut; where the loop slips off the jaws, it is laid again."""
        for _ in RETRIES:
            self.wrap(side)
            if self.take_short_end():
                break
        else:
            raise Failure(f"the loop slipped off {RIGHT} each time")
        self.draw(side)

    def make(self) -> None:
        """The whole throw."""
        self.take_long_end()
        self.throw()
        self.leave()

    def score(self) -> ThrowScore:
        """How well it went until now."""
        empty = all(self.simulation.grasps[name] is None for name in self.arms)
        return ThrowScore.of(self.points(), self.vessel, self.drawn, empty, self.simulation.time)


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


def operate(simulation: ligature.Simulation, watch: Callable[[], object] = lambda: None) -> tuple[ThrowScore, str]:
    """Make the throw; returns how well it went, and why it stopped, if it did."""
    knotter = Knotter(simulation, watch)
    try:
        knotter.make()
    except Failure as failure:
        return knotter.score(), str(failure)
    return knotter.score(), ""


def main() -> int:
    """Make a throw and print how well it went."""
    arguments = argparse.ArgumentParser(description="Two arms make a throw around a vessel by themselves.")
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
