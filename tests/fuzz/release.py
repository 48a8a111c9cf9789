"""Bodies that commands control by pose and release anywhere: ``python -m tests.fuzz.release --trials 200 --jobs 2``.

A trial moves one body along random straight lines and turns, through holes, into tissue, into other bodies, into
closed jaws, or nowhere near anything, at random speeds, rates and losses of commands, and releases it somewhere. Ten
seconds later it must be at rest within its surroundings, and never have been faster than what it had and the fall
explain. Trial N is the same in every run, so that ``--first N --trials 1`` repeats it. Metres, seconds, world axes.
"""

from __future__ import annotations

import argparse
import functools
import multiprocessing
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import ligature
import numpy as np
import yaml
from ligature import Simulation
from ligature.model.commands import BodyCommand, CommandType, Release
from ligature.model.frames import inverse, matrix_pose7, pose7_matrix, quaternion_matrix
from ligature.model.scene import ArmKind, Scene

ROOT = Path(__file__).resolve().parents[2]
LAB = Path(os.environ.get("LIGATURE_CORPUS", ROOT.parent / "shared" / "corpus")) / "suturing_scene"

AFTER = 10.0
"""Simulated seconds after the release."""

STORED = 0.5
"""Speed in m/s that tissue, thread and contacts may add to what a body had when released, and to its fall."""

LAST, STILL, STILL_TURN = 0.5, 2e-3, 0.1
"""At rest: in the last so many seconds the body moved and turned by less (metres, radians)."""

SILENCE = 0.5
"""Seconds without commands after which the watchdog of the ROS process releases a body."""

PLAIN = "friction: {static: 0.5, rolling: 0}, restitution: 0, collision margin: 0.0001, inertial offset: {}"
CROWD = f"""
bodies: [Table, Post, Tray, Brick, Chip, Hook]
Table: {{name: Table, mass: 0, collision shape: BOX, collision geometry: {{x: 1, y: 1, z: 0.1}}, {PLAIN},
  location: {{position: {{x: 0, y: 0, z: -0.05}}}}}}
Post: {{name: Post, mass: 0, collision shape: CYLINDER, collision geometry: {{radius: 0.01, height: 0.06, axis: Z}},
  {PLAIN}, location: {{position: {{x: 0.04, y: 0, z: 0.03}}}}}}
Tray: {{name: Tray, mass: 0, collision shape: BOX, collision geometry: {{x: 0.08, y: 0.08, z: 0.02}}, {PLAIN},
  location: {{position: {{x: -0.05, y: 0, z: 0.01}}}}}}
Brick: {{name: Brick, mass: 0.5, collision shape: BOX, collision geometry: {{x: 0.03, y: 0.02, z: 0.01}}, {PLAIN},
  location: {{position: {{x: 0, y: 0.04, z: 0.006}}}}}}
Chip: {{name: Chip, mass: 0.0002, collision shape: BOX, collision geometry: {{x: 0.012, y: 0.012, z: 0.003}}, {PLAIN},
  location: {{position: {{x: 0, y: -0.04, z: 0.002}}}}}}
Hook: {{name: Hook, mass: 0.0001, {PLAIN}, location: {{position: {{x: 0, y: 0, z: 0.001}}}},
  compound collision shape: [
  {{shape: CAPSULE, geometry: {{axis: X, radius: 0.0004, height: 0.01}}, offset: {{position: {{x: 0.004}}}}}},
  {{shape: CAPSULE, geometry: {{axis: Y, radius: 0.0004, height: 0.01}}, offset: {{position: {{y: 0.004}}}}}}]}}
"""


def _load_text(text: str) -> Scene:
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "world.yaml").write_text("namespace: /ambf/env/\ngravity: {x: 0, y: 0, z: -9.81}\n")
        Path(folder, "crowd.yaml").write_text(text)
        launch = Path(folder, "launch.yaml")
        launch.write_text("world config: world.yaml\nmultibody configs: [crowd.yaml]\n")
        return ligature.load(launch)


def _without_thread(root: Path, launch: str, phantom: str, models: list[int]) -> Scene:
    """A scene below ``root`` whose file ``phantom`` has lost its thread, in a copy."""
    with tempfile.TemporaryDirectory() as folder:
        copy = shutil.copytree(root, Path(folder, "scene"))
        document = yaml.safe_load((copy / phantom).read_text())
        for key in ("bodies", "joints"):
            document[key] = [name for name in document[key] if "Thread" not in name]
        (copy / phantom).write_text(yaml.safe_dump(document))
        return ligature.load(copy / launch, models=models)


