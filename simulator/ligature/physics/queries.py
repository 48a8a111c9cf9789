"""Questions about contacts, overlaps, gaps and rays. World axes, metres."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.model.hits import Contact, RayHits
from ligature.model.shapes import Collider
from ligature.physics import shapes
from ligature.physics.engine import Engine
from ligature.physics.wrenches import contact_forces

Array = NDArray[np.float64]

_FAR = [0.0, 0.0, -1000.0]
"""Where the probes of ghosts wait between questions."""


@dataclass(frozen=True, eq=False)
class Gaps:
    """Pairs of nearest points of one body with another, nearest first.

    ``distance`` (n,), ``point`` (n, 3) on the one, and ``normal`` (n, 3) from the other to the one.
    """

    distance: Array
    point: Array
    normal: Array


class BulletQueries:
    """Answers `ligature.sensing.queries.Queries`, and what grasping asks, for the bodies of an engine."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._probe_shapes: list[tuple[Sequence[Collider], float]] = []
        self._probes: list[int] = []

    def rebuild(self) -> None:
        """Register all probes again in an engine that was rebuilt."""
        shapes_before, self._probe_shapes, self._probes = self._probe_shapes, [], []
        for colliders, margin in shapes_before:
            self.add_probe(colliders, margin)

    # --- probes and rays --------------------------------------------------------------------

    def add_probe(self, colliders: Sequence[Collider], margin: float) -> int:
        """Register a volume that produces no contacts; returns its handle."""
        client = self._engine.client
        shape = shapes.create(client, self._engine.cache, colliders, np.eye(4), True, margin)
        uid = pybullet.createMultiBody(0, shape, basePosition=_FAR, physicsClientId=client)
        pybullet.setCollisionFilterGroupMask(uid, -1, 0, 0, physicsClientId=client)
        self._probe_shapes.append((colliders, margin))
        self._probes.append(uid)
        return len(self._probes) - 1

    def probe_gaps(self, probe: int, pose: Array, bodies: Sequence[int], within: float) -> list[float]:
        """Distance of each of ``bodies`` from the probe at ``pose`` (7,), negative where they overlap.

        ``within`` stands for all that is farther.
        """
        uid, client = self._probes[probe], self._engine.client
        pybullet.resetBasePositionAndOrientation(uid, pose[:3].tolist(), pose[3:].tolist(), physicsClientId=client)
        gaps = []
        for body in bodies:
            place, gap = self._engine.place_of.get(body), within
            if place is not None:
                at = (uid, place.uid, within, -1, place.link)
                for point in pybullet.getClosestPoints(*at, physicsClientId=client) or ():
                    gap = min(gap, float(point[8]))
            gaps.append(gap)
        return gaps

    def ray_test(self, starts: Array, ends: Array) -> RayHits:
        """Closest hits of the segments ``starts`` to ``ends``, each (n, 3)."""
        results = pybullet.rayTestBatch(starts.tolist(), ends.tolist(), physicsClientId=self._engine.client)
        body_at = self._engine.body_at
        body = np.array([body_at.get((r[0], r[1]), -1) if r[0] >= 0 else -1 for r in results], dtype=np.int32)
        return RayHits(
            body,
            np.array([r[2] for r in results]),
            np.array([r[3] for r in results]),
            np.array([r[4] for r in results]),
        )

    # --- contacts and gaps ------------------------------------------------------------------

    def contacts(self, body: int, threshold: float) -> list[Contact]:
        """Contact points of ``body`` whose distance is at most ``threshold``."""
        place = self._engine.place_of.get(body)
        if place is None:
            return []
        found = []
        for first in (True, False):
            side = (
                {"bodyA": place.uid, "linkIndexA": place.link}
                if first
                else {"bodyB": place.uid, "linkIndexB": place.link}
            )
            for point in pybullet.getContactPoints(physicsClientId=self._engine.client, **side):
                other = self._engine.body_at.get((point[2], point[4]) if first else (point[1], point[3]))
                if other is None or other == body or point[8] > threshold:
                    continue
                on_other = np.array(point[6] if first else point[5])
                normal = np.array(point[7]) if first else -np.array(point[7])
                found.append(Contact(other, float(point[8]), on_other, normal))
            if found:
                break
        return found

    def touches(self, most: int) -> tuple[Array, Array]:
        """Where bodies touched in the last tick, (n, 3), and the forces on one of the two, (n, 3); ``most`` of them."""
        found = [c for c in pybullet.getContactPoints(physicsClientId=self._engine.client) if c[9] > 0.0][:most]
        if not found:
            return np.zeros((0, 3)), np.zeros((0, 3))
        return np.array([c[5] for c in found]), contact_forces(found)

    def surroundings(self, bodies: Collection[int]) -> tuple[list[int], Array]:
        """Bodies whose boxes meet the common box of ``bodies``, in order, and the corners (2, 3) of that."""
        place_of, body_at, client = self._engine.place_of, self._engine.body_at, self._engine.client
        boxes = [
            pybullet.getAABB(place.uid, place.link, physicsClientId=client)
            for place in (place_of[body] for body in bodies)
        ]
        low = [min(corner) for corner in zip(*(box[0] for box in boxes), strict=True)]
        high = [max(corner) for corner in zip(*(box[1] for box in boxes), strict=True)]
        met = pybullet.getOverlappingObjects(low, high, physicsClientId=client) or ()
        found = {body_at[at] for at in met if at in body_at}
        return sorted(found - set(bodies)), np.array([low, high])

    def gaps(self, body: int, other: int, within: float) -> Gaps | None:
        """Nearest points of the convex parts of two bodies that are closer than ``within``; None without any."""
        a, b = self._engine.place_of[body], self._engine.place_of[other]
        found = pybullet.getClosestPoints(a.uid, b.uid, within, a.link, b.link, physicsClientId=self._engine.client)
        if not found:
            return None
        rows = sorted((row[8], row[5], row[7]) for row in found)
        return Gaps(np.array([r[0] for r in rows]), np.array([r[1] for r in rows]), np.array([r[2] for r in rows]))

    def overlap(self, bodies: set[int]) -> tuple[float, int, int]:
        """How deep in metres one of ``bodies`` overlaps another body, and both; (0, -1, -1) when none does."""
        deepest = (0.0, -1, -1)
        for body in sorted(bodies & self._engine.place_of.keys()):
            for contact in self.contacts(body, 0.0):
                deepest = max(deepest, (-contact.distance, body, contact.body))
        return deepest
