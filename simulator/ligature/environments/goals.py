"""What an agent is to do in an environment: where episodes begin, what is seen, rewarded and done. Metres, radians."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import axis_rotation, frame, inverse, matrix_pose7, pose7_matrix
from ligature.robots.psm_arm import PsmArm
from ligature.simulation import Simulation
from ligature.tasks.passages import PassageWatch
from ligature.tasks.scenery import Scenery
from ligature.tasks.scores import RECOMMENDED_AXIAL, judge_insertion
from ligature.tasks.throws import UP, NeedleArc, Throw, best_grasp

Array = NDArray[np.float64]

START = (0.0, 0.0, 0.12, 0.0, 0.0, 0.0)
"""Joint values with which an episode begins, where nothing is in hand."""

UNDONE = 1e-6
"""Metres that are left while a task is not done, wherever the needle is."""


class Goal(Protocol):
    """A task of an environment."""

    holes: int
    """Pairs of holes that a scene must have."""

    scene: str
    """Folder of the scene of ours that the task is made for."""

    models: tuple[int, ...]
    """Models of its launch file that the task needs: one arm, where all of them are simulated for nothing."""

    thread: bool
    """Whether the task needs the needle's thread."""

    arm: str
    """Name of the arm that does it."""

    def prepare(self, simulation: Simulation, scenery: Scenery, arm: PsmArm) -> None:
        """Bring the scene to where all episodes begin from; raises ValueError where that cannot be done."""

    def begin(self, simulation: Simulation, scenery: Scenery, arm: PsmArm, rng: np.random.Generator) -> None:
        """Set an episode up."""

    def target(self) -> Array:
        """Where something is wanted (3,), world axes."""

    def distance(self, simulation: Simulation, arm: PsmArm) -> float:
        """How far there is to go, in metres; zero when done."""


def tip_position(simulation: Simulation, arm: PsmArm) -> Array:
    """The control point of an arm's tool (3,), world axes."""
    base = pose7_matrix(simulation.state["body_pose"][0, _base_of(simulation, arm)])
    return np.asarray((base @ pose7_matrix(arm.local_measured_cp()))[:3, 3])


def _base_of(simulation: Simulation, arm: PsmArm) -> int:
    return next(description.base for description in simulation.scene.arms if description.name == arm.name)


def _stand_ready(simulation: Simulation, arm: PsmArm) -> None:
    """The arm above the work, the needle at rest."""
    arm.place_jp(START)
    arm.adopt()
    simulation.step(200)


class Reach:
    """Bring the tool's control point to within 2 mm of a random place above the work."""

    holes = 0
    scene, arm, models, thread = "suturing_small", "PSM1", (0, 1, 2), False
    WITHIN = 0.002
    REACH = np.array([0.025, 0.025, 0.012])

    def prepare(self, simulation: Simulation, scenery: Scenery, arm: PsmArm) -> None:
        """The arm above the work."""
        _stand_ready(simulation, arm)

    def begin(self, simulation: Simulation, scenery: Scenery, arm: PsmArm, rng: np.random.Generator) -> None:
        """A target in a box around where the tool is."""
        self._target = tip_position(simulation, arm) + rng.uniform(-1.0, 1.0, 3) * self.REACH

    def target(self) -> Array:
        """The place."""
        return self._target

    def distance(self, simulation: Simulation, arm: PsmArm) -> float:
        """Distance beyond `WITHIN`."""
        return max(float(np.linalg.norm(tip_position(simulation, arm) - self._target)) - self.WITHIN, 0.0)


