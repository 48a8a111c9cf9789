"""Bodies put anywhere at once, and arms sent from limit to limit: ``python -m tests.fuzz.placing --trials 200``.

A trial takes one of our scenes and puts its bodies where nobody would: far away, into each other, into tissue, held ones,
ends of threads, also several within a tick. What a joint holds is refused with ValueError. Every number of the state is
finite, nothing passes 50 m/s without being reported, and what was put back where it started comes to rest within its
surroundings. Trial N is the same in every run. Metres, seconds, world axes.
"""

from __future__ import annotations

import argparse
import functools
import random
import sys
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import ligature
import numpy as np
from ligature import Simulation
from ligature.model.scene import Scene
from ligature.physics.guard import MAX_SPEED
from ligature.robots.arm import Arm
from ligature.robots.operating_state import Rejected

from tests.fuzz.commands import _floats

ROOT = Path(__file__).resolve().parents[2]
STAGES = ("suturing_small", "soft_suturing", "peg_transfer", "knot_tying", "needle_pick", "suturing")

BURSTS, LONGEST = 8, 40
"""Bursts of placing in a trial, and most ticks after one."""

AFTER = 1500
"""Ticks after the last one in which the scene comes to rest."""

REST = 0.5
"""Speed in m/s below which a body counts as at rest among threads that still swing."""

FAR = (0.1, 1.0, 50.0, 1e3, 1e6)


@dataclass(frozen=True)
class Verdict:
    """How a trial ended; ``faults`` is empty when all is well."""

    stage: str
    number: int
    peak: float
    faults: tuple[str, ...]
    reported: tuple[str, ...]

    def __str__(self) -> str:
        what = "; ".join(self.faults) or "well"
        return f"{self.stage} {self.number}: at most {self.peak:.1f} m/s, {len(self.reported)} reported: {what}"


@functools.cache
def scene_of(stage: str) -> Scene:
    """The scene of a stage, loaded once in a process."""
    return ligature.load(ROOT / "scenes" / stage / "launch.yaml")


