"""What tasks of a ligature share: a thread around an upright vessel, its short end in a clip, its long end in a hand.

World axes, metres, radians, newtons, simulated seconds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.environments.goals.base import OPEN, SHUT, START, Goal, aside, base_of, put
from ligature.model.frames import axis_rotation, frame, inverse, pose7_matrix
from ligature.model.shapes import Cylinder
from ligature.robots.poses import rotation_vector

Array = NDArray[np.float64]

RIGHT, LEFT = 0, 1

LYING = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""Places times this are as if the upright vessel lay along x, with the thread below it. Its columns are the axis of the
vessel, the way of the short end, and the side where no thread passes at first."""

DEEP = 0.0075
"""Metres from the control point of a tool to where it holds a thread."""


class Ligating(Goal):
    """A task with the thread of the scene `ligating`; episodes begin with its long end in the first arm's jaws."""

    scene, arms, models, grasping = "ligating", ("PSM1", "PSM2"), (0, 1, 2, 3, 4), RIGHT
    LOOP = 0.05
    """Metres that are left at most for a loop that is not closed."""
    SLACK, TOUCHING = 0.008, 2.0
    """Metres by which the loop may be longer than around the vessel; thicknesses of the thread within which it meets
    itself."""
    CLEAR, TOOL, TIP = 0.006, 0.03, 0.0094
    """How far from the thread the last `TOOL` metres of a tool must be, up to the end of its fingers."""
    NEAR, GONE = 0.0015, 0.03
    """Metres from the vessel up to which the thread is at it, and from its axis on which all of it has left it."""
    HELD = 25
    """Elements from the end of the thread at which the first arm holds it as an episode begins."""
    OVER = np.array([0.004, -0.045, 0.014]), np.array([-0.022, -0.022, 0.010]), np.array([-0.016, 0.014, 0.008])
    """Where the first arm has brought it around the vessel, from the vessel's axis at the height of the thread."""
    FIRST, WAITING = np.array([0.015, 0.043, 0.010]), np.array([-0.024, 0.02, 0.034])
    """Where it holds it as an episode begins, likewise, and where the second arm's empty jaws are."""
    ASIDE, TURN, ARRIVAL = 0.004, 0.1, 25
    """Metres and radians by which hands are elsewhere, and ticks until they are there."""

    def _prepare(self) -> None:
        """Find vessel and thread."""
        scene = self._simulation.scene
        vessel = next((body for body in scene.bodies if body.identity.name == "Vessel"), None)
        tube = next((part for part in vessel.colliders if isinstance(part.shape, Cylinder)), None) if vessel else None
        if vessel is None or tube is None or not scene.rods:
            raise ValueError(f"the scene '{scene.name}' has no body 'Vessel' with a cylinder, or no thread")
        assert isinstance(tube.shape, Cylinder)
        rod = scene.rods[0]
        self.elements, self.length = list(rod.bodies), float(rod.lengths.mean())
        self.body, self.thickness, self.radius = self.elements[-1], 2.0 * rod.radius, float(tube.shape.radius)
        level = scene.bodies[self.elements[0]].T_world_body[2, 3]
        self.vessel = np.append((vessel.T_world_body @ tube.T_body_shape)[:2, 3], level)
        self._round = 2.0 * np.pi * (self.radius + 0.5 * self.thickness)

    # --- seeing -----------------------------------------------------------------------------

    @property
    def short(self) -> Array:
        """Where the short end begins (3,): beside the vessel."""
        return np.asarray(self.vessel + [self.radius + 0.5 * self.thickness, 0.0, 0.0])

    def points(self) -> Array:
        """Where the elements of the thread are (n, 3), from the short end on."""
        return np.array(self._poses()[self.elements, :3])

    def tension(self) -> Array:
        """Tension (n,) of the elements, N."""
        return np.array(self._simulation.state["rod_tension"][0][self.elements])

    def held(self, arm: int) -> int | None:
        """The element of the thread between the jaws of an arm."""
        grasp = self._simulation.grasps[self._arms[arm].name]
        return None if grasp is None or grasp.body not in self.elements else self.elements.index(grasp.body)

    def holds(self, arm: int = 0) -> bool:
        """Whether the jaws of an arm hold the thread, wherever that is."""
        return self.held(arm) is not None

    def beside(self, points: Array) -> int:
        """The element that is beside the vessel where the short end begins."""
        x, y, _ = (points - self.vessel).T
        return int((np.hypot(x, y) + np.where(x > 0.0, 0.0, 1.0)).argmin())

    def leaves(self, points: Array) -> int:
        """The element at which the long end leaves the vessel."""
        low = self.beside(points)
        away = np.linalg.norm((points - self.vessel)[low:, :2], axis=1)
        at = away < self.radius + self.thickness + self.NEAR
        return low + (int(np.argmin(at)) if not at.all() else len(at) - 1)

    def loop(self, points: Array) -> tuple[int, int] | None:
        """The two elements of a thread (n, 3) at which its loop around the vessel first meets itself; None without."""
        n, low = len(points), self.beside(points)
        apart = np.linalg.norm(points[: low + 1, None] - points[None, low:], axis=2)
        between = (np.arange(low, n)[None] - np.arange(low + 1)[:, None]) * self.length
        meets = (apart < self.TOUCHING * self.thickness) & (between > 0.5 * self._round)
        if not meets.any():
            return None
        first, last = np.unravel_index(int(np.where(meets, between, np.inf).argmin()), between.shape)
        return int(first), low + int(last)

    def slack(self, points: Array) -> float:
        """Metres by which the loop around the vessel, up to where the thread first meets itself, is too long."""
        loop = self.loop(points)
        length = np.inf if loop is None else (loop[1] - loop[0]) * self.length
        return float(np.clip(length - self._round, 0.0, self.LOOP))

    def pull(self, arm: int) -> float:
        """Tension in newtons of the thread beside the jaws of an arm, towards the vessel; 0 when they hold none."""
        held = self.held(arm)
        if held is None:
            return 0.0
        first = held - 8 if held > self.beside(self.points()) else held + 3
        return float(self.tension()[max(first, 0) :][:6].max())

    def is_gone(self, points: Array) -> bool:
        """Whether the thread (n, 3) is no longer at the vessel."""
        return float(np.linalg.norm((points - self.vessel)[:, :2], axis=1).min()) > self.GONE

    def clear(self, arm: int, points: Array) -> bool:
        """Whether the tool of an arm is away from the thread (n, 3)."""
        T = base_of(self._simulation, self._arms[arm]) @ pose7_matrix(self._arms[arm].local_measured_cp())
        local = (points - T[:3, 3]) @ T[:3, :3]
        beyond = np.maximum(local[:, 2] - self.TIP, 0.0) + np.maximum(-self.TOOL - local[:, 2], 0.0)
        return bool(np.sqrt(local[:, 0] ** 2 + local[:, 1] ** 2 + beyond**2).min() > self.CLEAR)

    # --- where episodes begin ----------------------------------------------------------------

    def settle(self, start: int = 0) -> None:
        """The first arm takes the long end and brings it around the vessel, over the short end.

        Raises ValueError when its jaws do not hold the thread.
        """
        for arm in self._arms:
            arm.place_jp(START)
            arm.adopt()
            assert arm.jaw is not None
            arm.jaw.servo_jp([OPEN])
        self._simulation.step(600)
        points, arm = self.points(), self._arms[RIGHT]
        at = len(points) - 1 - self.HELD
        along = points[at + 1] - points[at - 1]
        T = holding(np.array([-0.7, -0.15, -0.7]), along, points[at])
        self._put(RIGHT, frame(np.eye(3), -0.01 * T[:3, 2]) @ T)
        self._stream(RIGHT, T, 0.05)
        assert arm.jaw is not None
        for opening in np.linspace(OPEN, SHUT, 40):
            arm.jaw.servo_jp([opening])
            self._simulation.step(5)
        self._simulation.step(100)
        if self.held(RIGHT) is None:
            raise ValueError(f"the jaws of {arm.name} do not hold the thread")
        back, across = np.array([-0.5, -0.25, -0.83]), np.array([0.0, -1.0, -0.1])
        for place, way in zip((*self.OVER, self.FIRST), (along, along, across, across), strict=True):
            self._stream(RIGHT, holding(back, way, self.vessel + place), 0.15)
        self._put(LEFT, holding(back * [-1.0, 1.0, 1.0], across, self.vessel + self.WAITING))
        self._simulation.step(300)

    def begin(self, rng: np.random.Generator) -> None:
        """Both hands a little elsewhere, that with the thread turned otherwise."""
        right, left = self._arms
        right.servo_cp(aside(right, rng, self.ASIDE, self.TURN))
        put(left, aside(left, rng, 2.0 * self.ASIDE, 0.0))
        self._simulation.step(self.ARRIVAL)

    def _put(self, number: int, T: Array) -> None:
        put(self._arms[number], inverse(base_of(self._simulation, self._arms[number])) @ T)

    def _stream(self, number: int, T: Array, speed: float) -> None:
        """An arm goes straight to a pose (4, 4) of its tool."""
        arm = self._arms[number]
        start, goal = pose7_matrix(arm.local_setpoint_cp()), inverse(base_of(self._simulation, arm)) @ T
        way, turn = goal[:3, 3] - start[:3, 3], rotation_vector(start[:3, :3].T @ goal[:3, :3])
        angle = float(np.linalg.norm(turn))
        count = max(int(np.linalg.norm(way) / speed / 0.005), int(angle / 3.0 / 0.005), 1)
        for share in np.linspace(0.0, 1.0, count + 1)[1:]:
            R = axis_rotation(turn / angle, share * angle) if angle > 1e-9 else np.eye(3)
            arm.servo_cp(frame(start[:3, :3] @ R, start[:3, 3] + share * way))
            self._simulation.step(5)

    def target(self) -> Array:
        """Where the throw is to be: at the vessel, where the short end leaves it."""
        return np.asarray(self.vessel + self.radius * np.array([1.0, 1.0, 0.0]))


def holding(way: Array, along: Array, point: Array) -> Array:
    """Pose (4, 4) of a tool that points along ``way`` (3,), with a thread at ``point`` that there runs ``along``."""
    z = way / np.linalg.norm(way)
    x = along - (along @ z) * z
    x = x / np.linalg.norm(x)
    return frame(np.column_stack([x, np.cross(z, x), z]), point - DEEP * z)
