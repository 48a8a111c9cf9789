"""How well a task was done: the challenge's three tasks, with what its reports state. Metres, seconds.

Success and fields are those of the challenge's evaluation; `lines` are for people, `report` is for programs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.tasks.passages import Passage
from ligature.tasks.scenery import Scenery

Array = NDArray[np.float64]
Report = dict[str, float | int | bool | str]

RECOMMENDED_AXIAL = 0.005
"""How far the tip should have come out of the exit at the end."""

SUTURE_PAIRS = 4


@dataclass(frozen=True)
class EstimationScore:
    """Task 1: distances between reported and true points of the needle."""

    completion_time: float
    E_base: float
    E_mid: float
    E_tip: float

    @property
    def success(self) -> bool:
        """A report that arrives counts."""
        return True

    @property
    def total(self) -> float:
        """Sum of the three."""
        return self.E_base + self.E_mid + self.E_tip

    def report(self) -> Report:
        """The challenge's fields."""
        return {
            "success": True, "completion_time": self.completion_time, "E_base": self.E_base, "E_mid": self.E_mid,
            "E_tip": self.E_tip, "total": self.total,
        }  # fmt: skip

    def lines(self) -> list[str]:
        """One figure a line."""
        errors = zip(("base", "middle", "tip"), (self.E_base, self.E_mid, self.E_tip), strict=True)
        return [f"needle {name} off by {1e3 * error:.2f} mm" for name, error in errors]


def judge_estimate(
    scenery: Scenery, body_pose: Array, T_world_camera: Array, T_camera_needle: Array, time: float
) -> EstimationScore:
    """Judge a reported pose of the needle's body.

    Parameters
    ----------
    scenery
        Needle and holes of the scene.
    body_pose
        Where the bodies are, (bodies, 7), world axes.
    T_world_camera
        The camera's body in the world, (4, 4).
    T_camera_needle
        The reported pose of the needle's body in the camera's frame, (4, 4).
    time
        Simulated seconds until the report.

    Returns
    -------
    EstimationScore
        Errors of base, middle and tip of the needle in metres.
    """
    T = T_world_camera @ T_camera_needle
    reported = scenery.points @ T[:3, :3].T + T[:3, 3]
    errors = np.linalg.norm(reported - scenery.needle_points(body_pose), axis=1)
    return EstimationScore(time, *(float(error) for error in errors))


@dataclass(frozen=True)
class InsertionScore:
    """Task 2: the needle went in and out of one pair of holes."""

    success: bool
    completion_time: float
    pair: int
    axial: float
    entry: Passage | None
    exit: Passage | None
    why: str = ""

    def report(self) -> Report:
        """The challenge's fields; laterals are x and y in the hole's frame. Without success only the reason."""
        if not self.success:
            return {"success": False, "completion_time": self.completion_time, "why": self.why}
        assert self.entry is not None and self.exit is not None
        begun = {"success": True, "completion_time": self.completion_time, "hole": self.pair, "axial": self.axial}
        return {**begun, **_laterals("entry", self.entry), **_laterals("exit", self.exit)}

    def lines(self) -> list[str]:
        """One figure a line."""
        if not self.success:
            return [f"not done: {self.why}"]
        assert self.entry is not None and self.exit is not None
        return [
            f"pair {self.pair} in {self.completion_time:.1f} s",
            f"tip {1e3 * self.axial:.1f} mm beyond the exit (recommended {1e3 * RECOMMENDED_AXIAL:.0f} mm)",
            f"entry missed by {1e3 * self.entry.miss:.2f} mm, exit by {1e3 * self.exit.miss:.2f} mm",
        ]


def _laterals(name: str, passage: Passage) -> Report:
    """How far beside the hole's middle the tip passed: distance, largest component, and vector."""
    x, y = passage.lateral
    return {
        f"{name}_lateral": passage.miss, f"{name}_lateral_max": max(abs(x), abs(y)), f"{name}_lateral_x": x,
        f"{name}_lateral_y": y,
    }  # fmt: skip


