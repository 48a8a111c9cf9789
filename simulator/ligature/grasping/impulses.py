"""Impulses of a tick between a body and the pads that grasp it. World axes, SI units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import is_

import numpy as np
from numpy.typing import NDArray

from ligature.grasping.exchange import Exchanged, exchange
from ligature.grasping.grasp import Grasp, GraspSolver, Patch
from ligature.grasping.motion import Motion
from ligature.model.frames import inverse, pose7_matrix
from ligature.physics import World
from ligature.tables import table_of

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


class Exchange:
    """The exchange of impulses between one body and all that hold it.

    Attributes
    ----------
    grasps
        Those of the body.
    table
        What is `Exchanged`, for compiled code, from `prepare` on.
    """

    def __init__(self, world: World, grasps: Sequence[BodyGrasp]) -> None:
        self._world, self.grasps = world, tuple(grasps)
        self._held = [grasp.grasp for grasp in grasps]
        self._body = grasps[0].body
        described = world.scene.bodies[self._body]
        solver = self._solver = GraspSolver(len(grasps))
        solver.motions.bodies[:] = [self._body, *(grasp.palm for grasp in grasps)]
        self._arrays = Exchanged(
            solver.motion_table, solver.take(self._held), solver.room_table, np.array([0.0, described.mass]),
            np.zeros(3), np.array(described.gravity, dtype=float), np.zeros(1, np.bool_),
        )  # fmt: skip
        self.table = table_of(self._arrays)

    def prepare(self) -> None:
        """Take down what holds for the coming ticks, until a command comes or a body is grasped or let go."""
        world, at, arrays = self._world, self._solver.motions, self._arrays
        for g, grasp in enumerate(self.grasps):
            at.ride[g] = grasp.ride
        at.pushable[:] = [world.commands.pushable(other) for other in at.bodies.tolist()]
        arrays.mass[0], arrays.inertia[:] = world.masses.mass_of(self._body)
        arrays.laden[0] = world.masses.is_laden(self._body)
        self._solver.take(self._held)

    def conclude(self) -> None:
        """Take over what compiled code left."""
        self._solver.give_back(self._held)
        for g, grasp in enumerate(self.grasps):
            grasp.ride[:] = self._solver.motions.ride[g]

    def load(self) -> None:
        """Have Bullet apply what was exchanged, where compiled code cannot."""
        at = self._solver.motions
        bodies = at.bodies.tolist()
        self._world.masses.carry(bodies[0], at.attached_load)
        for body, pushable, impulse in zip(bodies, at.pushable.tolist(), at.impulse, strict=True):
            if pushable:
                self._world.impulses.load(body, impulse[:3], impulse[3:])


class ImpulseExchange:
    """Applies the impulses of grasps to held bodies and to their holders."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._exchanges: dict[int, Exchange] = {}

    def of(self, grasps: Sequence[BodyGrasp]) -> Exchange:
        """The exchange of ``grasps``, all of one body."""
        known = self._exchanges.get(grasps[0].body)
        if known is None or len(known.grasps) != len(grasps) or not all(map(is_, known.grasps, grasps)):
            known = self._exchanges[grasps[0].body] = Exchange(self._world, grasps)
        return known

    def apply(self, grasps: Sequence[BodyGrasp]) -> None:
        """Apply the impulses of ``grasps``, all of one body, in the coming tick."""
        world, at = self._world, self.of(grasps)
        at.prepare()
        motions = world.engine.motions
        motions.prepare()
        exchange(
            motions.handle, motions.table, world.engine.place_table, world.impulses.total, world.impulses.acted,
            at.table, world.dt,
        )  # fmt: skip
        at.conclude()
        if not motions.handle:
            at.load()
