"""How one arm picks a needle up and drives it: where throws can go in a scene, and how to hold it for one of them.

World axes, metres, radians; frames as in `ligature.tasks.throws`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import axis_rotation, frame, inverse, pose7_matrix
from ligature.model.scene import Scene
from ligature.robots.poses import rotation_vector
from ligature.robots.psm import Psm
from ligature.tasks.scenery import MissingBodies, Scenery
from ligature.tasks.throws import JUMP, UP, NeedleArc, Throw, clearances, grasps, margin, margins, reach
from ligature.tasks.wounds import Wound

Array = np.ndarray

BEFORE, BEYOND = 0.4, 0.5
"""Angles of the tip before the entry, where a drive begins, and beyond the exit, where it ends."""

ABOVE = 0.02
"""Metres over the work from which a needle comes down to its entry."""

CHORD, BITE = 0.014, 0.0045
"""Metres between entry and exit in tissue without a wound, and from a wound's lip to either."""


@dataclass(frozen=True)
class Search:
    """Which throws are tried: ``turns`` directions, ``asides`` metres from the middle of tissue without a wound.

    ``places`` are metres along a wound from its middle.
    """

    turns: int
    asides: tuple[float, ...]
    places: tuple[float, ...]


COARSE = Search(12, (0.0,), (0.0, -0.006, 0.006))
"""For a hold that is not known yet: a few hundred are tried for each throw."""

FINE = Search(36, (0.0, -0.006, 0.006), (0.0, -0.002, 0.002, -0.004, 0.004, -0.006, 0.006))
"""For a needle in hand."""

DEPTHS = (0.8, 0.87, 0.915)
"""Where a needle is held to be driven, as shares of its length from the tip."""

UPRIGHT_DEPTHS = (0.3, 0.5)
"""The same to lay it down in another direction."""

PLANNED, HELD = (0.002, 0.0006), 0.0
"""Metres that an instrument is to keep from the tissue before it has the needle, best first, and when it has it.

A needle moves in the jaws while they close; what is planned leaves room for that.
"""

APPROACH = 0.02
"""Metres along itself by which a tool must be able to stand back from where it takes a needle."""

LIES, LAID = 24, 0.0004
"""Directions in which a needle may be laid down, and metres above its resting place at which it is let go."""

STEPS = 10
"""Poses along a throw at which a hold is judged."""


def throws(scene: Scene, state: Any, radius: float, search: Search) -> Iterator[Throw]:
    """Throws that a scene is made for in a state (one element of the record): holes, a wound's lips, or any tissue.

    A needle of ``radius`` makes them; ends that are too far apart for it are left out.
    """
    for entry, exit in _ends(scene, state, search):
        if np.linalg.norm(exit - entry) < 1.95 * radius:
            yield Throw.through(entry, exit, radius, UP)


def _ends(scene: Scene, state: Any, search: Search) -> Iterator[tuple[Array, Array]]:
    scenery = Scenery.of(scene, 0)
    for one, other in zip(scenery.entries, scenery.exits, strict=True):
        yield state["body_pose"][one, :3].copy(), state["body_pose"][other, :3].copy()
    if scenery.entries or not scene.tissues:
        return
    try:
        wound = Wound.of(scene)
    except MissingBodies:
        nodes = state["tissue_node"][scene.tissues[0].rows]
        middle = np.append(0.5 * (nodes.min(axis=0) + nodes.max(axis=0))[:2], nodes[:, 2].max())
        for x, y in product(search.asides, repeat=2):
            for azimuth in np.linspace(0.0, 2.0 * np.pi, search.turns, endpoint=False):
                half = 0.5 * CHORD * np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
                yield middle + [x, y, 0.0] - half, middle + [x, y, 0.0] + half
        return
    for place in search.places:
        lips = [wound.point(state, side, place, BITE) for side in (-1, 1)]
        yield lips[0], lips[1]
        yield lips[1], lips[0]


class Pick(NamedTuple):
    """How to take a needle: the tool's pose (4, 4) in its arc frame, and whether the needle can be driven held so."""

    T_arc_tool: Array
    drives: bool


@dataclass(frozen=True, eq=False)
class Options:
    """Holds that are tried: tool poses ``T`` (n, 4, 4) in the arc frame, the cost of their lean (n,), which drive."""

    T: Array
    cost: Array
    drives: NDArray[np.bool_]

    @classmethod
    def of(cls, arc: NeedleArc) -> Options:
        """For a needle."""
        found = [
            (grasp.tool_in_arc(arc), 0.05 * (abs(grasp.tilt) + abs(grasp.pivot)), share in DEPTHS)
            for below in (False, True)
            for share in (*DEPTHS, *UPRIGHT_DEPTHS)
            for grasp in grasps([share * arc.length], False, below)
        ]
        T, cost, drives = zip(*found, strict=True)
        return cls(np.array(T), np.array(cost), np.array(drives))


