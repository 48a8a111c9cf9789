"""Questions about contacts, overlaps, gaps and rays. World axes, metres."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.model.hits import Contact, RayHits
from ligature.model.shapes import Collider
from ligature.physics import shapes
from ligature.physics.collisions import Collisions
from ligature.physics.engine import NEAR, VOID, Engine
from ligature.physics.wrenches import contact_forces

Array = NDArray[np.float64]

_FAR = [0.0, 0.0, -1000.0]
"""Position of the probes of ghosts between queries."""


class Gap(NamedTuple):
    """Nearest points of two convex parts: ``point`` (3,) on the one, and ``normal`` (3,) from the other to the one."""

    distance: float
    point: tuple[float, float, float]
    normal: tuple[float, float, float]


class BulletQueries:
    """Answers `ligature.sensing.queries.Queries`, and what grasping asks, for the bodies of an engine."""

    def __init__(self, engine: Engine, collisions: Collisions) -> None:
        self._engine, self._collisions = engine, collisions
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
        self._engine.collide(uid, *VOID)
        self._probe_shapes.append((colliders, margin))
        self._probes.append(uid)
        return len(self._probes) - 1

    def probe_gaps(self, probe: int, pose: Array, bodies: Sequence[int], within: float) -> list[float]:
        """Distance of each of ``bodies`` from the probe at ``pose`` (7,), negative where they overlap.

        ``within`` stands for all that is farther.
        """
        uid, client = self._probes[probe], self._engine.client
        numbers, gaps = pose.tolist(), []
        pybullet.resetBasePositionAndOrientation(uid, numbers[:3], numbers[3:], physicsClientId=client)
        for body in bodies:
            gap = within
            for other, link in self._engine.shapes_of(body):
                at = (uid, other, within, -1, link)
                for point in pybullet.getClosestPoints(*at, physicsClientId=client) or ():
                    gap = min(gap, point[8])
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
        """Contact points of ``body`` whose distance is at most ``threshold``.

        Bullet keeps those of its last tick up to `NEAR`; for a larger threshold it measures bodies where they are now.
        """
        places = self._engine.shapes_of(body)
        if places and threshold > NEAR:
            return self._contacts_within(body, threshold)
        return [contact for place in places for contact in self._contacts_at(body, *place, threshold)]

    def _contacts_at(self, body: int, uid: int, at: int, threshold: float) -> list[Contact]:
        """Contact points of the shapes of ``body`` that a multibody has at a link."""
        found = []
        for first in (True, False):
            side = {"bodyA": uid, "linkIndexA": at} if first else {"bodyB": uid, "linkIndexB": at}
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

    def _contacts_within(self, body: int, threshold: float) -> list[Contact]:
        """Nearest points of ``body`` and of the bodies that it collides with, up to ``threshold``."""
        found = []
        for other in self.surroundings([body], threshold)[0]:
            if self._collisions.collide(body, other):
                for points in self._closest(body, other, threshold):
                    found += [Contact(other, float(p[8]), np.array(p[6]), np.array(p[7])) for p in points]
        return found

    def _closest(self, body: int, other: int, within: float) -> Iterator[tuple[tuple[Any, ...], ...]]:
        """Bullet's nearest points of the shapes of two bodies that are closer than ``within``."""
        for a, link in self._engine.shapes_of(body):
            for b, to in self._engine.shapes_of(other):
                yield pybullet.getClosestPoints(a, b, within, link, to, physicsClientId=self._engine.client) or ()

    def touches(self, most: int) -> tuple[Array, Array]:
        """Where bodies touched in the last tick, (n, 3), and the forces on one of the two, (n, 3); ``most`` of them."""
        found = [c for c in pybullet.getContactPoints(physicsClientId=self._engine.client) if c[9] > 0.0][:most]
        if not found:
            return np.zeros((0, 3)), np.zeros((0, 3))
        return np.array([c[5] for c in found]), contact_forces(found)

    def surroundings(self, bodies: Collection[int], margin: float = 0.0) -> tuple[list[int], Array]:
        """Bodies that meet the common box of ``bodies`` with a ``margin`` around, in order, and its corners (2, 3)."""
        place_of, body_at, client = self._engine.place_of, self._engine.body_at, self._engine.client
        boxes = [
            pybullet.getAABB(*place, physicsClientId=client)
            for body in bodies
            for place in self._engine.shapes_of(body)[1:] or [(place_of[body].uid, place_of[body].link)]
        ]
        low = [min(corner) - margin for corner in zip(*(box[0] for box in boxes), strict=True)]
        high = [max(corner) + margin for corner in zip(*(box[1] for box in boxes), strict=True)]
        met = pybullet.getOverlappingObjects(low, high, physicsClientId=client) or ()
        found = {body_at[at] for at in met if at in body_at}
        return sorted(found - set(bodies)), np.array([low, high])

    def gaps(self, body: int, other: int, within: float) -> list[Gap]:
        """Nearest points of the convex parts of two bodies that are closer than ``within``, nearest first."""
        return sorted(Gap(row[8], row[5], row[7]) for found in self._closest(body, other, within) for row in found)

    def overlap(self, bodies: set[int]) -> tuple[float, int, int]:
        """How deep in metres one of ``bodies`` overlaps another body, and both; (0, -1, -1) when none does."""
        deepest = (0.0, -1, -1)
        for body in sorted(bodies & self._engine.place_of.keys()):
            for contact in self.contacts(body, 0.0):
                deepest = max(deepest, (-contact.distance, body, contact.body))
        return deepest
