"""Geometry of a throw: how a needle turns through two holes, and how a tool must hold it to reach all of that.

World axes, metres, radians. Frames: *arc*, at the centre of the needle's circle with the plane's normal as z, so that
the needle runs from base to tip with growing angle about z; *tool*, the tip frame of a PSM: z along the instrument, x
along the axis of its jaw.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ligature.model.frames import axis_rotation, frame, inverse, pose7_matrix
from ligature.model.piercing import Needle
from ligature.model.scene import Body
from ligature.robots.psm import Psm

Array = np.ndarray

PAD = 0.0094
"""Metres from the control point of a tool to where it holds: near the end of its fingers, as the needle lies flat."""

SHAFT_RADIUS, WRIST_RADIUS = 0.00425, 0.0026
SHAFT_END, PALM, JAW = 3, 4, 5
"""Radii of the instrument in metres, and which link frames of a PSM are at the end of its shaft."""

LEAST_CLEARANCE = 0.0006
"""Metres that an instrument keeps from the tissue while it drives."""

BEHIND = 0.015
"""Metres along itself by which a tool must be able to stand back from where it grasps."""

JUMP = 1.0
"""Radians between two poses of a way beyond which a joint would swing round."""

UP = np.array([0.0, 0.0, 1.0])

TILTS = np.radians(np.arange(-60, 61, 10))
"""Angles by which a tool may lean about the needle's tangent."""

PIVOTS = np.radians(np.arange(-40, 41, 10))
"""Angles by which it may turn about the needle's radius."""


@dataclass(frozen=True)
class NeedleArc:
    """A needle as a part of a circle: ``T_body_arc`` (4, 4), ``radius``, and ``begin`` < ``end`` from base to tip."""

    T_body_arc: Array
    radius: float
    begin: float
    end: float

    @classmethod
    def of(cls, needle: Needle, body: Body) -> NeedleArc:
        """The arc of a scene's needle."""
        arc = needle.arc
        R = np.column_stack([arc.x, arc.y, np.cross(arc.x, arc.y)])
        return cls(body.T_body_inertial @ frame(R, arc.centre), arc.radius, arc.begin, arc.end)

    @property
    def length(self) -> float:
        """Length from base to tip."""
        return self.radius * (self.end - self.begin)

    @property
    def tip(self) -> Array:
        """The tip (3,) in the arc frame."""
        return self.point(0.0)

    def angle(self, depth: float) -> float:
        """The angle at which ``depth`` metres are left to the tip."""
        return self.end - depth / self.radius

    def point(self, depth: float) -> Array:
        """The point (3,) of the centre line, in the arc frame, at which ``depth`` metres are left to the tip."""
        angle = self.angle(depth)
        return self.radius * np.array([math.cos(angle), math.sin(angle), 0.0])


@dataclass(frozen=True)
class NeedleGrasp:
    """How a tool holds a needle: ``depth`` metres from its tip; ``tilt``, ``pivot`` and ``flipped`` describe how.

    It comes along the normal of the needle's plane, or against it: from ``below``.
    """

    depth: float
    tilt: float
    pivot: float
    flipped: bool
    below: bool = False

    def tool_in_arc(self, arc: NeedleArc) -> Array:
        """Pose (4, 4) of the tool in the arc frame."""
        a = arc.angle(self.depth)
        c, s = math.cos(a), math.sin(a)
        out, along, normal = np.array([c, s, 0.0]), np.array([-s, c, 0.0]), [0.0, 0.0, 1.0]
        R = np.column_stack([along, np.cross(normal, along), normal])
        R = R * [1.0, -1.0, -1.0] if self.below else R
        R = axis_rotation(out, self.pivot) @ axis_rotation(along, self.tilt) @ R
        if self.flipped:
            R = R @ axis_rotation((0.0, 0.0, 1.0), np.pi)
        return frame(R, arc.radius * out - PAD * R[:, 2])


@dataclass(frozen=True)
class Throw:
    """The circle on which a needle goes in at ``entry`` and out at ``exit``, both (3,), under the surface ``up``."""

    centre: Array
    normal: Array
    towards_entry: float
    towards_exit: float
    axes: Array

    @classmethod
    def through(cls, entry: Array, exit: Array, radius: float, up: Array) -> Throw:
        """The circle of ``radius`` through both holes, its centre above them.

        Raises ValueError when they are further apart than the needle is wide.
        """
        chord = exit - entry
        length = float(np.linalg.norm(chord))
        if length >= 2.0 * radius:
            raise ValueError(
                f"holes {1e3 * length:.1f} mm apart are too far for a needle of radius {1e3 * radius:.1f} mm"
            )
        forward = chord / length
        up = up - (up @ forward) * forward
        up = up / np.linalg.norm(up)
        normal = np.cross(up, forward)
        normal = -normal if np.cross(normal, -up) @ forward < 0 else normal
        centre = (entry + exit) / 2 + np.sqrt(radius**2 - (length / 2) ** 2) * up
        x = (entry - centre) / radius
        axes = np.column_stack([x, np.cross(normal, x), normal])
        way = axes.T @ (exit - centre)
        return cls(centre, normal, 0.0, math.atan2(way[1], way[0]) % (2 * np.pi), axes)

    def arc_at(self, tip: float, arc: NeedleArc) -> Array:
        """Pose (4, 4) of the arc frame with the tip at the angle ``tip`` past the entry."""
        return frame(self.axes @ axis_rotation((0.0, 0.0, 1.0), tip - arc.end), self.centre)


