"""Minutes of random arms, needle and thread in the pad of `scenes/soft_suturing`, and whether it recovers.

``python -m tests.bench.tissue_soak [SECONDS] [SEED]`` (300 s of simulated time, seed 0). Both arms go to random places above
and in the pad, at random angles and speeds, with jaws that open and close; the needle is driven to random places in and
above the pad, or let go. Then all go away. Exit status 1 when anything was not finite, a tick took more than 10 ms of
processor time, or a node of the pad ends more than 0.1 mm beside its place in a pad that nothing has touched.
"""

from __future__ import annotations

import contextlib
import gc
import os
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import ligature
import numpy as np
from ligature.model.frames import axis_rotation, frame, inverse
from ligature.robots.operating_state import Rejected
from ligature.robots.psm_arm import PsmArm
from ligature.tasks.throws import UP, pose_of
from numpy.typing import NDArray

Array = NDArray[np.float64]

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "soft_suturing" / "launch.yaml"
SECONDS = 300.0
STREAM = 5
"""Ticks between two set-points."""

LONGEST, ASIDE = 10e-3, 0.1e-3
"""Seconds of processor time that a tick may take, and metres by which a node may end beside its place."""

REACH, LOW, HIGH = np.array([0.025, 0.035]), -0.009, 0.03
"""Metres from the middle of the pad's top: of the places along X and Y, and their heights."""

LEAN, FINGERS = 0.6, 0.0104
"""Radians by which a tool leans at most; metres from its control point to the ends of its fingers."""

RISE, SPEED = 0.08, 0.05
"""Metres by which all go up in the end, and how fast."""

WARM = 100
"""Ticks that do not count: the first ones load machine code."""


@dataclass
class Findings:
    """What a soak found: seconds of processor time of its ticks, and what was wrong."""

    ticks: list[float] = field(default_factory=list)
    aside: float = np.nan
    pierced: int = 0
    most_force: float = 0.0
    problems: list[str] = field(default_factory=list)

    @property
    def faults(self) -> list[str]:
        """Why the soak failed."""
        found = list(self.problems)
        slow = [(k, t) for k, t in enumerate(self.ticks) if t > LONGEST and k >= WARM]
        if slow:
            worst = max(slow, key=lambda row: row[1])
            found.append(
                f"{len(slow)} ticks above {1e3 * LONGEST:g} ms, the longest {1e3 * worst[1]:.1f} ms at {worst[0]}"
            )
        if not self.aside <= ASIDE:
            found.append(f"a node of the pad ends {1e3 * self.aside:.3f} mm beside its place")
        return found

    def line(self) -> str:
        """The figures."""
        ticks = 1e3 * np.array(self.ticks[WARM:])
        return (
            f"{len(self.ticks)} ticks, processor time p50 {np.median(ticks):.3f} ms, p99 {np.percentile(ticks, 99):.3f}, "
            f"longest {ticks.max():.2f} ms; needle or thread in the pad in {self.pierced} of the looks; most at one point "
            f"{self.most_force:.1f} N; the pad ends within {1e3 * self.aside:.4f} mm of its place"
        )


class Wanderer:
    """An arm that goes from one random place to the next."""

    def __init__(self, arm: PsmArm, base: Array, middle: Array, rng: np.random.Generator) -> None:
        self._arm, self._base, self._middle, self._rng = arm, base, middle, rng
        self._left = 0

    def _goal(self) -> Array | None:
        """A random pose (4, 4) of the tool in the axes of the arm's base, which it reaches."""
        rng = self._rng
        place = self._middle + np.array([*(REACH * rng.uniform(-1.0, 1.0, 2)), rng.uniform(LOW, HIGH)])
        axis = np.array([np.cos(a := rng.uniform(0.0, 2.0 * np.pi)), np.sin(a), 0.0])
        z = axis_rotation(axis, rng.uniform(0.0, LEAN)) @ -UP
        x = np.cross(axis_rotation(UP, rng.uniform(0.0, 2.0 * np.pi))[:, 0], z)
        x /= np.linalg.norm(x)
        T = inverse(self._base) @ frame(np.column_stack([x, np.cross(z, x), z]), place - FINGERS * z)
        return T if self._arm.kinematics.inverse(T[None]).ok.all() else None

    def wander(self) -> None:
        """Set out for another place, and move the jaw, when it has been on its way for long enough."""
        self._left -= 1
        goal = self._goal() if self._left < 0 else None
        if goal is None:
            return
        with contextlib.suppress(Rejected):
            self._arm.move_cp(goal)
            self._arm.move_jaw([float(self._rng.uniform(-0.3, 0.9))])
            self._left = int(self._rng.uniform(20, 200))

    def rise(self) -> None:
        """Go up from where it is."""
        T = inverse(self._base) @ frame(np.eye(3), RISE * UP) @ self._base @ pose_of(self._arm.local_measured_cp())
        try:
            self._arm.move_cp(T)
        except Rejected:
            self._arm.move_jp([0.0, 0.0, 0.06, 0.0, 0.0, 0.0])