def judge_insertion(scenery: Scenery, body_pose: Array, passages: Sequence[Passage], time: float) -> InsertionScore:
    """Judge the newest insertion, the last two of ``passages``.

    ``scenery`` names needle and holes, ``body_pose`` (bodies, 7) is where the bodies are, ``time`` is in simulated
    seconds.
    """
    pair, is_exit, axial = _closest(scenery, body_pose)
    failed = InsertionScore(False, time, pair, axial, None, None)
    if not is_exit:
        return _because(failed, "the hole closest to the tip is not an exit")
    if len(passages) < 2:
        return _because(failed, f"the tip went through {len(passages)} holes; two are needed")
    newest, before = passages[-1], passages[-2]
    if not (newest.exit and newest.pair == pair):
        return _because(failed, f"the last hole was not exit {pair}")
    if before.exit or before.pair != pair:
        return _because(failed, f"the hole before was not entry {pair}")
    return InsertionScore(True, time, pair, axial, before, newest)


def _because(score: InsertionScore, why: str) -> InsertionScore:
    return InsertionScore(False, score.completion_time, score.pair, score.axial, None, None, why)


def _closest(scenery: Scenery, body_pose: Array) -> tuple[int, bool, float]:
    """Pair of the hole closest to the tip, whether it is an exit, and how far the tip is beyond it along its z."""
    tip = scenery.needle_points(body_pose)[2]
    pairs, holes = len(scenery.entries), [*scenery.entries, *scenery.exits]
    nearest = int(((body_pose[holes, :3] - tip) ** 2).sum(axis=1).argmin())
    T = pose7_matrix(body_pose[holes[nearest]])
    return nearest % pairs + 1, nearest >= pairs, float((T[:3, :3].T @ (tip - T[:3, 3]))[2])


@dataclass(frozen=True)
class SutureScore:
    """Task 3: the needle went through several pairs of holes, one after the other."""

    success: bool
    completion_time: float
    axial: float
    misses: tuple[float, ...]
    why: str = ""

    def report(self) -> Report:
        """The challenge's fields. Without success only the reason."""
        if not self.success:
            return {"success": False, "completion_time": self.completion_time, "why": self.why}
        begun: Report = {"success": True, "completion_time": self.completion_time, "axial": self.axial}
        sides = [f"{side}{pair}" for pair in range(1, len(self.misses) // 2 + 1) for side in ("entry", "exit")]
        return begun | {f"{side}_lateral": miss for side, miss in zip(sides, self.misses, strict=True)}

    def lines(self) -> list[str]:
        """One figure a line."""
        if not self.success:
            return [f"not done: {self.why}"]
        worst, throws = 1e3 * max(self.misses), len(self.misses) // 2
        return [
            f"{throws} throw{'s' * (throws != 1)} in {self.completion_time:.1f} s",
            f"holes missed by {1e3 * float(np.mean(self.misses)):.2f} mm on average, {worst:.2f} mm at worst",
        ]


def passed_in_order(passages: Sequence[Passage], wanted: Sequence[tuple[int, bool]]) -> int:
    """How many of the ``wanted`` holes (pair, is an exit) the tip has passed, one after the other, last of all."""
    got = [(passage.pair, passage.exit) for passage in passages]
    return next(n for n in range(len(wanted), -1, -1) if n <= len(got) and got[len(got) - n :] == list(wanted[:n]))


def holes_of(pairs: Sequence[int]) -> list[tuple[int, bool]]:
    """Holes of throws through ``pairs`` in their order: pair, and whether it is the exit."""
    return [(pair, is_exit) for pair in pairs for is_exit in (False, True)]


def judge_suture(
    scenery: Scenery, body_pose: Array, passages: Sequence[Passage], time: float, pairs: int = SUTURE_PAIRS
) -> SutureScore:
    """Judge a suture of ``pairs`` throws, from pair 1 on, entry before exit.

    ``scenery`` names needle and holes, ``body_pose`` (bodies, 7) is where the bodies are, ``passages`` are those so
    far, ``time`` is in simulated seconds.
    """
    _, _, axial = _closest(scenery, body_pose)
    wanted = holes_of(range(1, pairs + 1))
    newest = list(passages[-len(wanted) :])
    got = [(passage.pair, passage.exit) for passage in newest]
    if got != wanted:
        holes = ", ".join(f"{'exit' if e else 'entry'} {p}" for p, e in got) or "none"
        return SutureScore(False, time, axial, (), f"the tip's last holes were {holes}")
    return SutureScore(True, time, axial, tuple(passage.miss for passage in newest))
