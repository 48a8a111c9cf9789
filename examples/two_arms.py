"""Two arms and a thread that lies under a vessel: what they see from ground truth, and how they move by CRTK.

World axes, metres, radians, seconds of simulated time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import ligature
import numpy as np
from ligature.model.frames import axis_rotation, frame, inverse
from ligature.model.shapes import Cylinder
from ligature.robots.operating_state import Rejected
from ligature.robots.poses import rotation_vector
from ligature.robots.psm_arm import PsmArm
from ligature.tasks.throws import drawn_back, pose_of
from suture import Failure

Array = np.ndarray

RIGHT, LEFT = "PSM1", "PSM2"
STREAM = 0.02
"""Seconds between two set-points of a stream."""

START = (0.0, 0.0, 0.12, 0.0, 0.0, 0.0)
OPEN, FINGER_OPEN, SHUT = 0.8, 0.4, -0.35
DEEP, FINGERTIP, ROOT = 0.0075, 0.0094, 0.002
"""Metres from the control point of a tool to where it holds the thread, to the end of its fingers, and to their root,
where a loop lies."""

SLOW, BRISK, FAST, CAREFUL = 0.03, 0.06, 0.08, 0.015
"""Speeds of tools in m/s."""

REACH = 0.5
"""Metres that no tool goes at once."""

BESIDE_PADS = 4
"""Elements beside the pads of a jaw, which bend the thread."""


class Missed(Failure):
    """A throw did not succeed, but can be tried again."""


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
