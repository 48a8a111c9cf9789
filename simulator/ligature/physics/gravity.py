"""Gravity of each body: Bullet has one for all, the difference is a force on every body that wants another.

World axes, m/s² and newtons.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ligature.physics.control import TreeControl
from ligature.physics.engine import Engine

Array = NDArray[np.float64]


class Lifts:
    """Forces on bodies whose gravity is not the common one, at their centres of mass.

    Attributes
    ----------
    bodies, forces
        (n,) and (n, 3) in newtons.
    """

    def __init__(self, engine: Engine, bodies: Sequence[int], forces: Sequence[Array]) -> None:
        self._engine = engine
        self.bodies, self.forces = np.array(bodies, dtype=np.int64), np.array(forces).reshape(-1, 3)

    def step(self) -> None:
        """Apply the forces for one tick, where compiled code cannot."""
        for body, force in zip(self.bodies.tolist(), self.forces, strict=True):
            self._engine.place_of[body].apply_force(force)


def gravity_lifts(engine: Engine, controls: Sequence[TreeControl]) -> Lifts:
    """What has to be pushed every tick so that every body feels its own gravity.

    Where nobody measures the joints' reactions, the joints carry it: efforts of a whole tree are set in one call.
    """
    bodies: list[int] = []
    lifts: list[Array] = []
    for k, tree in enumerate(engine.trees):
        places = [engine.place_of[body] for body in tree.link_of]
        forces = [place.body.mass * (place.body.gravity - engine.gravity) for place in places]
        pushed = [i for i, force in enumerate(forces) if np.any(force)]
        measured = any(engine.scene.joints[joint].feedback for _, joint, _, _ in tree.axes)
        if pushed and tree.static and not measured:
            for i in pushed:
                engine.motions.force[places[i].row] = forces[i]
            controls[k].carry()
        elif pushed:
            bodies += [places[i].body.index for i in pushed]
            lifts += [forces[i] for i in pushed]
    return Lifts(engine, bodies, lifts)
