"""Goals of an arm that go where the operator points, at a hand's speed: nothing jumps, and what stops, stops at once.

A slider or a gizmo may leap; the goal that is sent to the arm does not. Metres, radians, seconds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ligature.model.frames import axis_rotation, matrix_pose7
from ligature.robots.commands import VERBS, ArmCommand
from ligature.robots.poses import rotation_vector

Array = NDArray[np.float64]

LINEAR, ANGULAR = 0.1, 1.5
"""Maximum velocity of goals of a tip, in m/s and rad/s."""

SMOOTH = 0.06
"""Seconds in which the velocity of a goal follows a key or a stick."""

ARC = 0.8
"""Maximum velocity in rad/s at which a needle is turned along its arc."""

JAW = 2.0
"""Maximum velocity of goals of a jaw or gripper in rad/s."""

JOINT = {"revolute": 1.0, "prismatic": 0.1}
"""Maximum velocity of goals of a joint in rad/s and m/s."""


@dataclass(eq=False)
class JointPursuit:
    """Joint goals (n,) towards ``target``, each joint at ``speed``; ``verb`` is the command that carries them."""

    goal: Array
    target: Array
    speed: Array
    verb: str = "servo_jp"

    def advance(self, dt: float) -> tuple[float, ...]:
        """The goal ``dt`` seconds later."""
        step = self.speed * dt
        self.goal = self.goal + np.clip(self.target - self.goal, -step, step)
        return tuple(self.goal.tolist())

    @property
    def arrived(self) -> bool:
        """Whether the target is reached."""
        return bool((self.goal == self.target).all())


@dataclass(eq=False)
class PosePursuit:
    """Tip poses (4, 4) towards ``target``, in the frame that ``servo_cp`` of the arm takes."""

    goal: Array
    target: Array
    verb: str = "servo_cp"

    def advance(self, dt: float) -> tuple[float, ...]:
        """The goal ``dt`` seconds later, as a pose (7,)."""
        way, turn = self._rest()
        length, angle = float(np.linalg.norm(way)), float(np.linalg.norm(turn))
        share = min(1.0, LINEAR * dt / max(length, 1e-12), ANGULAR * dt / max(angle, 1e-12))
        if share == 1.0:
            self.goal = self.target
        else:
            goal = self.goal.copy()
            goal[:3, 3] += share * way
            if angle > 0.0:
                goal[:3, :3] = axis_rotation(turn / angle, share * angle) @ goal[:3, :3]
            self.goal = goal
        return tuple(matrix_pose7(self.goal).tolist())

    def _rest(self) -> tuple[Array, Array]:
        turn = rotation_vector(self.target[:3, :3] @ self.goal[:3, :3].T)
        return self.target[:3, 3] - self.goal[:3, 3], turn

    @property
    def arrived(self) -> bool:
        """Whether the target is reached."""
        return self.goal is self.target


@dataclass(eq=False)
class TwistPursuit:
    """Tip poses (4, 4) that move with ``twist`` (6,): m/s and rad/s in the frame that ``servo_cp`` of the arm takes.

    The velocity of the goal follows the twist within `SMOOTH`, so that a key that goes down does not jerk an arm.
    """

    goal: Array
    twist: Array
    verb: str = "servo_cp"

    def __post_init__(self) -> None:
        self._now = np.zeros(6)

    def advance(self, dt: float) -> tuple[float, ...]:
        """The goal ``dt`` seconds later, as a pose (7,)."""
        self._now = self._now + (self.twist - self._now) * min(dt / SMOOTH, 1.0)
        turn = dt * self._now[3:]
        angle = float(np.linalg.norm(turn))
        goal = self.goal.copy()
        goal[:3, 3] += dt * self._now[:3]
        if angle > 0.0:
            goal[:3, :3] = axis_rotation(turn / angle, angle) @ goal[:3, :3]
        self.goal = goal
        return tuple(matrix_pose7(goal).tolist())

    @property
    def arrived(self) -> bool:
        """Whether it stands and is to stand."""
        return not self.twist.any() and float(np.abs(self._now).max()) < 1e-5


@dataclass(eq=False)
class ArcPursuit:
    """Tip poses ``pose(angle)`` (4, 4) along an arc, from the angle ``at`` towards ``target``."""

    pose: Callable[[float], Array]
    at: float
    target: float
    verb: str = "servo_cp"

    @property
    def goal(self) -> Array:
        """The pose now."""
        return self.pose(self.at)

    def advance(self, dt: float) -> tuple[float, ...]:
        """The goal ``dt`` seconds later, as a pose (7,)."""
        self.at += float(np.clip(self.target - self.at, -ARC * dt, ARC * dt))
        return tuple(matrix_pose7(self.goal).tolist())

    @property
    def arrived(self) -> bool:
        """Whether the target is reached."""
        return self.at == self.target


class ArmPursuits:
    """What one arm pursues: joints, a tip pose or a twist, and beside it the jaw."""

    def __init__(self, arm: int) -> None:
        self._arm = arm
        self._motion: JointPursuit | PosePursuit | TwistPursuit | ArcPursuit | None = None
        self._jaw: JointPursuit | None = None
        self.planned = False
        """Whether a plan of the page steers it, not a hand: who asks last decides."""

    @property
    def active(self) -> bool:
        """Whether anything is pursued."""
        return self._motion is not None or self._jaw is not None

    def joint(self, start: ArrayLike, joint: int, target: float, speed: ArrayLike) -> None:
        """Take one joint to ``target``, the others where they are going or stay; ``start`` are set-points (n,)."""
        if not isinstance(self._motion, JointPursuit):
            goal = np.array(start, dtype=float)
            self._motion = JointPursuit(goal, goal.copy(), np.asarray(speed, dtype=float))
        self._motion.target = self._motion.target.copy()
        self._motion.target[joint] = target
        self.planned = False

    def joints(self, start: ArrayLike, target: ArrayLike, speed: ArrayLike) -> None:
        """Take all joints from ``start`` (n,) to ``target`` (n,) by a plan, all arriving together."""
        start, target = np.array(start, dtype=float), np.array(target, dtype=float)
        speed = np.asarray(speed, dtype=float)
        longest = max(float((np.abs(target - start) / speed).max()), 1e-9)
        self._motion = JointPursuit(start, target, np.abs(target - start) / longest)
        self.planned = True

    def pose(self, start: Array, target: Array, planned: bool = False) -> None:
        """Go to ``target`` (4, 4), from ``start`` (4, 4) unless a pose is pursued already."""
        goal = np.array(start) if isinstance(self._motion, JointPursuit | None) else self._motion.goal
        self._motion = PosePursuit(goal, np.array(target))
        self.planned = planned

    def along(self, pose: Callable[[float], Array], start: float, target: float) -> None:
        """Go along the poses (4, 4) of an arc from the angle ``start`` to ``target``, by a plan."""
        self._motion = ArcPursuit(pose, start, target)
        self.planned = True

    def steer(self, target: float) -> bool:
        """Go to another angle of the arc; False where no arc is pursued."""
        if not isinstance(self._motion, ArcPursuit):
            return False
        self._motion.target = target
        return True

    def twist(self, start: Array, twist: Array) -> None:
        """Move with ``twist`` (6,), from ``start`` (4, 4) unless the tip moves already; zeros let it come to rest."""
        if isinstance(self._motion, TwistPursuit):
            self._motion.twist = np.array(twist)
        elif np.any(twist):
            goal = self._motion.goal if isinstance(self._motion, PosePursuit | ArcPursuit) else np.array(start)
            self._motion = TwistPursuit(goal, np.array(twist))
        self.planned = False

    @property
    def twists(self) -> bool:
        """Whether it moves with a twist."""
        return isinstance(self._motion, TwistPursuit)

    def jaw(self, start: float, target: float, verb: str, planned: bool = False, speed: float = JAW) -> None:
        """Open or close to ``target`` at ``speed``, in rad/s."""
        self.planned = planned
        goal = np.array([start]) if self._jaw is None else self._jaw.goal
        self._jaw = JointPursuit(goal, np.array([target]), np.array([speed]), verb)

    def rest_jaw(self) -> None:
        """Leave the jaw where it is."""
        self._jaw = None

    def advance(self, dt: float) -> list[ArmCommand]:
        """Commands for the next ``dt`` seconds; what arrives is pursued no longer."""
        commands = []
        for pursuit in (self._motion, self._jaw):
            if pursuit is not None:
                commands.append(VERBS[pursuit.verb](self._arm, pursuit.advance(dt)))
        if self._motion is not None and self._motion.arrived:
            self._motion = None
        if self._jaw is not None and self._jaw.arrived:
            self._jaw = None
        return commands

    def stop(self) -> bool:
        """Pursue nothing any more; True when something was."""
        was = self.active
        self._motion = self._jaw = None
        self.planned = False
        return was