@dataclass(frozen=True, eq=False)
class Planner:
    """Plans for one arm with ``kinematics``, and the first needle of a scene, whose centre line is ``arc``."""

    scene: Scene
    kinematics: Psm
    arc: NeedleArc
    _options: Options

    @classmethod
    def of(cls, scene: Scene, kinematics: Psm) -> Planner:
        """For the first needle of ``scene``, which must have one."""
        needle = scene.needles[0]
        arc = NeedleArc.of(needle, scene.bodies[needle.body])
        return cls(scene, kinematics, arc, Options.of(arc))

    def needle(self, state: Any) -> Array:
        """The needle's arc frame (4, 4)."""
        return np.asarray(pose7_matrix(state["body_pose"][self.scene.needles[0].body]) @ self.arc.T_body_arc)

    def point(self, state: Any, share: float) -> Array:
        """A point (3,) of the needle's centre line, ``share`` of its length from the tip."""
        T = self.needle(state)
        return np.asarray(T[:3, :3] @ self.arc.point(share * self.arc.length) + T[:3, 3])

    def way(self, throw: Throw) -> list[Array]:
        """Poses (4, 4) of the needle's arc frame from above the entry to beyond the exit."""
        angles = np.linspace(-BEFORE, throw.towards_exit + BEYOND, STEPS)
        along = [throw.arc_at(float(angle), self.arc) for angle in angles]
        return [frame(np.eye(3), ABOVE * UP) @ along[0], *along]

    def entry(self, throw: Throw) -> Array:
        """Where a throw goes in (3,)."""
        return np.asarray(throw.centre + self.arc.radius * throw.axes[:, 0])

    def exit(self, throw: Throw) -> Array:
        """Where a throw comes out (3,)."""
        a = throw.towards_exit
        return np.asarray(throw.centre + self.arc.radius * (throw.axes @ [math.cos(a), math.sin(a), 0.0]))

    def angle(self, state: Any, throw: Throw) -> float:
        """Where the needle's tip is on the circle of a throw: the angle past the entry, -1 to 2 pi - 1."""
        local = throw.axes.T @ (self.point(state, 0.0) - throw.centre)
        return (math.atan2(local[1], local[0]) + 1.0) % (2.0 * np.pi) - 1.0

    def pick(self, state: Any, T_world_base: Array) -> Pick | None:
        """How the tool can take the needle where it is; None where it cannot.

        At best it can drive the needle then; else it can lay it down in another direction, from which it can.
        """
        now, options = self.needle(state), self._options
        least = self._pickable(now, T_world_base)
        drives = self._drivable(state, T_world_base, least > 0.0)
        rating = np.minimum(least, drives) - options.cost
        if rating.max() > -np.inf:
            return Pick(options.T[int(rating.argmax())], True)
        drives = self._drivable(state, T_world_base, np.ones(len(options.T), bool))
        best, found = -np.inf, None
        for lie in self._lies(now):
            after = float((np.minimum(self._pickable(lie, T_world_base), drives) - options.cost).max())
            if after > best:
                rating = np.minimum(least, self._laid(lie, options.T, T_world_base)) - options.cost
                rated = min(after, float(rating.max()))
                if rated > best:
                    best, found = rated, options.T[int(rating.argmax())]
        if found is None and least.max() > 0.0:
            found = options.T[int((np.where(least > 0.0, least, -np.inf) - options.cost).argmax())]
        return None if found is None else Pick(found, False)

    def lie(self, state: Any, T_world_base: Array, T_arc_tool: Array, rest: Array) -> Array | None:
        """Where a tool that holds the needle so can lay it down to pick it up better; None for nowhere.

        A pose (4, 4) of its arc frame, turned about the vertical from ``rest`` (4, 4), in which it lay before.
        """
        options = self._options
        drives = self._drivable(state, T_world_base, np.ones(len(options.T), bool))
        best, found = -np.inf, None
        for lie in self._lies(rest):
            laid = float(self._laid(lie, T_arc_tool[None], T_world_base)[0])
            if laid > best:
                after = float((np.minimum(self._pickable(lie, T_world_base), drives) - options.cost).max())
                if min(laid, after) > best:
                    best, found = min(laid, after), lie
        return found

    def _lies(self, rest: Array) -> Iterator[Array]:
        """Poses (4, 4) of the arc frame of a needle that lay at ``rest`` (4, 4), rotated about the vertical."""
        for angle in np.linspace(0.0, 2.0 * np.pi, LIES, endpoint=False)[1:]:
            turn = axis_rotation(UP, float(angle))
            yield frame(turn @ rest[:3, :3], rest[:3, 3] + LAID * UP)

    def _pickable(self, now: Array, T_world_base: Array) -> Array:
        """Least distance (n,) of joints from limits while the needle is grasped and lifted; -inf where that fails."""
        here = now @ self._options.T
        behind, over = here.copy(), here.copy()
        behind[:, :3, 3] -= APPROACH * here[:, :3, 2]
        over[:, 2, 3] += 1.5 * ABOVE
        return self._margins(T_world_base, np.stack([behind, here, over], axis=1), float(now[2, 3]), 0.0)

    def _laid(self, lie: Array, tools: Array, T_world_base: Array) -> Array:
        """The same (n,) while ``tools`` (n, 4, 4) in the arc frame lay the needle down at ``lie``."""
        here = lie @ tools
        over = here.copy()
        over[:, 2, 3] += 1.5 * ABOVE
        return self._margins(T_world_base, np.stack([over, here], axis=1), float(lie[2, 3]), 0.0)

    def _drivable(self, state: Any, T_world_base: Array, tried: NDArray[np.bool_]) -> Array:
        """The same (n,) for the best throw of a scene, for each grasp that is ``tried`` (n,) and allows driving."""
        found, tried = np.full(len(tried), -np.inf), tried & self._options.drives
        rows = np.flatnonzero(tried)
        for least in PLANNED:
            for throw in throws(self.scene, state, self.arc.radius, COARSE) if len(rows) else ():
                way = np.array(self.way(throw))[None] @ self._options.T[rows, None]
                rated = self._margins(T_world_base, way, float(self.entry(throw)[2]), least)
                found[rows] = np.maximum(found[rows], rated)
            if found.max(initial=-np.inf) > -np.inf:
                break
        return found

    def _margins(self, T_world_base: Array, ways: Array, surface: float, least: float) -> Array:
        """How far (n,) joints stay from their limits along ``ways`` (n, k, 4, 4) of the tool; -inf where one fails.

        It fails where a pose cannot be reached, a joint would swing, or the instrument comes nearer than ``least`` to
        the level ``surface``.
        """
        path = self.kinematics.inverse(inverse(T_world_base) @ ways)
        found = np.full(len(ways), -np.inf)
        good = path.ok.all(axis=1)
        good[good] = np.abs(np.diff(path.q[good], axis=1)).max(axis=(1, 2), initial=0.0) <= JUMP
        good[good] = clearances(self.kinematics, path.q[good], T_world_base, UP) - surface >= least
        found[good] = margins(self.kinematics, path.q[good])
        return found

    def straight(self, T_world_base: Array, q: Array, begin: Array, end: Array) -> bool:
        """Whether a tip goes straight from ``begin``, where joints are at ``q`` (6,), to ``end``, both (4, 4).

        It must come to where joints are least turned: else the motion after it would meet their limits.
        """
        way, turn = end[:3, 3] - begin[:3, 3], rotation_vector(end[:3, :3] @ begin[:3, :3].T)
        angle = float(np.linalg.norm(turn))
        for share in np.linspace(0.0, 1.0, STEPS)[1:]:
            R = axis_rotation(turn / angle, float(share) * angle) if angle > 0.0 else np.eye(3)
            T = frame(R @ begin[:3, :3], begin[:3, 3] + share * way)
            found = self.kinematics.inverse(inverse(T_world_base) @ T, q)
            if not found.ok or np.abs(found.q - q).max() > JUMP:
                return False
            q = found.q
        wanted = self.joints(T_world_base, end)
        return wanted is not None and bool(np.abs(wanted - q).max() < 0.1)

    def joints(self, T_world_base: Array, T: Array) -> Array | None:
        """Joint values (6,) at a pose (4, 4) of the tip, as little turned as can be; None where it is out of reach."""
        found = self.kinematics.inverse(inverse(T_world_base) @ T)
        return np.asarray(found.q) if found.ok else None

    def throw(self, state: Any, T_world_base: Array, T_arc_tool: Array) -> Throw | None:
        """The throw that an arm reaches best which holds the needle so; None where it reaches none."""
        best, rating = None, -np.inf
        for throw in throws(self.scene, state, self.arc.radius, FINE):
            q = reach(self.kinematics, T_world_base, [T @ T_arc_tool for T in self.way(throw)], self.entry(throw), HELD)
            if q is not None and (left := margin(self.kinematics, q)) > rating:
                best, rating = throw, left
        return best
