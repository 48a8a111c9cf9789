"""Gravity of each body: Bullet has one for all, the difference is a force on every body that wants another.

World axes, m/s² and newtons.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.physics.bodies import Placement
from ligature.physics.control import TreeControl
from ligature.physics.engine import Engine

Array = NDArray[np.float64]


class Lift:
    """Forces on the bodies of one tree whose gravity is not the common one, at their centres of mass."""

    def __init__(self, client: int, places: Sequence[Placement], forces: Sequence[Array]) -> None:
        self._client, self._uid = client, places[0].uid
        self._rows = [place.row for place in places]
        self._pushes = [(place.link, force.tolist()) for place, force in zip(places, forces, strict=True)]
        self._motions, self._tree = places[0].motions, places[0].tree
        self._read = self._motions.base if all(place.link < 0 for place in places) else self._motions.links

    def push(self) -> None:
        """Apply the forces for one tick."""
        self._read(self._tree)
        centres = self._motions.pose[self._rows].tolist()
        for (link, force), at in zip(self._pushes, centres, strict=True):
            pybullet.applyExternalForce(
                self._uid, link, force, at[:3], pybullet.WORLD_FRAME, physicsClientId=self._client
            )


def gravity_lifts(engine: Engine, controls: Sequence[TreeControl]) -> list[Lift]:
    """What has to be pushed every tick so that every body feels its own gravity.

    Where nobody measures the joints' reactions, the joints carry it: efforts of a whole tree are set in one call.
    """
    lifts = []
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
            lifts.append(Lift(engine.client, [places[i] for i in pushed], [forces[i] for i in pushed]))
    return lifts