class Pick:
    """Grasp the needle, which lies somewhere on the pad, and lift it by 20 mm."""

    holes = 0
    scene, arm, models, thread = "suturing_small", "PSM1", (0, 1, 2), True
    HEIGHT = 0.02
    SPREAD = 0.012

    def prepare(self, simulation: Simulation, scenery: Scenery, arm: PsmArm) -> None:
        """The arm above the work."""
        _stand_ready(simulation, arm)

    def begin(self, simulation: Simulation, scenery: Scenery, arm: PsmArm, rng: np.random.Generator) -> None:
        """The needle near its place, turned any way about the vertical."""
        body = scenery.needle
        T = simulation.scene.bodies[body].T_world_body
        shift = np.append(rng.uniform(-self.SPREAD, self.SPREAD, 2), 0.0)
        turn = axis_rotation((0.0, 0.0, 1.0), float(rng.uniform(-np.pi, np.pi)))
        middle = T[:3, :3] @ scenery.points.mean(axis=0) + T[:3, 3]
        placed = frame(turn @ T[:3, :3], turn @ (T[:3, 3] - middle) + middle + shift)
        simulation.set_pose(body, matrix_pose7(placed))
        simulation.step(100)
        self._needle = body
        self._height = float(simulation.state["body_pose"][0, body, 2]) + self.HEIGHT
        self._middle = scenery.points[1]
        self._at = pose7_matrix(simulation.state["body_pose"][0, body])[:3, 3]

    def target(self) -> Array:
        """The needle's place at the height wanted."""
        return np.append(self._at[:2], self._height)

    def distance(self, simulation: Simulation, arm: PsmArm) -> float:
        """How much higher the needle must be, and how far the tool is from it."""
        pose = simulation.state["body_pose"][0, self._needle]
        self._at = pose7_matrix(pose)[:3, :3] @ self._middle + pose[:3]
        missing = max(self._height - float(pose[2]), 0.0)
        return missing + 0.2 * float(np.linalg.norm(tip_position(simulation, arm) - self._at)) * (missing > 0.0)


class Insert:
    """Drive the needle, which is in hand before the entry of the first pair of holes, in there and out at the exit.

    Its tip shall go along the circle of its radius through both holes. Done when the tip has gone through the entry
    and then the exit, and is 5 mm beyond.
    """

    holes = 1
    scene, arm, thread = "suturing", "PSM2", True
    models: tuple[int, ...] = (0, 1, 4, 5)
    DEPTHS = (0.020, 0.0205, 0.021)
    BEFORE, MORE, LOOK = 0.4, 0.1, 0.15
    SHIFT, TURN = 0.002, 0.08
    OPEN, SHUT = 0.8, -0.35

    def prepare(self, simulation: Simulation, scenery: Scenery, arm: PsmArm) -> None:
        """The needle between the jaws, its tip before the entry."""
        scene, self._simulation, self._scenery = simulation.scene, simulation, scenery
        self._body = scene.bodies[scenery.needle]
        self.arc = NeedleArc.of(scene.needles[0], self._body)
        poses = simulation.state["body_pose"][0]
        entry, exit = self._ends()
        self.throw = Throw.through(entry, exit, self.arc.radius, UP)
        self._last = self.throw.towards_exit + RECOMMENDED_AXIAL / self.arc.radius + self.MORE
        T_base = pose7_matrix(poses[_base_of(simulation, arm)])
        way = [self.throw.arc_at(a, self.arc) for a in np.linspace(-self.BEFORE, self._last, 12)]
        grasp = best_grasp(self.arc, self.DEPTHS, arm.kinematics, T_base, way, way[0], entry)
        if grasp is None:
            raise ValueError(f"{arm.name} cannot hold the needle so that it reaches the whole throw")
        self._take(simulation, arm, way[0], inverse(T_base) @ way[0] @ grasp.tool_in_arc(self.arc))

    def _ends(self) -> tuple[Array, Array]:
        """Where the tip goes in and out, (3,) each."""
        poses = self._simulation.state["body_pose"][0]
        return poses[self._scenery.entries[0], :3], poses[self._scenery.exits[0], :3]

    def _take(self, simulation: Simulation, arm: PsmArm, T_world_arc: Array, T_base_tool: Array) -> None:
        """Close the jaws on the needle, put where it is wanted."""
        assert arm.jaw is not None
        arm.place_jp(arm.kinematics.inverse(T_base_tool[None]).q[0])
        arm.adopt()
        arm.jaw.servo_jp([self.OPEN])
        simulation.step(200)
        held = matrix_pose7(T_world_arc @ inverse(self.arc.T_body_arc))
        for opening in np.linspace(self.OPEN, self.SHUT, 60):
            if simulation.grasps[arm.name] is None:
                simulation.set_pose(self._scenery.needle, held)
            arm.jaw.servo_jp([opening])
            simulation.step(5)
        simulation.step(200)
        if simulation.grasps[arm.name] is None:
            raise ValueError(f"the jaws of {arm.name} do not hold the needle")

    def begin(self, simulation: Simulation, scenery: Scenery, arm: PsmArm, rng: np.random.Generator) -> None:
        """The hand a little elsewhere, and turned otherwise."""
        T = pose7_matrix(arm.local_setpoint_cp())
        turn = rng.uniform(-1.0, 1.0, 3)
        R = axis_rotation(turn / np.linalg.norm(turn), float(rng.uniform(0.0, self.TURN)))
        arm.servo_cp(frame(R @ T[:3, :3], T[:3, 3] + rng.uniform(-self.SHIFT, self.SHIFT, 3)))
        simulation.step(150)
        self._watch, self._done = PassageWatch(scenery), False

    def _tip(self) -> tuple[Array, float]:
        """The needle's tip (3,), and its angle past the entry on the circle."""
        tip = self._scenery.needle_points(self._simulation.state["body_pose"][0])[2]
        local = self.throw.axes.T @ (tip - self.throw.centre)
        return tip, float(np.arctan2(local[1], local[0]))

    def _is_through(self) -> bool:
        poses = self._simulation.state["body_pose"][0]
        self._watch.observe(self._simulation.time, poses)
        score = judge_insertion(self._scenery, poses, self._watch.passages, self._simulation.time)
        return score.success and score.pair == 1 and bool(score.axial >= RECOMMENDED_AXIAL)

    def _on_circle(self, angle: float) -> Array:
        local = self.arc.radius * np.array([np.cos(angle), np.sin(angle), 0.0])
        return np.asarray(self.throw.centre + self.throw.axes @ local)

    def target(self) -> Array:
        """Where the tip should be next: a little further on its circle."""
        _, angle = self._tip()
        return self._on_circle(float(np.clip(angle + self.LOOK, -self.BEFORE, self._last)))

    def distance(self, simulation: Simulation, arm: PsmArm) -> float:
        """Way of the tip along the circle that is left, and how far it is beside it."""
        self._done = self._done or self._is_through()
        if self._done:
            return 0.0
        tip, angle = self._tip()
        near = float(np.clip(angle, -2.0 * self.BEFORE, self._last))
        beside = float(np.linalg.norm(tip - self._on_circle(near)))
        return self.arc.radius * (self._last - near) + beside + UNDONE


