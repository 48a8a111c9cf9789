"""Questions about contacts, overlaps and rays, and the constraints that grasp; mixed into `World`.

World axes, metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.mesh import CollisionCache
from ligature.model.frames import inverse, matrix_quaternion
from ligature.model.hits import Contact, RayHits
from ligature.model.scene import Collider, Scene
from ligature.physics import shapes
from ligature.physics.bodies import Placement
from ligature.physics.wrenches import about, contact_forces, contact_wrench, fixed_wrench

Array = NDArray[np.float64]

WELD_FORCE = 500.0
"""Maximum force of a weld in newtons, so that jammed bodies slip instead of exploding."""

_FAR = [0.0, 0.0, -1000.0]
"""Where the probes of ghosts wait between questions."""


@dataclass
class Weld:
    """A rigid constraint of Bullet between frames of two bodies, given in their body frames B."""

    parent: int
    child: int
    T_parent_frame: Array
    T_child_frame: Array
    constraint: int


class BulletQueries:
    """Answers `ligature.sensing.queries.Queries` with Bullet."""

    scene: Scene
    client: int
    dt: float
    place_of: dict[int, Placement]
    _cache: CollisionCache

    def _setup_queries(self) -> None:
        self._body_at = {(place.uid, place.link): body for body, place in self.place_of.items()}
        probes = getattr(self, "_probe_shapes", [])
        self._probe_shapes: list[tuple[Sequence[Collider], float]] = []
        self._probes: list[int] = []
        self._welds: dict[int, Weld] = {}
        self._next_handle = 0
        self._impulses: dict[int, Array] = {}
        for colliders, margin in probes:
            self.add_probe(colliders, margin)

    def add_probe(self, colliders: Sequence[Collider], margin: float) -> int:
        """Register a volume that produces no contacts; returns its handle."""
        shape = shapes.create(self.client, self._cache, colliders, np.eye(4), True, margin)
        uid = pybullet.createMultiBody(0, shape, basePosition=_FAR, physicsClientId=self.client)
        pybullet.setCollisionFilterGroupMask(uid, -1, 0, 0, physicsClientId=self.client)
        self._probe_shapes.append((colliders, margin))
        self._probes.append(uid)
        return len(self._probes) - 1

    def probe_gaps(self, probe: int, pose: Array, bodies: Sequence[int], within: float) -> list[float]:
        """Distance of each of ``bodies`` from the probe at ``pose`` (7,), negative where they overlap.

        ``within`` stands for all that is farther.
        """
        uid = self._probes[probe]
        pybullet.resetBasePositionAndOrientation(uid, pose[:3].tolist(), pose[3:].tolist(), physicsClientId=self.client)
        gaps = []
        for body in bodies:
            place, gap = self.place_of.get(body), within
            if place is not None:
                at = (uid, place.uid, within, -1, place.link)
                for point in pybullet.getClosestPoints(*at, physicsClientId=self.client) or ():
                    gap = min(gap, float(point[8]))
            gaps.append(gap)
        return gaps

    def ray_test(self, starts: Array, ends: Array) -> RayHits:
        """Closest hits of the segments ``starts`` to ``ends``, each (n, 3)."""
        results = pybullet.rayTestBatch(starts.tolist(), ends.tolist(), physicsClientId=self.client)
        body = np.array([self._body_at.get((r[0], r[1]), -1) if r[0] >= 0 else -1 for r in results], dtype=np.int32)
        return RayHits(
            body,
            np.array([r[2] for r in results]),
            np.array([r[3] for r in results]),
            np.array([r[4] for r in results]),
        )

    def contacts(self, body: int, threshold: float) -> list[Contact]:
        """Contact points of ``body`` whose distance is at most ``threshold``."""
        place = self.place_of.get(body)
        if place is None:
            return []
        found = []
        for first in (True, False):
            side = (
                {"bodyA": place.uid, "linkIndexA": place.link}
                if first
                else {"bodyB": place.uid, "linkIndexB": place.link}
            )
            for point in pybullet.getContactPoints(physicsClientId=self.client, **side):
                other = self._body_at.get((point[2], point[4]) if first else (point[1], point[3]))
                if other is None or other == body or point[8] > threshold:
                    continue
                on_other = np.array(point[6] if first else point[5])
                normal = np.array(point[7]) if first else -np.array(point[7])
                found.append(Contact(other, float(point[8]), on_other, normal))
            if found:
                break
        return found

    def add_weld(self, parent: int, child: int, T_parent_frame: Array, T_child_frame: Array) -> Any:
        """Weld two frames, given in the body frames of parent and child; returns a handle."""
        bodies = self.scene.bodies
        in_parent = inverse(bodies[parent].T_body_inertial) @ T_parent_frame
        in_child = inverse(bodies[child].T_body_inertial) @ T_child_frame
        one, two = self.place_of[parent], self.place_of[child]
        constraint = pybullet.createConstraint(
            one.uid, one.link, two.uid, two.link, pybullet.JOINT_FIXED, [0.0] * 3,
            in_parent[:3, 3].tolist(), in_child[:3, 3].tolist(),
            matrix_quaternion(in_parent[:3, :3]).tolist(), matrix_quaternion(in_child[:3, :3]).tolist(),
            physicsClientId=self.client,
        )  # fmt: skip
        pybullet.changeConstraint(constraint, maxForce=WELD_FORCE, physicsClientId=self.client)
        self._next_handle += 1
        self._welds[self._next_handle] = Weld(parent, child, T_parent_frame, T_child_frame, int(constraint))
        return self._next_handle

    def remove_weld(self, handle: Any) -> None:
        """Remove a weld that `add_weld` made."""
        weld = self._welds.pop(handle)
        pybullet.removeConstraint(weld.constraint, physicsClientId=self.client)

    def touched(self, bodies: Sequence[int]) -> bool:
        """Whether `contact_wrench` may find anything: a quick look."""
        if any(body in self._impulses for body in bodies):
            return True
        if any(weld.parent in bodies or weld.child in bodies for weld in self._welds.values()):
            return True
        own = {(place.uid, place.link) for place in map(self.place_of.get, bodies) if place is not None}
        return any(
            (found[1], found[3]) in own and (found[2], found[4]) not in own
            for uid in {uid for uid, _ in own}
            for found in pybullet.getContactPoints(bodyA=uid, physicsClientId=self.client)
        )

    def touches(self, most: int) -> tuple[Array, Array]:
        """Where bodies touched in the last tick, (n, 3), and the forces on one of the two, (n, 3); ``most`` of them."""
        found = [c for c in pybullet.getContactPoints(physicsClientId=self.client) if c[9] > 0.0][:most]
        if not found:
            return np.zeros((0, 3)), np.zeros((0, 3))
        return np.array([c[5] for c in found]), contact_forces(found)

    def contact_wrench(self, bodies: Sequence[int], point: Array) -> Array:
        """Force and moment (6,) about ``point`` (3,) that the rest of the world exerted on ``bodies`` in the last tick.

        Counted are contacts, welds, and all that was given to `apply_impulse`: rods, grasps, tissue.
        Gravity, inertia and what the bodies do to each other are not.
        """
        places = [self.place_of[body] for body in bodies if body in self.place_of]
        own = {(place.uid, place.link) for place in places}
        wrench = np.zeros(6)
        for uid in dict.fromkeys(place.uid for place in places):
            links = {link for owner, link in own if owner == uid}
            wrench += contact_wrench(self.client, uid, links, own, point)
        inside = set(bodies)
        for weld in self._welds.values():
            if (weld.parent in inside) != (weld.child in inside):
                sign = 1.0 if weld.parent in inside else -1.0
                wrench += sign * self._weld_wrench(weld, point)
        for body in inside & self._impulses.keys():
            wrench += about(self._impulses[body] / self.dt, self.place_of[body].centre(), point)
        return wrench

    def _weld_wrench(self, weld: Weld, point: Array) -> Array:
        """Wrench (6,) of a weld on its parent."""
        pose, twist = np.empty(7), np.empty(6)
        self.place_of[weld.parent].read_inertial(pose, twist)
        in_parent = inverse(self.scene.bodies[weld.parent].T_body_inertial) @ weld.T_parent_frame
        return fixed_wrench(self.client, weld.constraint, pose, in_parent, point)

    def welds(self) -> dict[int, Weld]:
        """The present welds by handle, to be restored after a rebuild."""
        return dict(self._welds)

    def restore_welds(self, welds: dict[int, Weld]) -> None:
        """Make ``welds`` again under their old handles."""
        for handle, weld in welds.items():
            self._next_handle = handle - 1
            self.add_weld(weld.parent, weld.child, weld.T_parent_frame, weld.T_child_frame)
