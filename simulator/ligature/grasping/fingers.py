"""The fingers of one jaw: bodies between them, their approach, their efforts.

World axes, SI units.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.model.scene import Jaw
from ligature.physics import World
from ligature.physics.queries import Gap

Array = NDArray[np.float64]

FACING = 0.5
"""Cosine between a contact's normal and a finger's closing direction from which on its pad faces the contact."""

TOUCH = 30e-6
"""Gap in metres at which a pad touches."""

STIFFNESS = 2.0
"""Stiffness in N m/rad of a finger against the distance of its setpoint beyond the held body.

The joint drives of scene files are velocity motors of any strength; a real jaw has a compliant cable.
"""

EFFORT = 0.2
"""Largest effort of a finger in N m: 25 N on a needle 8 mm from its axis."""

PUSH, PUSH_SPEED = 2.0, 0.03
"""Maximum force in N and speed in m/s of a finger that touches a body alone."""

LEAST_LEVER = 1e-3
"""Least lever in metres about the axis of the fingers."""

APPROACH = 4
"""Least number of ticks in which a finger closes its gap."""


class Facing(NamedTuple):
    """Nearest point of a finger's pad to a body that it faces: ``gap``, ``point`` (3,), ``lever`` about the axis."""

    gap: float
    point: Array
    lever: float