class Soak:
    """A run of the scene, and what moves in it."""

    def __init__(self, seed: int) -> None:
        self.simulation = ligature.Simulation(ligature.load(SCENE))
        scene = self.simulation.scene
        self.rng = np.random.default_rng([seed, 5])
        self.piece = self.simulation.tissues.pieces[0]
        pad = scene.bodies[scene.tissues[0].body].T_world_body[:3, 3]
        self.middle = pad + [0.0, 0.0, float(scene.tissues[0].form.grid.nodes[:, 2].max())]
        self.needle = self.simulation.bodies[scene.bodies[scene.needles[0].body].identity.topic]
        self.found = Findings()
        self.arms = []
        for arm in scene.arms:
            running = self.simulation.arms[arm.name]
            if isinstance(running, PsmArm):
                self.arms.append(Wanderer(running, scene.bodies[arm.base].T_world_body, self.middle, self.rng))
                running.home()
        self.step(2000)
        # What nothing has touched: it has settled under its weight.
        self.rest = self.piece.block.positions.copy()

    def step(self, ticks: int) -> None:
        """Advance by single ticks, and look at each."""
        for _ in range(ticks):
            begin = time.thread_time()
            self.simulation.step()
            self.found.ticks.append(time.thread_time() - begin)

    def look(self) -> bool:
        """Whether all is finite still."""
        state = self.simulation.state
        self.found.most_force = max(self.found.most_force, float(state["tissue_peak"].max()))
        self.found.pierced += int(state["insertion_count"][0] > 0)
        for name in ("body_pose", "body_twist", "tissue_node", "tissue_wrench", "rod_tension"):
            if not np.isfinite(state[name]).all():
                self.found.problems.append(f"{name} is not finite at {self.simulation.time:.3f} s")
                return False
        return True

    def wander(self, seconds: float) -> None:
        """All of them at random."""
        rng, end, report = self.rng, self.simulation.time + seconds, self.simulation.time + 30.0
        until, goal, spin, driven = 0.0, self.middle, np.zeros(3), True
        while self.simulation.time < end:
            for arm in self.arms:
                arm.wander()
            if self.simulation.time >= until:
                until, driven = self.simulation.time + rng.uniform(0.3, 3.0), rng.random() < 0.8
                goal = self.middle + np.array([*(REACH * rng.uniform(-1.0, 1.0, 2)), rng.uniform(LOW, HIGH)])
                spin = rng.normal(size=3) * rng.uniform(0.0, 4.0)
                if not driven:
                    self.needle.release()
            if driven:
                way = 4.0 * (goal - self.needle.pose[:3])
                size = float(np.linalg.norm(way))
                self.needle.command_twist([*(way * min(1.0, 0.1 / max(size, 1e-9))), *spin])
            self.step(STREAM)
            if not self.look():
                return
            if self.simulation.time >= report:
                report += 30.0
                sys.stdout.write(f"{self.simulation.time:.0f} s: {self.found.line()}\n")
                sys.stdout.flush()

    def leave(self) -> None:
        """Arms and needle go up and away, the thread out of the pad; then the pad rests."""
        for arm in self.arms:
            arm.rise()
        self.needle.command_twist([0, 0, SPEED, 0, 0, 0])
        for _ in range(6):
            self.step(1000)
            self.needle.command_twist([0, 0, SPEED, 0, 0, 0])
        self.needle.command_twist([0] * 6)
        self.step(3000)
        self.look()
        away = np.linalg.norm(self.piece.block.positions - self.rest, axis=1)
        self.found.aside = float(away.max())


def soak(seconds: float, seed: int) -> Findings:
    """A whole run."""
    run = Soak(seed)
    gc.collect()
    gc.freeze()
    run.wander(seconds)
    if not run.found.problems:
        run.leave()
    return run.found


def main() -> int:
    """Entry point."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    found = soak(seconds, seed)
    sys.stdout.write(f"seed {seed}: {found.line()}; load {os.getloadavg()[0]:.1f}\n")
    sys.stdout.write("".join(f"{fault}\n" for fault in found.faults) or f"sound for {seconds:g} s\n")
    return 1 if found.faults else 0


if __name__ == "__main__":
    sys.exit(main())
