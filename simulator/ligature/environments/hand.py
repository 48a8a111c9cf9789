"""One arm of an environment as scripted experts drive it: poses of its tool, turned into the actions of an agent.

World axes, metres, radians.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ligature.environments.actions import STEP_ANGLE, STEP_JAW, STEP_LENGTH
from ligature.environments.layout import ACTION
from ligature.environments.suturing import SuturingEnv
from ligature.model.frames import frame, inverse, pose7_matrix
from ligature.robots.poses import rotation_vector
from ligature.tasks.throws import BEHIND, PAD, UP, NeedleArc, Throw, best_grasp, drawn_back

Array = NDArray[np.float64]
JAW = 6
"""The number of an action that moves the jaw."""

OPEN, SHUT = 0.8, -0.34
"""Angles of the jaw."""

WIDE, TIGHT = OPEN - 0.2, SHUT + 0.05
"""Angles of the jaw from which on it is open enough to go to the needle, and shut enough to lift it."""

NEAR, DEEP = 0.0015, 0.001
"""Metres across the tool and along it within which the jaws are where they can close."""

ABOVE, SLOPE = 0.015, 4.0
"""The tool comes down on the needle within a cone: metres that it stays above for each beside, and the most of them."""

UPRIGHT = 1e-6
"""Length of the level part of a needle's direction below which it has none."""

ARM = 0.01
"""Metres beside a place that count as much as a radian: the length of the jaws."""

TURN = 0.03
"""Angle by which the needle turns along its circle in an action."""

BESIDE = 0.001
"""Metres beside its circle up to which it goes on as fast; at twice that it stops and is brought back first."""

FIRST = -1.6
"""The least angle of a needle's tip past the entry; a turn more is the greatest."""


def apart(first: Array, second: Array) -> float:
    """How far apart two poses (4, 4) are in metres; a radian counts as `ARM`."""
    way = inverse(first) @ second
    return float(np.linalg.norm(way[:3, 3])) + ARM * float(np.linalg.norm(rotation_vector(way[:3, :3])))