def _ours(models: list[int]) -> Scene:
    return ligature.load(ROOT / "scenes" / "suturing" / "launch.yaml", models=models)


STAGES: dict[str, Callable[[], Scene]] = {
    "crowd": lambda: _load_text(CROWD),
    "pad": lambda: _without_thread(ROOT / "scenes", "suturing/launch.yaml", "suturing/phantom.yaml", [0, 1]),
    "pad with thread": lambda: _ours([0, 1]),
    "lab": lambda: _without_thread(LAB, "launch.yaml", "ADF/Phantoms/Simple/phantom.yaml", [10, 11]),
    "lab with thread": lambda: ligature.load(LAB / "launch.yaml", models=[10, 11]),
    "jaws": lambda: _ours([0, 1, 2, 3]),
}
"""Scenes by name; the needle weighs 0.09 g on ours, 0.5 kg on the lab's."""


@functools.cache
def scene_of(stage: str) -> Scene:
    """The scene of a stage, loaded once in a process."""
    return STAGES[stage]()


@dataclass(frozen=True)
class Verdict:
    """How a trial ended; ``faults`` is empty when all is well."""

    stage: str
    number: int
    update: int
    faults: tuple[str, ...]
    released_at: float
    peak: float

    def __str__(self) -> str:
        what = "; ".join(self.faults) or "at rest"
        return (
            f"{self.stage} {self.number} (updates of {self.update} ms): released at {self.released_at:.2f} m/s, "
            f"then at most {self.peak:.2f} m/s: {what}"
        )


