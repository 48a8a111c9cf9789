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

    def __init__(self, client: int, tree: Tree, forces: Mapping[int, Array]) -> None:
        self._client, self._uid = client, tree.uid
        self._base = next((f.tolist() for link, f in forces.items() if link < 0), None)
        self._links = [link for link in forces if link >= 0]
        self._forces = [forces[link].tolist() for link in self._links]

    def push(self) -> None:
        """Apply the forces for one tick."""
        if self._base is not None:
            at = pybullet.getBasePositionAndOrientation(self._uid, physicsClientId=self._client)[0]
            self._apply(-1, self._base, at)
        if self._links:
            states = pybullet.getLinkStates(self._uid, self._links, physicsClientId=self._client)
            for link, force, state in zip(self._links, self._forces, states, strict=True):
                self._apply(link, force, state[0])

    def _apply(self, link: int, force: list[float], at: Sequence[float]) -> None:
        pybullet.applyExternalForce(self._uid, link, force, at, pybullet.WORLD_FRAME, physicsClientId=self._client)


def gravity_lifts(client: int, trees: Sequence[Tree], place_of: Mapping[int, Placement], common: Array) -> list[Lift]:
    """What has to be pushed every tick so that every body feels its own gravity."""
    lifts = []
    for tree in trees:
        forces = {}
        for body, link in tree.link_of.items():
            wanted = place_of[body].body
            force = wanted.mass * (wanted.gravity - common)
            if np.any(force):
                forces[link] = force
        if forces:
            lifts.append(Lift(client, tree, forces))
    return lifts
