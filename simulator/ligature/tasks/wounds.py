"""A wound in soft tissue: where stitches are to go, how far its lips are apart, where a needle went through them.

World axes, metres. Places in the tissue are material ones: coordinates at rest, which move with it. A wound is a
slit of a body of tissue that reaches its upper side, +z. *Across* is the shorter edge of the slit, *along* the longer
one; the near lip is the one of smaller coordinates across.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.model.scene import Scene
from ligature.model.soft import TissueBody
from ligature.tasks.scenery import MissingBodies

Array = NDArray[np.float64]

INSIDE = 1e-6
"""Metres by which places on a face lie in the tissue, so that no other lip carries them."""

FINE, ASIDE, OUT = 1e-4, 0.003, 0.012
"""Metres between the places among which that of a puncture is found, and how far they go along and across."""

ON = 1e-3
"""Distance in metres from such a place at which a puncture counts as one of this lip."""

CLOSED = 0.5e-3
"""Metres that a closed wound gapes at most."""

UP = 2
"""Axis of the tissue's frame that points out of the wound."""


@dataclass(frozen=True)
class Stitch:
    """Where a stitch passes, in metres at rest, near lip first.

    ``widths`` of both lips that it takes on their upper sides, ``depths`` below those at which it passes the walls,
    ``places`` along the wound at which it goes in and out.
    """

    widths: tuple[float, float]
    depths: tuple[float, float]
    places: tuple[float, float]

    @property
    def figures(self) -> Array:
        """All of them, (6,)."""
        return np.array([*self.widths, *self.depths, *self.places])


@dataclass(frozen=True, eq=False)
class Wound:
    """One wound of a scene.

    Parameters
    ----------
    tissue
        The body of tissue.
    low, high
        Corners (3,) of the slit at rest in the body's frame.
    across, along
        Axes of that frame.
    """

    tissue: TissueBody
    low: Array
    high: Array
    across: int
    along: int

    @classmethod
    def of(cls, scene: Scene) -> Wound:
        """The first wound of a scene; raises `MissingBodies` where there is none."""
        for tissue in scene.tissues:
            top = float(tissue.form.grid.nodes[:, UP].max())
            for low, high in tissue.form.slits:
                if high[UP] >= top - INSIDE > low[UP]:
                    across, along = (0, 1) if high[0] - low[0] < high[1] - low[1] else (1, 0)
                    return cls(tissue, np.array(low), np.minimum(high, [np.inf, np.inf, top]), across, along)
        raise MissingBodies(f"the scene '{scene.name}' has no wound: no slit of soft tissue reaches its upper side")

    @property
    def length(self) -> float:
        """Along the wound, at rest."""
        return float(self.high[self.along] - self.low[self.along])

    def axes(self, state: Any) -> Array:
        """Directions across, along and up in the world, the columns of a matrix (3, 3)."""
        R = pose7_matrix(state["body_pose"][self.tissue.body])[:3, :3]
        return np.asarray(R[:, [self.across, self.along, UP]])

    def point(self, state: Any, side: int, place: float, width: float, depth: float = 0.0) -> Array:
        """A point (3,) of a lip: ``side`` -1 is the near one, 1 the other.

        Parameters
        ----------
        state
            One element of a state record.
        side
            Which lip.
        place
            Along the wound, from its middle.
        width, depth
            From the lip's edge, outwards and downwards.
        """
        return np.asarray(self._positions(state, side, np.array([[place, width, depth]]))[0])

    def gap(self, state: Any, place: float, depth: float = 0.0) -> float:
        """How far the lips are apart across the wound at a place along it; negative where they overlap."""
        near, far = (self.point(state, side, place, 0.0, depth) for side in (-1, 1))
        return float((far - near) @ self.axes(state)[:, 0])

    def stitch(self, state: Any, place: float) -> Stitch | None:
        """The stitch near a place along the wound, by its four punctures; None when one is missing."""
        k = self.tissue.index
        punctures = state["puncture_point"][k][: state["puncture_count"][k]]
        found = [self._nearest(punctures, state, side, place, wall) for wall in (False, True) for side in (-1, 1)]
        if any(one is None for one in found):
            return None
        near, far, near_wall, far_wall = (one for one in found if one is not None)
        return Stitch((near[1], far[1]), (near_wall[1], far_wall[1]), (near[0], far[0]))

    def _nearest(
        self, punctures: Array, state: Any, side: int, middle: float, wall: bool
    ) -> tuple[float, float] | None:
        """Place along the wound, and distance from the lip's edge, of the puncture in a face of a lip, or None."""
        most = min(OUT, float(self.high[UP] - self.low[UP])) if wall else OUT
        along, across = np.arange(middle - ASIDE, middle + ASIDE, FINE), np.arange(FINE, most, FINE)
        place, away = (a.reshape(-1) for a in np.meshgrid(along, across, indexing="ij"))
        zero = np.zeros_like(away)
        world = self._positions(state, side, np.column_stack([place, zero, away] if wall else [place, away, zero]))
        best, found = ON, None
        for puncture in punctures:
            distance = np.linalg.norm(world - puncture, axis=1)
            k = int(distance.argmin())
            if distance[k] < best:
                best, found = float(distance[k]), (float(place[k]), float(away[k]))
        return found

    def _positions(self, state: Any, side: int, local: Array) -> Array:
        """Current positions of points (n, 3) of a lip, given at rest as place along the wound, width and depth."""
        points = np.empty((len(local), 3))
        edge = self.low[self.across] if side < 0 else self.high[self.across]
        points[:, self.across] = edge + side * (local[:, 1] + INSIDE)
        points[:, self.along] = 0.5 * (self.low[self.along] + self.high[self.along]) + local[:, 0]
        points[:, UP] = self.high[UP] - INSIDE - local[:, 2]
        return self.tissue.form.embed(points).positions(np.asarray(state["tissue_node"][self.tissue.rows]))