class Trial:
    """One body of a stage, controlled and released; everything follows from ``stage`` and ``number``."""

    def __init__(self, stage: str, number: int) -> None:
        self._rng = rng = np.random.default_rng([number, *stage.encode()])
        self.stage, self.number = stage, number
        self.scene = scene = scene_of(stage)
        self.update = int(rng.choice([1, 5]))
        self.sim = Simulation(scene, 1e-3, self.update * 1e-3)
        free = [a.links[0].body for a in scene.articulations if len(a.links) == 1]
        free = [body for body in free if not scene.bodies[body].static]
        needles = [needle.body for needle in scene.needles]
        self.body = needles[0] if needles else int(rng.choice(free))
        self._solid = [b.index for b in scene.bodies if b.colliders and b.index != self.body]
        self._solid = [b for b in self._solid if b not in scene.rod_bodies]
        self._fingers = [finger for jaw in scene.jaws for finger in jaw.fingers]
        self._handle = self.sim.bodies[scene.bodies[self.body].identity.identifier]
        self._goal = self._handle.pose
        self.top_speed = 0.0

    # --- what is commanded --------------------------------------------------------------------

    def _turn(self) -> np.ndarray:
        q = self._rng.normal(size=4)
        return quaternion_matrix(q / np.linalg.norm(q))

    def _at_a_hole(self) -> np.ndarray:
        """Tip near the axis of a hole, 40 mm before to 25 mm behind its opening, along it as a rule."""
        rng, needle = self._rng, self.scene.needles[0]
        hole = self.scene.holes[int(rng.integers(len(self.scene.holes)))]
        T = pose7_matrix(self.sim.state["body_pose"][0, hole.body]) @ hole.T_body_hole
        arc = needle.arc
        ahead = (arc.point(0.0) - arc.point(1e-6)) / 1e-6
        out = (arc.point(0.0) - arc.centre) / arc.radius
        local = np.column_stack([ahead, out, np.cross(ahead, out)])
        side = rng.normal(size=3)
        along = T[:3, 2] * rng.choice([-1.0, 1.0])
        side = np.cross(along, side)
        side /= np.linalg.norm(side)
        R = np.column_stack([along, side, np.cross(along, side)]) @ local.T
        if rng.uniform() < 0.2:
            R = self._turn()
        T_inertial = np.eye(4)
        tip = T[:3, 3] + T[:3, 2] * rng.choice([0.0, rng.uniform(-0.025, 0.04)]) + rng.normal(size=3) * 0.3e-3
        T_inertial[:3, :3], T_inertial[:3, 3] = R, tip - R @ arc.point(0.0)
        return T_inertial @ inverse(self.scene.bodies[self.body].T_body_inertial)

    def _within(self) -> np.ndarray:
        """Anywhere in, or within 5 mm of, the box around another body or one of its shapes."""
        rng = self._rng
        in_jaw = bool(self._fingers) and rng.uniform() < 0.7
        other = self.scene.bodies[int(rng.choice(self._fingers if in_jaw else self._solid))]
        part = other.colliders[int(rng.integers(len(other.colliders)))]
        T_part = pose7_matrix(self.sim._world.pose7(other.index)) @ part.T_body_shape
        low, high = self.sim._world.queries.surroundings([other.index])[1]
        at = rng.uniform(low - 0.005, high + 0.005)
        if rng.uniform() < 0.5:
            at = T_part[:3, 3] + rng.normal(size=3) * 0.003
        if not in_jaw:
            at = np.clip(at, self._centre() - 0.08, self._centre() + 0.08)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self._turn(), at
        return T

    def _beside(self) -> np.ndarray:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self._turn(), self._centre() + self._rng.uniform([-0.05] * 3, [0.05, 0.05, 0.08])
        return T

    def _centre(self) -> np.ndarray:
        if self.scene.holes:
            poses = self.sim.state["body_pose"][0]
            return np.mean([poses[hole.body, :3] for hole in self.scene.holes], axis=0)
        return np.array([0.0, 0.0, 0.01])

    def _goals(self) -> Iterator[np.ndarray]:
        kinds = [self._within, self._beside] + [self._at_a_hole] * (3 if self.scene.needles and self.scene.holes else 0)
        for _ in range(int(self._rng.integers(1, 6))):
            yield kinds[int(self._rng.integers(len(kinds)))]()

    # --- what is done -------------------------------------------------------------------------

    def _step(self) -> None:
        self.sim.step(self.update)
        self.top_speed = max(self.top_speed, self._speed())

    def _speed(self) -> float:
        return float(np.linalg.norm(self._handle.twist[:3]))

    def _move(self, goal: np.ndarray) -> None:
        """Pose commands on a straight line, quintic in time, at a rate, some of them lost; then the last one again."""
        rng = self._rng
        start, begin = pose7_matrix(self._goal), self.sim.time
        seconds = 0.0 if rng.uniform() < 0.1 else rng.uniform(0.1, 1.0)
        every, lost, wait = 1.0 / rng.uniform(20.0, 200.0), rng.choice([0.0, rng.uniform()]), rng.uniform(0.0, 0.6)
        R = start[:3, :3].T @ goal[:3, :3]
        next_ = begin
        while self.sim.time < begin + seconds + wait:
            if self.sim.time >= next_ - 1e-9:
                next_ += every
                s = 1.0 if seconds == 0.0 else min((self.sim.time - begin) / seconds, 1.0)
                if s == 1.0 or rng.uniform() >= lost:
                    f = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
                    T = np.eye(4)
                    T[:3, :3] = start[:3, :3] @ _part(R, f)
                    T[:3, 3] = (1.0 - f) * start[:3, 3] + f * goal[:3, 3]
                    self._goal = matrix_pose7(T)
                    self._handle.command_pose(self._goal.tolist())
            self._step()

    def _release(self) -> None:
        """The watchdog after some silence, a script that commands no force, or a front end that dies."""
        how = int(self._rng.integers(3))
        if how == 0:
            for _ in range(int(SILENCE / self.update * 1e3)):
                self._step()
        if how == 1:
            self.sim.apply(BodyCommand(self.body, CommandType.FORCE, (0.0,) * 6))
        else:
            self.sim.apply(Release("body", self.body))

    def run(self, after: float = AFTER) -> Verdict:
        """Control, release, watch for ``after`` seconds."""
        for _ in range(20):
            self._step()
        self._prepare()
        for goal in self._goals():
            self._move(goal)
        self._release()
        had, floor, controlled = self._speed(), self._floor(), self.top_speed
        height = max(float(self._handle.pose[2]) - floor, 0.0)
        limit = float(np.sqrt(had**2 + 2.0 * 9.81 * height)) + STORED
        self.top_speed = 0.0
        others = 0.0
        end, last = self.sim.time + after, None
        faults: list[str] = []
        while self.sim.time < end:
            self._step()
            speeds = np.linalg.norm(self.sim.state["body_twist"][0, :, :3], axis=1)
            others = max(others, float(np.nanmax(speeds)))
            if last is None and self.sim.time >= end - LAST:
                last = self._handle.pose
        pose = self._handle.pose
        if not all(np.isfinite(self.sim.state[name]).all() for name in ("body_pose", "body_twist", "joint_position")):
            faults.append("the state is not finite")
        if self.top_speed > limit:
            faults.append(f"it was {self.top_speed:.2f} m/s fast, at most {limit:.2f} is explained")
        if others > max(10.0 * (limit + controlled), 10.0):
            faults.append(f"another body was {others:.1f} m/s fast")
        low, high = self._box()
        if (pose[:3] < low).any() or (pose[:3] > high).any():
            faults.append(f"it ended at {np.round(pose[:3], 3).tolist()}")
        assert last is not None
        turned = 2.0 * np.arccos(min(1.0, abs(float(pose[3:] @ last[3:]))))
        if np.linalg.norm(pose[:3] - last[:3]) > STILL or turned > STILL_TURN:
            faults.append(f"it still moves at {self._speed():.3f} m/s")
        faults += [str(p) for p in self.sim.problems if p.code == "diverged"]
        self.sim.close()
        return Verdict(self.stage, self.number, self.update, tuple(faults), had, self.top_speed)

    def _prepare(self) -> None:
        """On a stage with arms: home them, and close the jaws more or less."""
        names = [arm.name for arm in self.scene.arms if arm.kind is ArmKind.PSM and arm.name in self.sim.arms]
        for name in names:
            self.sim.arms[name].enable()
            self.sim.arms[name].home()
        for _ in range(int(3.0 / self.update * 1e3) if names else 0):
            self._step()
        for name in names:
            self.sim.arms[name].servo_jaw([float(self._rng.uniform(-0.15, 0.2))])  # type: ignore[attr-defined]

    def _statics(self) -> tuple[np.ndarray, np.ndarray]:
        static = [b.index for b in self.scene.bodies if b.static and b.colliders]
        boxes = [self.sim._world.queries.surroundings([body])[1] for body in static]
        return np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)

    def _floor(self) -> float:
        return float(self._statics()[0][2])

    def _box(self) -> tuple[np.ndarray, np.ndarray]:
        low, high = self._statics()
        return low, high + np.array([0.0, 0.0, 0.2])


