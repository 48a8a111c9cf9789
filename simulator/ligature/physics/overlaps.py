"""Bodies that start inside each other and that joints keep there, so that no contact can part them.

Bullet's contacts and joints would fight with meganewtons. Metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pybullet

from ligature.adf import Diagnostic, Severity
from ligature.model.scene import Scene
from ligature.physics.engine import Engine

DEEP = 0.005
"""Overlap in metres from which it is taken for a mistake of the scene rather than for a rounding or a press fit."""


@dataclass(frozen=True)
class Overlap:
    """How deep ``body`` and ``other`` overlap."""

    body: int
    other: int
    depth: float

    def finding(self, scene: Scene) -> Diagnostic:
        """The overlap for the author of the scene."""
        one, other = (scene.bodies[i].identity for i in (self.body, self.other))
        message = (
            f"'{one.identifier}' starts {1e3 * self.depth:.3g} mm inside '{other.identifier}', where joints hold it; "
            "they do not collide until they have parted"
        )
        return Diagnostic(Severity.WARNING, message, one.mark, "move them apart, or disable their collision", "overlap")


def findings(scene: Scene) -> list[Diagnostic]:
    """A warning for each of `held_overlaps` where ``scene`` starts."""
    engine = Engine(scene, 1e-3)
    try:
        return [found.finding(scene) for found in held_overlaps(engine)]
    finally:
        engine.close()


def held_overlaps(engine: Engine) -> list[Overlap]:
    """Overlaps beyond `DEEP` between links of trees with a fixed base, static bodies, and links of one tree.

    A free body or tree is left out: contacts part it from others. Call it while bodies are where the scene starts.
    """
    links = [(body, k) for k, tree in enumerate(engine.trees) for body in tree.link_of]
    if not links:
        return []
    body, tree = (np.array(column) for column in zip(*links, strict=True))
    static = np.array([engine.scene.bodies[b].static for b in body])
    held = np.array([engine.trees[k].static for k in tree])
    places = [engine.place_of[b] for b in body]
    boxes = np.array([pybullet.getAABB(p.uid, p.link, physicsClientId=engine.client) for p in places])
    low, high = boxes[:, 0], boxes[:, 1]
    found = []
    for i in np.flatnonzero(~static):
        near = ((low <= high[i]) & (high >= low[i])).all(axis=1)
        near &= (tree == tree[i]) | (held & held[i])
        near[: i + 1] &= static[: i + 1]
        near[i] = False
        for j in np.flatnonzero(near):
            if body[j] not in engine.scene.bodies[body[i]].no_collision_with:
                depth = overlap(engine, int(body[i]), int(body[j]))
                if depth > DEEP:
                    found.append(Overlap(int(body[i]), int(body[j]), depth))
    return found


def overlap(engine: Engine, body: int, other: int) -> float:
    """How deep two bodies overlap; 0 when they do not."""
    a, b = engine.place_of[body], engine.place_of[other]
    points = pybullet.getClosestPoints(a.uid, b.uid, 0.0, a.link, b.link, physicsClientId=engine.client) or ()
    return max((-float(point[8]) for point in points), default=0.0)