class Trial:
    """One run of a scene; everything follows from ``stage`` and ``number``."""

    def __init__(self, stage: str, number: int) -> None:
        self._rng = random.Random(f"{stage} {number}")
        self.stage, self.number = stage, number
        self.scene = scene_of(stage)
        self.simulation = Simulation(self.scene)
        self._start = self.simulation.state["body_pose"][0].copy()
        self._finite = _floats(self.simulation.state)
        self._peak, self._faults, self._reported = 0.0, list[str](), list[str]()
        roots = {tree.links[0].body for tree in self.scene.articulations}
        self._roots = sorted(roots | set(self.scene.rod_bodies))
        self._log, self._fast = list[str](), dict[str, str]()

    def run(self) -> Verdict:
        """Run the trial to its end."""
        try:
            self._home()
            for _ in range(BURSTS):
                for _ in range(self._rng.choice((1, 1, 1, 2, 6))):
                    self._put()
                if self._rng.random() < 0.5:
                    self._jump()
                self._step(self._rng.choice((0, 1, 1, 2, self._rng.randrange(LONGEST))))
            self._recover()
            if not self._reported:  # a body is reported at the end of an update
                self._faults += [f"{name} {how}" for name, how in self._fast.items()]
        finally:
            self.simulation.close()
        return Verdict(self.stage, self.number, self._peak, tuple(self._faults), tuple(self._reported))

    def _home(self) -> None:
        if self.simulation.arms and self._rng.random() < 0.5:
            for arm in self.simulation.arms.values():
                arm.adopt()

    def _put(self) -> None:
        """Put a body somewhere, or see that it is refused."""
        body = (
            self._rng.randrange(len(self.scene.bodies)) if self._rng.random() < 0.3 else self._rng.choice(self._roots)
        )
        pose = self._pose(body)
        self._log.append(f"{self.scene.bodies[body].identity.identifier} at {np.round(pose, 4).tolist()}")
        try:
            self.simulation.set_pose(body, pose)
        except (ValueError, Rejected) as error:
            assert len(str(error)) < 300, error

    def _pose(self, body: int) -> np.ndarray:
        rng, poses = self._rng, self.simulation.state["body_pose"][0]
        kind = rng.randrange(5)
        place = poses[body, :3].copy()
        if kind == 0:
            place += np.array([rng.gauss(0.0, 1.0) for _ in range(3)]) * rng.choice(FAR)
        elif kind == 1:
            place = poses[rng.randrange(len(poses)), :3] + np.array([rng.gauss(0.0, 2e-3) for _ in range(3)])
        elif kind == 2 and "tissue_node" in (self.simulation.state.dtype.names or ()):
            nodes = self.simulation.state["tissue_node"][0]
            if len(nodes):
                place = nodes[rng.randrange(len(nodes)), :3].copy()
        elif kind == 3:
            place += np.array([rng.gauss(0.0, 5e-3) for _ in range(3)])
        turn = np.array([rng.gauss(0.0, 1.0) for _ in range(4)])
        turn = poses[body, 3:] if rng.random() < 0.4 else turn / np.linalg.norm(turn)
        return np.array([*place, *turn])

    def _jump(self) -> None:
        """Send an arm from one limit to another, by every command of positions; open or close its jaw."""
        for arm in self.simulation.arms.values():
            jaw = getattr(arm, "jaw", None)
            if jaw is not None and self._rng.random() < 0.5:
                with suppress(Rejected):
                    jaw.servo_jp(self._rng.choice((-0.2, 0.0, 0.5, 1.0)))
            if self._rng.random() < 0.7:
                low, high = arm.kinematics.lower, arm.kinematics.upper
                goal = [self._rng.choice(pair) for pair in zip(low, high, strict=True)]
                self._send(arm, goal)

    def _send(self, arm: Arm, goal: list[float]) -> None:
        kind = self._rng.choice(("servo_jp", "servo_cp", "move_jp", "move_cp"))
        value = goal if kind.endswith("jp") else arm.kinematics.forward(np.array(goal))
        try:
            getattr(arm, kind)(value)
        except (ValueError, Rejected) as error:
            assert len(str(error)) < 300, error

    def _step(self, ticks: int) -> None:
        for _ in range(ticks):
            self.simulation.step()
            for name, values in self._finite:
                if not np.isfinite(values).all():
                    raise AssertionError(f"{name} is not finite after {self._log[-8:]}")
            speeds = np.linalg.norm(self.simulation.state["body_twist"][0, :, :3], axis=1)
            self._peak = max(self._peak, float(speeds.max()))
            self._reported += [str(problem) for problem in self.simulation.problems]
            self.simulation.problems.clear()
            if speeds.max() > MAX_SPEED:
                self._fast.setdefault(
                    self.scene.bodies[int(speeds.argmax())].identity.identifier,
                    f"at {speeds.max():.0f} m/s, unreported, after {self._log[-3:]}",
                )

    def _recover(self) -> None:
        """Reset, and see that the scene is as at its start: nothing of what was done lasts."""
        self.simulation.reset()
        moved = np.abs(self.simulation.state["body_pose"][0] - self._start).max()
        if moved > 1e-9:
            self._faults.append(f"a reset leaves a body {moved:.2g} from its start")
        self._step(200)
        speeds = np.linalg.norm(self.simulation.state["body_twist"][0, :, :3], axis=1)
        if speeds.max() > 3.0:
            self._faults.append(f"after a reset a body moves at {speeds.max():.2f} m/s")


def main() -> int:
    """Entry point."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--trials", type=int, default=200)
    flags.add_argument("--first", type=int, default=0)
    flags.add_argument("--stage", action="append", choices=STAGES)
    given = flags.parse_args()
    ends, begin = Counter[bool](), time.monotonic()
    stages = given.stage or STAGES
    for number in range(given.first, given.first + given.trials):
        stage = stages[number % len(stages)]
        verdict = Trial(stage, number).run()
        ends[bool(verdict.faults)] += 1
        if verdict.faults or verdict.peak > MAX_SPEED:
            sys.stdout.write(f"{verdict}; {verdict.reported[:2]}\n")
            sys.stdout.flush()
    sys.stdout.write(f"{ends.total()} trials in {time.monotonic() - begin:.0f} s: {ends[True]} with faults\n")
    return int(ends[True] > 0)


if __name__ == "__main__":
    sys.exit(main())
