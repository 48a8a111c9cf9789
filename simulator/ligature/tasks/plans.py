"""How one arm picks a needle up and drives it: where throws can go in a scene, and how to hold it for one of them.

World axes, metres, radians; frames as in `ligature.tasks.throws`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from ligature.model.frames import frame, pose7_matrix
from ligature.model.scene import Scene
from ligature.robots.psm import Psm
from ligature.tasks.scenery import MissingBodies, Scenery
from ligature.tasks.throws import UP, NeedleArc, NeedleGrasp, Throw, margin, rated_grasp, reach
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
"""The same where it can only be picked up."""

PLANNED, HELD = (0.002, 0.0006), 0.0
"""Metres that an instrument is to keep from the tissue before it has the needle, best first, and when it has it.

A needle moves in the jaws while they close; what is planned leaves room for that.
"""

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
                half = 0.5 * CHORD * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
                yield middle + [x, y, 0.0] - half, middle + [x, y, 0.0] + half
        return
    for place in search.places:
        lips = [wound.point(state, side, place, BITE) for side in (-1, 1)]
        yield lips[0], lips[1]
        yield lips[1], lips[0]


@dataclass(frozen=True, eq=False)
class Planner:
    """Plans for one arm with ``kinematics``, and the first needle of a scene, whose centre line is ``arc``."""

    scene: Scene
    kinematics: Psm
    arc: NeedleArc

    @classmethod
    def of(cls, scene: Scene, kinematics: Psm) -> Planner:
        """For the first needle of ``scene``, which must have one."""
        needle = scene.needles[0]
        return cls(scene, kinematics, NeedleArc.of(needle, scene.bodies[needle.body]))

    def needle(self, state: Any) -> Array:
        """The needle's arc frame (4, 4)."""
        return np.asarray(pose7_matrix(state["body_pose"][self.scene.needles[0].body]) @ self.arc.T_body_arc)

    def point(self, state: Any, share: float) -> Array:
        """A point (3,) of the needle's centre line, ``share`` of its length from the tip."""
        angle = self.arc.angle(share * self.arc.length)
        local = self.arc.radius * np.array([np.cos(angle), np.sin(angle), 0.0])
        T = self.needle(state)
        return np.asarray(T[:3, :3] @ local + T[:3, 3])

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
        return np.asarray(throw.centre + self.arc.radius * (throw.axes @ [np.cos(a), np.sin(a), 0.0]))

    def angle(self, state: Any, throw: Throw) -> float:
        """Where the needle's tip is on the circle of a throw: the angle past the entry, -1 to 2 pi - 1."""
        local = throw.axes.T @ (self.point(state, 0.0) - throw.centre)
        return float((np.arctan2(local[1], local[0]) + 1.0) % (2.0 * np.pi) - 1.0)

    def pick(self, state: Any, T_world_base: Array) -> Array | None:
        """Pose (4, 4) of the tool in the arc frame that can take the needle where it is, and drive it if any can."""
        now = self.needle(state)
        best: NeedleGrasp | None = None
        for least in PLANNED:
            best = best or self._grasp(state, T_world_base, least)
        if best is None:
            raised = frame(np.eye(3), 1.5 * ABOVE * UP) @ now
            depths = [share * self.arc.length for share in UPRIGHT_DEPTHS]
            low = now[:3, 3] - 0.004 * UP
            found = rated_grasp(self.arc, depths, self.kinematics, T_world_base, [raised], now, low, upright=True)
            best = None if found is None else found[0]
        return None if best is None else best.tool_in_arc(self.arc)

    def _grasp(self, state: Any, T_world_base: Array, least: float) -> NeedleGrasp | None:
        """The grasp that can drive the needle, of all throws the one farthest from the joints' limits."""
        best, rating, now = None, -np.inf, self.needle(state)
        depths = [share * self.arc.length for share in DEPTHS]
        for throw in throws(self.scene, state, self.arc.radius, COARSE):
            found = rated_grasp(
                self.arc, depths, self.kinematics, T_world_base, self.way(throw), now, self.entry(throw), least=least
            )
            if found is not None and found[1] > rating:
                best, rating = found
        return best

    def throw(self, state: Any, T_world_base: Array, T_arc_tool: Array) -> Throw | None:
        """The throw that an arm reaches best which holds the needle so; None where it reaches none."""
        best, rating = None, -np.inf
        for throw in throws(self.scene, state, self.arc.radius, FINE):
            q = reach(self.kinematics, T_world_base, [T @ T_arc_tool for T in self.way(throw)], self.entry(throw), HELD)
            if q is not None and (left := margin(self.kinematics, q)) > rating:
                best, rating = throw, left
        return best
