"""Measures an attempt at a task: passages, forces, path lengths, drops. SI units, world axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.scene import ArmKind, Scene
from ligature.tasks.passages import Passage, PassageWatch
from ligature.tasks.scenery import Scenery

Array = NDArray[np.float64]
Number = float | int | bool

STILL = 1e-5
"""Least displacement in metres that counts as motion of a tip: an arm at rest oscillates by less."""

FALLING = 0.2
"""Speed in m/s at which a released needle counts as falling: that after 20 ms of free fall."""


@dataclass(frozen=True)
class Measures:
    """What was measured of a task.

    ``tissue_force`` and ``thread_tension`` are the largest, in N; ``path_lengths`` those of the arms' tips in m;
    ``drops`` counts how often the needle fell.
    """

    time: float
    passages: tuple[Passage, ...]
    tissue_force: float
    tissue_force_mean: float
    thread_tension: float
    path_lengths: dict[str, float]
    drops: int

    def report(self) -> dict[str, Number]:
        """The figures by name: seconds, newtons, metres."""
        return {
            "time": self.time, "passages": len(self.passages), "tissue_force": self.tissue_force,
            "tissue_force_mean": self.tissue_force_mean, "thread_tension": self.thread_tension,
            **{f"path_length_{name}": way for name, way in self.path_lengths.items()}, "drops": self.drops,
        }  # fmt: skip

    def lines(self) -> list[str]:
        """One figure a line."""
        ways = ", ".join(f"{name} {way:.2f} m" for name, way in self.path_lengths.items())
        return [
            f"time {self.time:.1f} s",
            f"tissue force at most {self.tissue_force:.2f} N, {self.tissue_force_mean:.2f} N on average while inserted",
            f"thread tension at most {self.thread_tension:.2f} N",
            f"paths of the tips: {ways or 'none'}",
            f"drops of the needle: {self.drops}",
        ]


class Monitor:
    """Takes one state record of ``scene`` after the other; any rate of 100 Hz and more will do.

    Raises `ligature.tasks.MissingBodies` for a scene without needle or holes, unless it gets the ``scenery``.
    """

    def __init__(self, scene: Scene, scenery: Scenery | None = None) -> None:
        self.scenery = scenery or Scenery.of(scene)
        self._watch = PassageWatch(self.scenery)
        self._names = [arm.name for arm in scene.arms if arm.kind is ArmKind.PSM]
        self._tips = list(self.scenery.tips)
        self._start: float | None = None
        self._now = 0.0
        self._at: Array | None = None
        self._ways = np.zeros(len(self._tips))
        self._force = self._sum = self._tension = 0.0
        self._inserted = self.drops = 0
        self._held = False

    @property
    def passages(self) -> list[Passage]:
        """Holes that the tip went through so far."""
        return self._watch.passages

    def observe(self, state: Any) -> None:
        """Take a state record (`ligature.model.state`), one element of it."""
        time, poses = float(state["sim_time"]), state["body_pose"]
        self._start = time if self._start is None else self._start
        self._now = time
        self._watch.observe(time, poses)
        self._walk(poses)
        self._feel(state)
        self._look_for_drops(state)

    def _walk(self, poses: Array) -> None:
        tips = poses[self._tips, :3]
        if self._at is None:
            self._at = tips.copy()
        steps = np.linalg.norm(tips - self._at, axis=1)
        moved = steps > STILL
        self._ways[moved] += steps[moved]
        self._at[moved] = tips[moved]

    def _feel(self, state: Any) -> None:
        count = int(state["insertion_count"])
        if count:
            on_needle = state["insertion_body"][:count] == self.scenery.needle
            force = float(np.linalg.norm(state["insertion_force"][:count][on_needle], axis=1).sum())
            self._force = max(self._force, force)
            self._sum += force
            self._inserted += 1
        if self.scenery.thread:
            tension = float(np.abs(state["rod_tension"][list(self.scenery.thread)]).max())
            self._tension = max(self._tension, tension)

    def _look_for_drops(self, state: Any) -> None:
        """A needle was dropped when it was held, and now falls."""
        needle = self.scenery.needle
        if needle in state["jaw_body"] or needle in state["actuator_body"]:
            self._held = True
        elif self._held and float(state["body_twist"][needle, 2]) < -FALLING:
            self._held = False
            self.drops += 1

    def measures(self) -> Measures:
        """What was measured so far."""
        mean = self._sum / self._inserted if self._inserted else 0.0
        ways = dict(zip(self._names, (float(way) for way in self._ways), strict=True))
        time = self._now - (self._start or 0.0)
        return Measures(time, tuple(self.passages), self._force, mean, self._tension, ways, self.drops)