def _part(R: np.ndarray, share: float) -> np.ndarray:
    """A share of a rotation (3, 3)."""
    angle = float(np.arccos(np.clip(0.5 * (np.trace(R) - 1.0), -1.0, 1.0)))
    if angle < 1e-9:
        return np.eye(3)
    w, v = np.linalg.eig(R)
    axis = np.real(v[:, int(np.argmin(np.abs(w - 1.0)))])
    axis = axis / np.linalg.norm(axis)
    if np.trace(np.cross(np.eye(3), axis) @ R) < 0.0:
        axis = -axis
    K = np.cross(np.eye(3), -axis)
    return np.eye(3) + np.sin(share * angle) * K + (1.0 - np.cos(share * angle)) * K @ K


def run(stage: str, number: int, after: float = AFTER) -> Verdict:
    """One trial."""
    return Trial(stage, number).run(after)


def _run(job: tuple[str, int, float]) -> Verdict:
    return run(*job)


def main() -> None:
    """Entry point of ``make fuzz``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=100, help="on each stage")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--after", type=float, default=AFTER, help="simulated seconds after the release")
    parser.add_argument("--stages", nargs="*", default=[s for s in STAGES if LAB.is_dir() or not s.startswith("lab")])
    options = parser.parse_args()
    jobs = [(s, n, options.after) for n in range(options.first, options.first + options.trials) for s in options.stages]
    start, bad = time.monotonic(), 0
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        for done, verdict in enumerate(pool.imap_unordered(_run, jobs), 1):
            bad += bool(verdict.faults)
            if verdict.faults or done % 50 == 0:
                sys.stdout.write(f"{done} of {len(jobs)}: {verdict}\n")
                sys.stdout.flush()
    sys.stdout.write(f"{len(jobs)} releases in {time.monotonic() - start:.0f} s, {bad} not at rest or too fast\n")
    sys.exit(bad > 0)


if __name__ == "__main__":
    main()