@dataclass(frozen=True)
class ClosureScore:
    """How well a wound was closed; metres, newtons, seconds.

    Parameters
    ----------
    planned
        How many stitches there were to be, and the width of each lip that they were to take.
    stitches
        Those that go through both lips, as they were made.
    open_gap, gaps
        Width of the wound at first, and its widths at the planned stitches in the end.
    tear
        How far a puncture has moved in the tissue since it was made, the farthest.
    force, tension
        Largest force at one point of the tissue, and tension of the thread.
    time
        Simulated, until the end.
    """

    planned: tuple[int, float]
    stitches: tuple[Stitch, ...]
    open_gap: float
    gaps: tuple[float, ...]
    tear: float
    force: float
    tension: float
    time: float

    @property
    def success(self) -> bool:
        """Whether all stitches go through both lips, and the wound is closed at each."""
        return len(self.stitches) == self.planned[0] and max(self.gaps, default=np.inf) < CLOSED

    @property
    def asymmetry(self) -> float:
        """Largest difference between what a stitch takes of one lip and of the other, in width."""
        return max((abs(s.widths[0] - s.widths[1]) for s in self.stitches), default=0.0)

    @property
    def step(self) -> float:
        """Largest difference between the depths at which a stitch passes both walls: by it lips stand unevenly."""
        return max((abs(s.depths[0] - s.depths[1]) for s in self.stitches), default=0.0)

    def report(self) -> dict[str, float | int | bool]:
        """The figures by name."""
        return {
            "success": self.success, "stitches": len(self.stitches), "planned": self.planned[0],
            "gap": max(self.gaps, default=self.open_gap), "open_gap": self.open_gap, "asymmetry": self.asymmetry,
            "step": self.step, "depth": max((max(s.depths) for s in self.stitches), default=0.0), "tear": self.tear,
            "tissue_force": self.force, "thread_tension": self.tension, "completion_time": self.time,
        }  # fmt: skip

    def lines(self) -> list[str]:
        """One figure a line."""
        made = [
            f"stitch {n}: {1e3 * s.widths[0]:.1f} and {1e3 * s.widths[1]:.1f} mm of the lips, "
            f"{1e3 * s.depths[0]:.1f} and {1e3 * s.depths[1]:.1f} mm deep"
            for n, s in enumerate(self.stitches, 1)
        ]
        return [
            f"{len(self.stitches)} of {self.planned[0]} stitches through both lips in {self.time:.1f} s",
            *made,
            f"gap {1e3 * self.open_gap:.2f} mm at first, {1e3 * max(self.gaps):.2f} mm at the end",
            f"tissue torn by {1e3 * self.tear:.1f} mm, largest force at one point {self.force:.2f} N",
        ]


def torn(before: Sequence[Stitch | None], after: Sequence[Stitch | None]) -> float:
    """How far punctures have moved in the tissue, the farthest; metres. A stitch that is gone counts as `OUT`."""
    most = 0.0
    for one, two in zip(before, after, strict=True):
        if one is not None:
            most = max(most, OUT if two is None else float(np.abs(one.figures - two.figures).max()))
    return most