def grasps(depths: Sequence[float], upright: bool, below: bool = False) -> Iterator[NeedleGrasp]:
    """All ways to hold a needle that are worth a try; ``upright`` ones stand on its plane, to pick it up.

    They come along the normal of that plane, or from ``below`` it.
    """
    for depth in depths:
        for tilt in (0.0,) if upright else TILTS:
            for pivot in (0.0,) if upright else PIVOTS:
                for flipped in (False, True):
                    yield NeedleGrasp(depth, float(tilt), float(pivot), flipped, below)


def best_grasp(
    arc: NeedleArc,
    depths: Sequence[float],
    kinematics: Psm,
    T_world_base: Array,
    way: Sequence[Array],
    now: Array,
    surface: Array,
    upright: bool = False,
    up: Array = UP,
) -> NeedleGrasp | None:
    """The grasp farthest from the limits of a tool's joints of those that reach ``way`` (k, 4, 4) without a swing.

    It must also reach the needle where it is ``now`` (4, 4), from 15 mm behind, and on the way keep clear of the
    tissue, whose surface goes through the point ``surface`` (3,) and faces ``up`` (3,).
    """
    T_base = inverse(T_world_base)
    best: tuple[NeedleGrasp, float] | None = None
    for grasp in grasps(depths, upright):
        T_arc_tool = grasp.tool_in_arc(arc)
        q = reach(kinematics, T_world_base, [T @ T_arc_tool for T in way], surface, up=up)
        if q is None:
            continue
        here = now @ T_arc_tool
        behind = drawn_back(here, BEHIND)
        start = kinematics.inverse(np.array([T_base @ here, T_base @ behind]))
        if not start.ok.all():
            continue
        left = margin(kinematics, np.vstack([q, start.q])) - 0.05 * abs(grasp.tilt) - 0.05 * abs(grasp.pivot)
        if best is None or left > best[1]:
            best = grasp, left
    return None if best is None else best[0]


def drawn_back(T: Array, way: float) -> Array:
    """The pose ``T`` (4, 4) of a tool moved back along itself by ``way`` metres."""
    return frame(np.eye(3), -way * T[:3, 2]) @ T


def reach(
    kinematics: Psm, T_world_base: Array, way: Sequence[Array], surface: Array, least: float = LEAST_CLEARANCE,
    up: Array = UP,
) -> Array | None:  # fmt: skip
    """Joint values (k, 6) along ``way`` (k, 4, 4) of the tool, without a swing and clear of the tissue; else None."""
    T_base = inverse(T_world_base)
    path = kinematics.inverse(np.array([T_base @ T for T in way]))
    if not path.ok.all() or np.abs(np.diff(path.q, axis=0)).max(initial=0.0) > JUMP:
        return None
    height = clearance(kinematics, path.q, T_world_base, up) - float(surface @ up)
    return None if height < least else np.asarray(path.q)


def margin(kinematics: Psm, q: Array) -> float:
    """How far joint values (k, 6) stay from their limits, as a share of the joints' travel: the least of all."""
    return float(margins(kinematics, q))


def margins(kinematics: Psm, q: Array) -> Array:
    """The same of many ways, (..., k, 6) to (...)."""
    inside = np.minimum(q - kinematics.lower, kinematics.upper - q) / (kinematics.upper - kinematics.lower)
    return np.asarray(inside.min(axis=(-2, -1)))


def clearance(kinematics: Psm, q: Array, T_world_base: Array, up: Array) -> float:
    """How high over the plane through the world's origin the lowest part of an instrument's end stays (k, 6).

    The end of the shaft is a disc, the wrist a ball about its yaw axis.
    """
    return float(clearances(kinematics, q, T_world_base, up))


def clearances(kinematics: Psm, q: Array, T_world_base: Array, up: Array) -> Array:
    """The same of many ways, (..., k, 6) to (...)."""
    frames = T_world_base @ kinematics.frames(q)
    palm, jaw = frames[..., PALM, :3, 3] @ up, frames[..., JAW, :3, 3] @ up
    along = frames[..., SHAFT_END, :3, 2] @ up
    disc = palm - SHAFT_RADIUS * np.sqrt(np.maximum(1.0 - along**2, 0.0))
    return np.asarray(np.minimum(disc, jaw - WRIST_RADIUS).min(axis=-1))


def pose_of(pose7: Array) -> Array:
    """A pose (7,) as a matrix."""
    return pose7_matrix(np.asarray(pose7))
