"""Impulses of a tick between a body and the pads that grasp it. World axes, SI units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.grasping.exchange import exchange
from ligature.grasping.friction import Motions
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
        solver = self._solvers.get(len(grasps))
        if solver is None:
            solver = self._solvers[len(grasps)] = GraspSolver(len(grasps))
        at, described, laden = solver.motions, world.scene.bodies[body], world.masses.is_laden(body)
        at.bodies[0] = body
        for g, grasp in enumerate(grasps):
            at.bodies[1 + g], at.ride[g] = grasp.palm, grasp.ride
        at.pushable[:] = [world.commands.pushable(other) for other in at.bodies.tolist()]
        mass, inertia = world.masses.mass_of(body)
        held = [grasp.grasp for grasp in grasps]
        motions = world.engine.motions
        motions.prepare()
        exchange(
            motions.handle, motions.table, world.engine.place_table, world.impulses.total, world.impulses.acted,
            solver.motion_table, solver.take(held), solver.room_table, mass, inertia, described.mass,
            described.gravity, laden, world.dt,
        )  # fmt: skip
        solver.give_back(held)
        for g, grasp in enumerate(grasps):
            grasp.ride[:] = at.ride[g]
        if not motions.handle:
            self._load(at)

    def _load(self, at: Motions) -> None:
        """Have Bullet apply what was exchanged, where compiled code cannot."""
        bodies = at.bodies.tolist()
        self._world.masses.carry(bodies[0], at.attached_load)
        for body, pushable, impulse in zip(bodies, at.pushable.tolist(), at.impulse, strict=True):
            if pushable:
                self._world.impulses.load(body, impulse[:3], impulse[3:])
