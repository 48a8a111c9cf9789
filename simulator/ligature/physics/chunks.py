"""What of volumes collides: their surface in chunks, each a static body of Bullet that can be replaced by another.

Bullet cannot change the shape of a body. Each chunk keeps its place among Bullet's bodies and boxes, whatever it is
replaced by, so that the order of pairs, and with it what the solver does, depends on nothing that was before.
"""

from __future__ import annotations

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.model.shapes import TriMesh
from ligature.physics.engine import STANDS, VOID, Engine

Array = NDArray[np.float64]


MOST_REPLACED = 1000
"""Replaced chunks from which another client is better than the one that keeps their shapes."""


class Chunks:
    """The chunks of all static volumes of a scene that may change, in an engine.

    Attributes
    ----------
    bodies
        The volumes that collide.
    replaced
        Chunks that were replaced in the engine's present client, which keeps all their shapes, some 0.2 MB each.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._volumes = [v for v in engine.scene.volumes if engine.scene.bodies[v.body].colliders]
        self._surfaces: dict[int, list[TriMesh | None]] = {
            v.body: [_mesh(*v.form.surface(v.form.values, k)) for k in range(len(v.form.chunks))] for v in self._volumes
        }
        self.bodies = set(self._surfaces)
        self._poses: dict[int, list[float]] = {}
        self.rebuild()

    def rebuild(self) -> None:
        """Put all chunks in the engine's present client."""
        self.replaced = 0
        for body, surfaces in self._surfaces.items():
            self._poses[body] = self._pose(body)
            self._engine.chunks[body] = [self._made(body, surface) for surface in surfaces]

    def replace(self, body: int, chunk: int, vertices: Array, normals: Array, faces: NDArray[np.int32]) -> None:
        """Give a chunk of a volume another surface in the frame of the volume, maybe none."""
        surface = _mesh(vertices, normals, faces)
        chunks, client = self._engine.chunks[body], self._engine.client
        if surface is None and self._surfaces[body][chunk] is None:
            return
        self._surfaces[body][chunk] = surface
        uid = chunks[chunk][0]
        pybullet.removeBody(uid, physicsClientId=client)
        self.replaced += 1
        del self._engine.body_at[uid, -1]
        chunks[chunk] = self._made(body, surface)  # in the place that the former left

    def follow(self) -> None:
        """Put the chunks of volumes that were moved where these are."""
        for body, before in self._poses.items():
            now = self._pose(body)
            if now != before:
                self._poses[body] = now
                for uid, *_ in self._engine.chunks[body]:
                    client = self._engine.client
                    pybullet.resetBasePositionAndOrientation(uid, now[:3], now[3:], physicsClientId=client)

    def _pose(self, body: int) -> list[float]:
        pose, twist = np.empty(7), np.empty(6)
        self._engine.place_of[body].read(pose, twist)
        found: list[float] = pose.tolist()
        return found

    def _made(self, body: int, surface: TriMesh | None) -> tuple[int, int, int, int]:
        """A new multibody with its link, group and mask; one without a surface touches nothing."""
        client, pose, stated = self._engine.client, self._poses[body], self._engine.scene.bodies[body]
        if surface is None:
            shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=1e-3, physicsClientId=client)
        else:
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_MESH, vertices=surface.vertices.tolist(), indices=surface.faces.ravel().tolist(),
                flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH, physicsClientId=client,
            )  # fmt: skip
        uid = int(
            pybullet.createMultiBody(
                0.0, shape, basePosition=pose[:3], baseOrientation=pose[3:], physicsClientId=client
            )
        )
        pybullet.changeDynamics(
            uid, -1, lateralFriction=stated.friction, rollingFriction=stated.rolling_friction,
            restitution=stated.restitution, collisionMargin=stated.collision_margin, physicsClientId=client,
        )  # fmt: skip
        filters = VOID if surface is None else STANDS
        self._engine.collide(uid, *filters)
        self._engine.body_at[uid, -1] = body
        return uid, -1, *filters


def _mesh(vertices: Array, normals: Array, faces: NDArray[np.int32]) -> TriMesh | None:
    return TriMesh(vertices, faces) if len(faces) else None
