"""A wound in soft tissue: where its edges are, where stitches go, how well they close it. Metres, world axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.model.scene import Scene
from ligature.model.soft import TissueBody
from ligature.tasks.scenery import MissingBodies
from ligature.tasks.scores import Report

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

CLOSED = 0.5e-3
"""Gap between the lips at a stitch below which it closes the wound, m."""

UPPER = 0.5
"""Cosine between a puncture's normal and the upper side's above which it lies there, not in the wound's wall."""

NEAR = 2.5e-3
"""Distance along the wound within which a puncture belongs to a stitch, m."""


@dataclass(frozen=True)
class Bite:
    """Where a stitch goes in at ``entry`` and out at ``exit``, (3,) each, at ``place`` metres along the wound."""

    place: float
    entry: Array
    exit: Array


@dataclass(frozen=True, eq=False)
class Wound:
    """The upper edges of a wound, which lies along an axis of its body of tissue.

    ``pairs`` (p, 2) are nodes that face each other, the first on the side of smaller coordinates, in the order of
    ``along`` (p,), their places along the wound at rest, from its middle on. ``axes`` (3, 3) has as columns the
    directions across, along and up in the frame of the body.
    """

    tissue: TissueBody
    pairs: Integers
    along: Array
    axes: Array

    @classmethod
    def of(cls, scene: Scene) -> Wound:
        """The wound of the first body of tissue that has one; raises `MissingBodies` when none has."""
        for tissue in scene.tissues:
            grid = tissue.form.grid
            level = grid.lip_axis < 2
            if not level.any():
                continue
            across = int(np.bincount(grid.lip_axis[level]).argmax())
            pairs = grid.lips[grid.lip_axis == across]
            height = grid.site[pairs[:, 0], 2]
            pairs = pairs[height == height.max()]
            place = grid.nodes[pairs[:, 0], 1 - across]
            order = np.argsort(place)
            axes = np.eye(3)[:, [across, 1 - across, 2]]
            return cls(tissue, pairs[order], place[order] - 0.5 * (place.min() + place.max()), axes)
        raise MissingBodies(f"the scene '{scene.name}' has no wound: no body of soft tissue has a slit or a gap")

    def directions(self, state: Any) -> Array:
        """Directions across, along and up as columns, (3, 3), for an element of a state record."""
        return np.asarray(pose7_matrix(state["body_pose"][self.tissue.body])[:3, :3] @ self.axes)

    def edges(self, state: Any, place: float) -> Array:
        """Both edges of the wound at a place along it, (2, 3)."""
        nodes = state["tissue_node"][self.tissue.rows][self.pairs]
        return np.array([[np.interp(place, self.along, side[:, a]) for a in range(3)] for side in nodes.swapaxes(0, 1)])

    def gap(self, state: Any, place: float) -> float:
        """Distance between the edges across the wound at a place along it, negative where they overlap."""
        low, high = self.edges(state, place)
        return float((high - low) @ self.directions(state)[:, 0])

    def bite(self, state: Any, place: float, width: float) -> Bite:
        """A stitch that takes ``width`` metres of each lip, from the side of smaller coordinates to the other."""
        low, high = self.edges(state, place)
        across = self.directions(state)[:, 0]
        return Bite(place, low - width * across, high + width * across)

    def widths(self, state: Any, place: float) -> tuple[float, float] | None:
        """How much of each lip the stitch at a place has taken, by its punctures; None unless both are there."""
        k, across, along, up = self.tissue.index, *self.directions(state).T
        count = int(state["puncture_count"][k])
        points, normals = state["puncture_point"][k, :count], state["puncture_normal"][k, :count]
        low, high = self.edges(state, place)
        found = []
        for edge, side in ((low, -1.0), (high, 1.0)):
            away = points - edge
            here = (np.abs(away @ along) < NEAR) & (normals @ up > UPPER) & (side * (away @ across) > 0.0)
            if not here.any():
                return None
            found.append(float((side * (away @ across))[here].max()))
        return found[0], found[1]


@dataclass(frozen=True)
class ClosureScore:
    """How well stitches closed a wound.

    For each stitch the ``gaps`` that are left, the ``widths`` (s, 2) of both lips that it took, and ``depth``, how far
    the needle's tip went below the surface; ``wanted`` is the width that was planned, ``torn`` the most of a bite that
    the thread has cut through since it was made.
    """

    completion_time: float
    open_gap: float
    gaps: tuple[float, ...]
    widths: tuple[tuple[float, float], ...]
    depth: float
    wanted: float
    torn: float
    why: str = ""

    @property
    def success(self) -> bool:
        """Whether all stitches are there and the wound is closed at each."""
        return not self.why

    @property
    def asymmetry(self) -> float:
        """Largest difference between both sides of a bite."""
        return max((abs(a - b) for a, b in self.widths), default=0.0)

    def report(self) -> Report:
        """The figures by name."""
        return {
            "success": self.success, "completion_time": self.completion_time, "stitches": len(self.gaps),
            "gap": max(self.gaps, default=self.open_gap), "depth": self.depth, "asymmetry": self.asymmetry,
            "torn": self.torn, **({"why": self.why} if self.why else {}),
        }  # fmt: skip

    def lines(self) -> list[str]:
        """One figure a line."""
        lines = (
            [f"not done: {self.why}"] if self.why else [f"{len(self.gaps)} stitches in {self.completion_time:.1f} s"]
        )
        for gap, (a, b) in zip(self.gaps, self.widths, strict=True):
            lines.append(
                f"gap {1e3 * self.open_gap:.2f} → {1e3 * gap:.2f} mm, bites {1e3 * a:.2f} and {1e3 * b:.2f} mm"
            )
        return [*lines, f"{1e3 * self.depth:.1f} mm deep, torn by {1e3 * self.torn:.2f} mm"]


def judge_closure(
    wound: Wound, state: Any, bites: list[Bite], made: list[tuple[float, float] | None], wanted: float, open_gap: float,
    depth: float, time: float,
) -> ClosureScore:  # fmt: skip
    """Judge the stitches ``bites``, of which ``made`` is what they had taken when the needle left them.

    ``state`` is an element of a state record, ``open_gap`` the gap before, ``depth`` the largest of the tip, ``time``
    is in simulated seconds.
    """
    gaps, widths, torn, why = [], [], 0.0, ""
    for number, (bite, before) in enumerate(zip(bites, made, strict=True), 1):
        now = wound.widths(state, bite.place)
        if now is None or before is None:
            why = why or f"stitch {number} does not go through both lips"
            continue
        gaps.append(wound.gap(state, bite.place))
        widths.append(now)
        torn = max(torn, before[0] - now[0], before[1] - now[1])
        if gaps[-1] > CLOSED:
            why = why or f"the wound is open by {1e3 * gaps[-1]:.2f} mm at stitch {number}"
    why = why or ("" if bites else "no stitch was made")
    return ClosureScore(time, open_gap, tuple(gaps), tuple(widths), depth, wanted, torn, why)
