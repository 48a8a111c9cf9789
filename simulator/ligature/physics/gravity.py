"""Gravity of each body: Bullet has one for all, the difference is a force on every body that wants another.

World axes, m/s² and newtons.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.model.scene import Scene
from ligature.physics.articulation import Tree
from ligature.physics.bodies import Placement
from ligature.physics.control import TreeControl
from ligature.physics.motions import Motions

Array = NDArray[np.float64]


def common_gravity(scene: Scene) -> Array:
    """The gravity (3,) that most moving bodies share."""
    moving = [b for b in scene.bodies if not b.static and b.index not in scene.rod_bodies]
    counts = Counter(tuple(b.gravity.tolist()) for b in moving)
    if not counts:
        return np.array(scene.world.gravity)
    return np.array(max(counts, key=lambda g: (counts[g], g)))


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


def gravity_lifts(
    client: int, scene: Scene, trees: Sequence[Tree], controls: Sequence[TreeControl],
    place_of: Mapping[int, Placement], motions: Motions, common: Array,
) -> list[Lift]:  # fmt: skip
    """What has to be pushed every tick so that every body feels its own gravity.

    Where nobody measures the joints' reactions, the joints carry it: efforts of a whole tree are set in one call.
    """
    lifts = []
    for k, tree in enumerate(trees):
        places = [place_of[body] for body in tree.link_of]
        forces = [place.body.mass * (place.body.gravity - common) for place in places]
        pushed = [i for i, force in enumerate(forces) if np.any(force)]
        measured = any(scene.joints[joint].feedback for _, joint, _, _ in tree.axes)
        if pushed and tree.static and not measured:
            for i in pushed:
                motions.force[places[i].row] = forces[i]
            controls[k].carry()
        elif pushed:
            lifts.append(Lift(client, [places[i] for i in pushed], [forces[i] for i in pushed]))
    return lifts