class Puncture(Insert):
    """Drive the needle, which is in hand above a block of soft tissue, in at one place of its top and out at another.

    Its tip shall go along the circle of its radius through both. Done when the needle is in the tissue, has punctured
    its surface twice, and the tip is 5 mm beyond the second place.
    """

    holes = 0
    scene, arm = "needle_insertion", "PSM2"
    models, thread = (0, 1, 2), True
    CHORD = 0.014

    def _ends(self) -> tuple[Array, Array]:
        """Two places on the top of the block, either side of its middle."""
        if not self._simulation.scene.tissues:
            raise ValueError("the scene has no body of soft tissue to puncture")
        nodes = self._simulation.state["tissue_node"][0, self._simulation.scene.tissues[0].rows]
        middle = np.append(0.5 * (nodes.min(axis=0) + nodes.max(axis=0))[:2], nodes[:, 2].max())
        aside = np.array([0.5 * self.CHORD, 0.0, 0.0])
        return middle - aside, middle + aside

    def _is_through(self) -> bool:
        state = self._simulation.state
        n = int(state["insertion_count"][0])
        inside = (state["insertion_hole"][0, :n] == -1) & (state["insertion_body"][0, :n] == self._scenery.needle)
        _, angle = self._tip()
        beyond = self.throw.towards_exit + RECOMMENDED_AXIAL / self.arc.radius
        return bool(inside.any() and state["puncture_count"][0, 0] >= 2 and beyond < angle < np.pi)


GOALS: dict[str, type] = {"reach": Reach, "pick": Pick, "insert": Insert, "puncture": Puncture}
"""Tasks by name."""
