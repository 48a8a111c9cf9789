"""Ray sensors: proximity measurements, and the penalty forces of resistance sensors.

World axes, SI units. A ray's measurement is 1 minus the hit fraction: 0 for nothing or at the far
end, 1 at the origin (ADF specification §17.2).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.model.hits import RayHits
from ligature.model.scene import Scene, Sensor, SensorType
from ligature.sensing.queries import Queries

Array = NDArray[np.float64]
ApplyForce = Callable[[int, Array, Array], None]
"""Applies a force (3,) at a point (3,) of a body, both in world axes."""


class Rays:
    """The rays of all sensors of a scene, one after the other, as the state record wants them."""

    def __init__(self, scene: Scene, queries: Queries) -> None:
        self._queries = queries
        self.sensors = [s for s in scene.sensors if s.type is not SensorType.CONTACT]
        counts = [len(s.rays) for s in self.sensors]
        ends = np.cumsum([0, *counts])
        self.slices = [slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True)]
        n = int(ends[-1])
        self.hits = RayHits(np.full(n, -1, dtype=np.int32), np.ones(n), np.zeros((n, 3)), np.zeros((n, 3)))
        self._stick = [_Stick(sensor, sensor.parent not in scene.rod_bodies) for sensor in self.sensors]

    @property
    def measurement(self) -> Array:
        """Measurement (n,) of every ray."""
        return np.where(self.hits.body >= 0, 1.0 - self.hits.fraction, 0.0)

    def update(self, body_pose: Array, apply_force: ApplyForce | None = None) -> None:
        """Cast every ray with the bodies at ``body_pose`` (bodies, 7); resistance pushes by ``apply_force``."""
        if not self.sensors:
            return
        segments = np.concatenate([self._segments(s, body_pose) for s in self.sensors])
        self.hits = self._queries.ray_test(segments[:, 0], segments[:, 1])
        if apply_force is None:
            return
        for sensor, part, stick in zip(self.sensors, self.slices, self._stick, strict=True):
            if sensor.type is SensorType.RESISTANCE:
                stick.push(segments[part], self.hits.part(part), body_pose, apply_force)

    @staticmethod
    def _segments(sensor: Sensor, body_pose: Array) -> Array:
        """Start and end points (n, 2, 3) of one sensor's rays in world axes."""
        T = pose7_matrix(body_pose[sensor.parent]) @ sensor.T_body_sensor
        segments: Array = sensor.rays @ T[:3, :3].T + T[:3, 3]
        return segments


class _Stick:
    """Where each ray of a resistance sensor last stuck, and the forces that follow (§17.3)."""

    def __init__(self, sensor: Sensor, pushes_back: bool) -> None:
        self._sensor, self._pushes_back = sensor, pushes_back
        n = len(sensor.rays)
        self._body = np.full(n, -1, dtype=np.int64)
        self._on_sensed, self._on_parent = np.zeros((n, 3)), np.zeros((n, 3))
        self._error = np.zeros((n, 3))
        self._offset = np.zeros((n, 3))

    def push(self, segments: Array, hits: RayHits, body_pose: Array, apply_force: ApplyForce) -> None:
        """Push the bodies that the rays hit, and the parent back."""
        for ray in range(len(segments)):
            body = int(hits.body[ray])
            if body < 0:
                self._body[ray] = -1
                continue
            force = self._force(ray, segments[ray], hits, body_pose)
            apply_force(body, force, hits.point[ray])
            if self._pushes_back:
                apply_force(self._sensor.parent, -force, hits.point[ray])

    def _force(self, ray: int, segment: Array, hits: RayHits, body_pose: Array) -> Array:
        """Force (3,) on the sensed body from one ray: normal, sticking and sliding parts."""
        law = self._sensor.resistance
        direction = segment[1] - segment[0]
        direction = direction / np.linalg.norm(direction)
        normal = law.contact_stiffness * (1.0 - hits.fraction[ray]) * direction
        weight = float(np.linalg.norm(normal)) if law.variable else 1.0
        offset, sliding = self._tangential_offset(ray, direction, hits, body_pose)
        previous, self._error[ray] = self._error[ray].copy(), offset
        force: Array = normal + law.dynamic_friction * weight * sliding
        if np.linalg.norm(offset) <= law.contact_area:
            force = force + law.static_friction * weight * offset + law.damping * (offset - previous)
        else:
            self._latch(ray, int(hits.body[ray]), hits.point[ray], body_pose)
        return force

    def _tangential_offset(self, ray: int, direction: Array, hits: RayHits, body_pose: Array) -> tuple[Array, Array]:
        """Offset of the stuck points across the ray, and its change since the last call, each (3,)."""
        body = int(hits.body[ray])
        if self._body[ray] != body:
            self._latch(ray, body, hits.point[ray], body_pose)
        on_parent = pose7_matrix(body_pose[self._sensor.parent]) @ np.append(self._on_parent[ray], 1.0)
        on_sensed = pose7_matrix(body_pose[body]) @ np.append(self._on_sensed[ray], 1.0)
        offset = (on_parent - on_sensed)[:3]
        offset = offset - (offset @ direction) * direction
        sliding = offset - self._offset[ray]
        self._offset[ray] = offset
        return offset, sliding

    def _latch(self, ray: int, body: int, point: Array, body_pose: Array) -> None:
        """Remember ``point`` (3,) as stuck to both bodies."""
        self._body[ray] = body
        world = np.append(point, 1.0)
        self._on_sensed[ray] = (np.linalg.inv(pose7_matrix(body_pose[body])) @ world)[:3]
        self._on_parent[ray] = (np.linalg.inv(pose7_matrix(body_pose[self._sensor.parent])) @ world)[:3]
        self._error[ray] = 0.0
        self._offset[ray] = 0.0