class Hand:
    """One arm of an environment, the first unless ``number`` says otherwise, driven by its actions."""

    def __init__(self, env: SuturingEnv, number: int = 0) -> None:
        self.env, self._number = env, number
        self._reading = env.readings[number]
        self.base = pose7_matrix(self._reading.base)
        self.simulation, self.arm, self.needle = env.simulation, env.arms[number], env.needle

    @cached_property
    def arc(self) -> NeedleArc:
        """The arc of the needle."""
        return NeedleArc.of(self.simulation.scene.needles[0], self.simulation.scene.bodies[self.needle])

    def other(self, number: int) -> Hand:
        """Another arm of the environment."""
        return Hand(self.env, number)

    @property
    def tool(self) -> Array:
        """The set-point of the tool (4, 4)."""
        return self.base @ pose7_matrix(self._reading.setpoint)

    @property
    def needle_pose(self) -> Array:
        """Pose (4, 4) of what is handled."""
        return pose7_matrix(self.simulation.state["body_pose"][0, self.env.needle])

    @property
    def measured_tool(self) -> Array:
        """Where the tool is (4, 4)."""
        return self.base @ pose7_matrix(self.arm.local_measured_cp())

    @property
    def opening(self) -> float:
        """The set-point of the jaw."""
        assert self.arm.jaw is not None
        return float(self.arm.jaw.setpoint_js().position[0])

    @property
    def needle_arc(self) -> Array:
        """The needle's arc frame (4, 4)."""
        return pose7_matrix(self.simulation.state["body_pose"][0, self.needle]) @ self.arc.T_body_arc

    def action(self, T: Array, jaw: float) -> tuple[Array, float]:
        """The action towards a pose of the tool and a jaw angle, and how many of them are left; other arms stay."""
        wanted, now = inverse(self.base) @ T, pose7_matrix(self._reading.setpoint)
        every = np.zeros((len(self.env.arms), ACTION))
        found = every[self._number]
        found[:3] = (wanted - now)[:3, 3] / STEP_LENGTH
        found[3:6] = rotation_vector(now[:3, :3].T @ wanted[:3, :3]) / STEP_ANGLE
        left = float(np.abs(found).max())
        found[:6] /= max(left, 1.0)
        closing = (jaw - self.opening) / STEP_JAW
        found[JAW] = np.clip(closing, -1.0, 1.0)
        return every.ravel(), max(left, abs(closing))

    def go(self, T: Array, jaw: float, most: int = 120) -> Iterator[Array]:
        """Number of actions until the set-point arrives."""
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
        """Pose (4, 4) of the tool at which the jaws can close on the needle from above.

        Raises ValueError where the arm reaches none.
        """
        now = self.needle_arc
        raised = frame(np.eye(3), 0.03 * UP) @ now
        surface = self.simulation.state["body_pose"][0, self.needle, :3] - np.array([0.0, 0.0, 0.004])
        depths = (0.004, 0.006, 0.5 * self.arc.length)
        found = best_grasp(self.arc, depths, self.arm.kinematics, self.base, [raised], now, surface, upright=True)
        if found is None:
            raise ValueError("the arm reaches no grasp from which it can lift the needle")
        return now @ found.tool_in_arc(self.arc)

    def take(self, T: Array) -> Iterator[Array]:
        """Close the jaws at a pose of the tool, from above."""
        yield from self.go(drawn_back(T, BEHIND), OPEN)
        yield from self.go(T, OPEN)
        yield from self.stay(20, SHUT)

    def nearest_grasp(self) -> Array:
        """Pose (4, 4) of the upright tool at which its jaws stand across the needle's middle, turned the shorter way.

        The jaws are alike: half a turn about the tool changes nothing.
        """
        a = self.arc.angle(0.5 * self.arc.length)
        out, along = np.array([math.cos(a), math.sin(a), 0.0]), np.array([-math.sin(a), math.cos(a), 0.0])
        T, tool = self.needle_arc, self.tool
        x = T[:3, :3] @ along
        x -= (x @ UP) * UP
        x *= np.sign(x @ tool[:3, 0] or 1.0) / max(float(np.linalg.norm(x)), UPRIGHT)
        return frame(
            np.column_stack([x, np.cross(-UP, x), -UP]), T[:3, 3] + self.arc.radius * T[:3, :3] @ out + PAD * UP
        )

    def approach(self) -> Array:
        """The action that brings the jaws around the needle from above, and closes them there."""
        return self.close_at(self.nearest_grasp())

    def close_at(self, T: Array) -> Array:
        """The action that brings the jaws to a pose (4, 4) of the tool from behind it, and closes them there.

        Jaws that began to close go on where they would not begin; those that shut on nothing leave before they open.
        """
        jaw = self.opening
        way, share = inverse(T) @ self.tool, 1.0 if jaw > WIDE else 2.0
        beside = float(np.hypot(way[0, 3], way[1, 3])) + ARM * float(np.linalg.norm(rotation_vector(way[:3, :3])))
        around = beside < share * NEAR and abs(way[2, 3]) < share * DEEP
        if around and jaw > TIGHT:
            return self.action(T, SHUT)[0]
        above = max(SLOPE * (beside - 0.5 * NEAR), ABOVE * (WIDE - jaw) / WIDE)
        return self.action(drawn_back(T, float(np.clip(above, 0.0, ABOVE))), SHUT if around else OPEN)[0]

    def turn_needle(self, throw: Throw, last: float) -> Array:
        """The action that turns the needle, which the jaws hold, along the circle of a throw up to an angle."""
        arc_tool = inverse(self.needle_arc) @ self.measured_tool
        needle = self.tool @ inverse(arc_tool)
        tip = throw.axes.T @ ((needle @ frame(np.eye(3), self.arc.tip))[:3, 3] - throw.centre)
        angle = (math.atan2(tip[1], tip[0]) - FIRST) % (2.0 * np.pi) + FIRST
        beside = apart(throw.arc_at(angle, self.arc), needle)
        angle = min(angle + TURN * float(np.clip(2.0 - beside / BESIDE, 0.0, 1.0)), last)
        return self.action(throw.arc_at(angle, self.arc) @ arc_tool, SHUT)[0]

    def lift_to(self, height: float) -> Array:
        """The action that shuts the jaws, and lifts the needle's origin to a height."""
        missing = height - float(self.simulation.state["body_pose"][0, self.needle, 2])
        return self.action(self.moved(z=float(np.clip(missing, 0.0, 0.002)) if self.opening < TIGHT else 0.0), SHUT)[0]
