"""Two arms make the first throw of a ligature around a vessel. World axes, metres, radians, simulated seconds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.environments.goals.base import (
    EARLY,
    HOLD,
    OPEN,
    REGRASP,
    SHUT,
    START,
    UNDONE,
    Dwell,
    Goal,
    Progress,
    aside,
    base_of,
    put,
)
from ligature.model.frames import axis_rotation, frame, inverse, pose7_matrix
from ligature.model.shapes import Cylinder
from ligature.robots.poses import rotation_vector
from ligature.tasks.knots import HALF_KNOT, determinant, extended, knotted_around

Array = NDArray[np.float64]

RIGHT, LEFT = 0, 1

LYING = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""Places times this are as if the upright vessel lay along x, with the thread below it. Its columns are the axis of the
vessel, the way of the short end, and the side where no thread passes at first."""

DEEP = 0.0075
"""Metres from the control point of a tool to where it holds a thread."""


class FirstThrow(Goal):
    """Make the first throw of a ligature around an upright vessel, and draw it close.

    The thread passes beside the vessel; its short end is in a clip, its long end in the first arm's jaws. The task is
    done when for 0.5 s the thread has had one throw around the vessel, by the crossings of its two ends and not by what
    is near to what; the loop has been closed to within `SLACK` of the vessel; the second arm's jaws alone have held the
    thread, and the first arm's tool has been clear of it. It is lost when no jaws have held the thread for 2 s, or when
    it is no longer at the vessel.
    """

    text = "make a throw around the vessel: pass the long end around the short one with both arms, and draw it close"
    scene, arms, models, steps = "ligating", ("PSM1", "PSM2"), (0, 1, 2, 3, 4), 500
    THROW, LOOP, TAKE, RELEASE = 0.1, 0.05, 0.02, 0.02
    """What is left, in metres, until the thread has a throw, at most for a loop that is not closed, until the second
    arm holds the thread, and until the first arm has let go and gone away."""
    SLACK, TOUCHING = 0.008, 2.0
    """Metres by which the loop may be longer than around the vessel; thicknesses of the thread within which it meets
    itself."""
    CLEAR, TOOL, TIP = 0.006, 0.03, 0.0094
    """How far from the thread the last `TOOL` metres of the first arm's tool must be, up to the end of its fingers."""
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
    _KEPT = ("_rest", "_rested", "_free", "_held", "_thrown")

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

    def slack(self, points: Array) -> float:
        """Metres by which the loop around the vessel, up to where the thread first meets itself, is too long."""
        n, low = len(points), self.beside(points)
        apart = np.linalg.norm(points[: low + 1, None] - points[None, low:], axis=2)
        between = (np.arange(low, n)[None] - np.arange(low + 1)[:, None]) * self.length
        meets = (apart < self.TOUCHING * self.thickness) & (between > 0.5 * self._round)
        return float(np.clip(between[meets].min(initial=np.inf) - self._round, 0.0, self.LOOP))

    def thrown(self, points: Array) -> bool:
        """Whether the thread (n, 3), its ends continued straight away from the vessel, has one throw around it."""
        lying = (points - self.vessel) @ LYING
        return determinant(extended(lying, np.zeros(3))) == HALF_KNOT and knotted_around(
            lying, np.zeros(3), self.radius
        )

    @property
    def is_thrown(self) -> bool:
        """Whether the thread has the throw."""
        return bool(self._thrown)

    def clear(self, arm: int, points: Array) -> bool:
        """Whether the tool of an arm is away from the thread (n, 3)."""
        T = base_of(self._simulation, self._arms[arm]) @ pose7_matrix(self._arms[arm].local_measured_cp())
        local = (points - T[:3, 3]) @ T[:3, :3]
        beyond = np.maximum(local[:, 2] - self.TIP, 0.0) + np.maximum(-self.TOOL - local[:, 2], 0.0)
        return bool(np.sqrt(local[:, 0] ** 2 + local[:, 1] ** 2 + beyond**2).min() > self.CLEAR)

    # --- the task ---------------------------------------------------------------------------

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
        self._rest, self._rested, self._free, self._held, self._thrown = Dwell(), 0.0, Dwell(), True, False

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

    def observe(self) -> Progress:
        """The throw that is missing, how far its loop is from closed, and which hands are to hold the thread."""
        points, now = self.points(), self._simulation.time
        self._thrown, self._held, held = self.thrown(points), self.holds(RIGHT), self.holds(LEFT)
        loop = self.slack(points) if self._thrown else self.LOOP
        away = not self._held and self.clear(RIGHT, points)
        made = self._thrown and loop <= self.SLACK and held and away
        self._rested = self._rest.observe(made, now)
        if self._rested >= HOLD - EARLY:
            return Progress(0.0, True)
        left = self.THROW * (not self._thrown) + loop + UNDONE
        left += self.TAKE * (not (self._thrown and held)) + self.RELEASE * (not (self._thrown and away))
        if float(np.linalg.norm((points - self.vessel)[:, :2], axis=1).min()) > self.GONE:
            return Progress(left, lost="the thread is no longer at the vessel")
        dropped = self._free.observe(not self._held and not held, now) >= REGRASP - EARLY
        return Progress(left, lost="the thread was dropped" if dropped else "")

    def marks(self) -> Array:
        """Whether the first arm holds the thread, the share of the time that the throw is drawn, whether it is made."""
        return np.array([self._held, min(self._rested / HOLD, 1.0), self._thrown], dtype=float)


def holding(way: Array, along: Array, point: Array) -> Array:
    """Pose (4, 4) of a tool that points along ``way`` (3,), with a thread at ``point`` that there runs ``along``."""
    z = way / np.linalg.norm(way)
    x = along - (along @ z) * z
    x = x / np.linalg.norm(x)
    return frame(np.column_stack([x, np.cross(z, x), z]), point - DEEP * z)
