"""Impulses of a tick between a body and the pads that grasp it. World axes, SI units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.grasping.grasp import Grasp, GraspSolver, Patch
from ligature.grasping.motion import Motion
from ligature.model.frames import inverse, pose7_matrix
from ligature.physics import World

Array = NDArray[np.float64]


@dataclass
class BodyGrasp:
    """The scene's ``body`` held by friction; the pads belong to the body ``palm``.

    ``ride`` (6,) is the holder's velocity at the body's centre in the last tick.
    """

    body: int
    palm: int
    grasp: Grasp
    ride: Array


def begin(world: World, palm: int, body: int, patch: Patch) -> tuple[Grasp, Array]:
    """A grasp of ``body`` where it is now, and its first `BodyGrasp.ride`."""
    at = Motion(*world.motion(palm), 0.0, np.zeros(3))
    T_world_body = pose7_matrix(world.motion(body)[0])
    grasp = Grasp(patch, inverse(pose7_matrix(at.pose)) @ T_world_body)
    grasp.begin(at)
    return grasp, at.velocity_at(T_world_body[:3, 3])


class ImpulseExchange:
    """Applies the impulses of grasps to held bodies and to their holders."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._solvers: dict[int, GraspSolver] = {}

    def apply(self, grasps: Sequence[BodyGrasp]) -> None:
        """Apply the impulses of ``grasps``, all of one body, in the coming tick."""
        world, body = self._world, grasps[0].body
        if len(grasps) not in self._solvers:
            self._solvers[len(grasps)] = GraspSolver(len(grasps))
        solver = self._solvers[len(grasps)]
        at = solver.motions
        world.read_motion(body, at.body_pose, at.body_twist)
        for g, grasp in enumerate(grasps):
            world.read_motion(grasp.palm, at.palm_pose[g], at.palm_twist[g])
            at.ride[g] = grasp.ride
        mass, inertia = world.masses.mass_of(body)
        at.inverse[0], at.inverse[1:], at.pending[:] = 1.0 / mass, 1.0 / inertia, world.impulses.pending(body)
        described = world.scene.bodies[body]
        world.masses.carry(body, solver.predict_free(described.mass, described.gravity, world.dt))
        for g, grasp in enumerate(grasps):
            grasp.ride[:] = at.ride[g]
        impulses = solver.solve([grasp.grasp for grasp in grasps], world.dt)
        world.impulses.apply(body, impulses[0, :3], impulses[0, 3:])
        for grasp, impulse in zip(grasps, impulses[1:], strict=True):
            world.impulses.apply(grasp.palm, impulse[:3], impulse[3:])
