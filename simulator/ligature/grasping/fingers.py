"""The fingers of one jaw: what stands between them, how they close on it, how hard they press.

World axes, SI units.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.model.scene import Jaw
from ligature.physics import World

Array = NDArray[np.float64]

FACING = 0.5
"""Cosine between a contact's normal and a finger's way from which on its pad faces the contact."""

TOUCH = 30e-6
"""Gap in metres at which a pad touches."""

STIFFNESS = 2.0
"""N m/rad with which a finger presses for each radian that its set-point lies beyond what it holds.

The drives of joints in scene files are velocity motors of any strength; that of a real jaw is a cable.
"""

EFFORT = 0.2
"""Largest effort of a finger in N m: 25 N on a needle 8 mm from its axis."""

PUSH, PUSH_SPEED = 2.0, 0.03
"""Force in N with which one finger alone pushes what stands before it, and its speed then, m/s."""

LEAST_LEVER = 1e-3
"""Distance in metres from the axis of the fingers that counts for everything nearer."""

APPROACH = 4
"""Ticks in which a finger may close its gap."""


class Facing(NamedTuple):
    """The point of a finger's pad nearest to something before it: ``gap``, ``point`` (3,), ``lever`` from the axis."""

    gap: float
    point: Array
    lever: float


class Fingers:
    """Both fingers of ``jaw``; by index 0 or 1."""

    def __init__(self, jaw: Jaw, world: World) -> None:
        self.jaw, self._world = jaw, world
        self._slowed = False

    def axis(self) -> tuple[Array, Array]:
        """The axis (3,) about which both turn, and a point (3,) of it, now."""
        T = pose7_matrix(self._world.motion(self.jaw.holder)[0])
        return T[:3, :3] @ self.jaw.axis, T[:3, :3] @ self.jaw.pivot + T[:3, 3]

    def closing(self, finger: int, axis: Array, lever: Array) -> Array:
        """Direction (3,) in which a finger closes at ``lever`` (3,) from the axis."""
        turn = self.jaw.opening[0] if finger == 0 else -self.jaw.opening[0]
        (ax, ay, az), (lx, ly, lz) = (-turn * axis).tolist(), lever.tolist()
        way = np.array([ay * lz - az * ly, az * lx - ax * lz, ax * ly - ay * lx])  # np.cross takes ten times as long
        return np.asarray(way / max(float(np.linalg.norm(way)), 1e-12))

    def facing(self, body: int, within: float) -> tuple[Facing, Facing] | None:
        """What both pads show to a body between them, nearest points; None when it is not between them."""
        axis, pivot = self.axis()
        found = []
        for finger, own in enumerate(self.jaw.fingers):
            gaps = self._world.gaps(own, body, within)
            if gaps is None:
                return None
            for gap, point, normal in zip(gaps.distance, gaps.point, gaps.normal, strict=True):
                lever = point - pivot
                lever = lever - (lever @ axis) * axis
                if normal @ self.closing(finger, axis, lever) < -FACING:
                    found.append(Facing(float(gap), point, float(np.linalg.norm(lever))))
                    break
            if len(found) == finger:
                return None
        return found[0], found[1]

    def near(self, body: int) -> bool:
        """Whether a body touches a finger."""
        return any(self._world.gaps(own, body, 0.0) is not None for own in self.jaw.fingers)

    def driven(self) -> bool:
        """Whether a command moves a finger: limp ones grasp nothing."""
        return any(self._world.joint_driven(joint) for joint in self.jaw.joints)

    def efforts(self) -> tuple[float, float]:
        """Efforts (N m) with which the commands of both fingers would close them; negative ones open."""
        one, two = (
            -opening * self._world.pull(joint, STIFFNESS)
            for joint, opening in zip(self.jaw.joints, self.jaw.opening, strict=True)
        )
        return min(one, EFFORT), min(two, EFFORT)

    def approach(self, faces: tuple[Facing, Facing]) -> None:
        """Let the fingers close gently on what is this far from them."""
        self._slowed = True
        for joint, opening, face in zip(self.jaw.joints, self.jaw.opening, faces, strict=True):
            lever = max(face.lever, LEAST_LEVER)
            speed = (PUSH_SPEED + max(face.gap, 0.0) / (APPROACH * self._world.dt)) / lever
            strength = PUSH * lever if face.gap < 10 * TOUCH else np.inf
            low, high = (-speed, np.inf) if opening > 0.0 else (-np.inf, speed)
            self._world.slow_joint(joint, low, high, strength)

    def approach_thread(self, box: Array) -> None:
        """Let the fingers close gently on a thread that is within their box (2, 3)."""
        lever = 0.5 * self.jaw.reach
        self.approach((Facing(0.0, box[0], lever), Facing(0.0, box[1], lever)))

    def stop(self, positions: tuple[float, float], effort: tuple[float, float]) -> None:
        """Keep both fingers at ``positions``, pressing with ``effort``."""
        self._slowed = True
        for joint, opening, at, tau in zip(self.jaw.joints, self.jaw.opening, positions, effort, strict=True):
            self._world.stop_joint(joint, at, -opening * tau)

    def moved(
        self, positions: tuple[float, float], ways: tuple[float, float], levers: tuple[float, float]
    ) -> tuple[float, float]:
        """The joint positions at which the pads are ``ways`` metres further closed."""
        one, two = (
            at - opening * way / max(lever, LEAST_LEVER)
            for at, opening, way, lever in zip(positions, self.jaw.opening, ways, levers, strict=True)
        )
        return one, two

    def let(self) -> None:
        """Let both fingers follow their commands again."""
        if self._slowed:
            self._slowed = False
            for joint in self.jaw.joints:
                self._world.let_joint(joint)

    def reset(self) -> None:
        """Follow commands, in a world that was put back to its start."""
        self._slowed = False

    def snapshot(self) -> bool:
        """Whether anything but commands acts on the fingers."""
        return self._slowed

    def restore(self, snapshot: bool) -> None:
        """Continue from `snapshot`; the joints belong to the world."""
        self._slowed = snapshot

    def positions(self) -> tuple[float, float]:
        """Where both joints are."""
        one, two = (self._world.joint_position(joint) for joint in self.jaw.joints)
        return one, two
