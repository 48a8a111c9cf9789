"""Scripted experts of the environments: each does the deed by the actions that an agent has.

They find their way by the ground truth of the simulation. World axes, metres, radians.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from ligature.environments.goals import Insert, holds
from ligature.environments.suturing import STEP_ANGLE, STEP_JAW, STEP_LENGTH, SuturingEnv
from ligature.model.frames import frame, inverse, pose7_matrix
from ligature.robots.poses import rotation_vector
from ligature.tasks.throws import UP, NeedleArc, best_grasp

Array = NDArray[np.float64]
OPEN, SHUT = 0.8, -0.34
"""Angles of the jaw."""

TRIES = 3
"""How often an expert goes for the needle."""


class Hand:
    """The arm of an environment, driven by its actions."""

    def __init__(self, env: SuturingEnv) -> None:
        self.env = env
        self.base = frame(env.base_rotation, env.base_position)
        self.simulation, self.arm, self.needle = env.simulation, env.arm, env.needle
        self.arc = NeedleArc.of(self.simulation.scene.needles[0], self.simulation.scene.bodies[self.needle])

    @property
    def tool(self) -> Array:
        """The set-point of the tool (4, 4)."""
        return self.base @ pose7_matrix(self.env.setpoint)

    @property
    def needle_arc(self) -> Array:
        """The needle's arc frame (4, 4)."""
        return pose7_matrix(self.simulation.state["body_pose"][0, self.needle]) @ self.arc.T_body_arc

    def action(self, T: Array, jaw: float) -> tuple[Array, float]:
        """The action towards a pose of the tool and a jaw angle, and how many of them are left."""
        wanted, now = inverse(self.base) @ T, pose7_matrix(self.env.setpoint)
        found = np.zeros(7)
        found[:3] = (wanted - now)[:3, 3] / STEP_LENGTH
        found[3:6] = rotation_vector(now[:3, :3].T @ wanted[:3, :3]) / STEP_ANGLE
        left = float(np.abs(found).max())
        found[:6] /= max(left, 1.0)
        assert self.arm.jaw is not None
        closing = (jaw - float(self.arm.jaw.setpoint_js().position[0])) / STEP_JAW
        found[6] = np.clip(closing, -1.0, 1.0)
        return found, max(left, abs(closing))

    def go(self, T: Array, jaw: float, most: int = 120) -> Iterator[Array]:
        """Actions until the set-point is there."""
        for _ in range(most):
            found, left = self.action(T, jaw)
            if left < 0.2:
                return
            yield found

    def stay(self, count: int, jaw: float) -> Iterator[Array]:
        """Actions that only move the jaw."""
        T = self.tool
        for _ in range(count):
            yield self.action(T, jaw)[0]

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Array:
        """The set-point moved by so much."""
        return frame(np.eye(3), np.array([x, y, z])) @ self.tool

    def grasp(self) -> Array:
        """Pose (4, 4) of the tool at which the jaws can close on the needle from above."""
        now = self.needle_arc
        raised = frame(np.eye(3), 0.03 * UP) @ now
        surface = self.simulation.state["body_pose"][0, self.needle, :3] - np.array([0.0, 0.0, 0.004])
        depths = (0.004, 0.006, 0.5 * self.arc.length)
        found = best_grasp(self.arc, depths, self.arm.kinematics, self.base, [raised], now, surface, upright=True)
        if found is None:
            raise ValueError("the arm cannot reach a grasp from which it could lift the needle")
        return now @ found.tool_in_arc(self.arc)

    def take(self, T: Array) -> Iterator[Array]:
        """Close the jaws at a pose of the tool, from above."""
        yield from self.go(_above(T), OPEN)
        yield from self.go(T, OPEN)
        yield from self.stay(20, SHUT)

    def fetch(self) -> Iterator[Array]:
        """Grasp the needle; a thread that falls off the pad's edge may turn it meanwhile."""
        for _ in range(TRIES):
            T = self.grasp()
            T_arc_tool = inverse(self.needle_arc) @ T
            yield from self.go(_above(T), OPEN)
            yield from self.take(self.needle_arc @ T_arc_tool)
            if holds(self.simulation, self.arm, self.needle):
                return
            yield from self.go(self.moved(z=0.015), OPEN)


def _above(T: Array) -> Array:
    """The pose from which the tool goes straight to ``T``."""
    return frame(np.eye(3), -0.015 * T[:3, 2]) @ T


Policy = Callable[[Hand, Array], Iterator[Array]]
"""Actions (7,) of an episode, from the arm and the first observation."""


def reach(hand: Hand, observation: Array) -> Iterator[Array]:
    """Go there and stop."""
    yield from hand.go(frame(hand.tool[:3, :3], observation[30:33]), 0.0)
    yield from hand.stay(30, 0.0)


def pick(hand: Hand, observation: Array) -> Iterator[Array]:
    """Grasp the needle, lift it, hold it."""
    yield from hand.fetch()
    yield from hand.go(hand.moved(z=0.045), SHUT)
    yield from hand.stay(60, SHUT)


def drive(
    hand: Hand, observation: Array, aside: Array | None = None, end: float = 2.6, turn: float = 0.03
) -> Iterator[Array]:
    """Turn the needle along its circle.

    The circle is moved ``aside`` (3,); ``end`` is the tip's last angle, ``turn`` how far it goes in an action.
    """
    goal = hand.env.goal
    assert isinstance(goal, Insert)
    T_arc_tool = inverse(hand.needle_arc) @ hand.tool
    shift = frame(np.eye(3), np.zeros(3) if aside is None else aside)
    angle = -0.4
    while angle < end:
        wanted = shift @ goal.throw.arc_at(angle, goal.arc) @ T_arc_tool
        found, left = hand.action(wanted, SHUT)
        angle += turn if left <= 1.0 else 0.0
        yield found


EXPERTS: dict[str, Policy] = {"reach": reach, "pick": pick, "insert": drive, "puncture": drive}
"""Experts by the names of the tasks."""
