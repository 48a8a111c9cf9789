"""What an agent is to do in an environment: where episodes begin, what is seen, rewarded and done. Metres, radians."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import axis_rotation, frame, matrix_pose7, pose7_matrix
from ligature.robots.psm_arm import PsmArm
from ligature.simulation import Simulation
from ligature.tasks.scenery import Scenery

Array = NDArray[np.float64]


class Goal(Protocol):
    """A task of an environment."""

    holes: int
    """Pairs of holes that a scene must have."""

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


class Reach:
    """Bring the tool's control point to within 2 mm of a random place above the work."""

    holes = 0
    WITHIN = 0.002
    REACH = np.array([0.025, 0.025, 0.012])

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
    HEIGHT = 0.02
    SPREAD = 0.012

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


GOALS: dict[str, type] = {"reach": Reach, "pick": Pick}
"""Tasks by name."""