class Fingers:
    """Both fingers of ``jaw``, by index 0 or 1.

    Attributes
    ----------
    jaw
        What the scene says of them.
    axes, opening
        (2,) axes of the world that turn them, and the directions in which these open.
    """

    def __init__(self, jaw: Jaw, world: World) -> None:
        self.jaw, self._world = jaw, world
        self.axes = np.array([world.joints.axis(joint) for joint in jaw.joints])
        self.opening = np.array(jaw.opening, dtype=float)
        self._slowed = False

    def axis(self) -> tuple[Array, Array]:
        """The common axis (3,) of both fingers and a point (3,) on it, now."""
        T = pose7_matrix(self._world.motion(self.jaw.palm)[0])
        return T[:3, :3] @ self.jaw.axis, T[:3, :3] @ self.jaw.pivot + T[:3, 3]

    def closing(self, finger: int, axis: Array, lever: Array) -> Array:
        """Direction (3,) in which a finger closes at ``lever`` (3,) from the axis."""
        turn = self.jaw.opening[0] if finger == 0 else -self.jaw.opening[0]
        direction = np.array(_turned((-turn * axis).tolist(), lever.tolist()))
        return np.asarray(direction / max(float(np.linalg.norm(direction)), 1e-12))

    def _facing(self, finger: int, axis: Array, pivot: Array, gaps: Sequence[Gap]) -> Facing | None:
        """The nearest of the points to which a pad is near that the pad faces, None without any."""
        turn = self.jaw.opening[0] if finger == 0 else -self.jaw.opening[0]
        (ax, ay, az), closing, (px, py, pz) = axis.tolist(), (-turn * axis).tolist(), pivot.tolist()
        for gap in gaps:  # numbers, for arrays of three take ten times as long
            (x, y, z), (nx, ny, nz) = gap.point, gap.normal
            x, y, z = x - px, y - py, z - pz
            along = x * ax + y * ay + z * az
            dx, dy, dz = _turned(closing, [x - along * ax, y - along * ay, z - along * az])
            size = max(math.sqrt(dx * dx + dy * dy + dz * dz), 1e-12)
            if nx * dx + ny * dy + nz * dz < -FACING * size:
                point = np.array(gap.point)
                lever = point - pivot
                lever = lever - (lever @ axis) * axis
                return Facing(gap.distance, point, float(np.linalg.norm(lever)))
        return None

    def facing(self, body: int, within: float) -> tuple[Facing, Facing] | None:
        """Nearest points of both pads to a body between them; None when the body is not between them."""
        axis, pivot = self.axis()
        found = []
        for finger, own in enumerate(self.jaw.fingers):
            face = self._facing(finger, axis, pivot, self._world.queries.gaps(own, body, within))
            if face is None:
                return None
            found.append(face)
        return found[0], found[1]

    def near(self, body: int) -> bool:
        """Whether a body touches a finger."""
        return any(self._world.queries.gaps(own, body, 0.0) for own in self.jaw.fingers)

    def driven(self) -> bool:
        """Whether a command drives a finger; undriven fingers grasp nothing."""
        driven, (one, other) = self._world.joints.driven, self.jaw.joints
        return driven(one) or driven(other)

    def efforts(self) -> tuple[float, float]:
        """Efforts (N m) with which the commands of both fingers would close them; negative ones open."""
        one, two = (
            -opening * self._world.joints.requested_effort(joint, STIFFNESS)
            for joint, opening in zip(self.jaw.joints, self.jaw.opening, strict=True)
        )
        return min(one, EFFORT), min(two, EFFORT)

    def approach(self, faces: tuple[Facing, Facing]) -> None:
        """Slow the fingers as they close on a body at these gaps."""
        self._slowed = True
        for joint, opening, face in zip(self.jaw.joints, self.jaw.opening, faces, strict=True):
            lever = max(face.lever, LEAST_LEVER)
            speed = (PUSH_SPEED + max(face.gap, 0.0) / (APPROACH * self._world.dt)) / lever
            strength = PUSH * lever if face.gap < 10 * TOUCH else np.inf
            low, high = (-speed, np.inf) if opening > 0.0 else (-np.inf, speed)
            self._world.joints.limit_velocity(joint, low, high, strength)

    def approach_thread(self, box: Array) -> None:
        """Slow the fingers as they close on a thread within their box (2, 3)."""
        lever = 0.5 * self.jaw.reach
        self.approach((Facing(0.0, box[0], lever), Facing(0.0, box[1], lever)))

    def stop(self, positions: Iterable[float], effort: tuple[float, float]) -> None:
        """Stop both fingers at ``positions``; they press with ``effort``."""
        self._slowed = True
        for joint, opening, at, tau in zip(self.jaw.joints, self.jaw.opening, positions, effort, strict=True):
            self._world.joints.stop(joint, at, -opening * tau)

    def moved(
        self, positions: Iterable[float], distances: tuple[float, float], levers: tuple[float, float]
    ) -> tuple[float, float]:
        """Joint positions at which the pads have closed by further ``distances`` in metres."""
        one, two = (
            at - opening * distance / max(lever, LEAST_LEVER)
            for at, opening, distance, lever in zip(positions, self.jaw.opening, distances, levers, strict=True)
        )
        return one, two

    def sort_motors(self) -> None:
        """Have motors keep both fingers that were stopped without `stop`."""
        self._slowed = True
        for joint in self.jaw.joints:
            self._world.joints.control_of(joint).sort()

    def release(self) -> None:
        """Return both fingers to their commands."""
        if self._slowed:
            self._slowed = False
            for joint in self.jaw.joints:
                self._world.joints.resume(joint)

    def reset(self) -> None:
        """Follow commands, after the world was reset."""
        self._slowed = False

    def snapshot(self) -> bool:
        """Whether the fingers are slowed or stopped."""
        return self._slowed

    def restore(self, snapshot: bool) -> None:
        """Continue from `snapshot`; the joints belong to the world."""
        self._slowed = snapshot

    def positions(self) -> tuple[float, float]:
        """Positions of both joints in radians."""
        one, two = (self._world.joints.position(joint) for joint in self.jaw.joints)
        return one, two


def _turned(axis: list[float], lever: list[float]) -> list[float]:
    """The cross product (3,) of ``axis`` (3,) and ``lever`` (3,); np.cross takes ten times as long."""
    (ax, ay, az), (lx, ly, lz) = axis, lever
    return [ay * lz - az * ly, az * lx - ax * lz, ax * ly - ay * lx]
