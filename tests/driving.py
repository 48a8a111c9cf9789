"""Random commands for every body, arm, actuator and attached object of a scene, the same for the same seed."""

from __future__ import annotations

from typing import Any

import numpy as np
from ligature import Simulation
from ligature.model.commands import ActuatorCommand, BodyCommand, CommandType, PlaceCommand, WatchContacts
from ligature.model.scene import Scene
from ligature.robots.commands import Adopt, MoveJr, ServoJr

EVERY = 7
"""Ticks between two commands."""


class Driver:
    """Gives a simulation commands at ticks that depend on ``seed`` alone, however ticks are shared out over calls."""

    def __init__(self, scene: Scene, seed: int) -> None:
        self._scene, self._seed = scene, seed
        driven = [b for b in scene.bodies if b.index not in scene.rod_bodies]
        self._free = [b for b in driven if not b.static]
        self._roots = [b for b in driven if b.joints]

    def run(self, simulation: Simulation, begin: int, end: int, calls: list[int] | None = None) -> None:
        """Ticks ``begin`` … ``end`` in calls that end at the ticks ``calls`` and before every command."""
        stops = sorted({*range(begin, end, EVERY), *(c for c in calls or () if begin < c < end), end})
        for start, stop in zip(stops[:-1], stops[1:], strict=True):
            if (start - begin) % EVERY == 0:
                self._command(simulation, np.random.default_rng([self._seed, start]))
            simulation.step(stop - start)

    def _command(self, simulation: Simulation, rng: np.random.Generator) -> None:
        scene, kind = self._scene, rng.integers(8)
        if kind <= 2 and self._roots:
            body = self._roots[rng.integers(len(self._roots))]
            n = len(body.joints)
            types = tuple(CommandType(int(t)) for t in rng.integers(0, 3, n))
            values = tuple(rng.uniform(-0.4, 0.4, n).tolist())
            simulation.apply(BodyCommand(body.index, CommandType.FORCE, (0.0,) * 6, types, values))
        elif kind <= 4 and self._free:
            body = self._free[rng.integers(len(self._free))]
            if kind == 3:
                pose = simulation.state["body_pose"][0, body.index] + [*rng.uniform(-0.01, 0.01, 3), 0, 0, 0, 0]
                target: Any = tuple(pose.tolist())
                simulation.apply(BodyCommand(body.index, CommandType.POSITION, target))
            else:
                wrench = tuple((0.1 * rng.standard_normal(6)).tolist())
                simulation.apply(BodyCommand(body.index, CommandType.FORCE, wrench))
        elif kind == 5 and scene.arms:
            arm = int(rng.integers(len(scene.arms)))
            simulation.apply(Adopt(arm))
            n = simulation.arms[scene.arms[arm].name].joints.n
            move = (ServoJr, MoveJr)[rng.integers(2)]
            simulation.apply(move(arm, tuple(rng.uniform(-0.02, 0.02, n).tolist())))
        elif kind == 6 and scene.actuators:
            actuator, body = int(rng.integers(len(scene.actuators))), scene.bodies[rng.integers(len(scene.bodies))]
            simulation.apply(ActuatorCommand(actuator, bool(rng.integers(3)), body.identity.identifier))
        elif kind == 7 and scene.cameras:
            simulation.apply(PlaceCommand("camera", 0, (*rng.uniform(-1, 1, 3).tolist(), 0.0, 0.0, 0.0, 1.0)))
            simulation.apply(WatchContacts(bool(rng.integers(2))))
